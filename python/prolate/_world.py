"""Many bodies: which of them meet?"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from . import _core

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ._answers import Verdicts
    from ._queries import Order
    from ._tree import Tree


class WorldPairs(NamedTuple):
    """Pairs of bodies whose boxes overlap: ``ids`` uint64 (M, 2), and which of them ``begins`` bool (M,) since the
    last call."""

    ids: NDArray[np.uint64]
    begins: NDArray[np.bool_]


class WorldVerdicts(NamedTuple):
    """Pairs of bodies, ``ids`` uint64 (M, 2), and their ``verdict`` uint8 (M,). All other pairs are separated."""

    ids: NDArray[np.uint64]
    verdict: Verdicts


class World:
    """A broadphase over many bodies. Thread-safe; one call at a time works.

    Parameters
    ----------
    slack : float
        By how much boxes are enlarged, as a part of their longest side, 0 ... 1. More means fewer changes as bodies
        move, and more pairs that do not touch.

    Notes
    -----
    Poses in float64 are rounded to float32 when a body is inserted or moved; keep the world near (0, 0, 0), or add a
    margin. ``len(world)`` is the number of bodies.
    """

    __slots__ = ("_world",)

    def __init__(self, *, slack: float = 0.1) -> None:
        self._world = _core.World(slack)

    def __len__(self) -> int:
        return len(self._world)

    def __repr__(self) -> str:
        return f"prolate.World({len(self)} bodies)"

    def insert(
        self,
        tree: Tree,
        pose: ArrayLike,
        *,
        margin: float = 0,
        layers: int = 1,
        mask: int = 0xFFFFFFFF,
        order: Order = "xyzw",
    ) -> int:
        """Add a body and return its id, which is never used again.

        Parameters
        ----------
        tree : Tree
        pose : array of shape (7,) or (4, 4)
        margin : float
            Two bodies are a pair if nearer than the sum of their margins, metres.
        layers, mask : int
            32 bits: the layers that the body is in, and those that it meets. Bodies of a pair meet each other.
        order : {"xyzw", "wxyz"}
        """
        return self._world.insert(tree, pose, margin, layers, mask, order)

    def remove(self, id: int) -> None:
        """Take a body away. Raises :class:`prolate.Error` with code ``"bad_id"`` if there is none."""
        self._world.remove(id)

    def move(self, ids: ArrayLike, poses: ArrayLike, *, order: Order = "xyzw") -> None:
        """Move bodies ``ids`` (N,) to ``poses`` (N, 7) or (N, 4, 4); if one of them is wrong, none has moved."""
        self._world.move(ids, poses, order)

    def pairs(self) -> WorldPairs:
        """All pairs whose boxes overlap, ordered."""
        return WorldPairs(*self._world.pairs())

    def collide(self, *, margin: float = 0, threads: int = 1) -> WorldVerdicts:
        """All pairs whose boxes overlap, and whether their bodies come within ``margin`` (metres) of each other."""
        return WorldVerdicts(*self._world.collide(margin, threads))
