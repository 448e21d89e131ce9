"""Queries about ellipsoid trees at many poses."""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Union

from . import _core

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ._tree import Tree

    Floats = NDArray[np.float64]
    Verdicts = NDArray[np.uint8]

Order = Literal["xyzw", "wxyz"]


class Verdict(enum.IntEnum):
    """What a query certifies; arrays of verdicts hold these numbers as ``uint8``.

    ``SEPARATED``: the solids do not touch, proved. ``OVERLAPPING``: the covers, or of exact trees the solids, have a
    common point, or are so close that rounding hides the gap. ``UNDECIDED``: the budget ran out first.
    """

    SEPARATED = 0
    OVERLAPPING = 1
    UNDECIDED = 2


_VERDICTS = tuple(Verdict)


def _is_wxyz(order: Order) -> bool:
    if order == "xyzw":
        return False
    if order == "wxyz":
        return True
    raise ValueError(f'order: must be "xyzw" or "wxyz", not {order!r}')


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


def collide(
    a: Tree,
    poses_a: ArrayLike,
    b: Tree,
    poses_b: ArrayLike,
    *,
    margin: float = 0,
    max_level: int | None = None,
    budget: int | None = None,
    threads: int = 1,
    out: Verdicts | None = None,
    order: Order = "xyzw",
) -> Any:
    """Do two bodies meet, at each of N poses?

    Parameters
    ----------
    a, b : Tree
        The bodies.
    poses_a, poses_b : array of shape (7,), (N, 7), (4, 4) or (N, 4, 4)
        Where they are: ``x y z qx qy qz qw``, first rotated, then moved, metres; quaternions of any length but 0. Or
        rigid matrices for column vectors. One pose goes with all of the other body's.

        float32 arrays of shape (N, 7) are used where they lie. Poses in float64 are not rounded before they are used:
        one body is taken in the frame of the other in double precision, and how far the runtime's single precision
        then moves any point (about 1e-7 of the bodies' distance and size) is added to the margin. So *separated* holds
        of the poses as given, wherever in the world they are. Where floats hold both poses exactly, nothing is added.
    margin : float
        Bodies at most this far apart count as meeting, metres.
    max_level : int, optional
        Look no deeper than this level of either tree (0 = roots only). A shallow *separated* holds at every depth.
    budget : int, optional
        Stop before more than this many tests of nodes and triangles are made, for each pose.
    threads : int
        How many threads share the work; 0 = all cores. The results do not depend on it.
    out : uint8 array of shape (N,), optional
        Written to and returned.
    order : {"xyzw", "wxyz"}
        How quaternions are stored.

    Returns
    -------
    uint8 array of shape (N,), or a Verdict if both poses are single
        The numbers of :class:`Verdict`.

    Raises
    ------
    ValueError, TypeError
        Naming argument and index: a shape that does not fit, a number that is not finite, a quaternion of 0.

    Notes
    -----
    Thread-safe; other Python threads run meanwhile. Ctrl-C ends it.
    """
    found = _core.collide(
        a, poses_a, b, poses_b, margin, max_level, budget, threads, out, order != "xyzw" and _is_wxyz(order)
    )
    return _VERDICTS[found] if found.__class__ is int else found


def distance(
    a: Tree,
    poses_a: ArrayLike,
    b: Tree | HalfSpace,
    poses_b: ArrayLike | None = None,
    *,
    tolerance: float = 1e-6,
    max_distance: float | None = None,
    max_level: int | None = None,
    budget: int | None = None,
    threads: int = 1,
    order: Order = "xyzw",
) -> Distances:
    """How far apart are two bodies, at each of N poses?

    Parameters
    ----------
    a, poses_a, b, poses_b, budget, threads, order
        As for :func:`collide`. Poses in float64 widen the bounds by what rounding moves. In the place of ``b`` may be a
        :class:`HalfSpace`, which is in the world and has no pose; ``point_b`` is then the point of the plane below
        ``point_a``.
    tolerance : float
        Stop as soon as ``upper - lower`` is at most this part of ``upper``.
    max_distance : float, optional
        Stop as soon as the bodies are certain to be at least this far apart, metres.
    max_level : int, optional
        Look no deeper than this level to improve the lower bound.

    Returns
    -------
    Distances

    Raises
    ------
    ValueError, TypeError
        As :func:`collide`.
    """
    if isinstance(b, HalfSpace):
        ground = _ground(b, poses_b)
        arrays, single = _core.ground_distance(
            a, poses_a, ground, tolerance, max_distance, budget, threads, _is_wxyz(order)
        )
        return Distances(*(x[0] for x in arrays)) if single else Distances(*arrays)
    arrays, single = _core.distance(
        a, poses_a, b, poses_b, tolerance, max_distance, max_level, budget, threads, _is_wxyz(order)
    )
    return Distances(*(x[0] for x in arrays)) if single else Distances(*arrays)


def contacts(
    a: Tree,
    poses_a: ArrayLike,
    b: Tree | HalfSpace,
    poses_b: ArrayLike | None = None,
    *,
    margin: float = 0,
    max_level: int | None = None,
    budget: int | None = None,
    threads: int = 1,
    order: Order = "xyzw",
) -> Contacts:
    """Where and how deep do two bodies touch, at each of N poses?

    Parameters
    ----------
    a, poses_a, b, poses_b, margin, max_level, budget, threads, order
        As for :func:`collide`. In the place of ``b`` may be a :class:`HalfSpace`, which is in the world and has no
        pose.

    Returns
    -------
    Contacts
        At most 4 manifolds of 4 points a pose. The verdicts are certified; points and normals are accurate to rounding
        where surfaces touch or overlap a little.

    Raises
    ------
    ValueError, TypeError
        As :func:`collide`.
    """
    if isinstance(b, HalfSpace):
        ground = _ground(b, poses_b)
        arrays, verdict = _core.ground_contacts(a, poses_a, ground, margin, max_level, budget, threads, _is_wxyz(order))
        return Contacts(*arrays, verdict)
    arrays, verdict = _core.contacts(a, poses_a, b, poses_b, margin, max_level, budget, threads, _is_wxyz(order))
    return Contacts(*arrays, verdict)


def sweep(
    a: Tree,
    start_a: ArrayLike,
    end_a: ArrayLike,
    b: Tree,
    start_b: ArrayLike,
    end_b: ArrayLike,
    *,
    margin: float = 0,
    tolerance: float = 0,
    max_level: int | None = None,
    budget: int | None = None,
    threads: int = 1,
    order: Order = "xyzw",
) -> Sweeps:
    """When do two moving bodies first meet? Nothing tunnels, however fast or thin it is.

    Parameters
    ----------
    a, b, max_level, budget, threads, order
        As for :func:`collide`.
    start_a, end_a, start_b, end_b : array of shape (7,), (N, 7), (4, 4) or (N, 4, 4)
        Poses at times 0 and 1. In between, a body's origin moves along a straight line and the body turns about it at a
        constant rate, by the smaller angle.
    margin : float
        Bodies at most this far apart count as meeting, metres.
    tolerance : float
        Bodies within margin + tolerance may count as meeting, metres. 0: 1e-4 of the smaller body's size.

    Returns
    -------
    Sweeps

    Raises
    ------
    ValueError, TypeError
        As :func:`collide`.
    """
    arrays, gap, single = _core.sweep(
        a, start_a, end_a, b, start_b, end_b, margin, tolerance, max_level, budget, threads, _is_wxyz(order)
    )
    lower, upper, point_a, point_b, normal, verdict = arrays
    fields = (lower, upper, point_a, point_b, normal, gap, verdict)
    return Sweeps(*(x[0] for x in fields)) if single else Sweeps(*fields)


def raycast(
    tree: Tree,
    pose: ArrayLike,
    origins: ArrayLike,
    directions: ArrayLike,
    radius: float = 0,
    *,
    max_t: float | None = None,
    max_level: int | None = None,
    budget: int | None = None,
    threads: int = 1,
    order: Order = "xyzw",
) -> Hits:
    """Where do N rays, or balls that fly along them, first meet a body?

    Parameters
    ----------
    tree : Tree
        The body. An exact tree is hit at its triangles, from either side.
    pose : array of shape (7,), (N, 7), (4, 4) or (N, 4, 4)
        As for :func:`collide`. Rays in float64 are taken into the body's frame in double precision and rounded there.
    origins, directions : array of shape (3,) or (N, 3)
        World, metres. Directions may have any length but 0; with unit vectors, ``t`` is in metres.
    radius : float
        Of the ball, metres.
    max_t : float, optional
        Where rays end.
    max_level, budget, threads, order
        As for :func:`collide`.

    Returns
    -------
    Hits

    Raises
    ------
    ValueError, TypeError
        As :func:`collide`.
    """
    arrays, single = _core.raycast(
        tree, pose, origins, directions, radius, max_t, max_level, budget, threads, _is_wxyz(order)
    )
    return Hits(*(x[0] for x in arrays)) if single else Hits(*arrays)


class Sphere(NamedTuple):
    """All points at most ``radius`` from ``center`` (3,); world, metres."""

    center: ArrayLike
    radius: float


class Capsule(NamedTuple):
    """All points at most ``radius`` from the segment between ``a`` and ``b`` (3,); world, metres."""

    a: ArrayLike
    b: ArrayLike
    radius: float


class Box(NamedTuple):
    """The box of half extents ``half`` (3,) at ``pose`` (7,), ``x y z qx qy qz qw``; world, metres."""

    pose: ArrayLike
    half: ArrayLike


class HalfSpace(NamedTuple):
    """All points p with ``dot(normal, p) <= offset * |normal|``; ``normal`` (3,) is no zero vector; world, metres."""

    normal: ArrayLike
    offset: float


Shape = Union[Sphere, Capsule, Box, HalfSpace]


def _row(name: str, value: ArrayLike, count: int) -> Floats:
    import numpy as np

    try:
        row = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: cannot be taken as an array of float64") from None
    if row.shape != (count,):
        raise ValueError(f"{name}: must have shape ({count},), not {row.shape}")
    return row


def _length(name: str, value: float) -> Floats:
    row = _row(name, [value], 1)
    if row[0] < 0:
        raise ValueError(f"{name}: must be 0 or more")
    return row


def _numbers(shape: Shape) -> tuple[str, Floats]:
    import numpy as np

    if isinstance(shape, Sphere):
        return "sphere", np.concatenate([_row("shape.center", shape.center, 3), _length("shape.radius", shape.radius)])
    if isinstance(shape, Capsule):
        ends = [_row("shape.a", shape.a, 3), _row("shape.b", shape.b, 3)]
        return "capsule", np.concatenate([*ends, _length("shape.radius", shape.radius)])
    if isinstance(shape, Box):
        half = _row("shape.half", shape.half, 3)
        pose = _row("shape.pose", shape.pose, 7)
        if (half < 0).any():
            raise ValueError("shape.half: must be 0 or more")
        if not np.abs(pose[3:]).max() > 1e-18:
            raise ValueError("shape.pose: has a quaternion of 0; no rotation is 0 0 0 1")
        return "box", np.concatenate([pose, half])
    if isinstance(shape, HalfSpace):
        normal = _row("shape.normal", shape.normal, 3)
        length = float(np.linalg.norm(normal))
        if not 0 < length < np.inf:
            raise ValueError("shape.normal: must not be 0")
        offset = _row("shape.offset", [shape.offset], 1)
        return "half_space", np.concatenate([normal / length, offset])
    raise TypeError(f"shape: must be a Sphere, Capsule, Box or HalfSpace, not {type(shape).__name__}")


def _ground(half_space: HalfSpace, pose: object) -> Floats:
    if pose is not None:
        raise TypeError("poses_b: a HalfSpace is in the world and has no pose")
    return _numbers(half_space)[1]


def overlap(
    tree: Tree,
    poses: ArrayLike,
    shape: Shape,
    *,
    margin: float = 0,
    max_level: int | None = None,
    budget: int | None = None,
    threads: int = 1,
    out: Verdicts | None = None,
    order: Order = "xyzw",
) -> Any:
    """Does a body meet a simple, solid shape, at each of N poses?

    Parameters
    ----------
    tree, poses, margin, max_level, budget, threads, out, order
        As for :func:`collide`.
    shape : Sphere, Capsule, Box or HalfSpace
        In the world. (A Box's quaternion is always ``x y z w``.)

    Returns
    -------
    uint8 array of shape (N,), or a Verdict for a single pose

    Raises
    ------
    ValueError, TypeError
        As :func:`collide`.
    """
    kind, numbers = _numbers(shape)
    found = _core.overlap(tree, poses, kind, numbers, margin, max_level, budget, threads, out, _is_wxyz(order))
    return _VERDICTS[found] if isinstance(found, int) else found


_IDENTITY = (0, 0, 0, 0, 0, 0, 1)
_IDENTITY_WXYZ = (0, 0, 0, 1, 0, 0, 0)


def signed_distance(
    tree: Tree,
    points: ArrayLike,
    pose: ArrayLike | None = None,
    *,
    max_distance: float | None = None,
    budget: int | None = None,
    threads: int = 1,
    order: Order = "xyzw",
) -> SignedDistances:
    """How far are N points from a body, and on which side of its surface?

    Parameters
    ----------
    tree : Tree
        The body. An exact tree of an open mesh has no inside: its distances are above 0.
    points : array of shape (3,) or (N, 3)
        World, metres. In float64 they are taken into the body's frame in double precision; the bounds are widened by
        what rounding there moves. Points that follow each other closely are answered sooner.
    pose : array of shape (7,) or (4, 4), optional
        Of the body; the identity by default.
    max_distance : float, optional
        Stop as soon as a point is certain to be at least this far from the surface, metres.
    budget, threads, order
        As for :func:`collide`.

    Returns
    -------
    SignedDistances

    Raises
    ------
    ValueError, TypeError
        As :func:`collide`.
    """
    wxyz = _is_wxyz(order)
    at = (_IDENTITY_WXYZ if wxyz else _IDENTITY) if pose is None else pose
    arrays, single = _core.signed_distance(tree, points, at, max_distance, budget, threads, wxyz)
    return SignedDistances(*(x[0] for x in arrays)) if single else SignedDistances(*arrays)


def contains(
    tree: Tree, points: ArrayLike, pose: ArrayLike | None = None, *, threads: int = 1, order: Order = "xyzw"
) -> Any:
    """Which of N points are in a body? Sooner than :func:`signed_distance`, whose verdict it returns.

    Parameters
    ----------
    tree, points, pose, threads, order
        As for :func:`signed_distance`.

    Returns
    -------
    uint8 array of shape (N,), or a Verdict for a single point
        ``SEPARATED``: outside, certainly.
    """
    wxyz = _is_wxyz(order)
    at = (_IDENTITY_WXYZ if wxyz else _IDENTITY) if pose is None else pose
    found = _core.contains(tree, points, at, threads, wxyz)
    return _VERDICTS[found] if isinstance(found, int) else found


def bounds(tree: Tree, poses: ArrayLike, *, margin: float = 0, order: Order = "xyzw") -> Bounds:
    """Axis-aligned boxes that hold a body and all points within ``margin`` of it, at each of N poses.

    Parameters
    ----------
    tree, poses, margin, order
        As for :func:`collide`.

    Returns
    -------
    Bounds
        Certified, and at most 1 or 2 % longer than the smallest along each axis.
    """
    lower, upper, single = _core.bounds(tree, poses, margin, _is_wxyz(order))
    return Bounds(lower[0], upper[0]) if single else Bounds(lower, upper)
