"""A robot as a page for a browser: joints to move, covers over meshes, and which links touch."""

from __future__ import annotations

import base64
import html
import json
import os
import re
from importlib import resources
from typing import TYPE_CHECKING, Any, Union

import numpy as np

from .. import Tree, bake, signed_distance
from .._errors import Error
from ._baked import BakedRobot, LinkCover, is_solid
from ._kinematics import coordinates_of, source_of
from ._model import (
    BoxShape,
    CapsuleShape,
    CylinderShape,
    EllipsoidShape,
    Geometry,
    Joint,
    Link,
    MeshShape,
    SphereShape,
)
from ._solids import merged
from ._writing import Files

if TYPE_CHECKING:
    from numpy.typing import NDArray


def view_page(baked: BakedRobot) -> str:
    """A page of HTML, one file that needs no network and no server.

    Joints have sliders. Links whose covers no plane is found between are red; that is computed in the page, of the
    covers' own bodies, or of the ellipsoids around an exact tree's triangles. Colours may also show how far covers
    stick out. A table has a row for each link, as :meth:`BakedRobot.table`.

    Thread-safe.
    """
    robot = _robot(baked)
    folder = resources.files("prolate.robots")
    page, script = ((folder / name).read_text("utf-8") for name in ("view.html", "view.js"))
    data = json.dumps(robot, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    parts = {"TITLE": html.escape(baked.description.name), "SCRIPT": script, "ROBOT": data}
    return re.sub("@(TITLE|SCRIPT|ROBOT)@", lambda mark: parts[mark[1]], page)


def write_view(baked: BakedRobot, path: Union[str, os.PathLike[str]]) -> None:
    """Write :func:`view_page` to a file, which appears whole or not at all.

    Raises
    ------
    Error
        ``code`` is ``"io"``.
    ValueError
        ``path`` is the description itself.
    """
    files = Files.at(path, baked.description)
    files.contents[files.path] = view_page(baked).encode()
    files.write()


def _robot(baked: BakedRobot) -> dict[str, Any]:
    description = baked.description
    links = [_link(link, baked.covers.get(link.name)) for link in description.links]
    index = {link.name: i for i, link in enumerate(description.links)}
    checks = baked.checks
    home = checks.kinematics.home
    corners = _corners(baked, checks.fk(home))
    low, high = corners.min(axis=0), corners.max(axis=0)
    return {
        "name": description.name,
        "links": links,
        "joints": _joints(baked, index),
        "pairs": [[index[pair.link], index[pair.other]] for pair in checks.pairs()],
        "home": home.tolist(),
        "most": max((link["most"] for link in links), default=0.0),
        "middle": ((low + high) / 2).tolist(),
        "reach": float(np.linalg.norm(high - low)) / 2 or 1.0,
        "view": [-0.9, 0.35],
    }


def _corners(baked: BakedRobot, frames: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of boxes around the covers, where the frames (L, 7) place them."""
    from .. import bounds

    out = [np.zeros((1, 3))]
    for link, frame in zip(baked.description.links, frames):
        if link.name in baked.covers:
            box = bounds(baked.covers[link.name].tree, frame)
            out.append(np.array([box.lower, box.upper]))
    return np.concatenate(out)


def _joints(baked: BakedRobot, index: dict[str, int]) -> list[dict[str, Any]]:
    joints = {joint.name: joint for joint in baked.description.joints}
    first = {joint.name: at for joint, at in coordinates_of(baked.description)}
    out = []
    for joint in baked.description.joints:
        source, scale, offset = source_of(joint, joints)
        out.append(
            {
                "name": joint.name,
                "kind": joint.kind,
                "parent": index[joint.parent],
                "child": index[joint.child],
                "origin": _rows(joint.origin),
                "axis": list(joint.axis),
                "anchor": list(joint.anchor),
                "at": first.get(source.name, 0),
                "scale": scale,
                "offset": offset - joint.zero,
                "sliders": _sliders(joint),
                "quaternion": {"ball": 0, "floating": 3}.get(joint.kind),
            }
        )
    return out


def _sliders(joint: Joint) -> list[tuple[str, float, float]]:
    """What a joint's first coordinates are called, and their ranges. A quaternion, which ``quaternion`` says the
    place of, has sliders of another kind."""
    if joint.mimic or joint.kind in ("fixed", "ball"):
        return []
    if joint.kind in ("planar", "floating"):
        last = ("", -np.pi, np.pi) if joint.kind == "planar" else (" z", -1.0, 1.0)
        return [(" x", -1.0, 1.0), (" y", -1.0, 1.0), last]
    widest = 1.0 if joint.kind == "prismatic" else np.pi
    low = joint.lower if np.isfinite(joint.lower) else -widest
    high = joint.upper if np.isfinite(joint.upper) else widest
    return [("", float(low), float(high))]


def _link(link: Link, cover: LinkCover | None) -> dict[str, Any]:
    out: dict[str, Any] = {"name": link.name, "parts": [], "most": 0.0}
    if is_solid(link):
        out["mesh"] = _triangles(*merged(link.collisions))
    if cover is None:
        return out
    vertices, faces = merged(cover.geometries)
    heat = outside(link, vertices)
    ratio = cover.outside_ratio
    out["parts"] = _tree_parts(cover.tree) if cover.kind == "exact" else [_part(one) for one in cover.geometries]
    out["cover"] = {**_triangles(vertices, faces), "heat": _base64(heat, np.float32)}
    out["most"] = float(heat.max(initial=0.0))
    out["row"] = [
        cover.kind,
        str(len(cover.geometries)),
        "" if np.isnan(ratio) else f"{100 * ratio:.1f} %",
        f"{1000 * cover.clearance:.2f}",
        f"{1000 * cover.mean_distance:.2f}",
        "yes" if cover.proved else "no",
    ]
    return out


def outside(link: Link, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far points are outside the link's own bodies, metres; 0 inside."""
    try:
        body = bake(*merged(link.collisions), exact=True)
    except Error:  # what stands in the way is among the robot's notes
        return np.zeros(len(points))
    return np.maximum(signed_distance(body, points).upper, 0.0)


def _part(geometry: Geometry) -> dict[str, Any]:
    """A convex body as view.js takes it. ``bound`` is a radius around the origin of its pose."""
    shape, pose = geometry.shape, np.array(geometry.pose)
    if isinstance(shape, MeshShape):
        middle = shape.vertices.mean(axis=0)
        pose = pose.copy()
        pose[:3, 3] += pose[:3, :3] @ middle
        points = shape.vertices - middle
        bound = float(np.linalg.norm(points, axis=1).max())
        return {"kind": "hull", "pose": _rows(pose), "points": points.ravel().tolist(), "bound": bound}
    if isinstance(shape, (SphereShape, EllipsoidShape)):
        radii = [shape.radius] * 3 if isinstance(shape, SphereShape) else list(shape.radii)
        return {"kind": "ellipsoid", "pose": _rows(pose), "radii": radii, "bound": max(radii)}
    if isinstance(shape, BoxShape):
        half = [edge / 2 for edge in shape.size]
        return {"kind": "box", "pose": _rows(pose), "half": half, "bound": float(np.linalg.norm(half))}
    assert isinstance(shape, (CapsuleShape, CylinderShape)), "a cover has no planes"
    half_length, round_ = shape.length / 2, isinstance(shape, CapsuleShape)
    bound = half_length + shape.radius if round_ else float(np.hypot(half_length, shape.radius))
    kind = "capsule" if round_ else "cylinder"
    return {"kind": kind, "pose": _rows(pose), "radius": shape.radius, "half": half_length, "bound": bound}


def _tree_parts(tree: Tree) -> list[dict[str, Any]]:
    """The ellipsoids around the triangles of an exact tree's leaves."""
    leaves = tree.cut(-1)
    out = []
    for center, radii, rotation in zip(leaves.center, leaves.radii, leaves.rotation):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, center
        out.append({"kind": "ellipsoid", "pose": _rows(pose), "radii": radii.tolist(), "bound": float(radii.max())})
    return out


def _rows(pose: NDArray[np.float64]) -> list[float]:
    rows: list[float] = np.asarray(pose)[:3].ravel().tolist()
    return rows


def _triangles(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> dict[str, str]:
    return {"vertices": _base64(vertices, np.float32), "faces": _base64(faces, np.uint32)}


def _base64(array: NDArray[Any], kind: type[np.generic]) -> str:
    return base64.b64encode(np.ascontiguousarray(array, kind).tobytes()).decode("ascii")
