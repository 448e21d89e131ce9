"""URDF, SDF and lists of spheres as written, read again by the package's own readers; MuJoCo has a file of its own."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from robot_parts import arm, baked, frames, l_shape, points_of_l, pose, wedge

import prolate
from prolate.robots import Note, Robot, Where, load, write_mjcf, write_sdf, write_spheres, write_urdf
from prolate.robots._measure import beyond
from prolate.robots._model import BoxShape, EllipsoidShape, Mimic, SphereShape
from prolate.robots._proof import holds_ellipsoids, holds_points
from prolate.robots._solids import moved
from prolate.robots._writing import quaternion, roll_pitch_yaw
from prolate.robots._xml import rpy_matrix

KINDS = [None, "ellipsoids", "spheres", "hull", "capsule", "cylinder"]


def check_read_again(path: Path) -> None:
    """The frames are the robot's, and the collisions hold its solids."""
    again = load(path)
    assert not [note for note in again.notes if note.kind == "error"]
    places, originals = frames(again, {"turn": 0.7, "push": 0.15}), frames(arm(), {"turn": 0.7, "push": 0.15})
    solids = {"base": moved(pose(1), points_of_l(1000)), "hand": moved(pose(4), wedge().vertices)}
    for link in again.links:
        if link.name not in originals:
            continue  # the world
        place = originals[link.name]
        np.testing.assert_allclose(places[link.name], place, atol=1e-12)
        if link.name in solids:
            world = moved(originals[link.name], solids[link.name])
            assert (beyond(link.collisions, moved(np.linalg.inv(place), world)) <= 0).all()
        np.testing.assert_allclose(link.inertial.mass, 1.5)
    assert [joint.kind for joint in again.joints if joint.name in ("turn", "push")] == ["revolute", "prismatic"]


@pytest.mark.parametrize("only", KINDS)
def test_sdf_says_the_same_robot(only: str | None, bakes: Path, tmp_path: Path) -> None:
    write_sdf(baked(only, bakes), tmp_path / "arm.sdf")
    check_read_again(tmp_path / "arm.sdf")
    radii = ElementTree.parse(tmp_path / "arm.sdf").getroot().iter("radii")
    assert (len(list(radii)) > 0) == (only == "ellipsoids")


@pytest.mark.parametrize("only", KINDS)
def test_urdf_says_the_same_robot(only: str | None, bakes: Path, tmp_path: Path) -> None:
    write_urdf(baked(only, bakes), tmp_path / "arm.urdf")
    check_read_again(tmp_path / "arm.urdf")
    text = (tmp_path / "arm.urdf").read_text()
    assert "ellipsoid" not in text.replace("ellipsoids", "") and max(map(len, text.splitlines())) < 8191
    for mesh in (tmp_path / "arm.urdf_meshes").glob("*.obj"):
        assert {line[0] for line in mesh.read_text().splitlines()} == {"v", "f"}


@pytest.mark.parametrize("only", KINDS)
def test_mjcf_says_the_same_robot(only: str | None, bakes: Path, tmp_path: Path) -> None:
    write_mjcf(baked(only, bakes), tmp_path / "arm.xml")
    check_read_again(tmp_path / "arm.xml")


def test_urdf_for_drake_has_its_ellipsoids(bakes: Path, tmp_path: Path) -> None:
    robot = baked("ellipsoids", bakes)
    write_urdf(robot, tmp_path / "arm.urdf", ellipsoids="drake")
    root = ElementTree.parse(tmp_path / "arm.urdf").getroot()
    found = [tuple(float(one.get(name)) for name in "abc") for one in root.iter("{http://drake.mit.edu}ellipsoid")]
    wanted = [one.shape.radii for cover in robot.covers.values() for one in cover.geometries]
    assert found == wanted and isinstance(robot.covers["base"].geometries[0].shape, EllipsoidShape)


@pytest.mark.parametrize("write, name", [(write_urdf, "arm.urdf"), (write_sdf, "arm.sdf")])
def test_anchors_and_zeros_become_frames(write, name: str, tmp_path: Path) -> None:
    description = arm()
    turn, push = description.joints
    turn = replace(turn, anchor=(0.1, -0.2, 0.3), zero=0.4)
    push = replace(push, mimic=Mimic("turn", 0.5, 0.1))
    anchored = replace(description, joints=(turn, push))
    write(Robot(anchored).bake(only=("hull", "box"), clearance=1), tmp_path / name)
    again = load(tmp_path / name)
    mimic = next(joint.mimic for joint in again.joints if joint.name == "push")
    assert mimic.multiplier == 0.5 and mimic.offset == pytest.approx(0.1 + 0.5 * 0.4)
    for q in (-0.3, 1.1):
        ours = frames(anchored, {"turn": q, "push": 0.5 * q + 0.1})
        theirs = frames(again, {"turn": q - 0.4, "push": 0.5 * (q - 0.4) + mimic.offset})
        np.testing.assert_allclose(theirs["hand"], ours["hand"], atol=1e-12)
        wanted = moved(ours["elbow"] @ anchored.links[1].collisions[1].pose, np.eye(3))
        elbow = next(link for link in again.links if link.name == "elbow")
        boxes = [one for one in elbow.collisions if isinstance(one.shape, BoxShape)]
        np.testing.assert_allclose(moved(theirs["elbow"] @ boxes[0].pose, np.eye(3)), wanted, atol=1e-12)


def test_spheres_for_curobo(bakes: Path, tmp_path: Path) -> None:
    robot = baked("spheres", bakes)
    write_spheres(robot, tmp_path / "arm.yml")
    lines = (tmp_path / "arm.yml").read_text().splitlines()
    assert lines[:2] == ["collision_spheres:", '  "base":']
    numbers = [float(one) for one in lines[2].split("[")[1].rstrip("]").split(",")] + [float(lines[3].split()[-1])]
    first = robot.covers["base"].geometries[0]
    assert isinstance(first.shape, SphereShape) and numbers == [*first.pose[:3, 3], first.shape.radius]
    assert sum("radius" in line for line in lines) == sum(len(one.geometries) for one in robot.covers.values())
    with pytest.raises(prolate.Error, match=r"link base: .* ellipsoid; bake with only"):
        write_spheres(baked("ellipsoids", bakes), tmp_path / "no.yml")
    assert not (tmp_path / "no.yml").exists()


def test_rotations_as_text_mean_the_same_matrix() -> None:
    turned = [pose(seed)[:3, :3] for seed in range(50)]
    turned += [
        np.eye(3),
        np.diag([1.0, -1, -1]),
        np.diag([-1.0, 1, -1]),
        np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0.0]]),
        *(rpy_matrix((0.3, np.pi / 2 - off, 0.4)) for off in (1e-15, 1e-12, 1e-9, 1e-6)),
    ]
    for matrix in turned:
        w, x, y, z = quaternion(matrix)
        back = np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ])  # fmt: skip
        np.testing.assert_allclose(back, matrix, atol=4e-15)
        roll, pitch, yaw = roll_pitch_yaw(matrix)
        about = [
            np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]]),
            np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]]),
            np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]]),
        ]
        np.testing.assert_allclose(about[2] @ about[1] @ about[0], matrix, atol=4e-15)


@pytest.mark.parametrize("only", ["ellipsoids", "spheres", "hull"])
@pytest.mark.parametrize("name", ["arm.xml", "arm.sdf", "arm.urdf"])
def test_the_proof_holds_of_the_numbers_that_are_read_again(name: str, only: str, bakes: Path, tmp_path: Path) -> None:
    robot = baked(only, bakes)
    write = {"arm.xml": write_mjcf, "arm.sdf": write_sdf, "arm.urdf": partial(write_urdf, ellipsoids="drake")}[name]
    write(robot, tmp_path / name)
    read = {link.name: link.collisions for link in load(tmp_path / name).links}
    for cover, points in ((robot.covers["base"], l_shape().vertices), (robot.covers["hand"], wedge().vertices)):
        place = pose(1) if cover.name == "base" else pose(4)
        if cover.baked is None:
            assert holds_points(read[cover.name][0], moved(place, points))
        else:
            assert holds_ellipsoids(read[cover.name], cover.baked.cut(), cover.rounding)


@pytest.mark.parametrize("writer", [write_mjcf, write_sdf, write_urdf, write_spheres])
def test_what_is_not_proved_is_not_written_unless_that_is_said(writer: Callable, bakes: Path, tmp_path: Path) -> None:
    robot = baked("spheres", bakes)
    lost = replace(robot, notes=(Note("error", "has no cover", Where(Path("arm.urdf"), 7), "hand"),))
    loose = replace(robot, covers={**robot.covers, "base": replace(robot.covers["base"], proved=False)})
    for one, why in ((lost, "arm.urdf:7: link hand: has no cover"), (loose, "link base: its cover is not proved")):
        with pytest.raises(prolate.Error, match=f"{why}.* unproved=True") as error:
            writer(one, tmp_path / "out")
        assert error.value.code == "bad_mesh" and not list(tmp_path.iterdir())
    writer(loose, tmp_path / "out", unproved=True)
    assert (tmp_path / "out").exists()
