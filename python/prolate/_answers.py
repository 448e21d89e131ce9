"""What queries answer: verdicts, and arrays of what is known about N poses."""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Verdicts = NDArray[np.uint8]


class Verdict(enum.IntEnum):
    """What a query certifies; arrays of verdicts hold these numbers as ``uint8``.

    ``SEPARATED``: the solids do not touch, proved. ``OVERLAPPING``: the covers, or of exact trees the solids, have a
    common point, or are so close that rounding hides the gap. ``UNDECIDED``: the budget ran out first.
    """

    SEPARATED = 0
    OVERLAPPING = 1
    UNDECIDED = 2


class Distances(NamedTuple):
    """Distances of N pairs of bodies. Lengths in metres, points in the world; scalars and ``(3,)`` for single poses.

    Attributes
    ----------
    lower, upper : float64 (N,)
        Certified: ``lower <= distance <= upper``. Both are 0 (but for rounding) where the bodies meet; ``upper`` is
        infinite where the limits ended the search before it reached a pair of leaves.
    point_a, point_b : float64 (N, 3)
        Points of the two bodies, ``upper`` apart. NaN where there are none.
    normal : float64 (N, 3)
        Unit vector from ``point_a`` to ``point_b``; 0 if they coincide.
    verdict : uint8 (N,)
        :class:`Verdict`, that of :func:`collide`.
    """

    lower: Floats
    upper: Floats
    point_a: Floats
    point_b: Floats
    normal: Floats
    verdict: Verdicts


class SolidDistances(NamedTuple):
    """Distances of N pairs of solids, metres; scalars for single poses.

    Attributes
    ----------
    lower, upper : float64 (N,)
        Certified: ``lower <= distance of the solids <= upper``; both are 0 where they certainly meet. ``upper`` is
        infinite without inner covers. Their difference is the width of the band that covers leave open.
    verdict : uint8 (N,)
        :class:`Verdict`, that of :func:`collide_solids`.
    """

    lower: Floats
    upper: Floats
    verdict: Verdicts


class SolidDepths(NamedTuple):
    """Depths of N pairs of solids, metres; scalars for single poses.

    The depth is the length of the shortest translation after which the solids have no common inner point.

    Attributes
    ----------
    lower, upper : float64 (N,)
        Certified: ``lower <= depth of the solids <= upper``; both are 0 where they are certainly apart. ``upper`` is
        infinite where no way out was found, ``lower`` 0 without inner covers.
    way_out : float64 (N, 3)
        Moving ``b`` by it, in the world, certainly separates the solids. Of length ``upper``; 0 where there is none.
    verdict : uint8 (N,)
        :class:`Verdict`, that of :func:`collide_solids`.
    """

    lower: Floats
    upper: Floats
    way_out: Floats
    verdict: Verdicts


class Contacts(NamedTuple):
    """Contact points of N pairs of bodies, ragged: those of pair ``i`` are rows ``offsets[i]:offsets[i + 1]``.

    Attributes
    ----------
    offsets : int64 (N + 1,)
    point_a, point_b : float64 (M, 3)
        On the surfaces of the two bodies, opposite each other along the normal; world, metres.
    normal : float64 (M, 3)
        Unit vector: moving ``b`` along it takes it out of ``a``.
    depth : float64 (M,)
        Penetration along the normal, metres; below 0, the bodies are ``-depth`` apart there, at most the margin.
    manifold : int64 (M,)
        Points of a pair with the same number share their normal; the deepest manifold is 0.
    id : uint64 (M,)
        Names the features that touch. The same from call to call as long as these touch.
    verdict : uint8 (N,)
        :class:`Verdict`. A pair that overlaps without points has one body inside the other.
    """

    offsets: NDArray[np.int64]
    point_a: Floats
    point_b: Floats
    normal: Floats
    depth: Floats
    manifold: NDArray[np.int64]
    id: NDArray[np.uint64]
    verdict: Verdicts


class Sweeps(NamedTuple):
    """First contacts of N pairs of moving bodies; scalars and ``(3,)`` for single poses.

    Attributes
    ----------
    toi : float64 (N,)
        Certified: at all times before it the bodies are farther apart than the margin. 0 is the start, 1 the end, and
        1 where they never come that near.
    time_upper : float64 (N,)
        A time at which they are within margin and tolerance; infinite if none is known.
    point_a, point_b, normal : float64 (N, 3)
        As of :class:`Distances`, at ``time_upper``; NaN where there are none.
    distance : float64 (N,)
        Upper bound of the distance at ``time_upper``, metres.
    verdict : uint8 (N,)
        :class:`Verdict` of the whole motion.
    """

    toi: Floats
    time_upper: Floats
    point_a: Floats
    point_b: Floats
    normal: Floats
    distance: Floats
    verdict: Verdicts


class Hits(NamedTuple):
    """Where N rays first meet a body; scalars and ``(3,)`` for a single ray.

    Attributes
    ----------
    t : float64 (N,)
        The hit is at ``origin + t * direction``; infinite if there is none.
    point, normal : float64 (N, 3)
        The hit and the outward unit normal there, world; NaN if there is none.
    node, triangle : int64 (N,)
        The leaf that was hit and, of an exact tree, its triangle; -1 if there is none.
    verdict : uint8 (N,)
        :class:`Verdict`, the ray in the place of the second body.
    """

    t: Floats
    point: Floats
    normal: Floats
    node: NDArray[np.int64]
    triangle: NDArray[np.int64]
    verdict: Verdicts


class SignedDistances(NamedTuple):
    """Signed distances of N points from the surface of a body; scalars and ``(3,)`` for a single point.

    Attributes
    ----------
    lower, upper : float64 (N,)
        Certified bounds, metres; above 0 outside, below 0 inside.
    point : float64 (N, 3)
        The nearest point of the surface, world; NaN if none was reached.
    gradient : float64 (N, 3)
        Unit vector along which the signed distance grows fastest; at the surface, its normal.
    node, triangle : int64 (N,)
        The leaf that ``point`` lies on and, of an exact tree, the triangle; -1 if there is none.
    verdict : uint8 (N,)
        :class:`Verdict`: ``SEPARATED`` is outside, certainly; ``OVERLAPPING`` inside, or as near as rounding.
    """

    lower: Floats
    upper: Floats
    point: Floats
    gradient: Floats
    node: NDArray[np.int64]
    triangle: NDArray[np.int64]
    verdict: Verdicts


class Bounds(NamedTuple):
    """Axis-aligned boxes of N placed bodies, ``lower`` and ``upper`` ``(N, 3)``, world, metres."""

    lower: Floats
    upper: Floats
