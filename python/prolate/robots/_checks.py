"""Is a configuration free? Is a motion? How far from trouble?"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .. import _core
from ._kinematics import Kinematics
from ._model import Description
from ._scene import Scene

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from .._tree import Tree


class RobotDistances(NamedTuple):
    """How far N configurations are from the nearest contact: of all pairs, the least distance.

    Attributes
    ----------
    lower, upper : float64 (N,)
        Certified: ``lower <= distance <= upper``, metres. ``lower`` 0: they may touch. Both infinite: nothing to touch.
    pair : int64 (N,)
        The nearest pair, a row of :meth:`Checks.pairs`; -1 if none is nearer than ``max_distance``.
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    pair: NDArray[np.int64]


class Pair(NamedTuple):
    """Two bodies that are looked at: a link's name, and that of another link or of a body of the scene."""

    link: str
    other: str
    in_scene: bool


class Checks:
    """A robot's links as bodies, at many configurations, among themselves and in a scene.

    *Free* is certified, of the trees and of whatever they cover: joints in double precision, and what any rounding
    moves is added as a margin (some 1e-7 of a link's size). *May touch* is not: covers stick out.

    Which pairs of links are looked at: all but those that a joint connects (a floating one does not), those that no
    joint moves against each other, and those that the description or ``allowed`` says may touch. What the root, or what
    is fixed to it, touches in the scene, it touches in all configurations: leave it out of the scene, or allow it.

    Parameters
    ----------
    description : Description
    trees : mapping of str to Tree
        In the links' frames, by the links' names. A link without one is nowhere.
    slack : mapping of str to float, optional
        By how much what a tree stands for may stick out of it, metres.
    allowed : iterable of (str, str), optional
        Pairs of links, or of a link and a body of the scene by its name, that may touch. A name that a link and a body
        share is the link's.

    Notes
    -----
    Immutable and thread-safe. A scene is made ready when it is first asked about; after :meth:`Scene.add`, again.
    """

    def __init__(
        self,
        description: Description,
        trees: Mapping[str, Tree],
        *,
        slack: Mapping[str, float] | None = None,
        allowed: Iterable[tuple[str, str]] = (),
    ) -> None:
        self.kinematics = Kinematics(description)
        names = self.kinematics.links
        for argument, given in (("trees", trees), ("slack", slack or {})):
            unknown = sorted(set(given) - set(names))
            if unknown:
                raise ValueError(f"{argument}: the robot has no link {', '.join(unknown)}")
        self._allowed = {frozenset(pair) for pair in allowed}
        wide = np.array([(slack or {}).get(name, 0.0) for name in names], dtype=np.float64)
        if not (wide >= 0).all():
            raise ValueError("slack: must be 0 or more")
        apart = set(map(frozenset, description.disabled)) | self._allowed | _neighbours(description)
        held = [i for i, name in enumerate(names) if name in trees]
        pairs = [(i, j) for i in held for j in held if i < j and frozenset((names[i], names[j])) not in apart]
        self._robot = _core.Robot(
            self.kinematics.columns,
            len(names),
            self.kinematics.nq,
            [trees.get(name) for name in names],
            wide,
            np.array(pairs, np.int64).reshape(-1, 2),
        )
        self._nowhere = _core.RobotChecks(self._robot, _core.RobotScene(), np.empty((0, 2)))
        self._last: tuple[Scene, int, _core.RobotChecks] | None = None

    @property
    def nq(self) -> int:
        """How many numbers a configuration has; see :class:`Kinematics`."""
        return self.kinematics.nq

    def fk(self, q: ArrayLike, *, threads: int = 1) -> NDArray[np.float64]:
        """The frames of all links, (L, N, 7): :meth:`Kinematics.fk`."""
        return self.kinematics.fk(q, threads=threads)

    def pairs(self, scene: Scene | None = None) -> list[Pair]:
        """The pairs of bodies that are looked at."""
        names, bodies = self.kinematics.links, scene.names if scene else []
        return [
            Pair(names[link], bodies[other] if in_scene else names[other], bool(in_scene))
            for link, other, in_scene in self._native(scene).pairs()
        ]

    def collide(
        self, q: ArrayLike, scene: Scene | None = None, *, first_only: bool = True, threads: int = 0
    ) -> NDArray[np.bool_]:
        """May anything touch?

        Parameters
        ----------
        q : array of shape (N, nq) or (nq,)
            Configurations; see :class:`Kinematics`.
        scene : Scene, optional
            What stands around.
        first_only : bool
            Stop at the first pair that may touch. Otherwise, all pairs are answered.
        threads : int
            0 = all cores. The results do not depend on it.

        Returns
        -------
        bool array of shape (N,), or (N, P) without ``first_only``
            Not certified to be apart; P are the pairs of :meth:`pairs`.

        Raises
        ------
        ValueError, TypeError
            Naming the configuration: a shape that does not fit, a number that is not finite, a quaternion of 0.
        """
        return self._native(scene).collide(q, not first_only, threads).astype(np.bool_)

    def distance(
        self,
        q: ArrayLike,
        scene: Scene | None = None,
        *,
        max_distance: float | None = None,
        tolerance: float = 1e-6,
        threads: int = 0,
    ) -> RobotDistances:
        """How far apart is what is nearest?

        Parameters
        ----------
        q, scene, threads
            As for :meth:`collide`.
        max_distance : float, optional
            Look no farther, metres: what is at least this far apart has this for ``lower``.
        tolerance : float
            Stop as soon as ``upper - lower`` is at most this part of ``upper``.

        Raises
        ------
        ValueError, TypeError
            As :meth:`collide`.
        """
        return RobotDistances(*self._native(scene).distance(q, tolerance, max_distance, threads))

    def validate_motion(
        self,
        q0: ArrayLike,
        q1: ArrayLike,
        scene: Scene | None = None,
        *,
        depth: int = 6,
        budget: int | None = 100_000,
        threads: int = 0,
    ) -> NDArray[np.bool_]:
        """Is a straight motion free, at every moment?

        Parameters
        ----------
        q0, q1 : array of shape (N, nq) or (nq,)
            Where motions begin and end, both included. In between, all coordinates go evenly: an angle by q1 - q0,
            however many turns that is; a quaternion by the smaller rotation, at a constant rate.
        scene, threads
            As for :meth:`collide`.
        depth : int
            1 ... 16: a motion is cut into at most 8 ** depth parts. Where bodies pass each other more closely than they
            move in half of one, the motion is not certified.
        budget : int, optional
            How many pairs may be asked about, for each motion.

        Returns
        -------
        bool array of shape (N,)
            True: certified to be free. False: something may touch, or a limit was reached first.

        Raises
        ------
        ValueError, TypeError
            As :meth:`collide`.
        """
        verdicts = self.motion_verdicts(q0, q1, scene, depth=depth, budget=budget, threads=threads)
        return np.logical_not(verdicts)  # SEPARATED is 0

    def motion_verdicts(
        self,
        q0: ArrayLike,
        q1: ArrayLike,
        scene: Scene | None = None,
        *,
        depth: int = 6,
        budget: int | None = 100_000,
        threads: int = 0,
    ) -> NDArray[np.uint8]:
        """:meth:`validate_motion`, and why not: the numbers of :class:`prolate.Verdict`, (N,).

        ``OVERLAPPING``: at some moment of the motion, bodies may touch. ``UNDECIDED``: a limit was reached.
        """
        return self._native(scene).motion(q0, q1, depth, budget, threads)

    def _native(self, scene: Scene | None) -> _core.RobotChecks:
        """The checks in this scene as it is now."""
        if scene is None or len(scene) == 0:
            return self._nowhere
        last = self._last
        if last is None or last[0] is not scene or last[1] != len(scene):
            index = {name: i for i, name in enumerate(self.kinematics.links)}
            free = [
                (index[link], body)
                for link in index
                for body, name in enumerate(scene.names)
                if name not in index and frozenset((link, name)) in self._allowed
            ]
            native = _core.RobotChecks(self._robot, scene.native, np.array(free, np.int64).reshape(-1, 2))
            last = self._last = (scene, len(scene), native)
        return last[2]


def _neighbours(description: Description) -> set[frozenset[str]]:
    """Pairs of links that a joint connects, or that nothing moves against each other.

    A floating joint connects nothing. Links that are fixed together are one body, so what a joint connects to one is a
    neighbour of all of them.
    """
    body = {link.name: link.name for link in description.links}  # the first of those fixed together
    moving = []
    for joint in description.joints:
        if joint.kind == "fixed":
            body[joint.child] = body[joint.parent]
        elif joint.kind != "floating":
            moving.append(joint)
    connected = {frozenset((body[joint.parent], joint.child)) for joint in moving}
    names = list(body)
    return {
        frozenset((a, b))
        for i, a in enumerate(names)
        for b in names[i + 1 :]
        if body[a] == body[b] or frozenset((body[a], body[b])) in connected
    }
