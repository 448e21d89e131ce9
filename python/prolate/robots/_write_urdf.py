"""URDF: for Drake with its own ellipsoids, for all others with spheres and meshes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from typing import Literal, Union
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from .. import __version__
from .._errors import Error
from ._baked import BakedRobot
from ._model import (
    BoxShape,
    CapsuleShape,
    CylinderShape,
    EllipsoidShape,
    Geometry,
    Inertial,
    Joint,
    Link,
    Matrix,
    MeshShape,
    PlaneShape,
    SphereShape,
)
from ._rebase import rebased
from ._solids import polyhedron
from ._writing import Files, check_proved, roll_pitch_yaw, text

_SIDES = 1 / np.cos(np.pi / 32)  #: PyBullet makes a cylinder a prism of 32 sides in it; one larger by this holds it
_KINDS = {"fixed", "revolute", "continuous", "prismatic", "planar", "floating"}


def write_urdf(
    robot: BakedRobot,
    path: Union[str, os.PathLike[str]],
    *,
    ellipsoids: Literal["mesh", "drake"] = "mesh",
    visuals: bool = True,
    unproved: bool = False,
) -> None:
    """Write a robot and its covers as URDF.

    Boxes, spheres and cylinders stay what they are. A capsule becomes a cylinder and two spheres, as URDF has none.

    Parameters
    ----------
    path : path-like
        Meshes go into the folder ``PATH_meshes`` beside it, as OBJ.
    ellipsoids : {"mesh", "drake"}
        URDF has no ellipsoids. Write polyhedra around them, or ``<drake:ellipsoid>``, which only Drake reads.
    visuals : bool
        Write what is only seen, too.
    unproved : bool
        Write it even if something of the robot is missing, or a cover is not proved.

    Raises
    ------
    Error
        ``code`` is ``"unsupported"`` for a joint that URDF cannot have, a ball, ``"bad_mesh"`` for a robot that is
        not proved, or ``"io"``.
    ValueError
        For an option, or if ``path`` is what the robot was read from.
    """
    if ellipsoids not in ("mesh", "drake"):
        raise ValueError(f'ellipsoids: must be "mesh" or "drake", not {ellipsoids!r}')
    check_proved(robot, unproved)
    _Urdf(rebased(robot), Files.at(path, robot.description), ellipsoids, visuals).write()


class _Urdf:
    def __init__(self, robot: BakedRobot, files: Files, ellipsoids: str, visuals: bool) -> None:
        self.robot, self.files, self.ellipsoids, self.visuals = robot, files, ellipsoids, visuals
        self.root = Element("robot", name=robot.description.name or "robot")
        if ellipsoids == "drake":
            self.root.set("xmlns:drake", "http://drake.mit.edu")

    def write(self) -> None:
        for link in self.robot.description.links:
            self._link(link)
        for joint in self.robot.description.joints:
            self._joint(joint)
        self.files.xml(self.root, f"written by prolate {__version__}")
        self.files.write()

    def _link(self, link: Link) -> None:
        element = SubElement(self.root, "link", name=link.name)
        if link.inertial is not None:
            _add_inertial(element, link.inertial)
        cover = self.robot.covers.get(link.name)
        for tag, geometries in (
            ("visual", link.visuals if self.visuals else ()),
            ("collision", cover.geometries if cover else ()),
        ):
            parts = (part for whole in geometries for part in self._parts(whole, whole in link.collisions))
            for number, one in enumerate(parts):
                found = SubElement(element, tag, name=f"{link.name}_{tag}_{number}")
                _add_origin(found, one.pose)
                self._shape(SubElement(found, "geometry"), one, f"{link.name}_{tag}_{number}")

    def _parts(self, geometry: Geometry, own: bool) -> Iterator[Geometry]:
        """What URDF can say of it; a cylinder that is a cover, not the link's ``own``, must hold in PyBullet, too."""
        shape = geometry.shape
        wider = 1.0 if own or self.ellipsoids == "drake" else float(_SIDES)
        if isinstance(shape, CylinderShape):
            yield replace(geometry, shape=replace(shape, radius=shape.radius * wider))
        elif isinstance(shape, CapsuleShape):
            yield replace(geometry, shape=CylinderShape(shape.radius * wider, shape.length))
            for end in (-shape.length / 2, shape.length / 2):
                pose = geometry.pose.copy()
                pose[:3, 3] += pose[:3, 2] * end
                yield Geometry(SphereShape(shape.radius), pose)
        elif isinstance(shape, EllipsoidShape) and self.ellipsoids == "mesh":
            yield replace(geometry, shape=MeshShape(*polyhedron(shape)))
        elif not isinstance(shape, PlaneShape):
            yield geometry

    def _shape(self, element: Element, geometry: Geometry, name: str) -> None:
        shape = geometry.shape
        if isinstance(shape, MeshShape):
            SubElement(element, "mesh", filename=self.files.mesh(name, shape))
        elif isinstance(shape, BoxShape):
            SubElement(element, "box", size=text(*shape.size))
        elif isinstance(shape, SphereShape):
            SubElement(element, "sphere", radius=text(shape.radius))
        elif isinstance(shape, CylinderShape):
            SubElement(element, "cylinder", radius=text(shape.radius), length=text(shape.length))
        elif isinstance(shape, EllipsoidShape):
            a, b, c = shape.radii
            SubElement(element, "drake:ellipsoid", a=text(a), b=text(b), c=text(c))

    def _joint(self, joint: Joint) -> None:
        if joint.kind not in _KINDS:
            raise Error(f"{joint.where}: joint {joint.name}: URDF has no joints of kind {joint.kind}", "unsupported")
        element = SubElement(self.root, "joint", name=joint.name, type=_kind(joint))
        _add_origin(element, joint.origin)
        SubElement(element, "parent", link=joint.parent)
        SubElement(element, "child", link=joint.child)
        if joint.kind in ("fixed", "floating"):
            return
        SubElement(element, "axis", xyz=text(*joint.axis))
        limit = {"effort": joint.effort, "velocity": joint.velocity}
        if _kind(joint) in ("revolute", "prismatic"):
            limit |= {"lower": joint.lower, "upper": joint.upper}
        # A limit must be whole where there is one. 1e9 is none that a robot reaches.
        SubElement(element, "limit", {name: text(np.clip(value, -1e9, 1e9)) for name, value in limit.items()})
        if joint.damping or joint.friction:
            SubElement(element, "dynamics", damping=text(joint.damping), friction=text(joint.friction))
        if joint.mimic is not None:
            mimic = joint.mimic
            SubElement(
                element, "mimic", joint=mimic.joint, multiplier=text(mimic.multiplier), offset=text(mimic.offset)
            )


def _kind(joint: Joint) -> str:
    """A hinge without limits is continuous."""
    bounded = np.isfinite([joint.lower, joint.upper]).any()
    return "continuous" if joint.kind == "revolute" and not bounded else joint.kind


def _add_origin(element: Element, pose: Matrix) -> None:
    SubElement(element, "origin", xyz=text(*pose[:3, 3]), rpy=text(*roll_pitch_yaw(pose[:3, :3])))


def _add_inertial(element: Element, inertial: Inertial) -> None:
    found = SubElement(element, "inertial")
    _add_origin(found, inertial.pose)
    SubElement(found, "mass", value=text(inertial.mass))
    i = inertial.inertia
    names = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    SubElement(found, "inertia", {name: text(i[place]) for name, place in names.items()})
