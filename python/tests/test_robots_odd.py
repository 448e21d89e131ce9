"""Robots that are odd but legal, and input that is bad: names, limits, outputs, arguments."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import prolate
from prolate import robots
from prolate.robots._command import main

BOX = '<collision><geometry><box size="0.1 0.1 0.3"/></geometry></collision>'
# The root is called world, a joint as a link, and names have what XML must escape; limits are one number, and one side.
ODD = f"""<robot name="odd">
  <link name="world"/>
  <joint name="fixed_to_world" type="fixed"><parent link="world"/><child link="base"/></joint>
  <link name="base">{BOX}</link>
  <joint name="base" type="revolute">
    <parent link="base"/><child link="a/b &amp;&quot;&lt;"/><origin xyz="0 0 1" rpy="0.3 0.4 0.5"/><axis xyz="0 1 0"/>
    <limit lower="0.5" upper="0.5" velocity="1" effort="1"/>
  </joint>
  <link name="a/b &amp;&quot;&lt;">{BOX}</link>
  <joint name="slide" type="prismatic">
    <parent link="base"/><child link="s::t"/><origin xyz="1 0 1" rpy="0.1 0.2 0.9"/><axis xyz="0 1 1"/>
    <limit lower="-1" upper="1e16" velocity="1" effort="1"/>
  </joint>
  <link name="s::t">{BOX}</link>
</robot>"""


@pytest.fixture
def odd(tmp_path: Path) -> Path:
    (tmp_path / "odd.urdf").write_text(ODD)
    return tmp_path / "odd.urdf"


@pytest.mark.parametrize("ending", ["xml", "sdf", "urdf"])
def test_odd_names_and_limits_are_read_again(odd: Path, ending: str) -> None:
    baked = robots.Robot(robots.load(odd)).bake()
    out = odd.with_name(f"out.{ending}")
    {"xml": robots.write_mjcf, "sdf": robots.write_sdf, "urdf": robots.write_urdf}[ending](baked, out)
    again = robots.load(out, visuals=False)
    assert not [note for note in again.notes if note.kind == "error"]
    assert [len(link.collisions) for link in again.links] == [0, 1, 1, 1]
    q = baked.checks.kinematics.random(9)
    np.testing.assert_allclose(robots.Robot(again).bake().fk(q)[..., :3], baked.fk(q)[..., :3], atol=1e-14)
    turn, slide = (joint for joint in again.joints if joint.coordinates)
    assert abs(turn.lower - 0.5) + abs(turn.upper - 0.5) < 1e-8 and slide.lower == -1 and slide.upper >= 1e9


def test_a_robot_of_mujoco_is_written_for_mujoco(tmp_path: Path) -> None:
    path = tmp_path / "hip.xml"
    path.write_text("""<mujoco><worldbody>
      <geom type="box" size=".1 .1 .1" pos="3 0 0"/>
      <body name="pelvis" pos="0 0 1"><freejoint/><geom type="box" size=".2 .2 .2"/>
        <body name="thigh" pos="0 0 -.2"><joint axis="1 0 0"/><joint axis="0 1 0"/><geom type="capsule" size=".1 .2"/>
          <body pos="0 0 -.6"><joint axis="0 1 0"/><geom size=".1"/></body>
          <body name="body3" pos="0 1 -.6"><joint axis="0 1 0"/><geom size=".1"/></body>
        </body>
      </body>
    </worldbody></mujoco>""")
    baked = robots.Robot(robots.load(path)).bake()
    names = [link.name for link in baked.description.links if link.collisions]
    assert len(names) == len(set(names)) == 5 and not baked.description.notes  # one has no name, another takes its
    pairs = [pair[:2] for pair in baked.checks.pairs()]
    assert ("pelvis", "thigh") not in pairs and ("world", "pelvis") in pairs  # two joints between; a free one
    assert not baked.collide(baked.checks.kinematics.home)[0]
    robots.write_mjcf(baked, tmp_path / "out.xml", visuals=False)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out.xml"))
    assert model.nq == 11 and model.body_geomnum[0] == 1


def test_planar_joints_mean_the_same_in_mjcf(tmp_path: Path) -> None:
    for axis in ("0 0 1", "0 0 -1", "0.3 -0.4 0.5"):
        path = tmp_path / "planar.urdf"
        path.write_text(
            f'<robot name="p"><link name="a"/><link name="b">{BOX}</link><joint name="j" type="planar">'
            f'<parent link="a"/><child link="b"/><axis xyz="{axis}"/></joint></robot>'
        )
        baked = robots.Robot(robots.load(path)).bake()
        robots.write_mjcf(baked, tmp_path / "planar.xml")
        q = baked.checks.kinematics.random(9)
        again = robots.Robot(robots.load(tmp_path / "planar.xml")).bake().fk(q)
        np.testing.assert_allclose(again[-1, :, :3], baked.fk(q)[-1, :, :3], atol=1e-14)


# ---- outputs ----


@pytest.mark.parametrize("command", ["convert", "view", "touch"])
def test_the_input_is_never_overwritten(odd: Path, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    for output in (odd, odd.parent / "." / "link.urdf"):
        if output != odd:
            output.symlink_to(odd)
        assert main([command, str(odd), "-o", str(output), "-q", "--no-cache"]) == 2
        assert "--output" in capsys.readouterr().err and odd.read_text() == ODD


def test_writers_refuse_their_inputs(tmp_path: Path) -> None:
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (tmp_path / "out.sdf_meshes").mkdir()
    mesh = tmp_path / "out.sdf_meshes" / "a_visual_0.obj"
    mesh.write_text(corners)
    (tmp_path / "in.urdf").write_text(
        '<robot name="r"><link name="a"><visual><geometry><mesh filename="out.sdf_meshes/a_visual_0.obj"/></geometry>'
        f"</visual>{BOX}</link></robot>"
    )
    baked = robots.Robot.load(tmp_path / "in.urdf").bake()
    for write in (robots.write_urdf, robots.write_mjcf, robots.write_sdf, robots.write_view):
        with pytest.raises(ValueError, match="read from"):
            write(baked, tmp_path / "in.urdf")
    with pytest.raises(ValueError, match="read from"):
        robots.write_sdf(baked, tmp_path / "out.sdf")
    assert mesh.read_text() == corners and not (tmp_path / "out.sdf").exists()


def test_outputs_keep_apart_and_leave_nothing_behind(odd: Path) -> None:
    baked = robots.Robot(robots.load(odd)).bake(only="hull")
    folder = odd.parent / "out"
    robots.write_urdf(baked, folder / "robot.urdf")
    robots.write_sdf(baked, folder / "robot.sdf")
    assert sorted(os.listdir(folder)) == ["robot.sdf", "robot.sdf_meshes", "robot.urdf", "robot.urdf_meshes"]
    assert (folder / "robot.sdf").stat().st_mode == odd.stat().st_mode  # what the umask leaves
    (folder / "there.xml").mkdir()
    with pytest.raises(prolate.Error) as error:
        robots.write_mjcf(baked, folder / "there.xml")
    assert error.value.code == "io" and len(os.listdir(folder)) == 5


def test_names_in_a_page_are_no_marks(odd: Path) -> None:
    odd.write_text(ODD.replace('name="odd"', 'name="@SCRIPT@ &lt;/title&gt;"'))
    page = robots.view_page(robots.Robot(robots.load(odd)).bake())
    assert "<title>@SCRIPT@ &lt;/title&gt;</title>" in page


# ---- arguments ----


def test_a_folder_that_cannot_be_is_no_cache(odd: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bake", str(odd), "--only", "hull", "--cache", str(odd), "-q"]) == 4
    assert str(odd) in capsys.readouterr().err


@pytest.mark.parametrize("wrong", ["--ellipsoids=0", "--ellipsoids=-3", "--threads=-1", "--mend=-1"])
def test_numbers_out_of_range(odd: Path, wrong: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bake", str(odd), wrong, "--no-cache"]) == 2
    assert "must be" in capsys.readouterr().err


def test_a_body_called_as_a_link_is_not_allowed_with_it(odd: Path) -> None:
    description = robots.load(odd)
    trees = {name: cover.tree for name, cover in robots.Robot(description).bake(exact=True).covers.items()}
    checks = robots.Checks(description, trees, allowed=[("base", "s::t"), ("base", "floor")])
    box = prolate.Box([0, 0, 0, 0, 0, 0, 1], [0.1, 0.1, 0.1])
    assert checks.collide(checks.kinematics.home, robots.Scene().add(box, name="s::t"))[0]
    assert not checks.collide(checks.kinematics.home, robots.Scene().add(box, name="floor"))[0]


def test_slack_of_no_link_and_poses_that_scale_are_refused(odd: Path) -> None:
    description = robots.load(odd)
    with pytest.raises(ValueError, match="slack: the robot has no link bse"):
        robots.Checks(description, {}, slack={"bse": 0.01})
    scene = robots.Scene()
    for pose in (np.diag([2.0, 2, 2, 1]), np.diag([1.0, 1, -1, 1]), np.diag([1.0, 1, 1, 2])):
        with pytest.raises(ValueError, match="pose"):
            scene.add(prolate.HalfSpace([0, 0, 1], 1), pose)
    assert len(scene) == 0


# ---- files ----

LINK = '<link name="a"><collision name="c"><geometry>{}</geometry></collision></link>'
JOINT = '<joint type="revolute"><parent>a</parent><child>b</child><axis/></joint>'
MODEL = '<sdf version="1.9"><model name="m">{}</model></sdf>'
LONG = "x" * 5000  # more than a name may have
BAD = {
    "<&e;> in <robot>": '<!DOCTYPE r [<!ENTITY e SYSTEM "file:///etc/hostname">]><robot>&e;<link name="a"/></robot>',
    "there is no file": "<robot>" + LINK.format(f'<mesh filename="{LONG}"/>') + "</robot>",
    "has no name=": MODEL.format(f'<link name="a"/><link name="b"/>{JOINT}'),
    "no direction": MODEL.format(LINK.format("<plane><normal>0 0 0</normal></plane>")),
}


@pytest.mark.parametrize("said", BAD)
def test_bad_elements_are_named(tmp_path: Path, said: str) -> None:
    (tmp_path / "bad.robot").write_text(BAD[said])
    assert any(said in note.text for note in robots.load(tmp_path / "bad.robot").notes)


def test_a_link_that_misses_a_part_is_not_proved(tmp_path: Path) -> None:
    path = tmp_path / "part.urdf"
    mesh = '<collision><geometry><mesh filename="no.stl"/></geometry></collision>'
    path.write_text(f'<robot><link name="a">{BOX}{mesh}</link></robot>')
    for baked in (robots.Robot.load(path).bake(), robots.Robot.load(path).bake(exact=True)):
        assert list(baked.covers) == ["a"] and not baked.proved


@pytest.mark.parametrize("kind", ["box", "cylinder", "capsule", "sphere", "hull", "ellipsoids"])
def test_what_is_as_thin_as_rounding_has_covers(tmp_path: Path, kind: Any) -> None:
    for size in ("1 1 1e-12", "1e-9 1 1e-9"):
        path = tmp_path / "thin.urdf"
        path.write_text(f'<robot><link name="a">{BOX.replace("0.1 0.1 0.3", size)}</link></robot>')
        baked = robots.Robot.load(path).bake(only=kind, clearance=1)
        cover = baked.covers["a"]
        assert baked.proved and cover.kind in (kind, "own", "ellipsoids") and cover.clearance < 1


def test_a_link_of_no_size_that_can_be_is_named(tmp_path: Path) -> None:
    path = tmp_path / "far.urdf"
    path.write_text("<robot>" + LINK.format('<sphere radius="1e30"/>') + "</robot>")
    with pytest.raises(prolate.Error, match="link a: "):
        robots.Robot.load(path).bake().collide([])
