"""Geometry of shapes: how large they are, what they contain, and polyhedra around them.

A point or pose without a frame named is in the shape's own. Lengths are metres.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ._model import (
    BoxShape,
    CapsuleShape,
    CylinderShape,
    EllipsoidShape,
    Geometry,
    Matrix,
    MeshShape,
    PlaneShape,
    Shape,
    SphereShape,
)

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull

Faces = NDArray[np.int64]
Triangles = tuple[Matrix, Faces]


def moved(pose: Matrix, points: Matrix) -> Matrix:
    """The points (n, 3) of a frame, in its parent."""
    placed: Matrix = points @ pose[:3, :3].T + pose[:3, 3]
    return placed


def inverse(pose: Matrix) -> Matrix:
    """Of a rigid motion."""
    back = np.eye(4)
    back[:3, :3] = pose[:3, :3].T
    back[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return back


def volume(shape: Shape) -> float:
    """Of the solid, m^3; of a mesh, that of its convex hull, as which a cover's meshes are meant."""
    if isinstance(shape, BoxShape):
        return float(np.prod(shape.size))
    if isinstance(shape, SphereShape):
        return 4 / 3 * np.pi * shape.radius**3
    if isinstance(shape, CylinderShape):
        return np.pi * shape.radius**2 * shape.length
    if isinstance(shape, CapsuleShape):
        return np.pi * shape.radius**2 * (shape.length + 4 / 3 * shape.radius)
    if isinstance(shape, EllipsoidShape):
        return 4 / 3 * np.pi * float(np.prod(shape.radii))
    if isinstance(shape, MeshShape):
        return volume_of_hull(shape.vertices)
    raise TypeError(f"{type(shape).__name__} has no volume")


def outside(shape: Shape, points: Matrix) -> NDArray[np.float64]:
    """At most how far each of the points (n, 3) is outside of the solid; 0 or less for those in it, and only for them.

    A mesh stands for its convex hull.
    """
    found: NDArray[np.float64]
    if isinstance(shape, BoxShape):
        beyond = np.abs(points) - np.asarray(shape.size) / 2
        found = np.where((beyond > 0).any(1), np.linalg.norm(np.maximum(beyond, 0), axis=1), beyond.max(1))
    elif isinstance(shape, SphereShape):
        found = np.linalg.norm(points, axis=1) - shape.radius
    elif isinstance(shape, CylinderShape):
        radial = np.hypot(points[:, 0], points[:, 1]) - shape.radius
        found = np.maximum(radial, np.abs(points[:, 2]) - shape.length / 2)
    elif isinstance(shape, CapsuleShape):
        beyond = np.maximum(np.abs(points[:, 2]) - shape.length / 2, 0)
        found = np.sqrt((points[:, :2] ** 2).sum(1) + beyond**2) - shape.radius
    elif isinstance(shape, EllipsoidShape):
        radii = np.asarray(shape.radii)
        # |p / r| - 1 grows by no more than 1 / min(r) a metre, so this is no more than the distance.
        found = (np.linalg.norm(points / radii, axis=1) - 1) * radii.min()
    elif isinstance(shape, MeshShape):
        planes = hull_of(shape.vertices).equations
        found = (points @ planes[:, :3].T + planes[:, 3]).max(1)
    else:
        raise TypeError(f"{type(shape).__name__} contains nothing")
    return found


def polyhedron(shape: Shape) -> Triangles:
    """Triangles around the solid, closed, counter-clockwise from outside: curved faces stick out by up to 2 % of the
    radius. A mesh is returned as it is."""
    if isinstance(shape, MeshShape):
        return shape.vertices, shape.faces
    if isinstance(shape, BoxShape):
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
        return hull_triangles(signs * np.asarray(shape.size) / 2)
    if isinstance(shape, (SphereShape, EllipsoidShape)):
        radii = np.full(3, shape.radius) if isinstance(shape, SphereShape) else np.asarray(shape.radii)
        points, faces = _ball()
        return points * radii, faces
    if isinstance(shape, CylinderShape):
        rim = _rim(shape.radius)
        ends = [np.column_stack([rim, np.full(len(rim), z)]) for z in (-shape.length / 2, shape.length / 2)]
        return hull_triangles(np.concatenate(ends))
    if isinstance(shape, CapsuleShape):
        points, _ = _ball()
        up = np.array([0, 0, shape.length / 2])
        return hull_triangles(np.concatenate([points * shape.radius + up, points * shape.radius - up]))
    raise TypeError(f"{type(shape).__name__} has no surface to be triangulated")


def merged(geometries: Iterable[Geometry]) -> Triangles:
    """All their polyhedra as one mesh, in the link's frame. Planes are left out: they are ground."""
    vertices, faces, count = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
    for geometry in geometries:
        if isinstance(geometry.shape, PlaneShape):
            continue
        points, triangles = polyhedron(geometry.shape)
        vertices.append(moved(geometry.pose, points))
        faces.append(triangles + count)
        count += len(points)
    return np.concatenate(vertices), np.concatenate(faces)


def hull_of(points: Matrix) -> ConvexHull:
    """The convex hull; raises ValueError where the points are flat."""
    return _hull(points.tobytes())


@lru_cache(maxsize=64)
def _hull(points: bytes) -> ConvexHull:
    from scipy.spatial import ConvexHull, QhullError  # late: what is in the cache needs none, and it takes 0.3 s

    try:
        return ConvexHull(np.frombuffer(points).reshape(-1, 3))
    except QhullError:
        raise ValueError("the points are flat: they have no hull with a volume") from None


def volume_of_hull(points: Matrix) -> float:
    """m^3; raises ValueError where the points are flat."""
    return float(hull_of(points).volume)


def hull_triangles(points: Matrix) -> Triangles:
    """The convex hull as a mesh without unused vertices."""
    hull = hull_of(np.ascontiguousarray(points, np.float64))
    used, faces = np.unique(hull.simplices, return_inverse=True)
    faces = faces.reshape(-1, 3)
    corners = points[used]
    normals = np.cross(corners[faces[:, 1]] - corners[faces[:, 0]], corners[faces[:, 2]] - corners[faces[:, 0]])
    inward = (normals * hull.equations[:, :3]).sum(1) < 0  # Qhull does not order its simplices
    faces[inward] = faces[inward][:, ::-1]
    return corners, faces.astype(np.int64)


def cut(triangles: Matrix, height: Matrix) -> tuple[Matrix, Matrix]:
    """What of triangles (n, 3, 3) is below a plane, and what above, by their corners' heights (n, 3) over it. What lies
    in the plane is in both."""
    below, above = (height <= 0).all(1), (height >= 0).all(1)
    crossing = ~below & ~above
    parts, height = triangles[crossing], height[crossing]
    sides = []
    for sign, whole in ((-1, below), (1, above)):
        found = [triangles[whole]]
        for first in range(3):  # the corner that is alone on its side comes first
            p, q, r = (parts[:, (first + i) % 3] for i in range(3))
            hp, hq, hr = (sign * height[:, (first + i) % 3] for i in range(3))
            alone, other = (hp > 0) & (hq <= 0) & (hr <= 0), (hp <= 0) & (hq > 0) & (hr > 0)
            pq, pr = _between(p, q, hp, hq), _between(p, r, hp, hr)
            found.append(np.stack([p, pq, pr], 1)[alone])
            found += [np.stack([pq, q, r], 1)[other], np.stack([pq, r, pr], 1)[other]]
        sides.append(np.concatenate(found))
    return sides[0], sides[1]


def _between(p: Matrix, q: Matrix, hp: Matrix, hq: Matrix) -> Matrix:
    """Where edges cross the plane."""
    apart = np.where(hp == hq, 1.0, hp - hq)
    found: Matrix = p + (q - p) * np.clip(hp / apart, 0, 1)[:, None]
    return found


def is_flat(points: Matrix) -> bool:
    """Have the points no hull with a volume?"""
    try:
        hull_of(points)
    except ValueError:
        return True
    return False


def grown(geometry: Geometry, by: float) -> Geometry:
    """One that holds all points within ``by`` (metres, small) of this one."""
    shape = geometry.shape
    if isinstance(shape, BoxShape):
        x, y, z = (float(edge + 2 * by) for edge in shape.size)
        return replace(geometry, shape=BoxShape((x, y, z)))
    if isinstance(shape, SphereShape):
        return replace(geometry, shape=SphereShape(shape.radius + by))
    if isinstance(shape, CylinderShape):
        return replace(geometry, shape=CylinderShape(shape.radius + by, shape.length + 2 * by))
    if isinstance(shape, CapsuleShape):
        return replace(geometry, shape=CapsuleShape(shape.radius + by, shape.length))
    if isinstance(shape, EllipsoidShape):
        radii = np.asarray(shape.radii)
        # The sum of two ellipsoids of squared shapes A and B lies in that of (1 + s) A + (1 + 1 / s) B, for any s > 0.
        s = min(max(by / radii.min(), 1e-9), 0.01)
        x, y, z = (float(r) for r in np.sqrt((1 + s) * radii**2 + (1 + 1 / s) * by**2))
        return replace(geometry, shape=EllipsoidShape((x, y, z)))
    if isinstance(shape, MeshShape):
        vertices = shape.vertices
        middle = vertices.mean(0)
        inner = -float(outside(shape, middle[None])[0])  # radius of a ball in the hull
        return replace(geometry, shape=replace(shape, vertices=middle + (vertices - middle) * (1 + by / inner)))
    raise TypeError(f"{type(shape).__name__} cannot grow")


def _rim(radius: float, sides: int = 32) -> Matrix:
    """Corners of a regular polygon around the circle."""
    angles = 2 * np.pi * np.arange(sides) / sides
    rim: Matrix = radius / np.cos(np.pi / sides) * np.column_stack([np.cos(angles), np.sin(angles)])
    return rim


@lru_cache(maxsize=1)
def _ball() -> Triangles:
    """A polyhedron around the unit ball: points spread along a spiral, and their hull, enlarged to touch it."""
    count = 200
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (1 + 5**0.5) * np.arange(count)  # by the golden angle
    across = np.sqrt(1 - z * z)
    points, faces = hull_triangles(np.column_stack([across * np.cos(turn), across * np.sin(turn), z]))
    nearest = -float(hull_of(points).equations[:, 3].max())
    return points / nearest, faces
