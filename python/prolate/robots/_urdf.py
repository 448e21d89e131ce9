"""Reads URDF.

Over lxml, not yourdfpy, urdfdom or MuJoCo: these refuse a whole robot for one geometry, drop what they do not know
without a word, and do not say in which line.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ._assemble import Part, Parts
from ._meshes import MeshError, Meshes
from ._model import (
    BoxShape,
    CapsuleShape,
    CylinderShape,
    EllipsoidShape,
    Geometry,
    Inertial,
    Joint,
    JointKind,
    Link,
    Matrix,
    Mimic,
    Shape,
    SphereShape,
)
from ._xml import TURN, BadElement, Notes, Reader, name_of, pose_matrix, rpy_matrix

if TYPE_CHECKING:
    from ._xml import Element

_JOINTS: dict[str, JointKind] = {
    "fixed": "fixed", "revolute": "revolute", "continuous": "continuous", "prismatic": "prismatic", "planar": "planar",
    "floating": "floating",
}  # fmt: skip
_NO_LIMIT = 1e9  # what exporters write for it, write_urdf() as well


class UrdfReader(Reader):
    """Reads one file. What is wrong with an element becomes a note, and the rest is read."""

    def __init__(self, path: Path, meshes: Meshes, notes: Notes, visuals: bool) -> None:
        super().__init__(path)
        self.meshes, self.notes, self.visuals = meshes, notes, visuals

    def robot(self, root: Element) -> Parts:
        self.name_others(root, {"link", "joint", "material"}, self.notes)
        links = [link for element in root.findall("link") if (link := self._or_note(self.link, element, "the link"))]
        joints = [
            joint for element in root.findall("joint") if (joint := self._or_note(self.joint, element, "the joint"))
        ]
        return Parts(root.get("name") or self.path.stem, links, joints)

    def _or_note(self, read: Callable[[Element], Part], element: Element, what: str) -> Part | None:
        try:
            return read(element)
        except BadElement as error:
            self.notes.bad(error, element.get("name") or "" if what == "the link" else "", what)
            return None

    # ---- links ----

    def link(self, element: Element) -> Link:
        name = self.text(element, "name")
        self.name_others(element, {"visual", "collision", "inertial"}, self.notes, name)
        return Link(
            name,
            self.geometries(element.findall("collision"), name),
            self.geometries(element.findall("visual"), name) if self.visuals else (),
            self.inertial(element, name),
            self.where(element),
        )

    def geometries(self, elements: list[Element], link: str) -> tuple[Geometry, ...]:
        out = []
        for element in elements:
            try:
                shape = self.shape(element, link)
                out.append(Geometry(shape, self.origin(element, link), element.get("name") or "", self.where(element)))
            except BadElement as error:  # a link without its picture is whole
                seen = element.tag == "visual"
                text = f"{error.text}; this {element.tag} geometry is left out"
                self.notes.add("warning" if seen else "error", text, error.where, link)
        return tuple(out)

    def shape(self, element: Element, link: str) -> Shape:
        geometry = element.find("geometry")
        if geometry is None or len(geometry) != 1:
            raise self.fail(element, "has no <geometry> with one shape in it")
        (shape,) = geometry
        kind = name_of(shape)
        if kind == "mesh":
            return self.mesh(shape, link)
        if kind == "box":
            x, y, z = self.sizes(shape, "size", 3)
            return BoxShape((x, y, z))
        if kind == "sphere":
            return SphereShape(*self.sizes(shape, "radius", 1))
        if kind == "cylinder":
            return CylinderShape(*self.sizes(shape, "radius", 1), *self.sizes(shape, "length", 1))
        if kind in ("capsule", "drake:capsule"):  # of Bullet, Newton and Drake, who mean the same length
            return CapsuleShape(*self.sizes(shape, "radius", 1), *self.sizes(shape, "length", 1))
        if kind == "drake:ellipsoid":
            a, b, c = (self.sizes(shape, axis, 1)[0] for axis in "abc")
            return EllipsoidShape((a, b, c))
        raise self.fail(shape, "is no shape of URDF; use box, sphere, cylinder, mesh, capsule or drake:ellipsoid")

    def mesh(self, element: Element, link: str) -> Shape:
        x, y, z = self.numbers(element, "scale", 3, (1, 1, 1))
        try:
            shape, said = self.meshes.shape(self.text(element, "filename"), (x, y, z))
        except MeshError as error:
            raise self.fail(element, str(error)) from None
        for text in said:
            self.notes.once(text, self.where(element), link)
        return shape

    def origin(self, element: Element, link: str = "") -> Matrix:
        origin = element.find("origin")
        if origin is None:
            return np.eye(4)
        if origin.get("quat_xyzw"):
            raise self.fail(origin, "quat_xyzw= is not read by the tools of today; write rpy=")
        rpy = self.numbers(origin, "rpy", 3, (0, 0, 0))
        if max(map(abs, rpy)) > TURN:
            text = f"rpy={origin.get('rpy')!r} has an angle of more than a turn, read as radians; were degrees meant?"
            self.notes.add("warning", text, self.where(origin), link)
        return pose_matrix(self.numbers(origin, "xyz", 3, (0, 0, 0)), rpy_matrix(rpy))

    def inertial(self, link: Element, name: str) -> Inertial | None:
        element = link.find("inertial")
        if element is None:
            return None
        try:
            mass, inertia = element.find("mass"), element.find("inertia")
            if mass is None or inertia is None:
                raise self.fail(element, "needs <mass> and <inertia>")
            xx, xy, xz, yy, yz, zz = (self.number(inertia, "i" + axes) for axes in ("xx", "xy", "xz", "yy", "yz", "zz"))
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            return Inertial(self.number(mass, "value"), tensor, self.origin(element, name))
        except BadElement as error:
            self.notes.bad(error, name, "the inertial")
            return None

    # ---- joints ----

    def joint(self, element: Element) -> Joint:
        name = self.text(element, "name")
        stated = self.text(element, "type")
        if stated not in _JOINTS:
            raise self.fail(element, f"joint {name}: type {stated!r} is none of {', '.join(_JOINTS)}")
        kind = _JOINTS[stated]
        known = {"origin", "parent", "child", "axis", "limit", "dynamics", "mimic"}
        self.name_others(element, {*known, "calibration", "safety_controller"}, self.notes)
        dynamics, mimic = element.find("dynamics"), element.find("mimic")
        lower, upper, velocity, effort = self.limits(element, kind)
        return Joint(
            name,
            kind,
            self.end(element, "parent"),
            self.end(element, "child"),
            self.origin(element),
            self.axis(element, kind),
            lower=lower,
            upper=upper,
            velocity=velocity,
            effort=effort,
            damping=0.0 if dynamics is None else self.number(dynamics, "damping", 0.0),
            friction=0.0 if dynamics is None else self.number(dynamics, "friction", 0.0),
            mimic=None if mimic is None else self.mimic(mimic),
            where=self.where(element),
        )

    def end(self, joint: Element, which: str) -> str:
        element = joint.find(which)
        if element is None:
            raise self.fail(joint, f"joint {joint.get('name')}: has no <{which}>")
        return self.text(element, "link")

    def axis(self, joint: Element, kind: JointKind) -> tuple[float, float, float]:
        element = joint.find("axis")
        if element is None or kind in ("fixed", "floating"):
            return 1.0, 0.0, 0.0
        x, y, z = self.numbers(element, "xyz", 3, (1, 0, 0))
        length = math.sqrt(x * x + y * y + z * z)
        if length == 0:
            raise self.fail(element, f"joint {joint.get('name')}: its axis has no direction")
        return x / length, y / length, z / length

    def limits(self, joint: Element, kind: JointKind) -> tuple[float, float, float, float]:
        """lower, upper, velocity, effort; what is not limited is infinite."""
        element, inf = joint.find("limit"), math.inf
        if element is None:
            if kind in ("revolute", "prismatic"):
                text = f"joint {joint.get('name')}: has no <limit>; it is taken as unlimited"
                self.notes.add("warning", text, self.where(joint))
            return -inf, inf, inf, inf
        velocity, effort = self.number(element, "velocity", inf), self.number(element, "effort", inf)
        if kind not in ("revolute", "prismatic"):
            return -inf, inf, velocity, effort
        lower, upper = self.number(element, "lower", 0.0), self.number(element, "upper", 0.0)
        if lower > upper:
            text = f"joint {joint.get('name')}: lower={lower:g} is above upper={upper:g}; it is taken as unlimited"
            self.notes.add("error", text, self.where(element))
            return -inf, inf, velocity, effort
        lower, upper = (math.copysign(inf, at) if abs(at) >= _NO_LIMIT else at for at in (lower, upper))
        if kind == "revolute" and math.isfinite(upper - lower) and max(-lower, upper) > TURN:
            text = f"{lower:g} to {upper:g} is more than a turn, read as radians; were degrees meant?"
            text = f"joint {joint.get('name')}: {text}"
            self.notes.add("warning", text, self.where(element))
        return lower, upper, velocity, effort

    def mimic(self, element: Element) -> Mimic:
        multiplier, offset = self.number(element, "multiplier", 1.0), self.number(element, "offset", 0.0)
        return Mimic(self.text(element, "joint"), multiplier, offset)
