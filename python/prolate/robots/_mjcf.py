"""Reads MJCF with MuJoCo itself, so that classes, frames, angles and sizes mean what they mean there."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._errors import Error
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
    MeshShape,
    Mimic,
    PlaneShape,
    Shape,
    SphereShape,
    Where,
)
from ._srdf import pair_of
from ._writing import unique
from ._xml import Notes, library, pose_matrix, quaternion_matrix

if TYPE_CHECKING:
    Spec = Any  # mujoco.MjSpec
    Model = Any  # mujoco.MjModel

_NUMBERS = (
    "body_pos", "body_quat", "body_mass", "body_ipos", "body_iquat", "body_inertia", "jnt_pos", "jnt_axis", "jnt_range",
    "qpos0", "geom_pos", "geom_quat", "geom_size", "mesh_vert", "mesh_pos", "mesh_quat", "eq_data",
)  # fmt: skip
_SHOWN = 3  # MuJoCo shows geoms of the groups below this one
_NO_MASS = 1e-12  # what a body without any gets here, so that MuJoCo compiles the others; its own least is 1e-15


def read_mjcf(path: Path, meshes: Meshes, notes: Notes, visuals: bool) -> Parts:
    mujoco = library("mujoco", "reading MJCF")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        reader = MjcfReader(path, spec, meshes, notes, visuals)
        reader.prepare()
        reader.model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise Error(f"{path}: MuJoCo: {' '.join(str(error).split())}", "bad_file") from None
    for name in _NUMBERS:  # MuJoCo takes "nan" for a number
        if not np.isfinite(getattr(reader.model, name)).all():
            raise Error(f"{path}: MuJoCo reads a number that is not finite, in {name}; correct the file", "bad_file")
    return reader.robot()


class MjcfReader:
    """Reads one file, as MuJoCo compiles it."""

    model: Model

    def __init__(self, path: Path, spec: Spec, meshes: Meshes, notes: Notes, visuals: bool) -> None:
        self.mujoco = library("mujoco", "reading MJCF")
        self.path, self.spec, self.meshes, self.notes, self.visuals = path, spec, meshes, notes, visuals
        self.files: dict[str, MeshShape] = {}  # by the asset's name

    def where(self, element: Any) -> Where:
        """MuJoCo knows the line, but not in which of the files that include each other."""
        line = re.search(r"line (\d+)", element.info)
        return Where(self.path, int(line[1]) if line else 0)

    # ---- before MuJoCo compiles ----

    def prepare(self) -> None:
        """Takes out what MuJoCo would refuse the whole robot for, and what has nothing to do with shapes."""
        spec = self.spec
        spec.compiler.discardvisual = False
        spec.compiler.fusestatic = False  # every body stays a link
        spec.compiler.boundmass = spec.compiler.boundmass or _NO_MASS
        spec.compiler.boundinertia = spec.compiler.boundinertia or _NO_MASS
        for texture in spec.textures:
            texture.file, texture.cubefiles = "", [""] * len(texture.cubefiles)
            texture.builtin, texture.width, texture.height = self.mujoco.mjtBuiltin.mjBUILTIN_FLAT, 1, 1
        for mesh in list(spec.meshes):
            try:
                self._file_of(mesh)
            except MeshError as error:
                self._take_out(mesh, str(error))
        for kind in ("flexes", "skins"):
            for soft in getattr(spec, kind):
                self.notes.add("warning", f"{kind[:-2]} {soft.name} is soft, and left out", self.where(soft))

    def _file_of(self, mesh: Any) -> None:
        """The asset as this package reads its file. MuJoCo's own .msh, and what has no file, MuJoCo reads."""
        suffix = Path(mesh.file).suffix.lower()
        if not mesh.file or suffix == ".msh":
            return
        name = Path(mesh.file).name if self.spec.strippath else mesh.file
        x, y, z = (float(by) for by in mesh.scale)
        if 0 in (x, y, z):
            raise MeshError(f"{mesh.file}: a scale of {x:g} {y:g} {z:g} leaves no volume; none may be 0")
        shape, said = self.meshes.shape(str(Path(self.spec.meshdir) / name), (1, 1, 1))
        vertices = (shape.vertices - mesh.refpos) @ quaternion_matrix(*mesh.refquat) * (x, y, z)  # in MuJoCo's order
        faces = shape.faces[:, ::-1] if x * y * z < 0 else shape.faces
        self.files[mesh.name or Path(mesh.file).stem] = MeshShape(vertices, faces, shape.path, (x, y, z))
        for text in said:
            self.notes.once(text, self.where(mesh))

    def _take_out(self, mesh: Any, why: str) -> None:
        name = mesh.name or Path(mesh.file).stem
        for geom in list(self.spec.geoms):
            if geom.meshname == name:
                text = f"{why}; this geometry is left out"
                seen = not geom.contype and not geom.conaffinity
                self.notes.add("warning" if seen else "error", text, self.where(geom), geom.parent.name)
                self.spec.delete(geom)
        self.spec.delete(mesh)

    # ---- what it compiled ----

    def robot(self) -> Parts:
        model = self.model
        self.infos = sorted(self.spec.bodies, key=lambda body: body.id)
        taken = {body.name for body in self.infos if body.name}
        self.bodies = [body.name or unique(f"body{body.id}", taken) for body in self.infos]
        self.paired = {int(geom) for pair in (model.pair_geom1, model.pair_geom2) for geom in pair}
        self.geoms: dict[int, Any] = {geom.id: geom for geom in self.spec.geoms}
        followers = dict(self._mimics())
        links, joints = [], []
        for body in range(model.nbody):
            more, link = list(self._joints(body, followers)), self._link(body)
            links += [Link(joint.child, where=joint.where) for joint in more[:-1]] + [link]
            joints += more
        return Parts(self.spec.modelname, links, joints, self._disabled(), self._home())

    def _link(self, body: int) -> Link:
        model, name = self.model, self.bodies[body]
        collisions, visuals = [], []
        for index in range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body]):
            collides = model.geom_contype[index] or model.geom_conaffinity[index] or index in self.paired
            seen = self.visuals and (not collides or model.geom_group[index] < _SHOWN)
            geometry = self._geometry(index, name) if collides or seen else None
            if geometry and collides:
                collisions.append(geometry)
            if geometry and seen:
                visuals.append(geometry)
        return Link(name, tuple(collisions), tuple(visuals), self._inertial(body), self.where(self.infos[body]))

    def _inertial(self, body: int) -> Inertial | None:
        model, mass, moments = self.model, float(self.model.body_mass[body]), self.model.body_inertia[body]
        if body == 0:
            return None
        if mass <= _NO_MASS or min(moments) <= _NO_MASS:
            if model.body_jntnum[body] == 0 or self._carries(body):
                return None
            mass, moments = 0.0, np.zeros(3)  # moves, so MuJoCo would refuse it
        pose = pose_matrix(model.body_ipos[body], quaternion_matrix(*model.body_iquat[body]))
        return Inertial(mass, np.diag(moments), pose)

    def _carries(self, body: int) -> bool:
        """Does a body that is fixed to this one have a mass?"""
        model = self.model
        fixed = (i for i in range(1, model.nbody) if model.body_parentid[i] == body and model.body_jntnum[i] == 0)
        return any(model.body_mass[other] > _NO_MASS or self._carries(other) for other in fixed)

    # ---- geoms ----

    def _geometry(self, index: int, link: str) -> Geometry | None:
        model, types, geom = self.model, self.mujoco.mjtGeom, self.geoms[index]
        kind, (a, b, c) = model.geom_type[index], (float(size) for size in model.geom_size[index])
        pose = pose_matrix(model.geom_pos[index], quaternion_matrix(*model.geom_quat[index]))
        shape: Shape
        if kind == types.mjGEOM_MESH:
            shape, pose = self._mesh(model.geom_dataid[index], pose, geom, link)
        elif kind == types.mjGEOM_PLANE:
            shape = PlaneShape()
        elif kind == types.mjGEOM_SPHERE:
            shape = SphereShape(a)
        elif kind == types.mjGEOM_CAPSULE:
            shape = CapsuleShape(a, 2 * b)
        elif kind == types.mjGEOM_CYLINDER:
            shape = CylinderShape(a, 2 * b)
        elif kind == types.mjGEOM_ELLIPSOID:
            shape = EllipsoidShape((a, b, c))
        elif kind == types.mjGEOM_BOX:
            shape = BoxShape((2 * a, 2 * b, 2 * c))
        else:
            text = f"a geom of type {types(int(kind)).name[len('mjGEOM_') :].lower()} is not understood, and left out"
            self.notes.add("error", text, self.where(geom), link)
            return None
        if geom.meshname and kind != types.mjGEOM_MESH:
            text = f"MuJoCo fits this geom to the mesh {geom.meshname} by its inertia; parts of the mesh stick out"
            self.notes.add("warning", text, self.where(geom), link)
        return Geometry(shape, pose, geom.name, self.where(geom))

    def _mesh(self, index: int, pose: Matrix, geom: Any, link: str) -> tuple[MeshShape, Matrix]:
        """The mesh and its frame in the file's coordinates; MuJoCo moves both to the mesh's principal axes."""
        model = self.model
        first, count = model.mesh_vertadr[index], model.mesh_vertnum[index]
        moved = pose_matrix(model.mesh_pos[index], quaternion_matrix(*model.mesh_quat[index]))
        vertices = model.mesh_vert[first : first + count].astype(np.float64) @ moved[:3, :3].T + moved[:3, 3]
        first, count = model.mesh_faceadr[index], model.mesh_facenum[index]
        shape = MeshShape(vertices, model.mesh_face[first : first + count].astype(np.int64))
        if geom.meshname in self.files:
            shape = self.files[geom.meshname]
            gap = max(np.abs(get(vertices) - get(shape.vertices)).max() for get in (_low, _high))
            if gap > 1e-5 * np.linalg.norm(_high(vertices) - _low(vertices)):
                text = f"MuJoCo reads {geom.meshname} otherwise: its box differs by {gap:.3g} m; the file's counts here"
                self.notes.add("warning", text, self.where(geom), link)
        return shape, pose @ np.linalg.inv(moved)

    # ---- joints ----

    def _joints(self, body: int, followers: dict[int, Mimic]) -> Iterator[Joint]:
        """From the parent to the body, with a link in between for each joint but the last."""
        if body == 0:
            return
        model, name, where = self.model, self.bodies[body], self.where(self.infos[body])
        parent = self.bodies[model.body_parentid[body]]
        origin = pose_matrix(model.body_pos[body], quaternion_matrix(*model.body_quat[body]))
        first, count = model.body_jntadr[body], model.body_jntnum[body]
        if model.body_mocapid[body] >= 0:
            self.notes.add("warning", "is a mocap body; it stays where the file puts it", where, name)
        if count == 0:
            yield Joint(f"{name}_fixed", "fixed", parent, name, origin, where=where)
        for step, index in enumerate(range(first, first + count)):
            child = name if step == count - 1 else f"{name}_after_{self._joint_name(index)}"
            yield self._joint(index, parent, child, origin, followers)
            parent, origin = child, np.eye(4)

    def _joint_name(self, index: int) -> str:
        return str(self.model.joint(index).name) or f"{self.bodies[self.model.jnt_bodyid[index]]}_joint{index}"

    def _joint(self, index: int, parent: str, child: str, origin: Matrix, followers: dict[int, Mimic]) -> Joint:
        model, types = self.model, self.mujoco.mjtJoint
        limited = bool(model.jnt_limited[index])
        kinds: dict[int, JointKind] = {
            types.mjJNT_FREE: "floating",
            types.mjJNT_BALL: "ball",
            types.mjJNT_SLIDE: "prismatic",
            types.mjJNT_HINGE: "revolute" if limited else "continuous",
        }
        kind = kinds[int(model.jnt_type[index])]
        turns_or_slides = kind in ("revolute", "continuous", "prismatic")
        lower, upper = model.jnt_range[index] if limited and turns_or_slides else (-math.inf, math.inf)
        force = model.jnt_actfrcrange[index][1] if model.jnt_actfrclimited[index] else math.inf
        dof = model.jnt_dofadr[index]
        spec = next(joint for joint in self.spec.joints if joint.id == index)
        return Joint(
            self._joint_name(index),
            kind,
            parent,
            child,
            np.eye(4) if kind == "floating" else origin,  # its coordinates are the pose in the world
            tuple(float(x) for x in model.jnt_axis[index]) if turns_or_slides else (0.0, 0.0, 1.0),  # type: ignore[arg-type]
            tuple(float(x) for x in model.jnt_pos[index]) if kind != "floating" else (0.0, 0.0, 0.0),  # type: ignore[arg-type]
            float(model.qpos0[model.jnt_qposadr[index]]) if turns_or_slides else 0.0,
            lower=float(lower),
            upper=float(upper),
            effort=float(force),
            damping=float(np.ravel(model.dof_damping[dof])[0]),
            friction=float(model.dof_frictionloss[dof]),
            mimic=followers.get(index),
            where=self.where(spec),
        )

    def _mimics(self) -> Iterator[tuple[int, Mimic]]:
        """Joints that an <equality> makes follow another one, linearly."""
        model = self.model
        for index in range(model.neq):
            if model.eq_type[index] != self.mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[index]:
                continue
            follower, leader = int(model.eq_obj1id[index]), int(model.eq_obj2id[index])
            constant, slope, *curved = model.eq_data[index][:5]
            if leader < 0 or any(curved):
                text = f"the <equality> of joint {self._joint_name(follower)} is not linear in another; it is left out"
                self.notes.add("warning", text, Where(self.path))
                continue
            start, start_of_leader = (model.qpos0[model.jnt_qposadr[joint]] for joint in (follower, leader))
            offset = start + constant - slope * start_of_leader
            yield follower, Mimic(self._joint_name(leader), float(slope), float(offset))

    def _home(self) -> dict[str, tuple[float, ...]]:
        """qpos0, joint by joint, with quaternions x y z w."""
        out, model = {}, self.model
        counts = {self.mujoco.mjtJoint.mjJNT_FREE: 7, self.mujoco.mjtJoint.mjJNT_BALL: 4}
        for index in range(model.njnt):
            count = counts.get(int(model.jnt_type[index]), 1)
            values = [float(x) for x in model.qpos0[model.jnt_qposadr[index] :][:count]]
            if count >= 4:
                values = [*values[:-4], *values[-3:], values[-4]]
            out[self._joint_name(index)] = tuple(values)
        return out

    # ---- pairs ----

    def _disabled(self) -> dict[tuple[str, str], str]:
        """Pairs of bodies that MuJoCo never lets collide, but for those that one joint connects."""
        model, out = self.model, {}
        for exclude in self.spec.excludes:
            out[pair_of(exclude.bodyname1, exclude.bodyname2)] = "exclude"
        welded = [int(first) for first in model.body_weldid]  # of bodies that are fixed together, the first
        for body, first in enumerate(welded):
            above = welded[model.body_parentid[first]]
            if model.body_jntnum[first] > 1 and above != 0:  # MuJoCo takes the world for no one's neighbour
                for other in (i for i in range(model.nbody) if welded[i] == above):
                    out.setdefault(pair_of(self.bodies[body], self.bodies[other]), "adjacent")
        masks = np.zeros((model.nbody, 2), dtype=np.int64)  # contype and conaffinity of all geoms
        for geom in range(model.ngeom):
            masks[model.geom_bodyid[geom]] |= model.geom_contype[geom], model.geom_conaffinity[geom]
        kept = {pair_of(*(self.bodies[model.geom_bodyid[geom]] for geom in pair)) for pair in self._geom_pairs()}
        able = [body for body in range(model.nbody) if masks[body].any()]
        for index, one in enumerate(able):
            for other in able[index + 1 :]:
                pair = pair_of(self.bodies[one], self.bodies[other])
                if not (masks[one] & masks[other][::-1]).any() and pair not in kept:
                    out.setdefault(pair, "contype and conaffinity")
        return out

    def _geom_pairs(self) -> Iterator[tuple[int, int]]:
        return ((int(one), int(other)) for one, other in zip(self.model.pair_geom1, self.model.pair_geom2))


def _low(points: Matrix) -> Matrix:
    return np.asarray(points.min(axis=0))


def _high(points: Matrix) -> Matrix:
    return np.asarray(points.max(axis=0))
