"""One convex body around points: box, ball, cylinder, capsule, or a polyhedron of few vertices.

The bodies come from trimesh (boxes: the least over the faces of the hull; balls and cylinders: local optima) and Qhull.
Each is then made to hold the points, whatever rounding and optimisers did.
"""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._model import BoxShape, CapsuleShape, CylinderShape, Geometry, Matrix, MeshShape, Shape, SphereShape
from ._solids import grown, hull_of, hull_triangles, inverse, moved, outside

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull


def around(points: Matrix, kind: str) -> Geometry:
    """A small body of a kind (``"sphere"``, ``"box"``, ``"capsule"`` or ``"cylinder"``) that holds the points (n, 3),
    which are not flat."""
    corners = hull_triangles(points)[0]
    try:
        found = _FITS[kind](corners)
    except ValueError:  # of trimesh, for what is as thin as rounding
        found = _along_axes(corners, kind)
    return _holding(found, points)


def hull_within(points: Matrix, most: int) -> Geometry:
    """A convex polyhedron of at most ``most`` vertices (8 or more) that holds the points (n, 3), which are not flat.

    It is their hull if that is small enough. Otherwise half-spaces of the hull's own faces are taken that cut off what
    sticks out most; so none ever cuts the hull.
    """
    vertices, faces = hull_triangles(points)
    if len(vertices) > most:
        vertices, faces = _outer_hull(hull_of(vertices), most)
    return Geometry(MeshShape(vertices, faces))


def thickened(points: Matrix, size: float) -> Matrix:
    """The points (n, 3), or where these are flat, or nearly, points on both sides of them: a hull needs a volume.

    ``size``, metres, is that of all that they are a part of.
    """
    apart = points - points.mean(0)
    axes = np.linalg.eigh(apart.T @ apart)[1].T
    extents = np.ptp(apart @ axes.T, axis=0)
    by = 5e-4 * max(extents.max(), 0.02 * size)
    for axis in axes[extents < by]:
        points = np.concatenate([points + by * axis, points - by * axis])
    return points


def _outer_hull(hull: ConvexHull, most: int) -> tuple[Matrix, NDArray[np.int64]]:
    planes = hull.equations.copy()
    corners = hull.points[hull.vertices]
    planes[:, 3] = -(corners @ planes[:, :3].T).max(0)  # rounding may have moved them inwards
    inner = corners.mean(0)
    axes = _box(corners).pose[:3, :3].T
    box = np.concatenate([axes, -axes])
    taken = np.column_stack([box, -(corners @ box.T).max(0)])
    best = _corners(taken, inner)
    while True:
        beyond = best @ planes[:, :3].T + planes[:, 3]  # corner by plane
        if beyond.max() <= 1e-9 * np.ptp(corners):
            break
        several = max((most - len(best)) // 8, 1)  # each adds about two corners, so these leave room
        worst = np.argsort(-beyond.max(1))[:several]
        taken = np.concatenate([taken, planes[np.unique(beyond[worst].argmax(1))]])
        found = _corners(taken, inner)
        if len(found) > most:
            break
        best = found
    return hull_triangles(best)


def _corners(planes: Matrix, inner: Matrix) -> Matrix:
    """Of what lies below all planes, each once."""
    from scipy.spatial import HalfspaceIntersection

    points = HalfspaceIntersection(planes, inner).intersections
    near = np.unique((points / np.ptp(points)).round(9), axis=0, return_index=True)[1]
    corners: Matrix = points[near]
    return corners


def _holding(geometry: Geometry, points: Matrix) -> Geometry:
    """Grown until all points are in it."""
    beyond = float(outside(geometry.shape, moved(inverse(geometry.pose), points)).max())
    return grown(geometry, max(beyond, 0.0) * (1 + 1e-9) + 1e-12) if beyond > -1e-12 else geometry


def _along_axes(points: Matrix, kind: str) -> Geometry:
    """A body about the points' principal axes, z along the longest; not the smallest that there is."""
    apart, pose = points - points.mean(0), np.eye(4)
    pose[:3, :3] = np.linalg.eigh(apart.T @ apart)[1]
    pose[:3, 0] *= np.linalg.det(pose[:3, :3])  # right-handed
    local = moved(inverse(pose), points)
    low, high = local.min(0), local.max(0)
    x, y, z = (float(edge) for edge in np.maximum(high - low, 1e-12))
    pose[:3, 3] = pose[:3, :3] @ ((low + high) / 2)
    across = float(np.hypot(x, y)) / 2
    bodies: dict[str, Shape] = {
        "box": BoxShape((x, y, z)),
        "cylinder": CylinderShape(across, z),
        "capsule": CapsuleShape(across, z),
    }
    return Geometry(bodies.get(kind) or SphereShape(float(np.hypot(across, z / 2))), pose)


def _box(points: Matrix) -> Geometry:
    to_origin, (x, y, z) = _trimesh("bounds").oriented_bounds(points)
    return Geometry(BoxShape((float(x), float(y), float(z))), _rigid(np.linalg.inv(to_origin)))


def _sphere(points: Matrix) -> Geometry:
    center, radius = _trimesh("nsphere").minimum_nsphere(points)
    pose = np.eye(4)
    pose[:3, 3] = center
    return Geometry(SphereShape(float(radius)), pose)


def _cylinder(points: Matrix) -> Geometry:
    found = _trimesh("bounds").minimum_cylinder(points)
    return Geometry(CylinderShape(float(found["radius"]), float(found["height"])), _rigid(found["transform"]))


def _capsule(points: Matrix) -> Geometry:
    """About the cylinder's axis, with its radius; the balls are as close together as the points let them."""
    cylinder = _cylinder(points)
    assert isinstance(cylinder.shape, CylinderShape)
    local = moved(inverse(cylinder.pose), points)
    across = (local[:, :2] ** 2).sum(1)
    radius = max(cylinder.shape.radius, float(np.sqrt(across.max())))
    rise = np.sqrt(np.maximum(radius**2 - across, 0))
    top, bottom = float((local[:, 2] - rise).max()), float((local[:, 2] + rise).min())
    pose = cylinder.pose.copy()
    pose[:3, 3] += pose[:3, 2] * (top + bottom) / 2
    return Geometry(CapsuleShape(radius, max(top - bottom, 0.0)), pose)


_FITS: dict[str, Callable[[Matrix], Geometry]] = {
    "sphere": _sphere,
    "box": _box,
    "capsule": _capsule,
    "cylinder": _cylinder,
}


def _trimesh(part: str) -> Any:
    """Imported when it is needed: it takes as long as all else together."""
    with contextlib.nullcontext() if "trimesh" in sys.modules else _uninterrupted():
        return import_module(f"trimesh.{part}")


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Ctrl-C counts afterwards: trimesh, while it is imported, takes it for the lack of a library, and goes on."""
    before = signal.getsignal(signal.SIGINT)
    if before is None or threading.current_thread() is not threading.main_thread():  # only there it interrupts Python
        yield
        return
    came: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if came:
            signal.raise_signal(signal.SIGINT)


def _rigid(pose: Matrix) -> Matrix:
    """The rigid motion closest to a matrix that is one but for rounding, or mirrors: turned the right way round."""
    u, _, v = np.linalg.svd(pose[:3, :3])
    rotation = u @ v
    if np.linalg.det(rotation) < 0:
        rotation[:, 0] = -rotation[:, 0]  # the bodies are symmetric
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation, pose[:3, 3]
    return result
