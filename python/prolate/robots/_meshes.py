"""The meshes that descriptions name: where the file is, and its triangles in metres, sized as simulators size them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Union

import numpy as np

from .._errors import Error
from .._mesh import load_mesh
from ._model import Matrix, MeshShape
from ._xml import parse, version_of

Folders = Union[str, "os.PathLike[str]", Iterable[Union[str, "os.PathLike[str]"]]]


class MeshError(Exception):
    """Why there are no triangles, and what to do."""


@dataclass
class Packages:
    """Where ``package://name/…`` and ``model://name/…`` lead.

    ``named`` are folders that the user gave, by package. Then come the folders of ROS_PACKAGE_PATH (ROS 1),
    AMENT_PREFIX_PATH (ROS 2), GZ_SIM_RESOURCE_PATH and its older names (Gazebo), and those above the description.
    """

    description: Path
    named: Mapping[str, list[Path]]

    @staticmethod
    def of(description: Path, packages: Mapping[str, Folders] | None) -> Packages:
        named = {}
        for name, folders in (packages or {}).items():
            many = [folders] if isinstance(folders, (str, os.PathLike)) else list(folders)
            named[name] = [Path(folder) for folder in many]
        return Packages(description, named)

    def candidates(self, package: str) -> list[Path]:
        """Folders that may be the package, the likeliest first; not all need exist."""

        def listed(variable: str) -> list[Path]:
            return [Path(entry) for entry in os.environ.get(variable, "").split(os.pathsep) if entry]

        out = list(self.named.get(package, []))
        for folder in listed("ROS_PACKAGE_PATH"):
            out += [folder / package, *([folder] if folder.name == package else [])]
        out += [folder / "share" / package for folder in listed("AMENT_PREFIX_PATH")]
        for variable in ("GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH"):
            out += [folder / package for folder in listed(variable)]
        for folder in self.description.resolve().parents:
            out += [*([folder] if folder.name == package else []), folder / package]
        return out

    def find(self, name: str) -> Path:
        """The file that a description calls ``name``."""
        scheme, colon, rest = name.partition("://")
        if colon and scheme == "file":
            return self._existing(name, [Path(rest)])
        if colon and scheme in ("package", "model"):
            package, _, inside = rest.partition("/")
            self.folder(package, name)
            return self._existing(name, [folder / inside for folder in self.candidates(package)])
        if colon:
            raise MeshError(f"{name}: only package://, model:// and file:// are followed; give a path")
        return self._existing(name, [self.description.parent / name])

    def folder(self, package: str, name: str) -> Path:
        """The likeliest of the package's folders; ``name`` is what asks for it."""
        for folder in self.candidates(package):
            if os.path.isdir(folder):  # also false of a name that no system takes
                return folder
        raise MeshError(
            f"{name}: there is no package {package} in ROS_PACKAGE_PATH, AMENT_PREFIX_PATH or above "
            f"{self.description.resolve().parent}; say where with --package {package}=FOLDER (in Python packages=)"
        )

    def model(self, name: str, beside: Path) -> Path:
        """The SDF that an ``<include>`` in a file of the folder ``beside`` calls ``name``: a file, or a folder of one
        that its model.config names, or that is called model.sdf."""
        scheme, colon, rest = name.partition("://")
        if colon and scheme in ("package", "model"):
            package, _, inside = rest.partition("/")
            path = self.folder(package, name) / inside
        elif colon and scheme != "file":
            raise MeshError(f"{name}: only package://, model:// and file:// are followed; get it, and give a path")
        else:
            path = beside / (rest if colon else name)
        return self._existing(name, [path / _sdf_in(path) if path.is_dir() else path])

    @staticmethod
    def _existing(name: str, paths: list[Path]) -> Path:
        for path in paths:
            if os.path.isfile(path):  # also false of a name that no system takes
                return path
        there = next((path for path in paths if os.path.isdir(path.parent)), paths[0])
        raise MeshError(f"{name}: there is no file {there}; put it there, or correct the name")


def _sdf_in(folder: Path) -> str:
    """The file of the newest version that a model's folder has."""
    config = folder / "model.config"
    files = parse(config).findall("sdf") if config.is_file() else []
    newest = max(files, key=lambda one: version_of(one.get("version")), default=None)
    return "model.sdf" if newest is None else (newest.text or "").strip()


@dataclass
class Meshes:
    """Reads each file once for each way in which it is sized."""

    packages: Packages
    dae_unit: Literal["obey", "ignore"] | None = None
    gltf_axes: Literal["keep", "turn"] | None = None
    _read: dict[tuple[str, tuple[float, float, float]], tuple[MeshShape, list[str]]] = field(default_factory=dict)

    def shape(self, name: str, scale: tuple[float, float, float]) -> tuple[MeshShape, list[str]]:
        """The mesh, and what should be said about it. Raises MeshError."""
        if 0 in scale:
            raise MeshError(
                f"{name}: a scale of {scale[0]:g} {scale[1]:g} {scale[2]:g} leaves no volume; none may be 0"
            )
        if (name, scale) not in self._read:
            self._read[name, scale] = self._shape(self.packages.find(name), scale)
        return self._read[name, scale]

    def _shape(self, path: Path, scale: tuple[float, float, float]) -> tuple[MeshShape, list[str]]:
        kind = path.suffix.lower()
        turn = kind in (".gltf", ".glb") and self._gltf_turns(path)
        try:
            # A mesh far from its origin keeps its precision by being read near the middle and moved in double.
            mesh = load_mesh(path, recentre=True)
        except Error as error:
            raise MeshError(str(error)) from None
        used, faces = np.unique(mesh.faces, return_inverse=True)  # what no triangle uses belongs to no surface
        vertices, faces = mesh.vertices[used].astype(np.float64) + mesh.origin, faces.reshape(-1, 3).astype(np.int64)
        if turn:
            vertices = np.stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]], axis=1)
        vertices *= scale
        notes, unit, done = _parts(path) if kind == ".obj" else [], 1.0, ["taken around"]
        if kind == ".dae":
            unit = self._collada_unit(path, np.ptp(vertices, axis=0), notes)
            done += ["its unit", "states a unit"]
        notes += [f"{path.name}: {note}" for note in mesh.notes if not note.startswith(tuple(done))]
        faces = faces[:, ::-1].copy() if np.prod(scale) < 0 else faces
        return MeshShape(vertices * unit, faces, path, scale, unit), notes

    def _collada_unit(self, path: Path, size: Matrix, notes: list[str]) -> float:
        """Metres of a unit of the file, as the user wants it read; ``size`` is the mesh's if it is the metre."""
        unit, up = _collada_frame(path)
        if up != "Z_UP":
            notes.append(f"{path.name}: states {up}; its axes are kept, as all loaders of robots that were tried do")
        if unit == 1.0:
            return 1.0
        if self.dae_unit is None:
            as_read, as_stated = (" x ".join(f"{by * float(edge):.4g}" for edge in size) for by in (1, unit))
            raise MeshError(
                f"{path}: states a unit of {unit:g} m, which loaders read differently. --dae-unit ignore (Pinocchio, "
                f"yourdfpy, Newton, Genesis) makes it {as_read} m, --dae-unit obey (PyBullet, SAPIEN, scikit-robot) "
                f"{as_stated} m; say which (dae_unit= in Python)"
            )
        notes.append(f"{path.name}: states a unit of {unit:g} m, --dae-unit {self.dae_unit}; other loaders differ")
        return unit if self.dae_unit == "obey" else 1.0

    def _gltf_turns(self, path: Path) -> bool:
        if self.gltf_axes is None:
            raise MeshError(
                f"{path}: loaders place glTF differently. --gltf-axes keep takes its axes as they are (Pinocchio, "
                "yourdfpy, Newton, SAPIEN), --gltf-axes turn makes its Y axis the link's Z (Drake); say which "
                "(gltf_axes= in Python)"
            )
        return self.gltf_axes == "turn"


def _collada_frame(path: Path) -> tuple[float, str]:
    """The unit in metres and the up axis that a DAE states, or the format's defaults."""
    root = parse(path)
    unit, up = (root.find(f"{{*}}asset/{{*}}{name}") for name in ("unit", "up_axis"))  # COLLADA 1.4 and 1.5
    try:
        metre = float(unit.get("meter", "1")) if unit is not None else 1.0
    except ValueError:
        metre = 1.0
    return metre if metre > 0 else 1.0, "Y_UP" if up is None else (up.text or "").strip()


def _parts(path: Path) -> list[str]:
    """A word about an OBJ with several parts."""
    with path.open("rb") as file:
        parts = 0
        between = True  # faces of a part before
        for line in file:
            if line[:2] in (b"o ", b"g "):
                between = True
            elif between and line[:2] == b"f ":
                parts += 1
                between = False
    if parts < 2:
        return []
    return [
        f"{path.name}: has {parts} parts (o or g), all of which count here; MuJoCo keeps the faces of the first, "
        "Genesis loses the others, Drake makes one hull of all"
    ]
