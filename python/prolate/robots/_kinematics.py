"""Forward kinematics, many configurations at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from ._model import COORDINATES, Description, Joint

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

_KINDS = tuple(COORDINATES)  # as python/src/robot_chain.hpp numbers them


class Kinematics:
    """Where the links of a robot are.

    A configuration q has a number for each coordinate of the joints, in the order of ``description.joints``: an angle
    (revolute, continuous) or a length (prismatic); two lengths and an angle (planar: along x and y, turned as z is to
    the axis; where that points below, along x and -y, turned as -z is); a quaternion ``x y z w`` of any length but 0
    (ball); a position and such a quaternion (floating). A joint that mimics another has none, and limits are not looked
    at.

    Parameters
    ----------
    description : Description
        Of a robot whose first link is its root.

    Raises
    ------
    ValueError
        A joint mimics one that has no coordinate, or itself.

    Notes
    -----
    Immutable and thread-safe. Double precision; the sum of all lengths from the root to a link times 7e-15 for each
    joint between bounds the error of a position.
    """

    def __init__(self, description: Description) -> None:
        self.description = description
        self.links = tuple(link.name for link in description.links)
        self.columns = _columns(description)
        nothing = [None] * len(self.links)
        self._robot = _core.Robot(
            self.columns, len(self.links), self.nq, list(nothing), np.zeros(len(self.links)), np.empty((0, 2))
        )

    @property
    def nq(self) -> int:
        """How many numbers a configuration has."""
        return self.description.nq

    @property
    def home(self) -> NDArray[np.float64]:
        """Where q begins, (nq,): what the description says, or zeros and no rotation."""
        if self.description.home:
            return np.array(self.description.home, dtype=np.float64)
        out = np.zeros(self.nq)
        for joint, first in coordinates_of(self.description):
            if joint.kind in ("ball", "floating"):
                out[first + joint.coordinates - 1] = 1
        return out

    def fk(self, q: ArrayLike, *, threads: int = 1) -> NDArray[np.float64]:
        """The frames of all links.

        Parameters
        ----------
        q : array of shape (N, nq) or (nq,)
            Configurations: metres, radians.
        threads : int
            How many threads share the work; 0 = all cores. The results do not depend on it.

        Returns
        -------
        float64 array of shape (L, N, 7), or (L, 7) for one configuration
            ``x y z qx qy qz qw`` in the root's frame, of the links in the order of the description. Quaternions are
            unit ones, of either sign.

        Raises
        ------
        ValueError, TypeError
            Naming the configuration: a shape that does not fit, a number that is not finite, a quaternion of 0.
        """
        frames = self._robot.fk(q, threads)
        return frames[:, 0] if np.ndim(q) == 1 else frames

    def random(self, count: int, seed: int = 0) -> NDArray[np.float64]:
        """``count`` configurations, (count, nq): uniform within the joints' limits.

        An angle without limits lies within half a turn of 0, a length within 1 m; rotations are uniform.
        """
        rng = np.random.default_rng(seed)
        out = np.empty((count, self.nq))
        for joint, first in coordinates_of(self.description):
            if joint.kind in ("ball", "floating"):
                first_turn = first + (3 if joint.kind == "floating" else 0)
                out[:, first:first_turn] = rng.uniform(-1, 1, (count, first_turn - first))
                turn = rng.normal(size=(count, 4))
                out[:, first_turn : first_turn + 4] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
            elif joint.kind == "planar":
                out[:, first : first + 3] = rng.uniform(-1, 1, (count, 3)) * (1, 1, np.pi)
            else:
                widest = 1.0 if joint.kind == "prismatic" else np.pi
                low, high = (x if np.isfinite(x) else d for x, d in ((joint.lower, -widest), (joint.upper, widest)))
                out[:, first] = rng.uniform(min(low, high), max(low, high), count)
        return out


def coordinates_of(description: Description) -> list[tuple[Joint, int]]:
    """The joints that have coordinates, and where in q these begin."""
    out, first = [], 0
    for joint in description.joints:
        if joint.coordinates:
            out.append((joint, first))
        first += joint.coordinates
    return out


def _columns(description: Description) -> tuple[Any, ...]:
    """The joints as _core.Robot takes them: kind, parent, child, coordinate, origin, axis, anchor, scale and offset."""
    index = {link.name: i for i, link in enumerate(description.links)}
    joints = {joint.name: joint for joint in description.joints}
    first = {joint.name: at for joint, at in coordinates_of(description)}
    rows = description.joints
    scales = np.array([[1.0, 0.0]] * len(rows)).reshape(-1, 2)
    coordinates = np.zeros(len(rows), np.int64)
    for i, joint in enumerate(rows):
        source, scale, offset = source_of(joint, joints)
        coordinates[i] = first.get(source.name, 0)
        scales[i] = scale, offset - joint.zero
    return (
        np.array([_KINDS.index(joint.kind) for joint in rows], np.uint8),
        np.array([index[joint.parent] for joint in rows], np.int64),
        np.array([index[joint.child] for joint in rows], np.int64),
        coordinates,
        np.array([joint.origin for joint in rows], np.float64).reshape(-1, 4, 4),
        np.array([_axis(joint) for joint in rows], np.float64).reshape(-1, 3),
        np.array([joint.anchor for joint in rows], np.float64).reshape(-1, 3),
        scales,
    )


def _axis(joint: Joint) -> tuple[float, float, float]:
    # A ball or a floating base has none; the native side takes z.
    return joint.axis if joint.kind not in ("ball", "floating", "fixed") else (0.0, 0.0, 1.0)


def source_of(joint: Joint, joints: dict[str, Joint]) -> tuple[Joint, float, float]:
    """The joint whose coordinate moves this one, and its multiplier and offset."""
    scale, offset, source = 1.0, 0.0, joint
    for _ in joints:
        if source.mimic is None:
            break
        offset += scale * source.mimic.offset
        scale *= source.mimic.multiplier
        if source.mimic.joint not in joints:
            raise ValueError(f"joint {joint.name} mimics {source.mimic.joint}, which there is none of")
        source = joints[source.mimic.joint]
    if source.mimic is not None:
        raise ValueError(f"joint {joint.name} mimics itself, by way of others")
    if source is not joint and COORDINATES[source.kind] != 1:
        raise ValueError(f"joint {joint.name} mimics {source.name}, which is {source.kind} and has no one coordinate")
    return source, scale, offset
