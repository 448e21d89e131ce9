"""Proof that geometries, with the very numbers that were written, cover what they were made for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import Ellipsoids, Tree, signed_distance
from ._model import EllipsoidShape, Geometry, Matrix, SphereShape
from ._solids import cut, hull_of, hull_triangles, inverse, merged, moved, outside

_AT_ONCE = 512  # triangles that are compared with all faces of a hull


def holds_points(geometry: Geometry, points: Matrix, by: float = 0.0) -> bool:
    """Does a convex geometry hold all within ``by`` (metres) of the points (n, 3), and with them of their hull?"""
    return bool((outside(geometry.shape, moved(inverse(geometry.pose), points)) <= -by).all())


def holds_ellipsoids(geometries: Sequence[Geometry], ellipsoids: Ellipsoids, by: float) -> bool:
    """Does geometry i, an ellipsoid or a sphere, hold all points within ``by`` (metres) of ellipsoid i, for all i?

    A convex body holds another if its support function is nowhere less. Ellipsoids' are sqrt(u' A u) + c' u. If
    B >= (1 + s) A + (1 + 1 / s) d^2 I for some s > 0, then sqrt(u' B u) >= sqrt(u' A u) + d |u|, where d is ``by`` and
    how far the centres are apart.
    """
    if len(geometries) != len(ellipsoids.center):
        return False
    return all(
        _holds(one, center, factor @ factor.T, by)
        for one, center, factor in zip(geometries, ellipsoids.center, ellipsoids.factor)
    )


def _holds(geometry: Geometry, center: Matrix, inner: Matrix, by: float) -> bool:
    shape = geometry.shape
    if isinstance(shape, SphereShape):
        radii = np.full(3, shape.radius)
    elif isinstance(shape, EllipsoidShape):
        radii = np.asarray(shape.radii)
    else:
        return False
    axes = geometry.pose[:3, :3] * radii
    apart = by + float(np.linalg.norm(geometry.pose[:3, 3] - center))
    s = np.logspace(-10, 0, 101)[:, None, None]
    wanted = (1 + s) * inner + (1 + 1 / s) * apart**2 * np.eye(3)
    spare = np.linalg.eigvalsh(axes @ axes.T - wanted)[:, 0]
    return bool((spare >= 1e-14 * float(np.trace(inner))).any())  # more than the rounding of all this


def holds_solid(hulls: Sequence[Geometry], triangles: Matrix, solid: Tree, by: float, threads: int = 0) -> bool:
    """Do convex polyhedra together hold the solid between triangles (n, 3, 3), however they were found?

    ``solid`` is an exact tree of the triangles; ``by``, metres, is how far the faces are meant to be beyond the solid.
    The hulls' union U holds the solid S if

    1. nothing is left of S's surface when all hulls are cut from it, and
    2. what is left of each hull's surface when all others are cut from it is outside of S.

    Otherwise some of S is not in U. As S's surface is, that part ends inside of S, at U's surface, which 2 has found to
    be outside. What is left in 2 does not meet S's surface, so one point of each triangle decides. A surface that is
    open has no inside, and needs 1 alone.

    Faces are moved inwards for the cuts, in 2 by less than in 1, so that neither rounding nor the width of a cut
    matters. So what is nearly uncovered is not proved.
    """
    bodies = [_body(hull) for hull in hulls]
    if len(_left_over(triangles, [one.moved_in(by / 2) for one in bodies], by / 16)):
        return False
    if solid.info.surface_mode:
        return True
    inner = [one.moved_in(by / 4) for one in bodies]
    free = [_left_over(one.surface, [*inner[:i], *inner[i + 1 :]], by / 16) for i, one in enumerate(bodies)]
    middles = np.concatenate(free).mean(1)
    return bool((signed_distance(solid, middles, threads=threads).lower > 0).all())


class _Body(NamedTuple):
    """A convex polyhedron: unit normals and offsets of its faces (n, 4), a box around it, and triangles (n, 3, 3)."""

    planes: NDArray[np.float64]
    low: Matrix
    high: Matrix
    surface: Matrix

    def moved_in(self, by: float) -> _Body:
        return self._replace(planes=self.planes + [0, 0, 0, by])


def _body(hull: Geometry) -> _Body:
    points = np.ascontiguousarray(merged([hull])[0])
    corners, faces = hull_triangles(points)
    return _Body(hull_of(points).equations, corners.min(0), corners.max(0), corners[faces])


def _left_over(triangles: Matrix, bodies: Sequence[_Body], width: float) -> Matrix:
    """What of the triangles is in none of the bodies, as triangles.

    Taken away is what lies in a body but for ``width``; left is what lies beyond one of its planes but for ``width``.
    """
    for body in bodies:
        near = (triangles.max(1) >= body.low).all(1) & (triangles.min(1) <= body.high).all(1)
        some = np.flatnonzero(near)
        left = [triangles[~near]]
        for first in range(0, len(some), _AT_ONCE):
            left += _beyond(triangles[some[first : first + _AT_ONCE]], body.planes, width)
        triangles = np.concatenate(left)
    return triangles


def _beyond(triangles: Matrix, planes: NDArray[np.float64], width: float) -> list[Matrix]:
    """The triangles, cut by planes until each part is below all, and taken away, or above one."""
    out = []
    while len(triangles):
        height = triangles @ planes[:, :3].T + planes[:, 3]  # triangle by corner by plane
        apart = (height.min(1) >= -width).any(1)
        out.append(triangles[apart])
        crossing = ~apart & (height.max((1, 2)) > width)
        triangles, height = triangles[crossing], height[crossing]
        worst = height.max(1).argmax(1)
        triangles, above = cut(triangles, np.take_along_axis(height, worst[:, None, None], 2)[..., 0])
        out.append(above)
    return out
