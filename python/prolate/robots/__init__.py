"""Robots: a description in, covers and checks out. docs/robots.md is the tour.

:func:`load` reads a description, :class:`Robot` covers it, :func:`touches` tells which links touch, and ``write_...``
write what simulators and planners read.
It needs ``pip install 'prolate[robots]'``.
"""

from ._baked import BakedRobot, LinkCover
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
from ._render import render
from ._robot import Robot
from ._scene import PointCloud, Scene
from ._to_coal import geometry_model
from ._to_newton import add_to_newton
from ._touch import PairTouch, Touches, mend, touches
from ._view import view_page, write_view
from ._write_mjcf import write_mjcf
from ._write_sdf import write_sdf
from ._write_spheres import write_spheres
from ._write_urdf import write_urdf

__all__ = [
    "COORDINATES",
    "BakedRobot",
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
    "LinkCover",
    "MeshShape",
    "Mimic",
    "Note",
    "Pair",
    "PairTouch",
    "PlaneShape",
    "PointCloud",
    "Robot",
    "RobotDistances",
    "Scene",
    "SphereShape",
    "Touches",
    "Where",
    "add_to_newton",
    "geometry_model",
    "load",
    "mend",
    "render",
    "touches",
    "view_page",
    "write_mjcf",
    "write_sdf",
    "write_spheres",
    "write_urdf",
    "write_view",
]
