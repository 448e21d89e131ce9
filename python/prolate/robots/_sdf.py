"""Reads SDF (SDFormat 1.4 to 1.12): one model, with those nested in it.

Over lxml: PyPI has no kept binding of libsdformat (sdformat14-py-bindings had one release, for Python 3.11 alone), and
Debian packages libsdformat for C++ only.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ._assemble import Parts
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
    PlaneShape,
    Shape,
    SphereShape,
)
from ._sdf_frames import SdfFrames
from ._srdf import pair_of
from ._xml import BadElement, Notes, name_of, pose_matrix

if TYPE_CHECKING:
    from ._xml import Element

_ONE_AXIS: dict[str, JointKind] = {"revolute": "revolute", "continuous": "continuous", "prismatic": "prismatic"}
_NO_AXIS: dict[str, JointKind] = {"fixed": "fixed", "ball": "ball"}
_TWO_AXES = ("revolute2", "universal")
_NO_LIMIT = 1e16  # SDF's own number for it
_MODEL = {"pose", "link", "joint", "frame", "model", "static", "self_collide", "allow_auto_disable", "enable_wind"}
_LINK = {"pose", "inertial", "collision", "visual", "gravity", "self_collide", "kinematic", "must_be_base_link",
    "velocity_decay", "enable_wind"}  # fmt: skip
_SEEN = {"pose", "geometry", "material", "cast_shadows", "transparency", "meta", "visibility_flags", "plugin"}
_TOUCHED = {"pose", "geometry", "laser_retro", "max_contacts", "surface"}


class SdfReader(SdfFrames):
    """Reads one file. What is wrong with an element becomes a note, and the rest is read."""

    def __init__(self, path: Path, meshes: Meshes, notes: Notes, visuals: bool) -> None:
        super().__init__(path, meshes.packages, notes)
        self.meshes, self.visuals = meshes, visuals
        self.adjacent: list[tuple[str, str]] = []  # links that a joint of two axes connects

    def robot(self, root: Element) -> Parts:
        models = self._models(root)
        if not models:
            for world in root.findall("world"):
                self.follow(world)
            models = self._models(root)
        if not models:
            raise self.fail(root, "has no <model>")
        for other in models[1:]:
            text = f"model {other.get('name')}: only the first model of a file is read, {models[0].get('name')}"
            self.notes.add("warning", text, self.where(other))
        model, name = models[0], models[0].get("name") or self.path.stem
        self.follow(model)
        self._name_contents(model)
        self.declare(model)
        links = list(self._links(model, ""))
        joints = list(self._joints(model, ""))
        if any("world" in (joint.parent, joint.child) for joint in joints):
            links = [Link("world", where=self.where(model)), *links]
        return Parts(name, links, joints, dict.fromkeys(self.adjacent, "adjacent"))

    @staticmethod
    def _models(root: Element) -> list[Element]:
        return [*root.findall("model"), *(model for world in root.findall("world") for model in world.findall("model"))]

    def _name_contents(self, model: Element) -> None:
        self.name_others(model, {*_MODEL, "include"}, self.notes)
        for nested in model.findall("model"):
            self._name_contents(nested)

    # ---- links ----

    def _links(self, model: Element, scope: str) -> Iterator[Link]:
        for element in model:
            name = scope + (element.get("name") or "")
            if name_of(element) == "model":
                yield from self._links(element, f"{name}::")
            elif name_of(element) == "link":
                self.name_others(element, _LINK, self.notes, name)
                collisions = self._geometries(element, "collision", name, scope)
                visuals = self._geometries(element, "visual", name, scope) if self.visuals else ()
                yield Link(name, collisions, visuals, self._inertial(element, name, scope), self.where(element))
            elif name_of(element) == "joint" and element.get("type") in _TWO_AXES:
                yield Link(f"{name}::between", where=self.where(element))

    def _geometries(self, link: Element, kind: str, name: str, scope: str) -> tuple[Geometry, ...]:
        out = []
        for element in link.findall(kind):
            try:
                self.name_others(element, _SEEN if kind == "visual" else _TOUCHED, self.notes, name)
                shape, turn = self._shape(element, name)
                if shape is not None:
                    pose = self._in_link(element, name, scope) @ turn
                    out.append(Geometry(shape, pose, element.get("name") or "", self.where(element)))
            except BadElement as error:  # a link without its picture is whole
                text = f"{error.text}; this {kind} geometry is left out"
                self.notes.add("warning" if kind == "visual" else "error", text, error.where, name)
        return tuple(out)

    def _in_link(self, element: Element, link: str, scope: str) -> Matrix:
        """The pose of something within a link, in the link's frame."""
        pose, relative_to = self.pose(element)
        if relative_to is None:
            return pose
        return self.between(link, scope + relative_to, element) @ pose

    def _between(self, outer: str, inner: str, element: Element) -> Matrix:
        """The frame ``inner`` in the frame ``outer``."""
        return np.asarray(np.linalg.inv(self.in_world(outer, element)) @ self.in_world(inner, element))

    def _shape(self, element: Element, link: str) -> tuple[Shape | None, Matrix]:
        """The shape, and how it is turned in the geometry's frame; None if it is meant to be empty."""
        geometry = element.find("geometry")
        if geometry is None or len(geometry) != 1:
            raise self.fail(element, "has no <geometry> with one shape in it")
        (shape,) = geometry
        kind, here = name_of(shape), np.eye(4)
        if kind == "empty":
            return None, here
        if kind == "mesh":
            return self._mesh(shape, link), here
        if kind == "box":
            x, y, z = self.sizes(shape, "size", 3)
            return BoxShape((x, y, z)), here
        if kind == "sphere":
            return SphereShape(*self.sizes(shape, "radius", 1)), here
        if kind == "cylinder":
            return CylinderShape(*self.sizes(shape, "radius", 1), *self.sizes(shape, "length", 1)), here
        if kind == "capsule":
            return CapsuleShape(*self.sizes(shape, "radius", 1), *self.sizes(shape, "length", 1)), here
        if kind == "ellipsoid":
            a, b, c = self.sizes(shape, "radii", 3)
            return EllipsoidShape((a, b, c)), here
        if kind == "plane":
            normal = self.numbers(shape, "normal", 3, (0, 0, 1))
            if not np.linalg.norm(normal) > 0:
                raise self.fail(shape, "its normal has no direction")
            return PlaneShape(), pose_matrix((0, 0, 0), _turn_to(normal))
        raise self.fail(shape, "is not understood; use box, sphere, cylinder, capsule, ellipsoid or mesh")

    def _mesh(self, element: Element, link: str) -> Shape:
        if element.find("submesh") is not None:
            raise self.fail(element, "a <submesh> of a file is not understood; put it into a file of its own")
        x, y, z = self.numbers(element, "scale", 3, (1, 1, 1))
        try:
            shape, said = self.meshes.shape(self._uri(element), (x, y, z))
        except MeshError as error:
            raise self.fail(element, str(error)) from None
        for text in said:
            self.notes.once(text, self.where(element), link)
        return shape

    def _uri(self, element: Element) -> str:
        """Of a file; what is relative is so to the file that names it."""
        uri, file = self.child(element, "uri"), self.file_of(element)
        return uri if "://" in uri or file == self.path else f"file://{file.absolute().parent / uri}"

    def _inertial(self, link: Element, name: str, scope: str) -> Inertial | None:
        element = link.find("inertial")
        if element is None:
            return None
        try:
            tensor, inertia = np.eye(3), element.find("inertia")
            if inertia is not None:
                xx, yy, zz = (self.number(inertia, "i" + axes, 1.0) for axes in ("xx", "yy", "zz"))
                xy, xz, yz = (self.number(inertia, "i" + axes, 0.0) for axes in ("xy", "xz", "yz"))
                tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            return Inertial(self.number(element, "mass", 1.0), tensor, self._in_link(element, name, scope))
        except BadElement as error:
            self.notes.bad(error, name, "the inertial")
            return None

    # ---- joints ----

    def _joints(self, model: Element, scope: str) -> Iterator[Joint]:
        for element in model:
            name = scope + (element.get("name") or "")
            if name_of(element) == "model":
                yield from self._joints(element, f"{name}::")
            elif name_of(element) == "joint":
                try:
                    yield from self._joint(element, name, scope)
                except BadElement as error:
                    self.notes.bad(error, left_out="the joint")

    def _joint(self, element: Element, name: str, scope: str) -> Iterator[Joint]:
        self.text(element, "name")
        stated = self.text(element, "type")
        self.name_others(element, {"pose", "parent", "child", "axis", "axis2"}, self.notes)
        ends = [self.child(element, end) for end in ("parent", "child")]
        if not all(ends):
            raise self.fail(element, f"joint {name}: needs <parent> and <child>")
        parent, child = (self.link_of(end if end == "world" else f"{scope}{end}", element) for end in ends)
        origin, where = self.between(parent, child, element), self.where(element)
        anchor = self.between(child, name, element)  # the joint's frame in the child's
        x, y, z = (float(p) for p in anchor[:3, 3])
        if stated in _NO_AXIS:
            yield Joint(name, _NO_AXIS[stated], parent, child, origin, anchor=(x, y, z), where=where)
        elif stated in _ONE_AXIS:
            yield self._moving(element, "axis", name, _ONE_AXIS[stated], (parent, child), origin, (child, scope))
        elif stated in _TWO_AXES:
            self.notes.add("info", f"joint {name}: is {stated}; it becomes two, with a link between", where, child)
            middle = f"{name}::between"
            self.adjacent.append(pair_of(parent, child))
            yield self._moving(element, "axis", name, "revolute", (parent, middle), origin, (child, scope))
            yield self._moving(element, "axis2", f"{name}::2", "revolute", (middle, child), np.eye(4), (child, scope))
        else:
            raise self.fail(element, f"joint {name}: a joint of type {stated} is not understood")

    def _moving(
        self,
        joint: Element,
        which: str,
        name: str,
        kind: JointKind,
        ends: tuple[str, str],
        origin: Matrix,
        frame: tuple[str, str],
    ) -> Joint:
        """A joint of one axis; ``frame`` are the link whose frame it is about, and the scope of names."""
        axis = joint.find(which)
        if axis is None:
            raise self.fail(joint, f"joint {name}: has no <{which}>")
        child, scope = frame
        limit, dynamics = axis.find("limit"), axis.find("dynamics")
        lower, upper, velocity, effort = self._limits(limit, kind, name)
        anchor = self.between(child, scope + joint.get("name"), joint)[:3, 3]
        return Joint(
            name,
            "continuous" if kind == "revolute" and upper - lower == math.inf else kind,
            *ends,
            origin,
            self._axis(axis, joint, child, scope),
            (float(anchor[0]), float(anchor[1]), float(anchor[2])),
            lower=lower,
            upper=upper,
            velocity=velocity,
            effort=effort,
            damping=0.0 if dynamics is None else self.number(dynamics, "damping", 0.0),
            friction=0.0 if dynamics is None else self.number(dynamics, "friction", 0.0),
            mimic=self._mimic(axis, scope),
            where=self.where(joint),
        )

    def _limits(self, limit: Element | None, kind: JointKind, name: str) -> tuple[float, float, float, float]:
        """lower, upper, velocity, effort; what is not limited is infinite."""
        inf = math.inf
        if limit is None:
            return -inf, inf, inf, inf
        velocity, effort = self.number(limit, "velocity", -1.0), self.number(limit, "effort", -1.0)
        lower, upper = self.number(limit, "lower", -_NO_LIMIT), self.number(limit, "upper", _NO_LIMIT)
        if lower > upper:
            text = f"joint {name}: lower {lower:g} is above upper {upper:g}; it is taken as unlimited"
            self.notes.add("error", text, self.where(limit))
            lower, upper = -inf, inf
        lower = -inf if kind == "continuous" or lower <= -_NO_LIMIT else lower
        upper = inf if kind == "continuous" or upper >= _NO_LIMIT else upper
        return lower, upper, velocity if velocity >= 0 else inf, effort if effort >= 0 else inf

    def _axis(self, axis: Element, joint: Element, child: str, scope: str) -> tuple[float, float, float]:
        """The unit vector in the child's frame."""
        vector = np.array(self.numbers(axis, "xyz", 3, (0, 0, 1)))
        length = float(np.linalg.norm(vector))
        if length == 0:
            raise self.fail(axis, "has no direction")
        xyz = axis.find("xyz")
        frame = (None if xyz is None else xyz.get("expressed_in")) or joint.get("name")
        if self.version_of(joint) < (1, 5) or self.child(axis, "use_parent_model_frame") in ("1", "true"):
            frame = "__model__"
        x, y, z = self.between(child, scope + frame, axis)[:3, :3] @ vector / length
        return float(x), float(y), float(z)

    def _mimic(self, axis: Element, scope: str) -> Mimic | None:
        mimic = axis.find("mimic")
        if mimic is None:
            return None
        multiplier, offset = self.number(mimic, "multiplier", 1.0), self.number(mimic, "offset", 0.0)
        leader = scope + self.text(mimic, "joint")
        return Mimic(leader, multiplier, offset - multiplier * self.number(mimic, "reference", 0.0))


def _turn_to(normal: list[float]) -> Matrix:
    """A rotation (3, 3) that takes z to a direction."""
    z = np.array(normal) / np.linalg.norm(normal)
    x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0), z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)
