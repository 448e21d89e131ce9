"""Covers of links on disk, by the content that they were made of."""

from __future__ import annotations

import base64
import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from .. import Error, Tree, __version__, _core
from .._bake import core_options
from .._bake_many import write_atomically
from ._baked import LinkCover
from ._model import BoxShape, CapsuleShape, CylinderShape, EllipsoidShape, Geometry, Link, MeshShape, Shape, SphereShape

_SHAPES: dict[str, Any] = {
    kind.__name__: kind for kind in (BoxShape, CapsuleShape, CylinderShape, EllipsoidShape, SphereShape)
}
_FORMAT = 4  #: rises whenever the same links and options give other covers


def key_of(links: Sequence[Link], options: object) -> str:
    """Of the covers of these links with these options, whose ``repr`` says all of them."""
    digest = hashlib.blake2b(digest_size=16)
    digest.update(repr((_FORMAT, __version__, _core.options_hash(core_options({})), options)).encode())
    for link in links:
        for one in link.collisions:
            digest.update(one.pose.tobytes())
            if isinstance(one.shape, MeshShape):
                digest.update(b"%d %d" % (len(one.shape.vertices), len(one.shape.faces)))
                digest.update(one.shape.vertices.tobytes())
                digest.update(one.shape.faces.tobytes())
            else:
                digest.update(repr(one.shape).encode())
    return digest.hexdigest()


def find(folder: str | None, key: str) -> list[LinkCover] | None:
    """What :func:`keep` has written, if it is undamaged."""
    if folder is None:
        return None
    try:
        with open(_path(folder, key), encoding="ascii") as file:
            digest, text = file.readline().strip(), file.read()
        if digest != _digest(key, text):
            return None
        return [_read(entry) for entry in json.loads(text)]
    except (OSError, ValueError, Error):
        return None


def keep(folder: str | None, key: str, covers: Sequence[LinkCover]) -> None:
    """Atomically: other processes may read the entry meanwhile."""
    if folder is not None:
        text = json.dumps([_entry(cover) for cover in covers])
        write_atomically(_path(folder, key), f"{_digest(key, text)}\n{text}".encode("ascii"))


def _path(folder: str, key: str) -> str:
    return os.path.join(folder, f"{key}.covers")


def _digest(key: str, text: str) -> str:
    return hashlib.blake2b((key + text).encode(), digest_size=16).hexdigest()


def _entry(cover: LinkCover) -> dict[str, Any]:
    entry = {one.name: getattr(cover, one.name) for one in fields(cover)}
    entry["geometries"] = [_numbers(one) for one in cover.geometries]
    entry["baked"] = None if cover.baked is None else base64.b64encode(bytes(cover.baked)).decode()
    return entry


def _read(entry: dict[str, Any]) -> LinkCover:
    entry["geometries"] = tuple(_geometry(one) for one in entry["geometries"])
    entry["baked"] = None if entry["baked"] is None else Tree.from_bytes(base64.b64decode(entry["baked"]))
    return LinkCover(**entry)


def _numbers(geometry: Geometry) -> list[Any]:
    shape = geometry.shape
    if isinstance(shape, MeshShape):
        return [geometry.pose.tolist(), "MeshShape", shape.vertices.tolist(), shape.faces.tolist()]
    return [geometry.pose.tolist(), type(shape).__name__, *(getattr(shape, one.name) for one in fields(shape))]


def _geometry(numbers: list[Any]) -> Geometry:
    pose, kind, *values = numbers
    shape: Shape
    if kind == "MeshShape":
        shape = MeshShape(np.array(values[0], np.float64), np.array(values[1], np.int64))
    else:
        shape = _SHAPES[kind](*(tuple(one) if isinstance(one, list) else one for one in values))
    return Geometry(shape, np.array(pose, np.float64))
