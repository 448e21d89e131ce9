"""What a robot description says, whichever format it came in: links, joints, and geometries with their frames.

All lengths are metres, angles radians, masses kilograms. Poses are 4x4 matrices of float64: a pose of a frame in its
parent maps points of the frame to points of the parent. Everything here is plain data and immutable; a reader makes it,
and covers, writers and checks only read it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Union

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Where:
    """A place in a description, for messages: ``panda.urdf:17``. ``line`` is 0 where the parser does not tell."""

    path: Path
    line: int = 0

    def __str__(self) -> str:
        return f"{self.path}:{self.line}" if self.line else str(self.path)


@dataclass(frozen=True)
class Note:
    """Something that the reader, the bake or a writer wants to be known.

    ``kind`` is ``"error"`` (a link is missing something; the others go on), ``"warning"`` (read, but surely not meant
    so) or ``"info"`` (what was done, where other loaders do otherwise).
    """

    kind: Literal["error", "warning", "info"]
    text: str
    where: Where
    link: str = ""

    def __str__(self) -> str:
        return f"{self.kind}: {self.where}: " + (f"link {self.link}: " if self.link else "") + self.text


@dataclass(frozen=True, eq=False)
class MeshShape:
    """Triangles, placed and sized as the target does it: scale and unit are in ``vertices``, mirrored faces are turned.

    ``vertices`` is (n, 3) float64 in the geometry's frame, ``faces`` (m, 3) int64, counter-clockwise from outside.
    ``path`` and ``scale`` say where they came from, ``unit`` what a unit of the file is in metres (before ``scale``).
    """

    vertices: Matrix = field(repr=False)
    faces: NDArray[np.int64] = field(repr=False)
    path: Path | None = None
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    unit: float = 1.0


@dataclass(frozen=True)
class BoxShape:
    """Of these full edge lengths, centred."""

    size: tuple[float, float, float]


@dataclass(frozen=True)
class SphereShape:
    """A ball around the origin."""

    radius: float


@dataclass(frozen=True)
class CylinderShape:
    """Around the z axis, centred; ``length`` from end to end."""

    radius: float
    length: float


@dataclass(frozen=True)
class CapsuleShape:
    """Around the z axis, centred; ``length`` from one ball's centre to the other's."""

    radius: float
    length: float


@dataclass(frozen=True)
class EllipsoidShape:
    """Of these semi-axes along x, y and z."""

    radii: tuple[float, float, float]


@dataclass(frozen=True)
class PlaneShape:
    """What lies below z = 0. It is ground: it belongs to no moving link and gets no cover."""


Shape = Union[MeshShape, BoxShape, SphereShape, CylinderShape, CapsuleShape, EllipsoidShape, PlaneShape]


@dataclass(frozen=True, eq=False)
class Geometry:
    """One shape of a link. ``pose`` is its frame in the link's."""

    shape: Shape
    pose: Matrix = field(default_factory=lambda: np.eye(4))
    name: str = ""
    where: Where = Where(Path())


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass, and the inertia tensor (3, 3) about the centre of mass, which is the origin of ``pose``, in its axes."""

    mass: float
    inertia: Matrix
    pose: Matrix = field(default_factory=lambda: np.eye(4))


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid body. ``collisions`` are what counts for contact, ``visuals`` what is seen."""

    name: str
    collisions: tuple[Geometry, ...] = ()
    visuals: tuple[Geometry, ...] = ()
    inertial: Inertial | None = None
    where: Where = Where(Path())


JointKind = Literal["fixed", "revolute", "continuous", "prismatic", "planar", "ball", "floating"]

#: Coordinates that a joint of each kind takes of q. ``ball``: a quaternion x y z w; ``floating``: a position and a
#: quaternion x y z w; ``planar``: two lengths in the plane across the axis and an angle about it.
COORDINATES: Mapping[str, int] = {
    "fixed": 0, "revolute": 1, "continuous": 1, "prismatic": 1, "planar": 3, "ball": 4, "floating": 7,
}  # fmt: skip


@dataclass(frozen=True)
class Mimic:
    """The joint moves by ``multiplier`` times the coordinate of another joint, plus ``offset``."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Joint:
    """How a link hangs on its parent.

    The child's frame in the parent's is ``origin @ translate(anchor) @ motion(q - zero) @ translate(-anchor)``, where
    the motion is along or about ``axis``, a unit vector in the frame of ``origin``. URDF and SDF have ``anchor`` and
    ``zero`` 0; MJCF's ``pos`` and ``ref`` of a joint are these. A body of MJCF with several joints becomes several
    links, of which only the last has geometries. A mimic joint has no coordinate of its own.
    """

    name: str
    kind: JointKind
    parent: str
    child: str
    origin: Matrix = field(default_factory=lambda: np.eye(4))
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    anchor: tuple[float, float, float] = (0.0, 0.0, 0.0)
    zero: float = 0.0
    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    effort: float = np.inf
    damping: float = 0.0
    friction: float = 0.0
    mimic: Mimic | None = None
    where: Where = Where(Path())

    @property
    def coordinates(self) -> int:
        """How many numbers of q are this joint's."""
        return 0 if self.mimic else COORDINATES[self.kind]


Format = Literal["urdf", "mjcf", "sdf"]


@dataclass(frozen=True, eq=False)
class Description:
    """A robot as it was described.

    ``links`` and ``joints`` are in the order of the file but for this: a joint's parent link comes before its child, so
    that one pass from the front computes all frames. The first link is the root. ``disabled`` are pairs of links, as
    sorted tuples of names, that an SRDF or an ``<exclude>`` calls never in contact, with the reason given. ``home`` is
    the configuration (nq,) in which the robot begins: what MJCF says, else zeros as far as the limits allow.
    """

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    source: Path
    format: Format
    disabled: Mapping[tuple[str, str], str] = field(default_factory=dict)
    notes: Sequence[Note] = ()
    home: tuple[float, ...] = ()

    @property
    def nq(self) -> int:
        """The length of a configuration q: the coordinates of all joints, in the order of ``joints``."""
        return sum(joint.coordinates for joint in self.joints)
