"""SDF as prolate.robots reads it: one robot said in several ways must be one robot."""

from __future__ import annotations

import numpy as np
import pytest
from robot_files import TETRAHEDRON, frames, link, texts, volume

import prolate

pytest.importorskip("lxml")
from prolate import robots

URDF = """<robot name="r"><link name="base"/><link name="a"/><link name="b"/>
<joint name="ja" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/>
<axis xyz="1 2 -2"/><limit lower="-1" upper="2" velocity="3" effort="4"/></joint>
<joint name="jb" type="prismatic"><parent link="a"/><child link="b"/><origin xyz="1 0 2" rpy="-1 0.2 3"/>
<axis xyz="0 3 4"/><limit lower="0" upper="2"/></joint></robot>"""

RELATIVE = """<sdf version="1.7"><model name="r"><pose>5 6 7 1 1 1</pose>
<link name="base"/>
<frame name="middle" attached_to="base"><pose>0.1 0.2 0.3 0.4 0.5 0.6</pose></frame>
<link name="a"><pose relative_to="ja"/></link>
<joint name="ja" type="revolute"><pose relative_to="middle"/><parent>base</parent><child>a</child>
<axis><xyz>1 2 -2</xyz>
<limit><lower>-1</lower><upper>2</upper><velocity>3</velocity><effort>4</effort></limit></axis></joint>
<link name="b"><pose relative_to="a">1 0 2 -1 0.2 3</pose></link>
<joint name="jb" type="prismatic"><parent>a</parent><child>b</child>
<axis><xyz expressed_in="b">0 3 4</xyz><limit><lower>0</lower><upper>2</upper></limit></axis></joint>
</model></sdf>"""


@pytest.fixture
def write(tmp_path):
    (tmp_path / "part.obj").write_text(TETRAHEDRON)

    def to(text, name="robot.sdf"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return to


def in_model(matrix):
    """A pose as text."""
    r = matrix[:3, :3]
    rpy = np.arctan2(r[2, 1], r[2, 2]), -np.arcsin(r[2, 0]), np.arctan2(r[1, 0], r[0, 0])
    return " ".join(repr(float(x)) for x in (*matrix[:3, 3], *rpy))


def absolute(robot):
    """The same robot with every pose in the model's frame and joints with a pose of their own, as SDF 1.4 has it."""
    home = frames(robot, [0, 0])
    axes = {"ja": home["a"][:3, :3] @ [1, 2, -2], "jb": home["b"][:3, :3] @ [0, 3, 4]}
    text = ["{}".format(" ".join(map(repr, map(float, axes[name])))) for name in ("ja", "jb")]
    return f"""<sdf version="1.4"><world name="w"><model name="r">
<link name="b"><pose>{in_model(home["b"])}</pose></link>
<link name="a"><pose>{in_model(home["a"])}</pose></link>
<link name="base"/>
<joint name="jb" type="prismatic"><pose>0.3 0.1 0.2 0.7 0.8 0.9</pose><parent>a</parent><child>b</child>
<axis><xyz>{text[1]}</xyz><limit><lower>0</lower><upper>2</upper></limit></axis></joint>
<joint name="ja" type="revolute"><parent>base</parent><child>a</child>
<axis><xyz>{text[0]}</xyz><limit><lower>-1</lower><upper>2</upper></limit></axis></joint>
</model></world></sdf>"""


def test_the_same_robot_in_urdf_and_sdf(write):
    urdf = robots.load(write(URDF, "robot.urdf"))
    relative, plain = robots.load(write(RELATIVE)), robots.load(write(absolute(urdf), "plain.sdf"))
    turned = RELATIVE.replace("<pose>0.1 0.2 0.3 0.4 0.5 0.6<", '<pose degrees="true">0.1 0.2 0.3 {} {} {}<').format(
        *np.degrees([0.4, 0.5, 0.6])
    )
    for robot in (relative, plain, robots.load(write(turned, "degrees.sdf"))):
        assert robot.format == "sdf" and not robot.notes and robot.links[0].name == "base"
        for q in np.random.default_rng(3).uniform([-1, 0], [2, 2], (20, 2)):
            theirs, ours = frames(urdf, q), frames(robot, q)
            for name in theirs:
                np.testing.assert_allclose(ours[name], theirs[name], atol=1e-12)
    assert [(joint.lower, joint.upper, joint.velocity) for joint in relative.joints] == [(-1, 2, 3), (0, 2, np.inf)]


def test_a_joint_off_the_links_origin_turns_about_its_own_place(write):
    text = """<sdf version="1.9"><model name="r"><link name="base"/><link name="a"/>
<joint name="j" type="revolute"><pose>1 0 0 0 0 0</pose><parent>base</parent><child>a</child>
<axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"""
    robot = robots.load(write(text))
    assert robot.joints[0].kind == "continuous"
    np.testing.assert_allclose(frames(robot, [np.pi / 2])["a"][:3, 3], [1, -1, 0], atol=1e-15)


def test_joints_of_two_axes_and_nested_models(write):
    text = """<sdf version="1.9"><model name="r"><link name="base"/>
<model name="in"><pose relative_to="base">0 0 1 0 0 0</pose><link name="a"/>
<frame name="tip"><pose>1 0 0 0 0 0</pose></frame></model>
<joint name="j" type="universal"><parent>base</parent><child>in::tip</child>
<axis><xyz>1 0 0</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis><axis2><xyz>0 1 0</xyz></axis2></joint>
<joint name="w" type="fixed"><parent>world</parent><child>base</child></joint>
</model></sdf>"""
    robot = robots.load(write(text))
    assert [joint.kind for joint in robot.joints] == ["fixed", "revolute", "continuous"]
    assert [one.name for one in robot.links] == ["world", "base", "j::between", "in::a"]
    out = frames(robot, [0.5, -0.25])["in::a"]
    x, y = 0.5, -0.25
    rx = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    ry = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    np.testing.assert_allclose(out[:3, :3], rx @ ry, atol=1e-15)
    np.testing.assert_allclose(out[:3, 3], np.array([1, 0, 1]) - rx @ ry @ [1, 0, 0], atol=1e-15)
    assert "becomes two" in texts(robot, "info")[0]


def test_shapes(write):
    shapes = [
        ("<box><size>1 2 3</size></box>", robots.BoxShape((1, 2, 3))),
        ("<sphere><radius>2</radius></sphere>", robots.SphereShape(2)),
        ("<cylinder><radius>1</radius><length>4</length></cylinder>", robots.CylinderShape(1, 4)),
        ("<capsule><radius>1</radius><length>4</length></capsule>", robots.CapsuleShape(1, 4)),
        ("<ellipsoid><radii>1 2 3</radii></ellipsoid>", robots.EllipsoidShape((1, 2, 3))),
        ("<plane><normal>1 0 0</normal></plane>", robots.PlaneShape()),
        ("<mesh><uri>part.obj</uri><scale>1 -1 2</scale></mesh>", None),
        ("<empty/>", "none"),
        ("<cone><radius>1</radius></cone>", "bad"),
    ]
    inside = "\n".join(
        f'<collision name="{i}"><pose>0 0 {i} 0 0 0</pose><geometry>{text}</geometry></collision>'
        for i, (text, _) in enumerate(shapes)
    )
    robot = robots.load(write(f'<sdf version="1.10"><model name="r"><link name="a">\n{inside}</link></model></sdf>'))
    collisions = link(robot, "a").collisions
    assert [geometry.shape for geometry in collisions[:6]] == [shape for _, shape in shapes[:6]]
    assert [geometry.pose[2, 3] for geometry in collisions] == [0, 1, 2, 3, 4, 5, 6]
    np.testing.assert_allclose(collisions[5].pose[:3, 2], [1, 0, 0])
    assert np.isclose(volume(collisions[6].shape), 2)
    (error,) = texts(robot, "error")
    assert "robot.sdf:10: link a: <cone>: is not understood" in error


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('relative_to="middle"', 'relative_to="muddle"', "no link, joint or frame muddle"),
        ('attached_to="base"><pose>', 'attached_to="base"><pose relative_to="ja">', "is relative to itself"),
        ("<child>b</child>", "<child>c</child>", "no link, joint or frame c"),
        ('type="prismatic"', 'type="screw"', "of type screw is not understood"),
        ("<xyz>1 2 -2</xyz>", "<xyz>0 0 0</xyz>", "has no direction"),
        ("<lower>-1</lower>", "<lower>3</lower>", "lower 3 is above upper 2"),
        ("<lower>-1</lower>", "<lower>x</lower>", "must be one number, not 'x'"),
    ],
)
def test_broken_frames_and_joints_are_named(write, old, new, said):
    assert old in RELATIVE
    robot = robots.load(write(RELATIVE.replace(old, new)))
    errors = texts(robot, "error")
    assert said in " ".join(errors) and all("robot.sdf:" in error for error in errors)
    assert robot.links[0].name in ("base", "a")


def test_what_is_left_out_is_named(write):
    text = RELATIVE.replace(
        "</model>", "<include><uri>https://fuel/wheel</uri></include><plugin/></model><model name='s'/>"
    )
    robot = robots.load(write(text))
    assert "https://fuel/wheel: only package://, model:// and file://" in texts(robot, "error")[0]
    assert "model s: only the first model" in texts(robot, "warning")[0]
    assert "<plugin> in <model> is not understood" in texts(robot, "info")[0]
    with pytest.raises(prolate.Error, match="has no <model>"):
        robots.load(write('<sdf version="1.7"/>'))


WHEEL = """<sdf version="1.4"><model name="wheel"><pose>9 9 9 0 0 0</pose><link name="rim">
<pose>0 0 0 0 0 1</pose>
<collision name="c"><geometry><mesh><uri>tyre.obj</uri></mesh></geometry></collision></link><link name="cap"/>
<joint name="spin" type="revolute"><parent>rim</parent><child>cap</child><axis><xyz>0 1 0</xyz></axis></joint>
</model></sdf>"""


@pytest.fixture
def wheel(tmp_path):
    folder = tmp_path / "models" / "wheel"
    folder.mkdir(parents=True)
    (folder / "wheel.sdf").write_text(WHEEL)
    (folder / "tyre.obj").write_text(TETRAHEDRON)
    (folder / "model.config").write_text('<model><sdf version="1.4">wheel.sdf</sdf><sdf version="1.3">x</sdf></model>')
    return folder


def test_includes_are_nested_models(write, wheel):
    text = RELATIVE.replace(
        "</model>",
        '<include><uri>model://wheel</uri><name>left</name><pose relative_to="a">1 2 3 0 0 0.5</pose></include>'
        "<include><uri>models/wheel/wheel.sdf</uri></include>"
        '<joint name="weld" type="fixed"><parent>a</parent><child>left::rim</child></joint>'
        '<joint name="other" type="fixed"><parent>b</parent><child>wheel::rim</child></joint></model>',
    )
    robot = robots.load(write(text), packages={"wheel": wheel})
    assert not robot.notes and {one.name for one in robot.links} == {
        "base", "a", "left::rim", "left::cap", "b", "wheel::rim", "wheel::cap",
    }  # fmt: skip
    home = frames(robot, [0] * robot.nq)
    turn = lambda angle: np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])  # noqa: E731
    there = np.linalg.inv(home["a"]) @ home["left::rim"]
    np.testing.assert_allclose(there[:3, 3], [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(there[:2, :2], turn(1.5), atol=1e-12)
    np.testing.assert_allclose(home["wheel::rim"][:3, 3], [9, 9, 9], atol=1e-12)  # as the wheel itself says
    # An axis is along the model's in SDF 1.4, whatever the version of the file that includes it.
    spin = next(joint for joint in robot.joints if joint.name == "left::spin")
    np.testing.assert_allclose(home["left::cap"][:3, :3] @ spin.axis, home["a"][:3, :3] @ [*(turn(0.5) @ [0, 1]), 0])
    assert np.isclose(volume(link(robot, "left::rim").collisions[0].shape), 1)


def test_a_world_that_only_includes(write, wheel):
    text = '<sdf version="1.6"><world name="w"><include><uri>model://wheel</uri></include></world></sdf>'
    robot = robots.load(write(text), packages={"wheel": wheel})
    assert [one.name for one in robot.links] == ["rim", "cap"] and not robot.notes


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ('<include merge="true"><uri>model://wheel</uri></include>', "merge= is not understood"),
        ("<include><uri>model://tyre</uri></include>", "there is no package tyre"),
        ("<include><uri>models/wheel/none.sdf</uri></include>", "there is no file"),
        ("<include><uri>models/wheel/tyre.obj</uri></include>", "is not XML"),
        ("<include><uri>robot.sdf</uri></include>", "includes itself"),
        ("<include/>", "there is no file"),
    ],
)
def test_includes_that_cannot_be_followed_are_named(write, wheel, wrong, said):
    robot = robots.load(write(RELATIVE.replace("</model>", f"\n{wrong}</model>")), packages={"wheel": wheel})
    (error,) = texts(robot, "error")
    assert said in error and "robot.sdf:12: <include>" in error and len(robot.links) == 3


def test_what_is_wrong_with_an_included_model_names_its_file(write, wheel):
    (wheel / "tyre.obj").unlink()
    robot = robots.load(
        write(RELATIVE.replace("</model>", "<include><uri>models/wheel</uri></include></model>")),
    )
    assert any("wheel.sdf:3: link wheel::rim: " in error and "tyre.obj" in error for error in texts(robot, "error"))
