"""Single ellipsoids, for particles and crowds: many bodies, and pairs of them by index."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from . import _core

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ._answers import Floats, Verdicts
    from ._queries import Order

__all__ = ["PairDistances", "collide", "distance"]


class PairDistances(NamedTuple):
    """Signed distances of M pairs of ellipsoids.

    Attributes
    ----------
    lower, upper : float64 (M,)
        Certified bounds of the signed distance, metres: below 0, minus the length of the shortest translation that
        separates the two.
    point_a, point_b : float64 (M, 3)
        Nearest points, or those deepest in the other body; world, metres.
    normal : float64 (M, 3)
        Unit vector from the first to the second: the direction in which the second should move to get away.
    """

    lower: Floats
    upper: Floats
    point_a: Floats
    point_b: Floats
    normal: Floats


def collide(
    radii: ArrayLike, poses: ArrayLike, pairs: ArrayLike, *, margin: float = 0, order: Order = "xyzw"
) -> Verdicts:
    """Do ellipsoids come within ``margin`` of each other?

    Parameters
    ----------
    radii : array of shape (N, 3), or (3,) for all
        Semi-axes along the body's x, y and z, metres, above 0. Rounded up to float32.
    poses : array of shape (N, 7) or (N, 4, 4)
        Centers and rotations, as for :func:`prolate.collide`. Rounding of float64 is added to the margin.
    pairs : integer array of shape (M, 2)
        Indices of bodies.
    margin : float
        Metres.
    order : {"xyzw", "wxyz"}
        How quaternions are stored.

    Returns
    -------
    uint8 array of shape (M,)
        The numbers of :class:`prolate.Verdict`; *separated* is certified.

    Raises
    ------
    ValueError, TypeError
        Naming argument and index.
    """
    return _core.pairs_collide(radii, poses, pairs, margin, order)


def distance(
    radii: ArrayLike, poses: ArrayLike, pairs: ArrayLike, *, tolerance: float = 0, order: Order = "xyzw"
) -> PairDistances:
    """How far apart, or how deep in each other, are ellipsoids?

    Parameters
    ----------
    radii, poses, pairs, order
        As for :func:`collide`. Rounding of float64 poses widens the bounds.
    tolerance : float
        ``upper - lower`` of separated pairs is at most this, metres, wherever rounding allows. From about 1e-5 of the
        bodies' size on, eight pairs are done at a time.

    Returns
    -------
    PairDistances

    Raises
    ------
    ValueError, TypeError
        Naming argument and index.
    """
    return PairDistances(*_core.pairs_distance(radii, poses, pairs, tolerance, order))
