"""Other models that an SDF includes: each becomes a nested model of the tree that is read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .._errors import Error
from ._meshes import MeshError, Packages
from ._model import Where
from ._xml import BadElement, Notes, Reader, name_of, parse, version_of

if TYPE_CHECKING:
    from ._xml import Element

_FILE, _VERSION = "{prolate}file", "{prolate}version"  # of a model that was included: where it is from


class SdfIncludes(Reader):
    """Knows of each element which file it is from."""

    def __init__(self, path: Path, packages: Packages, notes: Notes) -> None:
        super().__init__(path)
        self.packages, self.notes = packages, notes

    def where(self, element: Element) -> Where:
        return Where(self.file_of(element), element.sourceline or 0)

    def file_of(self, element: Element) -> Path:
        return next((Path(one.get(_FILE)) for one in _upwards(element) if one.get(_FILE)), self.path)

    def version_of(self, element: Element) -> tuple[int, ...]:
        """Of the file, as major and minor number."""
        top = list(_upwards(element))
        return version_of(next((one.get(_VERSION) for one in top if one.get(_VERSION)), top[-1].get("version")))

    def follow(self, within: Element) -> None:
        """Puts what a model or a world includes, and what that includes, in place of each ``<include>``.

        One that cannot be followed stays, and is named.
        """
        for element in within.findall("include"):
            try:
                model = self._included(element)
                within.replace(element, model)
            except BadElement as error:
                self.notes.bad(error, left_out="what it includes")
        for nested in within.findall("model"):
            self.follow(nested)

    def _included(self, element: Element) -> Element:
        uri = element.find("uri")
        if element.get("merge") in ("true", "1"):
            raise self.fail(element, "merge= is not understood; `gz sdf -p` writes it out")
        try:
            path = self.packages.model("" if uri is None else (uri.text or "").strip(), self.file_of(element).parent)
            root = parse(path)
        except (MeshError, Error) as error:
            raise self.fail(element, str(error)) from None
        if path.resolve() in [self.path.resolve(), *(Path(one.get(_FILE, "")).resolve() for one in _upwards(element))]:
            raise self.fail(element, f"{path} includes itself")
        model = root.find("model") if name_of(root) == "sdf" else None
        if model is None:
            raise self.fail(element, f"{path}: has no <model> in an <sdf>")
        self.name_others(element, {"uri", "name", "pose", "static", "placement_frame"}, self.notes)
        model.set(_FILE, str(path))
        model.set(_VERSION, root.get("version") or "1.6")
        self._override(model, element)
        return model

    def _override(self, model: Element, element: Element) -> None:
        """An ``<include>`` may give its model another name, pose and frame that this places."""
        name, pose, frame = (element.find(tag) for tag in ("name", "pose", "placement_frame"))
        if name is not None:
            model.set("name", (name.text or "").strip())
        if frame is not None:
            model.set("placement_frame", (frame.text or "").strip())
        if pose is not None:
            for own in model.findall("pose"):
                model.remove(own)
            model.append(pose)


def _upwards(element: Element) -> list[Element]:
    return [element, *element.iterancestors()]
