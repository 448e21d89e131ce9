"""Many bodies: which of them meet, where, and what else is near?"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, Union

from . import _core
from ._answers import Contacts, Distances, Hits, Sweeps
from ._shapes import Box, Capsule, HalfSpace, Sphere, numbers
from ._tree import Tree

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ._answers import Verdicts
    from ._queries import Order

    Ids = NDArray[np.uint64]

_ALL = 0xFFFFFFFF


class WorldPairs(NamedTuple):
    """Pairs of bodies whose boxes overlap: ``ids`` uint64 (M, 2), and which ``begins`` bool (M,) since the pairs
    were last found."""

    ids: Ids
    begins: NDArray[np.bool_]


class WorldVerdicts(NamedTuple):
    """Pairs of bodies, ``ids`` uint64 (M, 2), and their ``verdict`` uint8 (M,). All other pairs are separated."""

    ids: Ids
    verdict: Verdicts


class WorldDistances(NamedTuple):
    """Pairs of bodies, ``ids`` uint64 (M, 2), and how far apart they are: rows of ``found``, :class:`Distances`."""

    ids: Ids
    found: Distances


class EventKind(enum.IntEnum):
    """What has become of a contact since the last call."""

    BEGAN = 0
    STAYS = 1
    ENDED = 2


class WorldContacts(NamedTuple):
    """Where bodies touch.

    Attributes
    ----------
    ids : uint64 (M, 2)
        Pairs of bodies. Normals point from the first to the second.
    found : Contacts
        Those of pair ``i`` are rows ``offsets[i]:offsets[i + 1]``.
    event_ids : uint64 (E, 2)
        Pairs that touch, or did when :meth:`World.contacts` was last called. One of them may have been removed.
    event_kind : uint8 (E,)
        :class:`EventKind`.
    """

    ids: Ids
    found: Contacts
    event_ids: Ids
    event_kind: NDArray[np.uint8]


class WorldHits(NamedTuple):
    """The bodies that N rays hit first, ``id`` uint64 (N,), 0 if none, and where: rows of ``found``, :class:`Hits`."""

    id: Ids
    found: Hits


class WorldSweeps(NamedTuple):
    """The bodies that a moving tree meets first, ``id`` uint64 (N,), 0 if none, and when: rows of ``found``,
    :class:`Sweeps`, the moving tree being ``a``."""

    id: Ids
    found: Sweeps


class WorldOverlaps(NamedTuple):
    """Bodies that N probes meet, ragged: those of probe ``i`` are ``ids[offsets[i]:offsets[i + 1]]``, ascending.

    ``offsets`` int64 (N + 1,), ``ids`` uint64 (M,). All other bodies are separated from the probe.
    """

    offsets: NDArray[np.int64]
    ids: Ids


Probe = Union[Sphere, Capsule, Box]


class World:
    """Many bodies: a broadphase, and queries of its pairs and from outside. Thread-safe; one call at a time works.

    Parameters
    ----------
    slack : float
        By how much boxes are enlarged, as a part of their longest side, 0 ... 1. More means fewer changes as bodies
        move, and more pairs that do not touch.

    Notes
    -----
    The world holds its poses in float32: what is given in float64 is rounded when a body is inserted or moved, and when
    a ray is asked about. Keep the world near (0, 0, 0), or add a margin. Answers are certified of the rounded poses.
    Probes and moving trees of float64 are not rounded but for a margin that holds both.

    All queries of pairs find the pairs first. ``len(world)`` is the number of bodies, parts of compounds included.
    """

    __slots__ = ("_world",)

    def __init__(self, *, slack: float = 0.1) -> None:
        self._world = _core.World(slack)

    def __len__(self) -> int:
        return len(self._world)

    def __repr__(self) -> str:
        return f"prolate.World({len(self)} bodies)"

    # ---- bodies ----

    def insert(
        self,
        shape: Tree | HalfSpace,
        pose: ArrayLike | None = None,
        *,
        parts: Sequence[tuple[Tree, ArrayLike]] = (),
        margin: float = 0,
        layers: int = 1,
        mask: int = _ALL,
        order: Order = "xyzw",
    ) -> int:
        """Add a body and return its id, which is never used again.

        Parameters
        ----------
        shape : Tree or HalfSpace
            A half-space is ground: it has no pose and no parts, and does not move.
        pose : array of shape (7,) or (4, 4)
        parts : sequence of (Tree, pose)
            More trees that move with the body, at poses in its frame. Pairs are pairs of parts; :meth:`body_of` has
            the body that a part's id belongs to.
        margin : float
            Two bodies are a pair if nearer than the sum of their margins, metres.
        layers, mask : int
            32 bits: the layers that the body is in, and those that it meets. Bodies of a pair meet each other.
        order : {"xyzw", "wxyz"}
        """
        if isinstance(shape, HalfSpace):
            if pose is not None:
                raise TypeError("pose: a HalfSpace is in the world and has no pose")
            return self._world.insert(numbers(shape)[1], None, _parts(parts), margin, layers, mask, order)
        if not isinstance(shape, Tree):
            raise TypeError(f"shape: must be a Tree or a HalfSpace, not {type(shape).__name__}")
        return self._world.insert(shape, pose, _parts(parts), margin, layers, mask, order)

    def remove(self, id: int) -> None:
        """Take a body away, with its parts. Raises :class:`prolate.Error` with code ``"bad_id"`` if there is none."""
        self._world.remove(id)

    def move(self, ids: ArrayLike, poses: ArrayLike, *, order: Order = "xyzw") -> None:
        """Move bodies ``ids`` (N,) to ``poses`` (N, 7) or (N, 4, 4); if one of them is wrong, none has moved."""
        self._world.move(ids, poses, order)

    def refilter(self, id: int, *, layers: int, mask: int = _ALL) -> None:
        """Change the layers of a body, and those that it meets. Raises :class:`prolate.Error` as :meth:`remove`."""
        self._world.refilter(id, layers, mask)

    def body_of(self, id: int) -> int:
        """The body that a part belongs to; a body's own id for itself, and 0 if there is none."""
        return self._world.body_of(id)

    def part(self, id: int, i: int) -> int:
        """The id of part ``i`` of a body, in the order of :meth:`insert`; 0 is the body itself. 0 if there is none."""
        return self._world.part(id, i)

    # ---- its pairs ----

    def pairs(self) -> WorldPairs:
        """All pairs whose boxes overlap, ordered."""
        return WorldPairs(*self._world.pairs())

    def collide(
        self, *, margin: float = 0, max_level: int | None = None, budget: int | None = None, threads: int = 1
    ) -> WorldVerdicts:
        """All pairs whose boxes overlap, and whether their bodies come within ``margin`` (metres) of each other.

        Parameters are those of :func:`prolate.collide`.
        """
        return WorldVerdicts(*self._world.collide(margin, max_level, budget, threads))

    def collide_solids(self, *, margin: float = 0, budget: int | None = None, threads: int = 1) -> WorldVerdicts:
        """All pairs whose boxes overlap, and whether their *solids* come within ``margin`` (metres), certain both ways.

        Parameters are those of :func:`prolate.collide_solids`.
        """
        return WorldVerdicts(*self._world.collide_solids(margin, budget, threads))

    def distance(
        self,
        *,
        tolerance: float = 1e-6,
        max_distance: float | None = None,
        budget: int | None = None,
        threads: int = 1,
    ) -> WorldDistances:
        """All pairs whose boxes overlap, and how far apart their bodies are; give these margins, to be pairs from afar.

        Parameters are those of :func:`prolate.distance`.
        """
        ids, arrays = self._world.distance(tolerance, max_distance, budget, threads)
        return WorldDistances(ids, Distances(*arrays))

    def contacts(self, *, margin: float = 0, budget: int | None = None, threads: int = 1) -> WorldContacts:
        """Where all bodies touch, and which contacts began, stay or ended since the last call.

        Parameters are those of :func:`prolate.contacts`. Ids of points stay from call to call as long as the same
        features touch.
        """
        ids, arrays, verdict, event_ids, event_kind = self._world.contacts(margin, budget, threads)
        return WorldContacts(ids, Contacts(*arrays, verdict), event_ids, event_kind)

    # ---- from outside ----

    def raycast(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        radius: float = 0,
        *,
        max_t: float | None = None,
        mask: int = _ALL,
        budget: int | None = None,
        threads: int = 1,
    ) -> WorldHits:
        """Where do N rays, or balls that fly along them, first meet a body?

        Parameters
        ----------
        origins, directions, radius, max_t, budget, threads
            As for :func:`prolate.raycast`; the budget is for each body.
        mask : int
            Bodies of these layers.
        """
        ids, arrays, single = self._world.raycast(origins, directions, radius, max_t, mask, budget, threads)
        return WorldHits(ids[0], Hits(*(x[0] for x in arrays))) if single else WorldHits(ids, Hits(*arrays))

    def sweep(
        self,
        tree: Tree,
        start: ArrayLike,
        end: ArrayLike,
        *,
        margin: float = 0,
        tolerance: float = 0,
        mask: int = _ALL,
        budget: int | None = None,
        threads: int = 1,
        order: Order = "xyzw",
    ) -> WorldSweeps:
        """When does a tree, on N ways from ``start`` to ``end``, first meet a body, all bodies being at rest?

        Parameters
        ----------
        tree, start, end, margin, tolerance, budget, threads, order
            As for :func:`prolate.sweep`; the budget is for each body.
        mask : int
            Bodies of these layers.
        """
        ids, arrays, gap, single = self._world.sweep(tree, start, end, margin, tolerance, mask, budget, threads, order)
        lower, upper, point_a, point_b, normal, verdict = arrays
        fields = (lower, upper, point_a, point_b, normal, gap, verdict)
        return WorldSweeps(ids[0], Sweeps(*(x[0] for x in fields))) if single else WorldSweeps(ids, Sweeps(*fields))

    def overlap(
        self,
        what: Tree | Probe | Sequence[Probe],
        poses: ArrayLike | None = None,
        *,
        margin: float = 0,
        mask: int = _ALL,
        budget: int | None = None,
        threads: int = 1,
        order: Order = "xyzw",
    ) -> WorldOverlaps:
        """Which bodies does a tree at N poses meet, or does each of N shapes?

        Parameters
        ----------
        what : Tree, or one or several of Sphere, Capsule and Box
        poses : array of shape (7,), (N, 7), (4, 4) or (N, 4, 4)
            Of a tree.
        margin, budget, threads, order
            As for :func:`prolate.overlap`; the budget is for each body.
        mask : int
            Bodies of these layers.
        """
        if isinstance(what, Tree):
            return WorldOverlaps(*self._world.overlap_tree(what, poses, margin, mask, budget, threads, order))
        if poses is not None:
            raise TypeError("poses: only a Tree has poses here")
        if isinstance(what, (Sphere, Capsule, Box)):
            what = (what,)
        elif not isinstance(what, (list, tuple)):
            raise TypeError(f"what: must be a Tree, a shape or a list of shapes, not {type(what).__name__}")
        rows = []
        for i, shape in enumerate(what):
            try:
                rows.append(numbers(shape))
            except (TypeError, ValueError) as error:
                raise type(error)(f"what[{i}]: {error}") from None
        return WorldOverlaps(*self._world.overlap_shapes(rows, margin, mask, budget, threads))


def _parts(parts: Sequence[tuple[Tree, ArrayLike]]) -> list[tuple[Tree, ArrayLike]]:
    try:
        return [(tree, pose) for tree, pose in parts]
    except (TypeError, ValueError):
        raise TypeError("parts: must be a sequence of (Tree, pose)") from None
