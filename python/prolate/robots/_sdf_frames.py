"""The frames of an SDF model: what poses are relative to, and which link each moves with."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ._meshes import Packages
from ._model import Matrix
from ._sdf_include import SdfIncludes
from ._xml import TURN, BadElement, Notes, name_of, pose_matrix, quaternion_matrix, rpy_matrix

if TYPE_CHECKING:
    from ._xml import Element


@dataclass
class Frame:
    """A frame, by what its pose is relative to; ``body`` is the frame it moves with, "" for a link's own."""

    element: Element
    parent: str
    pose: Matrix
    body: str = ""


class SdfFrames(SdfIncludes):
    """Frames by name. Those of a nested model have its name and :: before theirs, as SDF has it."""

    def __init__(self, path: Path, packages: Packages, notes: Notes) -> None:
        super().__init__(path, packages, notes)
        self.frames: dict[str, Frame] = {}

    def declare(self, model: Element) -> None:
        """Enters all frames of the top model, which stands in the world where its pose says."""
        self.frames["world"] = Frame(model, "", np.eye(4))
        self.frames["__model__"] = Frame(model, "world", self.pose(model)[0])
        self._declare(model, "")

    def _declare(self, model: Element, scope: str) -> None:
        for element in model:
            kind, name = name_of(element), scope + (element.get("name") or "")
            if kind not in ("link", "joint", "frame", "model"):
                continue
            try:
                pose, relative_to = self.pose(element)
            except BadElement as error:
                self.notes.bad(error, name, f"the frame {name}")
                continue
            attached = element.get("attached_to") if kind == "frame" else None
            usual = {"joint": self.child(element, "child"), "frame": attached}.get(kind) or "__model__"
            parent = relative_to or usual
            parent = parent if parent == "world" else scope + parent
            self.frames[name] = Frame(element, parent, pose, "" if kind == "link" else scope + usual)
            if kind == "model":
                if element.get("placement_frame"):
                    text = "placement_frame= is not understood; its pose is taken as that of the model's own frame"
                    self.notes.add("error", f"model {name}: {text}", self.where(element))
                self.frames[f"{name}::__model__"] = Frame(element, name, np.eye(4))
                self._declare(element, f"{name}::")

    def in_world(self, name: str, element: Element) -> Matrix:
        """The pose of a frame in the world."""
        out, at = np.eye(4), name
        for _ in self.frames:
            if at == "world":
                return out
            frame = self._frame(at, element)
            out, at = frame.pose @ out, frame.parent
        raise self.fail(element, f"the pose of {name} is relative to itself")

    def between(self, outer: str, inner: str, element: Element) -> Matrix:
        """The frame ``inner`` in the frame ``outer``."""
        return np.asarray(np.linalg.inv(self.in_world(outer, element)) @ self.in_world(inner, element))

    def link_of(self, name: str, element: Element) -> str:
        """The link that a frame moves with, or "world"."""
        at = name
        for _ in self.frames:
            if at == "world":
                return at
            frame = self._frame(at, element)
            if name_of(frame.element) == "model":
                at = self._canonical(at, frame.element)
            elif not frame.body:
                return at
            else:
                at = frame.body
        raise self.fail(element, f"{name} is attached to itself")

    def _canonical(self, name: str, model: Element) -> str:
        """The link that a model's frame moves with: the one it says, or the first."""
        scope = name.removesuffix("__model__") if name.endswith("__model__") else f"{name}::"
        stated, first = model.get("canonical_link"), model.find("link")
        return scope + (stated or ("" if first is None else first.get("name") or ""))

    def _frame(self, name: str, element: Element) -> Frame:
        if name not in self.frames:
            raise self.fail(element, f"there is no link, joint or frame {name}")
        return self.frames[name]

    def pose(self, element: Element) -> tuple[Matrix, str | None]:
        """The pose that stands in an element, and what it is relative to, if that is said."""
        pose = element.find("pose")
        if pose is None:
            return np.eye(4), None
        relative_to, text = pose.get("relative_to") or None, (pose.text or "").strip()
        if not text:
            return np.eye(4), relative_to
        if pose.get("rotation_format") == "quat_xyzw":
            x, y, z, qx, qy, qz, qw = self.parsed(pose, text, 7)
            if not any((qx, qy, qz, qw)):
                raise self.fail(pose, "a quaternion of zeros is no rotation")
            return pose_matrix((x, y, z), quaternion_matrix(qw, qx, qy, qz)), relative_to
        x, y, z, *rpy = self.parsed(pose, text, 6)
        if pose.get("degrees") in ("true", "1"):
            rpy = [math.radians(angle) for angle in rpy]
        elif max(map(abs, rpy)) > TURN:
            text = f"the pose {text!r} has an angle of more than a turn, read as radians; were degrees meant?"
            self.notes.add("warning", text, self.where(pose))
        return pose_matrix((x, y, z), rpy_matrix(rpy)), relative_to

    # ---- what stands in child elements ----

    def child(self, element: Element, tag: str) -> str:
        """The text of a child element; "" if there is none."""
        found = element.find(tag)
        return "" if found is None else (found.text or "").strip()

    def number(self, element: Element, attribute: str, default: float | None = None) -> float:
        return self.numbers(element, attribute, 1, None if default is None else (default,))[0]

    def numbers(
        self, element: Element, attribute: str, count: int, default: Iterable[float] | None = None
    ) -> list[float]:
        """So many numbers of a child element, where URDF has an attribute."""
        found = element.find(attribute)
        if found is None:
            if default is None:
                raise self.fail(element, f"has no <{attribute}>")
            return list(default)
        return self.parsed(found, found.text or "", count)
