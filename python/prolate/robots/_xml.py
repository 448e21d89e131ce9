"""XML that knows its lines: attributes as numbers, and notes about what a reader did not expect."""

from __future__ import annotations

import importlib
import math
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from .._errors import Error
from ._model import Matrix, Note, Where

if TYPE_CHECKING:
    Element = Any  # lxml has no types of its own


TURN = 2 * math.pi * (1 + 1e-3)  # an angle above this is likely to be in degrees


class BadElement(Exception):
    """What is wrong with an element, and where; a reader makes it a note and goes on with the next one."""

    def __init__(self, text: str, where: Where) -> None:
        super().__init__(text)
        self.text, self.where = text, where


class Notes:
    """In the order in which they come up."""

    def __init__(self) -> None:
        self.all: list[Note] = []
        self._known: set[tuple[str, str]] = set()

    def add(self, kind: Literal["error", "warning", "info"], text: str, where: Where, link: str = "") -> None:
        self.all.append(Note(kind, text, where, link))

    def once(self, text: str, where: Where, link: str = "") -> None:
        """An info of which one a link is enough."""
        if (text, link) not in self._known:
            self._known.add((text, link))
            self.add("info", text, where, link)

    def bad(self, error: BadElement, link: str = "", left_out: str = "") -> None:
        """What is wrong with an element, and what is therefore left out."""
        self.add("error", error.text + (f"; {left_out} is left out" if left_out else ""), error.where, link)


def library(name: str, use: str) -> Any:
    """A module that the package itself does not need."""
    try:
        return importlib.import_module(name)
    except ImportError:
        text = f"{use} needs {name.partition('.')[0]}: pip install 'prolate[robots]'"
        raise Error(text, "unsupported") from None


def parse(path: Path, text: bytes | None = None) -> Element:
    """The root element of a file, or of ``text`` that was made of it. Entities and other files are not followed."""
    etree = library("lxml.etree", "reading robots")
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, remove_pis=True)
    try:
        return etree.fromstring(path.read_bytes() if text is None else text, parser)
    except OSError as error:
        raise Error(f"{path}: {error.strerror}", "io", error.errno or 0) from None
    except etree.XMLSyntaxError as error:
        raise Error(f"{path}:{error.lineno}: is not XML: {error.msg}", "bad_file", error.lineno or 0) from None


class Reader:
    """Elements of one file, with messages that say where."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def where(self, element: Element) -> Where:
        return Where(self.path, element.sourceline or 0)

    def fail(self, element: Element, text: str) -> BadElement:
        return BadElement(f"<{name_of(element)}>: {text}", self.where(element))

    def text(self, element: Element, attribute: str) -> str:
        """An attribute that must be there."""
        value = element.get(attribute)
        if value is None:
            raise self.fail(element, f"has no {attribute}=")
        return str(value).strip()

    def numbers(
        self, element: Element, attribute: str, count: int, default: Iterable[float] | None = None
    ) -> list[float]:
        """So many numbers of an attribute."""
        if element.get(attribute) is None and default is not None:
            return list(default)
        return self.parsed(element, self.text(element, attribute), count, f"{attribute}=")

    def parsed(self, element: Element, text: str, count: int, what: str = "it") -> list[float]:
        """So many finite numbers of a text."""
        try:
            out = [float(word) for word in text.split()]
        except ValueError:
            out = []
        if len(out) != count or not all(map(math.isfinite, out)):
            one = "one number" if count == 1 else f"{count} numbers"
            raise self.fail(element, f"{what} must be {one}, not {text!r}")
        return out

    def number(self, element: Element, attribute: str, default: float | None = None) -> float:
        return self.numbers(element, attribute, 1, None if default is None else (default,))[0]

    def sizes(self, element: Element, attribute: str, count: int) -> tuple[float, ...]:
        """Lengths, each above 0."""
        out = self.numbers(element, attribute, count)
        if min(out) <= 0:
            raise self.fail(element, f"{attribute} must be above 0, not {' '.join(f'{x:g}' for x in out)}")
        return tuple(out)

    def name_others(self, element: Element, known: Collection[str], notes: Notes, link: str = "") -> None:
        """Says which children are not understood."""
        unknown: dict[str, list[Element]] = {}
        for child in element:
            if name_of(child) not in known:
                unknown.setdefault(name_of(child), []).append(child)
        for name, found in unknown.items():
            many = f" ({len(found)} times)" if len(found) > 1 else ""
            text = f"<{name}> in <{name_of(element)}>{many} is not understood, and left out"
            notes.add("info", text, self.where(found[0]), link)


def version_of(text: str | None) -> tuple[int, ...]:
    """Major and minor number of SDF's; 1.6 where none is stated."""
    return tuple(int(part) for part in (text or "1.6").split(".")[:2] if part.isdigit())


def name_of(element: Element) -> str:
    """Its tag, with the namespace's prefix if it has one; of an entity, which is not followed, ``&name;``."""
    if not isinstance(element.tag, str):
        return str(element.text)
    tag = element.tag.rpartition("}")[2]
    return f"{element.prefix}:{tag}" if element.prefix else tag


def rpy_matrix(rpy: Iterable[float]) -> Matrix:
    """Rotation (3, 3) by fixed-axis angles: about x, then y, then z."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a), math.cos(a)) for a in rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def quaternion_matrix(w: float, x: float, y: float, z: float) -> Matrix:
    """Rotation (3, 3) of a quaternion, which need not be of length 1."""
    n = w * w + x * x + y * y + z * z
    return np.array(
        [
            [1 - 2 * (y * y + z * z) / n, 2 * (x * y - z * w) / n, 2 * (x * z + y * w) / n],
            [2 * (x * y + z * w) / n, 1 - 2 * (x * x + z * z) / n, 2 * (y * z - x * w) / n],
            [2 * (x * z - y * w) / n, 2 * (y * z + x * w) / n, 1 - 2 * (x * x + y * y) / n],
        ]
    )


def pose_matrix(position: Iterable[float], rotation: Matrix) -> Matrix:
    out = np.eye(4)
    out[:3, :3] = rotation
    out[:3, 3] = list(position)
    return out
