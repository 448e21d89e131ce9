"""MJCF, for MuJoCo 4."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
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
    Description,
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
from ._writing import Files, check_proved, quaternion, text, unique

_COLLISION, _VISUAL = "collision", "visual"
_MOST_IN_STL = 200_000  # triangles, for MuJoCo


def write_mjcf(
    robot: BakedRobot,
    path: Union[str, os.PathLike[str]],
    *,
    floating: bool = False,
    visuals: bool = True,
    exclude: Iterable[tuple[str, str]] = (),
    unproved: bool = False,
) -> None:
    """Write a robot and its covers for MuJoCo.

    Geoms have no mass; links have that of the description. Distances are computed to 1e-10 m or finer: MuJoCo's default
    of 1e-6 misjudges small parts. Links that the root's cover is next to are excluded from contact with it, as MuJoCo
    excludes all other neighbours by itself.

    Parameters
    ----------
    path : path-like
        Visual meshes go into the folder ``PATH_meshes`` beside it.
    floating : bool
        Let the root move freely; or else it is fixed to the world.
    visuals : bool
        Write what is only seen, too; in group 2. Covers are in group 3.
    exclude : iterable of (str, str)
        Further pairs of links that never touch, besides those of the description.
    unproved : bool
        Write it even if something of the robot is missing, or a cover is not proved.

    Raises
    ------
    Error
        ``code`` is ``"unsupported"`` for a floating joint that does not hang on the world, ``"bad_mesh"`` for a
        robot that is not proved, or ``"io"``.
    ValueError
        ``path`` is what the robot was read from.
    """
    check_proved(robot, unproved)
    _Mjcf(robot, Files.at(path, robot.description), visuals).write(floating, exclude)


class _Mjcf:
    def __init__(self, robot: BakedRobot, files: Files, visuals: bool) -> None:
        self.robot, self.files, self.visuals = robot, files, visuals
        self.description: Description = robot.description
        self.root = Element("mujoco", model=self.description.name or "robot")
        self.names: set[str] = set()
        self.bodies: dict[str, str] = {}  # those that are not called as their links
        self.assets: dict[str, str] = {}

    def write(self, floating: bool, exclude: Iterable[tuple[str, str]]) -> None:
        smallest = min(
            (_smallest(one) for cover in self.robot.covers.values() for one in cover.geometries), default=1.0
        )
        SubElement(self.root, "compiler", {"angle": "radian", "autolimits": "true", **self._bounds()})
        SubElement(self.root, "option", ccd_tolerance=text(min(1e-10, 1e-9 * smallest)), ccd_iterations="100")
        SubElement(self.root, "size", memory="64M")  # a full arena drops every contact
        defaults = SubElement(self.root, "default")
        SubElement(SubElement(defaults, "default", {"class": _COLLISION}), "geom", mass="0", group="3")
        SubElement(
            SubElement(defaults, "default", {"class": _VISUAL}),
            "geom", mass="0", group="2", contype="0", conaffinity="0",
        )  # fmt: skip
        self.asset = SubElement(self.root, "asset")
        world = SubElement(self.root, "worldbody")
        bodies: dict[str, Element] = {}
        if floating or self.description.links[0].name != "world":  # MuJoCo has a body of this name
            self.bodies["world"] = unique("world", {"world", *(link.name for link in self.description.links)})
        joints = {joint.child: joint for joint in self.description.joints}
        for link in self._parents_first():
            joint = joints.get(link.name)
            if joint is None and link.name == "world" and not floating:
                bodies[link.name] = world
                self._fill(world, replace(link, inertial=None))
                continue
            if joint and joint.kind == "floating" and bodies[joint.parent] is not world:
                why = "MuJoCo lets only bodies of the world move freely"
                raise Error(f"{joint.where}: joint {joint.name}: {why}", "unsupported")
            name = self.bodies.get(link.name, link.name)
            body = SubElement(bodies[joint.parent] if joint else world, "body", name=name)
            bodies[link.name] = body
            if joint is not None:
                body.attrib.update(_frame(joint.origin))
                _add_joint(body, joint)
            elif floating:
                SubElement(body, "freejoint", name=unique("root", {one.name for one in self.description.joints}))
            self._fill(body, link)
        self._contact(floating, exclude)
        self._equality()
        self.files.xml(self.root, f"written by prolate {__version__}")
        self.files.write()

    def _parents_first(self) -> list[Link]:
        by_name = {link.name: link for link in self.description.links}
        children = [by_name[joint.child] for joint in self.description.joints]
        moved = {link.name for link in children}
        return [link for link in self.description.links if link.name not in moved] + children

    def _bounds(self) -> dict[str, str]:
        """MuJoCo refuses links that move and have no mass."""
        if all(_is_whole(link.inertial) for link in self.description.links):
            return {}
        return {"boundmass": "1e-6", "boundinertia": "1e-9"}

    def _fill(self, body: Element, link: Link) -> None:
        if link.inertial is not None and link.inertial.mass > 0:
            turn = link.inertial.pose[:3, :3]
            i = turn @ _possible(link.inertial.inertia) @ turn.T  # along the link's axes: MuJoCo takes no others
            SubElement(
                body, "inertial", mass=text(link.inertial.mass), pos=text(*link.inertial.pose[:3, 3]),
                fullinertia=text(i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]),
            )  # fmt: skip
        if link.name in self.robot.covers:
            for one in self.robot.covers[link.name].geometries:
                self._geom(body, one, _COLLISION, unique(f"{link.name}_cover", self.names))
        for one in link.visuals if self.visuals else ():
            self._geom(body, one, _VISUAL, unique(one.name or f"{link.name}_visual", self.names))

    def _geom(self, body: Element, geometry: Geometry, kind: str, name: str) -> None:
        shape = geometry.shape
        geom = SubElement(body, "geom", {"class": kind}, name=name, **_frame(geometry.pose))
        if isinstance(shape, MeshShape):
            geom.attrib.update(type="mesh", mesh=self._mesh(shape, kind, name))
        else:
            geom.attrib.update(_primitive(shape))

    def _mesh(self, shape: MeshShape, kind: str, name: str) -> str:
        """The name of an asset. Only a mesh of which MuJoCo needs no volume may be flat or thin, hence the shell."""
        if kind == _COLLISION:
            vertices = text(*shape.vertices.ravel())
            SubElement(self.asset, "mesh", name=name, vertex=vertices, inertia="shell")
            return name
        file = self.files.mesh(name, shape, kind="stl" if 4 <= len(shape.faces) <= _MOST_IN_STL else "obj")
        if file not in self.assets:
            self.assets[file] = name
            SubElement(self.asset, "mesh", name=name, file=file, inertia="shell")
        return self.assets[file]

    def _contact(self, floating: bool, exclude: Iterable[tuple[str, str]]) -> None:
        pairs = {tuple(sorted(pair)) for pair in (*self.description.disabled, *exclude)}
        if not floating:
            pairs |= self._next_to_root()
        contact = SubElement(self.root, "contact")
        for one, other in sorted(pair for pair in pairs if set(pair) <= set(self.robot.covers)):
            SubElement(contact, "exclude", body1=self.bodies.get(one, one), body2=self.bodies.get(other, other))

    def _next_to_root(self) -> set[tuple[str, ...]]:
        """MuJoCo takes links that fixed joints hold together as one, and ignores contacts of each with the one before
        it, unless that is fixed to the world."""
        group = {link.name: link.name for link in self.description.links}
        before: dict[str, str] = {}
        for joint in self.description.joints:
            if joint.kind == "fixed":
                group[joint.child] = group[joint.parent]
            elif joint.kind != "floating":
                before[joint.child] = group[joint.parent]
        first = self.description.links[0].name
        base = [link for link in group if group[link] == first]
        near = [link for link in group if before.get(group[link]) == first]
        return {tuple(sorted((one, other))) for one in base for other in near}

    def _equality(self) -> None:
        equality = SubElement(self.root, "equality")
        zeros = {joint.name: joint.zero for joint in self.description.joints}
        for joint in self.description.joints:
            if joint.mimic is not None:
                # q1 - zero1 = offset' + multiplier (q2 - zero2), where MuJoCo's offset is that of the zeros.
                factor = joint.mimic.multiplier
                offset = joint.mimic.offset + factor * zeros[joint.mimic.joint] - joint.zero
                SubElement(
                    equality, "joint", joint1=joint.name, joint2=joint.mimic.joint,
                    polycoef=text(offset, factor, 0, 0, 0),
                )  # fmt: skip


def _is_whole(inertial: Inertial | None) -> bool:
    return inertial is not None and inertial.mass > 0 and bool((np.linalg.eigvalsh(inertial.inertia) > 0).all())


def _possible(inertia: Matrix) -> Matrix:
    """The tensor, or one near it that a body can have: MuJoCo refuses all others. What is read warns of them."""
    moments, axes = np.linalg.eigh(inertia)
    if moments[0] > 0 and moments[2] <= moments[0] + moments[1]:
        return inertia
    moments = np.maximum(moments, max(1e-6 * moments[2], 1e-9))
    lacking = moments[2] - moments[0] - moments[1]
    if lacking > -1e-6 * moments[2]:
        moments[:2] += (lacking + 1e-6 * moments[2]) / 2
    return np.asarray(axes @ np.diag(moments) @ axes.T)


def _frame(pose: Matrix) -> dict[str, str]:
    """Quaternions are w x y z here."""
    frame = {}
    if pose[:3, 3].any():
        frame["pos"] = text(*pose[:3, 3])
    if (pose[:3, :3] != np.eye(3)).any():
        frame["quat"] = text(*quaternion(pose[:3, :3]))
    return frame


def _primitive(shape: object) -> dict[str, str]:
    """Sizes are half of ours."""
    if isinstance(shape, EllipsoidShape):
        return {"type": "ellipsoid", "size": text(*shape.radii)}
    if isinstance(shape, SphereShape):
        return {"type": "sphere", "size": text(shape.radius)}
    if isinstance(shape, BoxShape):
        return {"type": "box", "size": text(*(edge / 2 for edge in shape.size))}
    if isinstance(shape, CapsuleShape):
        return {"type": "capsule", "size": text(shape.radius, shape.length / 2)}
    if isinstance(shape, CylinderShape):
        return {"type": "cylinder", "size": text(shape.radius, shape.length / 2)}
    if isinstance(shape, PlaneShape):
        return {"type": "plane", "size": "0 0 1"}
    raise TypeError(f"{type(shape).__name__} is nothing that MJCF knows")


def _smallest(geometry: Geometry) -> float:
    """A length of it that matters, metres."""
    shape = geometry.shape
    if isinstance(shape, EllipsoidShape):
        return min(shape.radii)
    if isinstance(shape, MeshShape):
        return float(np.ptp(shape.vertices, axis=0).min())
    return min(shape.size) if isinstance(shape, BoxShape) else getattr(shape, "radius", 1.0)


_KINDS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "ball": "ball"}


def _add_joint(body: Element, joint: Joint) -> None:
    if joint.kind == "fixed":
        return
    if joint.kind == "floating":
        SubElement(body, "freejoint", name=joint.name)
        return
    if joint.kind == "planar":  # two lengths across the axis, and an angle about it
        x, y = _across(np.asarray(joint.axis))
        SubElement(body, "joint", name=f"{joint.name}_x", type="slide", axis=text(*x))
        SubElement(body, "joint", name=f"{joint.name}_y", type="slide", axis=text(*y))
        SubElement(body, "joint", name=joint.name, type="hinge", axis=text(*joint.axis))
        return
    found = SubElement(body, "joint", name=joint.name, type=_KINDS[joint.kind])
    if joint.kind != "ball":
        found.set("axis", text(*joint.axis))
        if joint.zero:
            found.set("ref", text(joint.zero))
        if np.isfinite([joint.lower, joint.upper]).any() and joint.kind != "continuous":
            found.set("range", text(*_range(joint)))
        if np.isfinite(joint.effort) and joint.effort > 0:
            found.set("actuatorfrcrange", text(-joint.effort, joint.effort))
    if any(joint.anchor):
        found.set("pos", text(*joint.anchor))
    if joint.damping:
        found.set("damping", text(joint.damping))
    if joint.friction:
        found.set("frictionloss", text(joint.friction))


def _across(axis: Matrix) -> tuple[Matrix, Matrix]:
    """Two unit vectors that make a right-handed frame with the axis: those of python/src/robot_chain.cpp, so that q
    means the same."""
    x, y, z = axis
    s = -1.0 if z < 0 else 1.0
    b = -1 / (s + z)
    return np.array([1 + s * x * x * b, s * x * y * b, -s * x]), np.array([x * y * b, s + y * y * b, -y])


def _range(joint: Joint) -> tuple[float, float]:
    """MuJoCo wants two numbers, the second above the first. 1e9 is no limit that a robot reaches."""
    lower, upper = (float(np.clip(limit, -1e9, 1e9)) for limit in (joint.lower, joint.upper))
    if upper > lower:
        return lower, upper
    return lower - 1e-9 * max(1.0, abs(lower)), upper + 1e-9 * max(1.0, abs(upper))
