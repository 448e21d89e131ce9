"""Descriptions of robots, whatever their format."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Union

from .._errors import Error, path_of
from ._assemble import Parts, assemble
from ._meshes import Folders, Meshes, Packages
from ._mjcf import read_mjcf
from ._model import Description, Format, Where
from ._sdf import SdfReader
from ._srdf import read_srdf
from ._urdf import UrdfReader
from ._xacro import expand_xacro
from ._xml import BadElement, Notes, name_of, parse

if TYPE_CHECKING:
    from ._xml import Element


def load(
    path: Union[str, os.PathLike[str]],
    *,
    packages: Mapping[str, Folders] | None = None,
    srdf: Union[str, os.PathLike[str], None] = None,
    xacro_args: Mapping[str, str] | None = None,
    dae_unit: Literal["obey", "ignore"] | None = None,
    gltf_axes: Literal["keep", "turn"] | None = None,
    visuals: bool = True,
) -> Description:
    """Read a robot from URDF, xacro, MJCF or SDF.

    What cannot be read is left out and named in ``notes``, with link, file, line and what to do; the rest is read.

    Parameters
    ----------
    path : path-like
        What is in the file decides, not its name; but a xacro file is known by its ending ``.xacro``.
    packages : mapping of str to path-like, or to several, optional
        Folders of packages, for ``package://name/...``, ``model://name/...`` and xacro's ``$(find name)``. Then
        ROS_PACKAGE_PATH, AMENT_PREFIX_PATH and Gazebo's paths are searched, and the folders above the file for one of
        that name.
    srdf : path-like, optional
        Names pairs of links that are never in contact.
    xacro_args : mapping of str to str, optional
        Arguments of a xacro file.
    dae_unit : {"obey", "ignore"}, optional
        Whether the unit that a DAE states scales it. Loaders differ, so one other than the metre needs this.
    gltf_axes : {"keep", "turn"}, optional
        Whether a glTF's Y axis becomes Z. Loaders differ, so every glTF needs this.
    visuals : bool
        Read the meshes that are only seen, too.

    Returns
    -------
    Description

    Raises
    ------
    Error
        ``code`` is ``"io"`` or ``"bad_file"`` if nothing of a robot can be read, ``"unsupported"`` if a library is
        missing.
    ValueError, TypeError
        For an option.

    Thread-safe.
    """
    source = Path(path_of("path", path))
    _check("dae_unit", dae_unit, ("obey", "ignore"))
    _check("gltf_axes", gltf_axes, ("keep", "turn"))
    notes = Notes()
    folders = Packages.of(source, packages)
    meshes = Meshes(folders, dae_unit, gltf_axes)
    text = None
    if source.suffix == ".xacro":
        text = expand_xacro(source, xacro_args or {}, folders)
        notes.add("info", "lines are those of the URDF that xacro makes of it", Where(source))
    root = parse(source, text)
    description = assemble(*_parts(root, source, meshes, notes, visuals), notes)
    return description if srdf is None else _with_srdf(description, Path(path_of("srdf", srdf)))


def _parts(root: Element, source: Path, meshes: Meshes, notes: Notes, visuals: bool) -> tuple[Parts, Path, Format]:
    kind = name_of(root)
    try:
        if kind == "robot":
            return UrdfReader(source, meshes, notes, visuals).robot(root), source, "urdf"
        if kind == "mujoco":
            return read_mjcf(source, meshes, notes, visuals), source, "mjcf"
        if kind == "sdf":
            return SdfReader(source, meshes, notes, visuals).robot(root), source, "sdf"
    except BadElement as error:
        raise Error(f"{error.where}: {error.text}", "bad_file", error.where.line) from None
    raise Error(f"{source}: begins with <{kind}>; a robot begins with <robot>, <mujoco> or <sdf>", "bad_file")


def _with_srdf(description: Description, path: Path) -> Description:
    notes = Notes()
    pairs = read_srdf(path, {link.name for link in description.links}, notes)
    return replace(description, disabled={**description.disabled, **pairs}, notes=(*description.notes, *notes.all))


def _check(name: str, value: object, known: tuple[str, ...]) -> None:
    if value is not None and value not in known:
        raise ValueError(f"{name}: must be one of {', '.join(known)}; not {value!r}")
