"""MJCF, as MuJoCo itself reads it: frames, sizes, masses and what touches."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from robot_parts import arm, baked, frames, l_shape, points_of_l, pose

from prolate.robots._model import EllipsoidShape, Geometry, Inertial, MeshShape, Mimic
from prolate.robots._robot import Robot
from prolate.robots._solids import hull_of, moved, polyhedron
from prolate.robots._write_mjcf import write_mjcf

mujoco = pytest.importorskip("mujoco")
pytestmark = pytest.mark.usefixtures("own_folder")


def compiled(robot, path: Path, **options):
    write_mjcf(robot, path, **options)
    return mujoco.MjModel.from_xml_path(str(path))


def holds(model, data, geom: int, points: np.ndarray) -> np.ndarray:
    """Which world points are in a geom, by MuJoCo's own numbers."""
    local = (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
    size, kind = model.geom_size[geom], mujoco.mjtGeom(model.geom_type[geom])
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return ((local / size) ** 2).sum(1) <= 1
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return (local**2).sum(1) <= size[0] ** 2
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return (np.abs(local) <= size).all(1)
    if kind in (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER):
        beyond = np.maximum(np.abs(local[:, 2]) - size[1], 0)
        across = np.hypot(local[:, 0], local[:, 1])
        if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
            return (across <= size[0]) & (beyond == 0)
        return np.hypot(across, beyond) <= size[0]
    assert kind == mujoco.mjtGeom.mjGEOM_MESH
    mesh = model.geom_dataid[geom]
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    planes = hull_of(model.mesh_vert[start : start + count].astype(np.float64)).equations
    return (local @ planes[:, :3].T + planes[:, 3] <= 0).all(1)


def covered(model, data, body: str, points: np.ndarray) -> bool:
    geoms = np.flatnonzero((model.geom_bodyid == model.body(body).id) & (model.geom_group == 3))
    return bool(np.any([holds(model, data, geom, points) for geom in geoms], axis=0).all())


@pytest.mark.parametrize("only", [None, "ellipsoids", "spheres", "hull", "box", "capsule", "cylinder", "sphere"])
def test_mujoco_places_each_cover_around_its_link(only: str | None, bakes: Path, tmp_path: Path) -> None:
    description = arm()
    robot = baked(only, bakes)
    model = compiled(robot, tmp_path / "arm.xml")
    data = mujoco.MjData(model)
    data.qpos[:] = [0.7, 0.15]
    mujoco.mj_forward(model, data)
    places = frames(description, {"turn": 0.7, "push": 0.15})
    box = description.links[1].collisions[1]
    wedge = description.links[2].collisions[0].shape
    samples = {
        "base": moved(pose(1), points_of_l(2000)),
        "hand": moved(pose(4), wedge.vertices),
        "elbow": np.concatenate(
            [moved(pose(2), wedge.vertices), moved(box.pose, polyhedron(box.shape)[0] * (1 - 1e-9))]
        ),
    }
    for name, place in places.items():
        body = model.body(name).id
        np.testing.assert_allclose(data.xpos[body], place[:3, 3], atol=1e-12)
        np.testing.assert_allclose(data.xmat[body].reshape(3, 3), place[:3, :3], atol=1e-12)
        assert covered(model, data, name, moved(place, samples[name]))


def test_masses_and_limits_are_the_descriptions_own(tmp_path: Path) -> None:
    description = arm()
    model = compiled(Robot(description).bake(only="hull", clearance=1), tmp_path / "arm.xml", floating=True)
    np.testing.assert_allclose(model.body_mass[1:], 1.5)
    inertial = description.links[0].inertial
    for body in (1, 2, 3):
        np.testing.assert_allclose(sorted(model.body_inertia[body]), np.diag(inertial.inertia), rtol=1e-9)
        np.testing.assert_allclose(model.body_ipos[body], inertial.pose[:3, 3], atol=1e-12)
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[body])
        turn = turn.reshape(3, 3)
        expected = inertial.pose[:3, :3] @ inertial.inertia @ inertial.pose[:3, :3].T
        np.testing.assert_allclose(turn @ np.diag(model.body_inertia[body]) @ turn.T, expected, atol=1e-9)
    np.testing.assert_allclose(model.jnt_range[1:], [[-2.0, 1.5], [-0.1, 0.2]])
    assert model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    assert model.opt.ccd_tolerance <= 1e-10 and model.opt.ccd_iterations == 100
    assert (model.geom_contype[model.geom_group == 2] == 0).all() and (model.geom_group == 2).sum() == 1


def test_anchors_zeros_and_mimics_mean_the_same_to_mujoco(tmp_path: Path) -> None:
    description = arm()
    turn, push = description.joints
    turn = replace(turn, anchor=(0.1, -0.2, 0.3), zero=0.4)
    push = replace(push, mimic=Mimic("turn", 0.1, 0.02))
    description = replace(description, joints=(turn, push))
    model = compiled(Robot(description).bake(exact=True), tmp_path / "arm.xml")
    data = mujoco.MjData(model)
    data.qpos[:] = [-0.9, 0.02 - 0.09]
    mujoco.mj_forward(model, data)
    for name, place in frames(description, {"turn": -0.9, "push": 0.02 - 0.09}).items():
        np.testing.assert_allclose(data.body(name).xpos, place[:3, 3], atol=1e-12)
    assert data.ne == 1 and abs(data.efc_pos[0]) < 1e-12  # the mimic holds here, and only such
    data.qpos[1] += 0.01
    mujoco.mj_forward(model, data)
    assert abs(data.efc_pos[0]) == pytest.approx(0.01)


def test_neighbours_of_a_fixed_root_do_not_touch(tmp_path: Path) -> None:
    description = arm()
    links = tuple(replace(link, collisions=(Geometry(l_shape(), pose(1)),)) for link in description.links)
    joints = tuple(replace(one, origin=np.eye(4)) for one in description.joints)
    together = replace(description, links=links, joints=joints)
    robot = Robot(together).bake(only="sphere")
    model = compiled(robot, tmp_path / "arm.xml", exclude=[("hand", "base")])
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    model = compiled(robot, tmp_path / "arm.xml")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    touching = {tuple(sorted((model.geom_bodyid[one.geom1], model.geom_bodyid[one.geom2]))) for one in data.contact}
    assert touching == {(model.body("base").id, model.body("hand").id)}


def test_the_arena_holds_what_many_ellipsoids_touch(tmp_path: Path) -> None:
    """By default MuJoCo's arena overflows here, and the bodies fall freely."""
    robot = Robot(arm()).bake(only="hull", clearance=1)
    many = tuple(Geometry(EllipsoidShape((0.03, 0.05, 0.04)), pose(100 + i, 0.1)) for i in range(120))
    covers = {name: replace(cover, geometries=many, baked=None) for name, cover in robot.covers.items()}
    joints = tuple(replace(one, origin=pose(50, 0.01)) for one in robot.description.joints)
    robot = replace(robot, covers=covers, description=replace(robot.description, joints=joints))
    model = compiled(robot, tmp_path / "many.xml", floating=True)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon > 500 and data.warning[mujoco.mjtWarning.mjWARN_CONTACTFULL].number == 0


def test_flat_visuals_and_links_without_mass_or_inertia_are_accepted(tmp_path: Path) -> None:
    description = arm()
    flat = MeshShape(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]]), np.array([[0, 1, 2]]))
    bare = (None, Inertial(1.0, np.zeros((3, 3))), Inertial(1.0, np.diag([1.0, 1.0, 9.0])))
    links = tuple(
        replace(link, visuals=(Geometry(flat, pose(8)),), inertial=inertial)
        for link, inertial in zip(description.links, bare)
    )
    robot = Robot(replace(description, links=links)).bake(only="hull", clearance=1)
    model = compiled(robot, tmp_path / "arm.xml")
    assert (model.body_mass[2:] > 0).all() and (model.body_inertia[2:] > 0).all()


def test_nothing_is_written_where_nothing_can_be(tmp_path: Path) -> None:
    robot = Robot(arm()).bake(exact=True)
    (tmp_path / "a_file").write_text("")
    with pytest.raises(Exception, match="a_file"):
        write_mjcf(robot, tmp_path / "a_file" / "arm.xml")
    assert [one.name for one in tmp_path.iterdir()] == ["a_file"]


@pytest.mark.parametrize("moments", [(1, 1, 3), (-1, 2, 2), (0, 0, 0), (1, 2, 3)])
def test_inertia_that_no_body_has_is_mended(tmp_path: Path, moments: tuple[float, float, float]) -> None:
    description = arm()
    turn = pose(8)[:3, :3]
    inertial = Inertial(2.0, turn @ np.diag(np.array(moments) * 1e-3) @ turn.T, pose(9))
    links = tuple(replace(link, inertial=inertial) for link in description.links)
    robot = Robot(replace(description, links=links)).bake(only="hull", clearance=1)
    model = compiled(robot, tmp_path / "arm.xml")
    found = np.sort(model.body_inertia[-1])
    assert found[0] > 0 and found[2] <= found[0] + found[1] and model.body_mass[-1] == 2
    if moments == (1, 2, 3):
        np.testing.assert_allclose(found, np.array(moments) * 1e-3, rtol=1e-5)
