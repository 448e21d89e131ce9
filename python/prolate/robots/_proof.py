"""Proof that geometries, with the very numbers that were written, cover what they were made for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .. import Ellipsoids
from ._model import EllipsoidShape, Geometry, Matrix, SphereShape
from ._solids import inverse, moved, outside


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
