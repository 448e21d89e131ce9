"""Shapes for Newton's model builder."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from .._errors import Error
from ._baked import BakedRobot
from ._model import BoxShape, CapsuleShape, CylinderShape, EllipsoidShape, Geometry, MeshShape, SphereShape
from ._writing import check_proved, quaternion


def add_to_newton(
    robot: BakedRobot, builder: Any, bodies: Mapping[str, int], cfg: Any = None, *, unproved: bool = False
) -> list[int]:
    """Add the covers to a ``newton.ModelBuilder``, for Newton 1.8 and later.

    Newton's contacts begin 0.1 m before shapes touch unless ``builder.rigid_gap`` is set; 0 is what covers need.

    Parameters
    ----------
    robot : BakedRobot
    builder : newton.ModelBuilder
    bodies : mapping of str to int
        The builder's bodies, by the names of links; -1 is the world.
    cfg : newton.ModelBuilder.ShapeConfig, optional
        Of all shapes. By default it is the builder's own with density 0, as links have their masses.
    unproved : bool
        Add it even if something of the robot is missing, or a cover is not proved.

    Returns
    -------
    list of int
        The shapes.

    Raises
    ------
    Error
        ``code`` is ``"unsupported"`` if a link is not among the bodies, ``"bad_mesh"`` for a robot that is not proved.
    """
    check_proved(robot, unproved)
    if cfg is None:
        cfg = builder.default_shape_cfg.copy()
        cfg.density = 0.0
    shapes = []
    for cover in robot.covers.values():
        if cover.name not in bodies:
            raise Error(f"link {cover.name}: is not among the bodies", "unsupported")
        for number, one in enumerate(cover.geometries):
            label = f"{cover.name}_{number}"
            shapes.append(_add(builder, bodies[cover.name], one, {"cfg": cfg, "label": label}))
    return shapes


def _add(builder: Any, body: int, geometry: Geometry, more: dict[str, Any]) -> int:
    warp: Any = import_module("warp")
    shape = geometry.shape
    w, x, y, z = quaternion(geometry.pose[:3, :3])
    place = warp.transform(warp.vec3(*geometry.pose[:3, 3]), warp.quat(x, y, z, w))
    found: int
    if isinstance(shape, EllipsoidShape):
        a, b, c = shape.radii
        found = builder.add_shape_ellipsoid(body, xform=place, rx=a, ry=b, rz=c, **more)
    elif isinstance(shape, SphereShape):
        found = builder.add_shape_sphere(body, xform=place, radius=shape.radius, **more)
    elif isinstance(shape, BoxShape):
        a, b, c = (edge / 2 for edge in shape.size)
        found = builder.add_shape_box(body, xform=place, hx=a, hy=b, hz=c, **more)
    elif isinstance(shape, CapsuleShape):
        found = builder.add_shape_capsule(body, xform=place, radius=shape.radius, half_height=shape.length / 2, **more)
    elif isinstance(shape, CylinderShape):
        found = builder.add_shape_cylinder(body, xform=place, radius=shape.radius, half_height=shape.length / 2, **more)
    elif isinstance(shape, MeshShape):
        mesh = import_module("newton").Mesh(shape.vertices, shape.faces.ravel(), compute_inertia=False)
        found = builder.add_shape_convex_hull(body, xform=place, mesh=mesh, **more)
    else:
        raise Error(f"{type(shape).__name__} has no counterpart in Newton", "unsupported")
    return found
