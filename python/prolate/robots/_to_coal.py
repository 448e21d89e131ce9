"""Pinocchio's geometry model, with Coal's shapes."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from .._errors import Error
from ._baked import BakedRobot
from ._model import (
    BoxShape,
    CapsuleShape,
    CylinderShape,
    EllipsoidShape,
    MeshShape,
    Shape,
    SphereShape,
)
from ._writing import check_proved


def geometry_model(robot: BakedRobot, model: Any, *, unproved: bool = False) -> Any:
    """The covers as a ``pinocchio.GeometryModel``, for Pinocchio 3 and later. It has no collision pairs yet.

    Parameters
    ----------
    robot : BakedRobot
    model : pinocchio.Model
        Of the same robot, as ``pinocchio.buildModelFromUrdf`` makes it: its frames have the names of the links.
    unproved : bool
        Take it even if something of the robot is missing, or a cover is not proved.

    Raises
    ------
    Error
        ``code`` is ``"unsupported"`` if Pinocchio is not installed or a link is none of the model's frames,
        ``"bad_mesh"`` for a robot that is not proved.
    """
    check_proved(robot, unproved)
    try:
        pinocchio: Any = import_module("pinocchio")
    except ImportError as error:
        raise Error(f"Pinocchio is not installed ({error}); pip install pin", "unsupported") from None
    geometries = pinocchio.GeometryModel()
    for cover in robot.covers.values():
        if not model.existFrame(cover.name):
            raise Error(f"link {cover.name}: the model has no frame of this name", "unsupported")
        frame = model.getFrameId(cover.name)
        joint, place = model.frames[frame].parentJoint, model.frames[frame].placement
        for number, one in enumerate(cover.geometries):
            placement = place * pinocchio.SE3(one.pose)
            name = f"{cover.name}_{number}"
            geometries.addGeometryObject(
                pinocchio.GeometryObject(name, joint, frame, placement, coal_shape(one.shape, cover.kind == "exact"))
            )
    return geometries


def coal_shape(shape: Shape, exact: bool = False) -> Any:
    """A shape of Coal's; a mesh becomes its convex hull, or triangles if ``exact``."""
    coal: Any = import_module("coal")
    if isinstance(shape, EllipsoidShape):
        return coal.Ellipsoid(*shape.radii)
    if isinstance(shape, SphereShape):
        return coal.Sphere(shape.radius)
    if isinstance(shape, BoxShape):
        return coal.Box(*shape.size)
    if isinstance(shape, CapsuleShape):
        return coal.Capsule(shape.radius, shape.length)
    if isinstance(shape, CylinderShape):
        return coal.Cylinder(shape.radius, shape.length)
    if isinstance(shape, MeshShape):
        return _mesh(coal, shape, exact)
    raise Error(f"{type(shape).__name__} has no counterpart in Coal", "unsupported")


def _mesh(coal: Any, shape: MeshShape, exact: bool) -> Any:
    found = coal.BVHModelOBBRSS()
    found.beginModel(len(shape.faces), len(shape.vertices))
    found.addVertices(np.ascontiguousarray(shape.vertices))
    found.addTriangles(np.ascontiguousarray(shape.faces))
    found.endModel()
    if exact:
        return found
    found.buildConvexHull(True, "Qt")
    return found.convex
