"""Robots: a description in, covers and checks out. docs/robots.md is the tour.

:func:`load` reads a description. It needs ``pip install 'prolate[robots]'``.
"""

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

__all__ = [
    "COORDINATES",
    "BoxShape",
    "CapsuleShape",
    "CylinderShape",
    "Description",
    "EllipsoidShape",
    "Geometry",
    "Inertial",
    "Joint",
    "Link",
    "MeshShape",
    "Mimic",
    "Note",
    "PlaneShape",
    "SphereShape",
    "Where",
    "load",
]
