"""What all writers share: numbers as text, rotations, meshes, and files that appear whole or not at all."""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Union
from xml.etree import ElementTree

import numpy as np

from .._bake_many import write_atomically
from .._errors import Error, path_of
from ._model import Description, Matrix, MeshShape

if TYPE_CHECKING:
    from ._baked import BakedRobot


def check_proved(robot: BakedRobot, unproved: bool) -> None:
    """Raises Error, ``code`` ``"bad_mesh"``, for a robot that is not proved, unless that is meant."""
    if unproved or robot.proved:
        return
    errors = [note for note in (*robot.description.notes, *robot.notes) if note.kind == "error"]
    loose = [f"link {name}: its cover is not proved" for name, cover in robot.covers.items() if not cover.proved]
    why = "; ".join([*map(str, errors), *loose]) or "a link has no cover"
    raise Error(
        f"not written, as it is not proved to hold the robot: {why}. unproved=True writes it all the same", "bad_mesh"
    )


def text(*values: float) -> str:
    """Numbers with all their digits: what reads them as doubles has the same ones."""
    return " ".join(repr(float(value)) for value in values)


def quaternion(rotation: Matrix) -> tuple[float, float, float, float]:
    """``w x y z`` of a rotation matrix, by the eigenvector that no rounding spoils (Bar-Itzhack 2000)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    symmetric = np.array([
        [xx - yy - zz, yx + xy, zx + xz, zy - yz],
        [yx + xy, yy - xx - zz, zy + yz, xz - zx],
        [zx + xz, zy + yz, zz - xx - yy, yx - xy],
        [zy - yz, xz - zx, yx - xy, xx + yy + zz],
    ])  # fmt: skip
    x, y, z, w = (float(one) for one in np.linalg.eigh(symmetric)[1][:, -1])
    return (w, x, y, z) if w >= 0 else (-w, -x, -y, -z)


def roll_pitch_yaw(rotation: Matrix) -> tuple[float, float, float]:
    """Angles about the fixed axes x, y and z, in this order; radians."""
    roll = float(np.arctan2(rotation[2, 1], rotation[2, 2]))
    pitch = float(np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0])))
    # What the roll leaves to turn. When the pitch is near 90 degrees the roll is ill determined; this makes up for it.
    s, c = np.sin(roll), np.cos(roll)
    yaw = np.arctan2(s * rotation[0, 2] - c * rotation[0, 1], c * rotation[1, 1] - s * rotation[1, 2])
    return roll, pitch, float(yaw)


@dataclass
class Files:
    """Files that belong together: written when all are ready, and ``path``, which names the others, last.

    None of them may be one that the robot was read from, which are ``inputs``.
    """

    path: Path
    inputs: frozenset[Path] = frozenset()
    contents: dict[Path, bytes] = field(default_factory=dict)
    _meshes: dict[tuple[int, int], str] = field(default_factory=dict)
    _names: set[str] = field(default_factory=set)

    @classmethod
    def at(cls, path: Union[str, os.PathLike[str]], robot: Description | None = None) -> Files:
        return cls(Path(path_of("path", path)), frozenset() if robot is None else _inputs(robot))

    def mesh(self, name: str, shape: MeshShape, *, kind: Literal["obj", "stl"] = "obj") -> str:
        """The name, relative to ``path``, of a file of this mesh; shapes of the same arrays share one.

        STL is binary, in float32: for what is only seen.
        """
        key = (id(shape.vertices), id(shape.faces))
        if key not in self._meshes:
            safe = "".join(c if c.isalnum() or c in "-_." else "_" for c in name)
            relative = f"{self.path.name}_meshes/{unique(safe, self._names)}.{kind}"
            self.contents[self.path.parent / relative] = _obj(shape) if kind == "obj" else _stl(shape)
            self._meshes[key] = relative
        return self._meshes[key]

    def xml(self, root: ElementTree.Element, comment: str) -> None:
        """An element a line: PyBullet cuts lines at 8191 bytes."""
        ElementTree.indent(root)
        body = ElementTree.tostring(root, encoding="unicode")
        self.contents[self.path] = f'<?xml version="1.0"?>\n<!-- {comment} -->\n{body}\n'.encode()

    def write(self) -> None:
        """Raises Error, ``code`` ``"io"``, and ValueError for a path that would overwrite an input."""
        for path in self.contents:
            if path.resolve() in self.inputs:
                raise ValueError(f"path: {path} is what the robot was read from; choose another name for the output")
        last = self.contents[self.path]
        others = [item for item in self.contents.items() if item[0] != self.path]
        for path, content in [*others, (self.path, last)]:
            try:
                write_atomically(os.fspath(path.absolute()), content)
            except OSError as error:
                raise Error(f"{error.strerror}: {path}", "io", error.errno or 0) from None


def _inputs(robot: Description) -> frozenset[Path]:
    """The description, and the meshes that it names."""
    shapes = (one.shape for link in robot.links for one in (*link.collisions, *link.visuals))
    meshes = (shape.path for shape in shapes if isinstance(shape, MeshShape) and shape.path)
    return frozenset(path.resolve() for path in (robot.source, *meshes))


def _obj(shape: MeshShape) -> bytes:
    """Without ``o`` and ``g``: several targets read only the first part of a file that has these."""
    lines = [f"v {x!r} {y!r} {z!r}\n" for x, y, z in shape.vertices.tolist()]
    lines += [f"f {a} {b} {c}\n" for a, b, c in (shape.faces + 1).tolist()]
    return "".join(lines).encode()


def _stl(shape: MeshShape) -> bytes:
    triangles = np.zeros(len(shape.faces), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles["corners"] = shape.vertices[shape.faces]
    return b"by prolate".ljust(80) + struct.pack("<I", len(triangles)) + triangles.tobytes()


def unique(name: str, taken: set[str]) -> str:
    """The name, with a number behind it if it is taken; it is taken from then on."""
    found, count = name, 1
    while found in taken:
        count += 1
        found = f"{name}_{count}"
    taken.add(found)
    return found
