"""SDF 1.11, for Gazebo and Drake."""

from __future__ import annotations

import os
from typing import Union
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
from ._writing import Files, check_proved, roll_pitch_yaw, text, unique

_KINDS = {
    "fixed": "fixed",
    "revolute": "revolute",
    "continuous": "continuous",
    "prismatic": "prismatic",
    "ball": "ball",
}


def write_sdf(
    robot: BakedRobot,
    path: Union[str, os.PathLike[str]],
    *,
    floating: bool = False,
    visuals: bool = True,
    unproved: bool = False,
) -> None:
    """Write a robot and its covers as a model in SDF.

    Parameters
    ----------
    path : path-like
        Meshes go into the folder ``PATH_meshes`` beside it, as OBJ.
    floating : bool
        Let the root move freely; or else a joint fixes it to the world.
    visuals : bool
        Write what is only seen, too.
    unproved : bool
        Write it even if something of the robot is missing, or a cover is not proved.

    Raises
    ------
    Error
        ``code`` is ``"unsupported"`` for a joint that SDF cannot have, a planar or a floating one, ``"bad_mesh"``
        for a robot that is not proved, or ``"io"``.
    ValueError
        ``path`` is what the robot was read from.
    """
    check_proved(robot, unproved)
    _Sdf(rebased(robot), Files.at(path, robot.description), visuals).write(floating)


class _Sdf:
    def __init__(self, robot: BakedRobot, files: Files, visuals: bool) -> None:
        self.robot, self.files, self.visuals = robot, files, visuals
        self.root = Element("sdf", version="1.11")
        self.model = SubElement(self.root, "model", name=robot.description.name or "robot")
        # No two elements of a model may have one name, "world" is SDF's own, and :: leads into a model.
        taken = {"world"}
        links, joints = robot.description.links, robot.description.joints
        self.links = {link.name: unique(link.name.replace("::", "_"), taken) for link in links}
        self.joints = {joint.name: unique(joint.name.replace("::", "_"), taken) for joint in joints}
        self.to_world = unique("fixed_to_world", taken)

    def write(self, floating: bool) -> None:
        description = self.robot.description
        above = {joint.child: joint.name for joint in description.joints}
        root = description.links[0]
        if root.name == "world" and not (floating or root.visuals or root.name in self.robot.covers):
            self.links["world"] = "world"
        for link in description.links:
            if self.links[link.name] != "world":
                self._link(link, above.get(link.name))
        if not floating and self.links[root.name] != "world":
            fixed = SubElement(self.model, "joint", name=self.to_world, type="fixed")
            _leaf(fixed, "parent", "world")
            _leaf(fixed, "child", self.links[root.name])
        for joint in description.joints:
            self._joint(joint)
        self.files.xml(self.root, f"written by prolate {__version__}")
        self.files.write()

    def _link(self, link: Link, joint: str | None) -> None:
        element = SubElement(self.model, "link", name=self.links[link.name])
        if joint is not None:
            SubElement(element, "pose", relative_to=self.joints[joint]).text = "0 0 0 0 0 0"
        if link.inertial is not None:
            _add_inertial(element, link.inertial)
        cover = self.robot.covers.get(link.name)
        for tag, geometries in (
            ("visual", link.visuals if self.visuals else ()),
            ("collision", cover.geometries if cover else ()),
        ):
            for number, one in enumerate(geometries):
                name = f"{link.name}_{tag}_{number}"
                found = SubElement(element, tag, name=name)
                _add_pose(found, one.pose)
                self._shape(SubElement(found, "geometry"), one, name)

    def _shape(self, element: Element, geometry: Geometry, name: str) -> None:
        shape = geometry.shape
        if isinstance(shape, MeshShape):
            _leaf(SubElement(element, "mesh"), "uri", self.files.mesh(name, shape))
        elif isinstance(shape, BoxShape):
            _leaf(SubElement(element, "box"), "size", text(*shape.size))
        elif isinstance(shape, SphereShape):
            _leaf(SubElement(element, "sphere"), "radius", text(shape.radius))
        elif isinstance(shape, EllipsoidShape):
            _leaf(SubElement(element, "ellipsoid"), "radii", text(*shape.radii))
        elif isinstance(shape, (CylinderShape, CapsuleShape)):
            found = SubElement(element, "cylinder" if isinstance(shape, CylinderShape) else "capsule")
            _leaf(found, "radius", text(shape.radius))
            _leaf(found, "length", text(shape.length))
        elif isinstance(shape, PlaneShape):
            _leaf(SubElement(element, "plane"), "normal", "0 0 1")

    def _joint(self, joint: Joint) -> None:
        if joint.kind not in _KINDS:
            raise Error(f"{joint.where}: joint {joint.name}: SDF has no joints of kind {joint.kind}", "unsupported")
        element = SubElement(self.model, "joint", name=self.joints[joint.name], type=_KINDS[joint.kind])
        parent = self.links[joint.parent]
        SubElement(element, "pose", relative_to="__model__" if parent == "world" else parent).text = _pose(joint.origin)
        _leaf(element, "parent", parent)
        _leaf(element, "child", self.links[joint.child])
        if joint.kind in ("fixed", "ball"):
            return
        axis = SubElement(element, "axis")
        _leaf(axis, "xyz", text(*joint.axis))
        if joint.mimic is not None:
            mimic = SubElement(axis, "mimic", joint=self.joints[joint.mimic.joint])
            _leaf(mimic, "multiplier", text(joint.mimic.multiplier))
            _leaf(mimic, "offset", text(joint.mimic.offset))
            _leaf(mimic, "reference", "0")
        limit = SubElement(axis, "limit")
        for name, value in (
            ("lower", joint.lower),
            ("upper", joint.upper),
            ("effort", joint.effort),
            ("velocity", joint.velocity),
        ):
            if np.isfinite(value):
                _leaf(limit, name, text(value))
        dynamics = SubElement(axis, "dynamics")
        _leaf(dynamics, "damping", text(joint.damping))
        _leaf(dynamics, "friction", text(joint.friction))


def _leaf(parent: Element, tag: str, content: str) -> None:
    SubElement(parent, tag).text = content


def _pose(pose: Matrix) -> str:
    return text(*pose[:3, 3], *roll_pitch_yaw(pose[:3, :3]))


def _add_pose(parent: Element, pose: Matrix) -> None:
    _leaf(parent, "pose", _pose(pose))


def _add_inertial(parent: Element, inertial: Inertial) -> None:
    found = SubElement(parent, "inertial")
    _add_pose(found, inertial.pose)
    _leaf(found, "mass", text(inertial.mass))
    tensor = SubElement(found, "inertia")
    i = inertial.inertia
    names = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    for name, place in names.items():
        _leaf(tensor, name, text(i[place]))
