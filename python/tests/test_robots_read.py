"""URDF, meshes and SRDF as prolate.robots reads them."""

from __future__ import annotations

import base64
import sys

import numpy as np
import pytest
from robot_files import TETRAHEDRON, frames, link, texts, volume

import prolate

pytest.importorskip("lxml")
from prolate import robots

ARM = """<?xml version="1.0"?>
<robot name="arm">
  <link name="base"><collision><geometry><box size="1 2 3"/></geometry></collision></link>
  <joint name="j1" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"/>
    <axis xyz="1 2 -2"/><limit lower="-1" upper="2" velocity="3" effort="4"/><dynamics damping="0.5" friction="0.25"/>
  </joint>
  <link name="tool"/>
  <joint name="j3" type="continuous"><parent link="fore"/><child link="tool"/><origin rpy="1 2 3"/></joint>
  <link name="upper"/>
  <joint name="j2" type="prismatic">
    <parent link="upper"/><child link="fore"/><origin xyz="1 0 -1" rpy="-2 0.1 0.7"/><axis xyz="0 0.6 0.8"/>
    <limit lower="0.5" upper="1.5"/>
  </joint>
  <link name="fore"/>
  <joint name="j5" type="revolute">
    <parent link="fore"/><child link="second"/><axis xyz="0 0 1"/><limit lower="-6" upper="6"/>
    <mimic joint="j4" multiplier="3" offset="0.5"/>
  </joint>
  <joint name="j4" type="revolute">
    <parent link="fore"/><child link="first"/><axis xyz="0 1 0"/><limit lower="-1" upper="1"/>
    <mimic joint="j1" multiplier="-2" offset="0.25"/>
  </joint>
  <link name="first"/><link name="second"/>
</robot>
"""


@pytest.fixture
def write(tmp_path):
    def to(text, name="robot.urdf"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    return to


def one_link(inside, more=""):
    return f'<robot name="r">\n<link name="a">\n{inside}\n</link>\n{more}\n</robot>\n'


def collision(shape, origin=""):
    return f"<collision>{origin}<geometry>{shape}</geometry></collision>"


def test_frames_are_those_of_yourdfpy(write):
    yourdfpy = pytest.importorskip("yourdfpy")
    path = write(ARM)
    arm = robots.load(path)
    assert [joint.name for joint in arm.joints] == ["j1", "j2", "j3", "j5", "j4"]
    assert arm.nq == 3 and arm.home == (0.0, 0.5, 0.0)
    other = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
    # yourdfpy lets j5 follow j4's own coordinate, which j1 leads: a chain it does not follow.
    for q in np.random.default_rng(1).uniform([-1, 0.5, -3], [2, 1.5, 3], (20, 3)):
        other.update_cfg({"j1": q[0], "j2": q[1], "j3": q[2]})
        ours = frames(arm, q)
        for name in ("base", "upper", "fore", "tool", "first"):
            np.testing.assert_allclose(ours[name], other.get_transform(name, "base"), atol=1e-12)


def test_a_mimic_of_a_mimic_follows_the_first(write):
    mimics = {joint.name: joint.mimic for joint in robots.load(write(ARM)).joints}
    assert mimics["j4"] == robots.Mimic("j1", -2, 0.25)
    assert mimics["j5"] == robots.Mimic("j1", -6, 1.25)


@pytest.mark.parametrize(
    ("old", "new", "said", "coordinates"),
    [
        ('"j1" multiplier', '"j9" multiplier', "as there is no joint j9", 5),
        ('"j1" multiplier', '"j5" multiplier', "which follows it in turn", 5),
        ('name="j1" type="revolute"', 'name="j1" type="fixed"', "as j1 is fixed", 4),
    ],
)
def test_a_mimic_that_cannot_follow_moves_by_itself(write, old, new, said, coordinates):
    assert old in ARM
    arm = robots.load(write(ARM.replace(old, new)))
    warnings = texts(arm, "warning")
    assert arm.nq == coordinates and len(warnings) == 2
    assert all(said in warning and "moves by itself" in warning for warning in warnings)
    assert not texts(arm, "error")


def test_joints_keep_what_the_file_says(write):
    arm = robots.load(write(ARM))
    j1, j2, j3, *_ = arm.joints
    assert (j1.lower, j1.upper, j1.velocity, j1.effort, j1.damping, j1.friction) == (-1, 2, 3, 4, 0.5, 0.25)
    assert np.allclose(j1.axis, (1 / 3, 2 / 3, -2 / 3)) and j3.axis == (1, 0, 0)
    assert (j2.velocity, j3.lower, j3.upper) == (np.inf, -np.inf, np.inf)
    assert j1.where.line == 4 and str(j1.where).endswith("robot.urdf:4")


def test_shapes_and_inertia(write):
    text = one_link(
        collision('<cylinder radius="1" length="2"/>', '<origin xyz="1 2 3" rpy="0.3 0 0"/>')
        + collision('<sphere radius="0.5"/>')
        + collision('<capsule radius="0.25" length="3"/>')
        + collision('<drake:ellipsoid xmlns:drake="http://drake.mit.edu" a="1" b="2" c="3"/>')
        + '<inertial><origin xyz="0 0 1"/><mass value="2"/>'
        + '<inertia ixx="3" ixy="0.1" ixz="0.2" iyy="4" iyz="0.3" izz="5"/></inertial>'
    )
    robot = robots.load(write(text))
    a = link(robot, "a")
    assert [geometry.shape for geometry in a.collisions] == [
        robots.CylinderShape(1, 2),
        robots.SphereShape(0.5),
        robots.CapsuleShape(0.25, 3),
        robots.EllipsoidShape((1, 2, 3)),
    ]
    pose = np.eye(4)
    pose[:3, 3], pose[1:3, 1:3] = (1, 2, 3), [[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]]
    np.testing.assert_allclose(a.collisions[0].pose, pose, atol=1e-15)
    assert a.inertial.mass == 2 and a.inertial.pose[2, 3] == 1
    assert a.inertial.inertia.tolist() == [[3, 0.1, 0.2], [0.1, 4, 0.3], [0.2, 0.3, 5]]
    assert not robot.notes


@pytest.mark.parametrize("scale", [(1, 1, 1), (0.5, -2, 3), (-1, -1, 1), (-1, -1, -1)])
def test_scaled_and_mirrored_meshes_face_outwards(write, scale):
    write(TETRAHEDRON, "meshes/part.obj")
    robot = robots.load(
        write(one_link(collision('<mesh filename="meshes/part.obj" scale="{} {} {}"/>'.format(*scale))))
    )
    shape = link(robot, "a").collisions[0].shape
    assert np.isclose(volume(shape), abs(np.prod(scale)), rtol=1e-6)
    assert {tuple(v) for v in shape.vertices.round(6)} == {
        tuple(np.round(np.array(v) * scale, 6)) for v in [(0, 0, 0), (1, 0, 0), (0, 2, 0), (0, 0, 3)]
    }


def test_a_mesh_far_away_keeps_its_shape(write):
    far = "\n".join(
        f"v {float(x) + 5000} {y} {z}" for _, x, y, z in (line.split() for line in TETRAHEDRON.splitlines()[:4])
    )
    write(far + "\n" + "\n".join(TETRAHEDRON.splitlines()[4:]), "part.obj")
    robot = robots.load(write(one_link(collision('<mesh filename="part.obj" scale="0.001 0.001 0.001"/>'))))
    vertices = link(robot, "a").collisions[0].shape.vertices
    assert np.abs(vertices.min(axis=0) - (5, 0, 0)).max() < 1e-9 and np.ptp(vertices[:, 0]) == pytest.approx(
        0.001, rel=1e-6
    )


def test_vertices_without_a_triangle_do_not_count(write):
    write(TETRAHEDRON.replace("f", "v 9 9 9\nf", 1), "part.obj")
    shape = robots.load(write(one_link(collision('<mesh filename="part.obj"/>')))).links[0].collisions[0].shape
    assert len(shape.vertices) == 4 and np.isclose(volume(shape), 1)


def test_packages_are_found(write, tmp_path, monkeypatch):
    mesh = one_link(collision('<mesh filename="package://parts/meshes/part.obj"/>'))
    path = write(mesh, "parts/urdf/robot.urdf")
    (error,) = texts(robots.load(path), "error")
    assert "robot.urdf:3: link a: " in error and "put it there" in error
    write(TETRAHEDRON, "parts/meshes/part.obj")
    assert not robots.load(path).notes  # a folder above the description
    elsewhere = write(mesh, "other/robot.urdf")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "none"))
    (tmp_path / "parts").rename(tmp_path / "moved")
    (error,) = texts(robots.load(elsewhere), "error")
    assert "there is no package parts" in error and "--package parts=FOLDER" in error
    assert not robots.load(elsewhere, packages={"parts": tmp_path / "moved"}).notes
    (tmp_path / "none").mkdir()
    (tmp_path / "moved").rename(tmp_path / "none" / "parts")
    assert not robots.load(elsewhere).notes


def dae(unit, up="Z_UP"):
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="{unit}"/><up_axis>{up}</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 1 0 0 0 2 0 0 0 3</float_array>
<technique_common><accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">
<node><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def test_a_unit_that_loaders_read_differently_is_asked_for(write):
    write(dae(1), "metres.dae")
    write(dae(0.001), "small.dae")
    metres = robots.load(write(one_link(collision('<mesh filename="metres.dae"/>'))))
    assert not metres.notes and np.isclose(volume(metres.links[0].collisions[0].shape), 1)
    path = write(one_link(collision('<mesh filename="small.dae" scale="1 1 2"/>')))
    asked = robots.load(path)
    (error,) = texts(asked, "error")
    assert "--dae-unit ignore" in error and "1 x 2 x 6 m" in error and "0.001 x 0.002 x 0.006 m" in error
    assert not asked.links[0].collisions
    for how, size in (("obey", 0.001), ("ignore", 1)):
        robot = robots.load(path, dae_unit=how)
        shape = robot.links[0].collisions[0].shape
        np.testing.assert_allclose(np.ptp(shape.vertices, axis=0), np.array([1, 2, 6]) * size, rtol=1e-6)
        assert shape.unit == size and "states a unit of 0.001 m" in texts(robot, "info")[0]


GLTF = """{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 2, 3]},
{"bufferView": 1, "componentType": 5125, "count": 12, "type": "SCALAR"}],
"bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 48}],
"buffers": [{"byteLength": 96, "uri": "data:application/octet-stream;base64,%s"}]}"""


@pytest.mark.parametrize("scale", [(1, 1, 1), (1, -2, 3)])
def test_axes_of_a_gltf_are_asked_for(write, scale):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], dtype="<f4")
    corners = np.array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], dtype="<u4")
    write(GLTF % base64.b64encode(points.tobytes() + corners.tobytes()).decode(), "part.gltf")
    path = write(one_link(collision('<mesh filename="part.gltf" scale="{} {} {}"/>'.format(*scale))))
    (error,) = texts(robots.load(path), "error")
    assert "--gltf-axes keep" in error and "--gltf-axes turn" in error
    for how, size in (("keep", (1, 2, 3)), ("turn", (1, 3, 2))):
        shape = robots.load(path, gltf_axes=how).links[0].collisions[0].shape
        np.testing.assert_allclose(np.ptp(shape.vertices, axis=0), np.abs(np.multiply(size, scale)), rtol=1e-6)
        assert np.isclose(volume(shape), abs(np.prod(scale)), rtol=1e-6)


def test_parts_of_an_obj_are_named(write):
    write(
        "o one\n" + TETRAHEDRON + "o two\nv 5 0 0\nv 6 0 0\nv 5 1 0\nv 5 0 1\nf 5 7 6\nf 5 6 8\nf 5 8 7\nf 6 7 8\n",
        "two.obj",
    )
    robot = robots.load(write(one_link(collision('<mesh filename="two.obj"/>'))))
    assert "has 2 parts" in texts(robot, "info")[0] and len(robot.links[0].collisions[0].shape.faces) == 8


BROKEN = [
    ('<mesh filename="no.obj"/>', "there is no file"),
    ('<mesh filename="part.obj" scale="1 0 1"/>', "leaves no volume"),
    ('<mesh filename="empty.obj"/>', "empty.obj"),
    ('<box size="1 2"/>', "size= must be 3 numbers, not '1 2'"),
    ('<box size="1 2 nan"/>', "size= must be 3 numbers"),
    ('<sphere radius="-1"/>', "radius must be above 0"),
    ("<sphere/>", "has no radius="),
    ('<ellipsoid radii="1 2 3"/>', "is no shape of URDF"),
    ("", "one shape"),
]


@pytest.mark.parametrize(("shape", "said"), BROKEN)
def test_a_broken_geometry_is_named_and_the_rest_goes_on(write, shape, said):
    write(TETRAHEDRON, "part.obj")
    write("", "empty.obj")
    text = one_link(collision(shape) + "\n" + collision('<mesh filename="part.obj"/>'), '<link name="b"/>')
    robot = robots.load(write(text.replace("</robot>", FIXED + "</robot>")))
    (error,) = texts(robot, "error")
    assert "robot.urdf:3: link a: " in error and said in error and "left out" in error
    assert len(link(robot, "a").collisions) == 1 and len(robot.links) == 2


FIXED = '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>'


@pytest.mark.parametrize(
    ("more", "said", "left"),
    [
        (FIXED.replace('"b"', '"c"'), "joint j: there is no link c", 1),
        (FIXED, "", 2),
        (FIXED + FIXED, "there is another joint j", 2),
        (FIXED + FIXED.replace('"j"', '"k"'), "hangs on joint j", 2),
        (FIXED + '<link name="b"/>', "there is another link b", 2),
        ("", "no joint has it as its child", 1),
        (FIXED.replace('"a"', '"b"'), "go round in a circle", 1),
        (FIXED.replace("fixed", "screw"), "type 'screw' is none of", 1),
        (FIXED.replace('"fixed">', '"prismatic"><axis xyz="0 0 0"/>'), "no direction", 1),
        (FIXED.replace('"fixed">', '"prismatic"><limit lower="2" upper="1"/>'), "lower=2 is above upper=1", 2),
    ],
)
def test_broken_joints_are_named(write, more, said, left):
    robot = robots.load(write(one_link("", '<link name="b"/>\n' + more)))
    errors = texts(robot, "error")
    assert len(robot.links) == left and (errors == [] if said == "" else said in " ".join(errors))
    assert all("robot.urdf:5: " in error or "robot.urdf:6: " in error for error in errors)


def test_what_is_surely_not_meant_gets_a_warning(write):
    degrees = collision('<sphere radius="1"/>', '<origin rpy="0 0 90"/>')
    zero = '<inertial><mass value="1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    thin = zero.replace('ixx="0"', 'ixx="1"').replace('iyy="0"', 'iyy="1"').replace('izz="0"', 'izz="3"')
    turn = FIXED.replace('"fixed">', '"revolute"><limit lower="-90" upper="90"/>')
    loose = FIXED.replace('"fixed"', '"revolute"').replace('"b"', '"c"').replace('"j"', '"k"')
    text = one_link(degrees + zero, f'<link name="b">{thin}</link><link name="c"/>{turn}{loose}<gazebo/><gazebo/>')
    robot = robots.load(write(text))
    for said, warning in zip(
        ["more than a turn", "more than a turn", "no <limit>", "is zero", "none exceeds"], texts(robot, "warning")
    ):
        assert said in warning
    assert texts(robot, "error") == [] and len(texts(robot, "warning")) == 5
    assert "<gazebo> in <robot> (2 times) is not understood" in texts(robot, "info")[0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<robot><link", ":1: is not XML"),
        ("<robots/>", "begins with <robots>"),
        ("<robot/>", "has no link"),
        (one_link("").replace("</robot>", FIXED.replace('"b"', '"a"') + "</robot>"), "none is the root"),
    ],
)
def test_no_robot_at_all(write, text, said):
    path = write(text)
    with pytest.raises(prolate.Error, match=said) as error:
        robots.load(path)
    assert error.value.code == "bad_file" and str(path) in str(error.value)


def test_options_and_files_that_are_not(write, tmp_path):
    with pytest.raises(prolate.Error) as error:
        robots.load(tmp_path / "none.urdf")
    assert error.value.code == "io"
    with pytest.raises(ValueError, match="dae_unit"):
        robots.load(write(ARM), dae_unit="maybe")


def test_srdf(write):
    srdf = write(
        '<robot name="arm"><disable_default_collisions link="base"/>\n'
        '<disable_collisions link1="tool" link2="fore" reason="Adjacent"/>\n'
        '<enable_collisions link1="base" link2="first"/>\n<disable_collisions link1="fore" link2="none"/></robot>',
        "arm.srdf",
    )
    arm = robots.load(write(ARM), srdf=srdf)
    assert arm.disabled == {
        ("fore", "tool"): "Adjacent",
        **{pair: "default" for pair in [("base", "fore"), ("base", "second"), ("base", "tool"), ("base", "upper")]},
    }
    (warning,) = texts(arm, "warning")
    assert "arm.srdf:4" in warning and "no link none" in warning


def test_xacro(write):
    pytest.importorskip("xacro")
    text = ARM.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    text = text.replace('<box size="1 2 3"/>', '<xacro:arg name="z" default="4"/><box size="${1} ${1 + 1} $(arg z)"/>')
    robot = robots.load(write(text, "arm.urdf.xacro"), xacro_args={"z": "3"})
    assert robot.links[0].collisions[0].shape == robots.BoxShape((1, 2, 3)) and robot.nq == 3
    with pytest.raises(prolate.Error, match="xacro: "):
        robots.load(write(text.replace("${1}", "${one}"), "broken.xacro"))


def test_xacro_finds_packages(write, tmp_path):
    pytest.importorskip("xacro")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "sizes.xacro").write_text(
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="one" value="1"/></robot>'
    )
    text = ARM.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    text = text.replace("<link", '<xacro:include filename="$(find sizes)/sizes.xacro"/><link', 1)
    path = write(text.replace('<box size="1 2 3"/>', '<box size="${one} 2 3"/>'), "find.xacro")
    robot = robots.load(path, packages={"sizes": tmp_path / "elsewhere"})
    assert robot.links[0].collisions[0].shape == robots.BoxShape((1, 2, 3))
    with pytest.raises(prolate.Error, match=r"find sizes\): there is no package sizes .* --package sizes=FOLDER"):
        robots.load(path)
    assert "ament_index_python" not in sys.modules
