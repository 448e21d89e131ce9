"""Queries about ellipsoid trees at many poses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from . import _core
from ._answers import Bounds, Contacts, Distances, Hits, SignedDistances, SolidDepths, SolidDistances, Sweeps, Verdict
from ._shapes import HalfSpace, Shape, ground, numbers

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ._answers import Verdicts
    from ._tree import Tree

Order = Literal["xyzw", "wxyz"]

_VERDICTS = tuple(Verdict)


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
    found = _core.collide(a, poses_a, b, poses_b, margin, max_level, budget, threads, out, order)
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
        plane = ground(b, poses_b)
        arrays, single = _core.ground_distance(a, poses_a, plane, tolerance, max_distance, budget, threads, order)
        return Distances(*(x[0] for x in arrays)) if single else Distances(*arrays)
    arrays, single = _core.distance(a, poses_a, b, poses_b, tolerance, max_distance, max_level, budget, threads, order)
    return Distances(*(x[0] for x in arrays)) if single else Distances(*arrays)


def collide_solids(
    a: Tree,
    poses_a: ArrayLike,
    b: Tree,
    poses_b: ArrayLike,
    *,
    margin: float = 0,
    max_level: int | None = None,
    budget: int | None = None,
    threads: int = 1,
    order: Order = "xyzw",
) -> Any:
    """Do two *solids* meet, for certain, at each of N poses? Without a triangle, from covers outside and inside.

    Outer ellipsoids apart: the solids are apart. Inner ellipsoids meeting (``bake(..., inner=64)``): the solids meet.
    Neither: ``UNDECIDED``, and whoever needs to know asks exact trees. An exact tree is the solid: its triangles decide
    what inner covers leave open.

    Parameters
    ----------
    a, poses_a, b, poses_b, margin, budget, threads, order
        As for :func:`collide`. How far the runtime's single precision moves poses in float64 is allowed for both ways:
        of trees without triangles, ``OVERLAPPING`` holds of the poses as given, too.
    max_level : int, optional
        The covers at this level of either tree (0 = roots only).

    Returns
    -------
    uint8 array of shape (N,), or a Verdict if both poses are single
        ``SEPARATED`` and ``OVERLAPPING`` are certain of the solids.

    Raises
    ------
    ValueError, TypeError
        As :func:`collide`.
    """
    found = _core.collide_solids(a, poses_a, b, poses_b, margin, max_level, budget, threads, order)
    return _VERDICTS[found] if isinstance(found, int) else found


def _matrices(bones: ArrayLike | None, name: str) -> Any:
    """Of each pose 12 numbers for each bone."""
    if bones is None:
        return None
    import numpy as np

    try:
        out = np.asarray(bones, dtype=float)
    except (ValueError, TypeError) as error:
        raise type(error)(f"{name}: {error}; give matrices of shape (B, 3, 4)") from None
    if out.ndim not in (3, 4) or out.shape[-2:] not in ((3, 4), (4, 4)):
        raise ValueError(f"{name}: must have shape (B, 3, 4) or (N, B, 3, 4), not {out.shape}")
    return np.ascontiguousarray(out[..., :3, :]).reshape(*out.shape[:-3], 12 * out.shape[-3])


def collide_deformed(
    a: Tree,
    poses_a: ArrayLike,
    b: Tree,
    poses_b: ArrayLike,
    *,
    q_a: ArrayLike | None = None,
    q_b: ArrayLike | None = None,
    bones_a: ArrayLike | None = None,
    bones_b: ArrayLike | None = None,
    margin: float = 0,
    max_level: int | None = None,
    budget: int | None = None,
    threads: int = 1,
    order: Order = "xyzw",
) -> Any:
    """Do two bodies that deform by modes or bones meet, at each of N poses? Without a vertex, by their nodes.

    ``SEPARATED`` is certain of the deformed meshes. ``OVERLAPPING``: deformed triangles meet, or of trees without
    triangles leaf ellipsoids, as their coordinates move and enlarge them; or one body may lie inside the other.

    Parameters
    ----------
    a, poses_a, b, poses_b, margin, max_level, budget, threads, order
        As for :func:`collide`. Trees of :meth:`Tree.with_modes` or :meth:`Tree.with_skin`, or rigid ones.
    q_a, q_b : array of shape (M,) or (N, M), optional
        Coordinates of the bodies, rounded to float32; without, they are at rest. One row goes with all of the others.
    bones_a, bones_b : array of shape (B, 3, 4), (B, 4, 4), (N, B, 3, 4) or (N, B, 4, 4), optional
        Where each bone takes the mesh: affine maps in its frame, rounded to float32, the last row of a 4x4 left out.
        In an animation the joint's matrix times its inverse bind matrix. Without, all are the identity.

    Returns
    -------
    uint8 array of shape (N,), or a Verdict if poses and coordinates are single
        ``UNDECIDED`` if the budget ran out, or a coordinate is NaN or beyond :attr:`Tree.mode_ranges`: no bound holds;
        or a matrix is not finite, or has a factor above 1024.

    Raises
    ------
    ValueError, TypeError
        As :func:`collide`; for coordinates of another number than the tree has modes, or bones.
    """
    flat_a, flat_b = _matrices(bones_a, "bones_a"), _matrices(bones_b, "bones_b")
    found = _core.collide_deformed(
        a, poses_a, q_a, flat_a, b, poses_b, q_b, flat_b, margin, max_level, budget, threads, order
    )
    return _VERDICTS[found] if isinstance(found, int) else found


def distance_deformed(
    a: Tree,
    poses_a: ArrayLike,
    b: Tree,
    poses_b: ArrayLike,
    *,
    q_a: ArrayLike | None = None,
    q_b: ArrayLike | None = None,
    bones_a: ArrayLike | None = None,
    bones_b: ArrayLike | None = None,
    tolerance: float = 1e-6,
    max_distance: float | None = None,
    max_level: int | None = None,
    budget: int | None = None,
    threads: int = 1,
    order: Order = "xyzw",
) -> Distances:
    """How far apart are two bodies that deform by modes, at each of N poses and coordinates?

    ``lower`` is certain of the deformed meshes. ``upper`` is that of the deformed triangles of exact trees, and of the
    leaf ellipsoids of others, as their coordinates move and enlarge them.

    Parameters
    ----------
    a, poses_a, b, poses_b, q_a, q_b, bones_a, bones_b
        As for :func:`collide_deformed`.
    tolerance, max_distance, max_level, budget, threads, order
        As for :func:`distance`.

    Returns
    -------
    Distances
        Where a coordinate is NaN or beyond :attr:`Tree.mode_ranges`: ``UNDECIDED``, ``lower`` 0, ``upper`` infinite.
        Where one body may lie inside the other, ``lower`` is 0 and ``upper`` that of the surfaces.

    Raises
    ------
    ValueError, TypeError
        As :func:`collide_deformed`.
    """
    flat_a, flat_b = _matrices(bones_a, "bones_a"), _matrices(bones_b, "bones_b")
    arrays, single = _core.distance_deformed(
        a, poses_a, q_a, flat_a, b, poses_b, q_b, flat_b, tolerance, max_distance, max_level, budget, threads, order
    )
    return Distances(*(x[0] for x in arrays)) if single else Distances(*arrays)


def raycast_deformed(
    tree: Tree,
    pose: ArrayLike,
    origins: ArrayLike,
    directions: ArrayLike,
    radius: float = 0,
    *,
    q: ArrayLike | None = None,
    bones: ArrayLike | None = None,
    max_t: float | None = None,
    max_level: int | None = None,
    budget: int | None = None,
    threads: int = 1,
    order: Order = "xyzw",
) -> Hits:
    """Where do N rays, or balls that fly along them, first meet a body that deforms by modes?

    Parameters
    ----------
    tree, pose, origins, directions, radius, max_t, max_level, budget, threads, order
        As for :func:`raycast`. A tree of :meth:`Tree.with_modes`, or a rigid one.
    q : array of shape (M,) or (N, M), optional
    bones : array of shape (B, 3, 4), (B, 4, 4), (N, B, 3, 4) or (N, B, 4, 4), optional
        As for :func:`collide_deformed`.

    Returns
    -------
    Hits
        Nothing is hit, and the verdict is ``UNDECIDED``, where a coordinate is NaN or beyond :attr:`Tree.mode_ranges`.

    Raises
    ------
    ValueError, TypeError
        As :func:`raycast`; for coordinates of another number than the tree has modes.
    """
    arrays, single = _core.raycast_deformed(
        tree, pose, q, _matrices(bones, "bones"), origins, directions, radius, max_t, max_level, budget, threads, order
    )
    return Hits(*(x[0] for x in arrays)) if single else Hits(*arrays)


def distance_solids(
    a: Tree,
    poses_a: ArrayLike,
    b: Tree,
    poses_b: ArrayLike,
    *,
    tolerance: float = 1e-6,
    max_distance: float | None = None,
    max_level: int | None = None,
    budget: int | None = None,
    threads: int = 1,
    order: Order = "xyzw",
) -> SolidDistances:
    """How far apart are two *solids*, at each of N poses? Bounds from covers outside and inside.

    Parameters
    ----------
    a, poses_a, b, poses_b, max_level, budget, threads, order
        As for :func:`collide_solids`.
    tolerance, max_distance
        As for :func:`distance`, of either cover. Of solids that are certainly ``max_distance`` apart, no upper bound
        is looked for.

    Returns
    -------
    SolidDistances

    Raises
    ------
    ValueError, TypeError
        As :func:`collide`.
    """
    arrays, single = _core.distance_solids(
        a, poses_a, b, poses_b, tolerance, max_distance, max_level, budget, threads, order
    )
    return SolidDistances(*(x[0] for x in arrays)) if single else SolidDistances(*arrays)


def depth_solids(
    a: Tree,
    poses_a: ArrayLike,
    b: Tree,
    poses_b: ArrayLike,
    *,
    max_level: int | None = None,
    budget: int | None = None,
    threads: int = 1,
    order: Order = "xyzw",
) -> SolidDepths:
    """How deep are two *solids* in each other, at each of N poses? Bounds from covers outside and inside.

    Parameters
    ----------
    a, poses_a, b, poses_b, max_level, budget, threads, order
        As for :func:`collide_solids`.

    Returns
    -------
    SolidDepths

    Raises
    ------
    ValueError, TypeError
        As :func:`collide`.
    """
    arrays, single = _core.depth_solids(a, poses_a, b, poses_b, max_level, budget, threads, order)
    return SolidDepths(*(x[0] for x in arrays)) if single else SolidDepths(*arrays)


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
        plane = ground(b, poses_b)
        arrays, verdict = _core.ground_contacts(a, poses_a, plane, margin, max_level, budget, threads, order)
        return Contacts(*arrays, verdict)
    arrays, verdict = _core.contacts(a, poses_a, b, poses_b, margin, max_level, budget, threads, order)
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
        a, start_a, end_a, b, start_b, end_b, margin, tolerance, max_level, budget, threads, order
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
    arrays, single = _core.raycast(tree, pose, origins, directions, radius, max_t, max_level, budget, threads, order)
    return Hits(*(x[0] for x in arrays)) if single else Hits(*arrays)


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
    kind, row = numbers(shape)
    found = _core.overlap(tree, poses, kind, row, margin, max_level, budget, threads, out, order)
    return _VERDICTS[found] if isinstance(found, int) else found


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
    arrays, single = _core.signed_distance(tree, points, pose, max_distance, budget, threads, order)
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
    found = _core.contains(tree, points, pose, threads, order)
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
    lower, upper, single = _core.bounds(tree, poses, margin, order)
    return Bounds(lower[0], upper[0]) if single else Bounds(lower, upper)
