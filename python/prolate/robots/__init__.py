"""Robots: a description in, covers and checks out. docs/robots.md is the tour.

:func:`load` reads a description. It needs ``pip install 'prolate[robots]'``.
"""

from ._checks import Checks, Pair, RobotDistances
from ._kinematics import Kinematics
from ._model import (
    COORDINATES,
    BoxShape,
    CapsuleShape,
    CylinderShape,
    Description,
    EllipsoidShape,
    Geometry,
    Inertial,
    Joint,
    Link,
    MeshShape,
    Mimic,
    Note,
    PlaneShape,
    SphereShape,
    Where,
)
from ._read import load
from ._scene import PointCloud, Scene

__all__ = [
    "COORDINATES",
    "BoxShape",
    "CapsuleShape",
    "Checks",
    "CylinderShape",
    "Description",
    "EllipsoidShape",
    "Geometry",
    "Inertial",
    "Joint",
    "Kinematics",
    "Link",
    "MeshShape",
    "Mimic",
    "Note",
    "Pair",
    "PlaneShape",
    "PointCloud",
    "RobotDistances",
    "Scene",
    "SphereShape",
    "Where",
    "load",
]
