"""MJCF as prolate.robots reads it, against MuJoCo's own kinematics."""

from __future__ import annotations

import numpy as np
import pytest
from robot_files import TETRAHEDRON, frames, from_quaternion, link, texts, volume

import prolate

pytest.importorskip("lxml")
mujoco = pytest.importorskip("mujoco")
pytestmark = pytest.mark.usefixtures("own_folder")
from prolate import robots  # noqa: E402

ROBOT = """<mujoco model="thing">
<compiler angle="degree" eulerseq="zyx"/>
<default>
  <default class="small"><geom type="capsule" size=".1"/><joint damping="0.5" range="-30 50"/></default>
</default>
<asset>
  <mesh name="file" file="part.obj" scale="1 -2 0.5" refpos="0.1 0.2 0.3" refquat="0.5 0.1 -0.7 0.3"/>
  <mesh name="inline" vertex="0 0 0  1 0 0  0 1 0  0 0 1" refpos="0.2 0 0"/>
  <material name="paint" texture="none"/><texture name="none" type="2d" file="none.png"/>
</asset>
<worldbody>
  <geom name="floor" type="plane" size="1 1 1"/>
  <body name="free" pos="1 2 3" euler="10 20 30">
    <freejoint name="root"/>
    <geom name="rod" class="small" fromto="0 0 0 1 1 2"/>
    <geom name="seen" type="box" size="1 2 3" contype="0" conaffinity="0" mass="0"/>
    <frame pos="0.5 0 0" euler="0 40 0">
      <body name="arm" pos="0 0 1" axisangle="1 1 0 35">
        <joint name="a" class="small" axis="0 1 1" pos="0.1 0.2 0.3" ref="20"/>
        <joint name="b" class="small" type="slide" axis="1 0 2" pos="1 0 0" limited="false"/>
        <geom name="mesh" type="mesh" mesh="file" pos="0.3 0 0" euler="20 -30 40" material="paint"/>
        <body name="ball" pos="0 1 0"><joint type="ball" pos="0 0 0.5"/>
          <geom name="inline" type="mesh" mesh="inline" quat="1 2 3 4" group="3"/>
          <geom type="ellipsoid" size="0.1 0.2 0.3"/></body>
        <body name="led" pos="0 0 2"><joint name="c" axis="1 0 0" ref="5"/><geom type="cylinder" size="0.1 0.2"/></body>
      </body>
    </frame>
  </body>
  <body name="apart"><geom type="sphere" size="0.5" contype="2" conaffinity="4"/></body>
</worldbody>
<contact><exclude body1="led" body2="free"/></contact>
<equality><joint joint1="c" joint2="a" polycoef="0.1 2 0 0 0"/></equality>
</mujoco>
"""


@pytest.fixture
def write(tmp_path):
    (tmp_path / "part.obj").write_text(TETRAHEDRON)

    def to(text):
        path = tmp_path / "robot.xml"
        path.write_text(text)
        return path

    return to


def of_mujoco(write):
    """The model as MuJoCo makes it, without the texture that there is not."""
    text = ROBOT.replace(' texture="none"', "").replace('<texture name="none" type="2d" file="none.png"/>', "")
    return mujoco.MjModel.from_xml_path(str(write(text)))


def test_frames_are_those_of_mujoco(write):
    model = of_mujoco(write)
    robot = robots.load(write(ROBOT))
    data, rng = mujoco.MjData(model), np.random.default_rng(2)
    kinds = {joint.name: (joint.kind, joint.coordinates) for joint in robot.joints}
    assert kinds["root"] == ("floating", 7) and kinds["a"] == ("revolute", 1) and kinds["b"] == ("prismatic", 1)
    assert kinds["c"] == ("continuous", 0) and robot.nq == 13
    for _ in range(20):
        qpos = rng.normal(size=model.nq)
        mujoco.mj_normalizeQuat(model, qpos)
        a, c = (model.joint(name).qposadr[0] for name in "ac")
        qpos[c] = model.qpos0[c] + 0.1 + 2 * (qpos[a] - model.qpos0[a])  # as the equality says
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        free, (ra, rb), ball = qpos[:7], qpos[7:9], qpos[9:13]
        q = [*free[:3], *free[4:], free[3], ra, rb, *ball[1:], ball[0]]
        ours = frames(robot, q)
        for body in range(model.nbody):
            pose = from_quaternion(*data.xquat[body][[1, 2, 3, 0]])
            pose[:3, 3] = data.xpos[body]
            np.testing.assert_allclose(ours[model.body(body).name], pose, atol=1e-12)


def test_home_is_qpos0(write):
    robot, model = robots.load(write(ROBOT)), of_mujoco(write)
    qpos = model.qpos0
    assert np.allclose(robot.home, [*qpos[:3], *qpos[4:7], qpos[3], *qpos[7:9], *qpos[10:13], qpos[9]])


def test_geoms_lie_where_mujoco_puts_them(write):
    """All vertices and sizes, in the frame of their body."""
    robot, model = robots.load(write(ROBOT)), of_mujoco(write)
    arm, ball, free = (link(robot, name) for name in ("arm", "ball", "free"))
    for geometry in (arm.collisions[0], ball.collisions[0]):
        geom = model.geom(geometry.name)
        start, count = (int(x[geom.dataid[0]]) for x in (model.mesh_vertadr, model.mesh_vertnum))
        theirs = model.mesh_vert[start : start + count] @ from_quaternion(*geom.quat[[1, 2, 3, 0]])[:3, :3].T + geom.pos
        ours = geometry.shape.vertices @ geometry.pose[:3, :3].T + geometry.pose[:3, 3]
        gaps = np.linalg.norm(ours[:, None] - theirs[None], axis=2)
        assert gaps.min(axis=0).max() < 1e-6 and gaps.min(axis=1).max() < 1e-6
        assert volume(geometry.shape) > 0
    rod = free.collisions[0]
    assert rod.shape.radius == 0.1 and np.isclose(rod.shape.length, 6**0.5)
    np.testing.assert_allclose(rod.pose[:3, 3], [0.5, 0.5, 1])
    np.testing.assert_allclose(np.abs(rod.pose[:3, 2]), np.array([1, 1, 2]) / 6**0.5)
    assert ball.collisions[1].shape == robots.EllipsoidShape((0.1, 0.2, 0.3))
    assert [geometry.name for geometry in free.visuals] == ["rod", "seen"] and len(free.collisions) == 1
    assert len(ball.visuals) == 1  # group 3 is not shown
    assert isinstance(robot.links[0].collisions[0].shape, robots.PlaneShape)


def test_joints_say_what_the_file_says(write):
    joints = {joint.name: joint for joint in robots.load(write(ROBOT)).joints}
    assert np.allclose((joints["a"].lower, joints["a"].upper), np.radians([-30, 50])) and joints["a"].damping == 0.5
    assert joints["b"].lower == -np.inf and joints["a"].where.line == 19
    mimic = joints["c"].mimic
    assert mimic.joint == "a" and np.isclose(mimic.offset, np.radians(5) + 0.1 - 2 * np.radians(20))


def test_pairs_that_never_collide(write):
    disabled = robots.load(write(ROBOT)).disabled
    assert disabled.pop(("free", "led")) == "exclude"
    assert disabled.pop(("arm", "free")) == "adjacent"  # two joints are between them
    assert set(disabled) == {tuple(sorted(("apart", other))) for other in ("world", "free", "arm", "ball", "led")}
    assert set(disabled.values()) == {"contype and conaffinity"}


def test_inertia_is_the_bodys_own(write):
    robot, model = robots.load(write(ROBOT)), of_mujoco(write)
    for name in ("free", "arm", "ball", "led"):
        body, inertial = model.body(name), link(robot, name).inertial
        axes = from_quaternion(*body.iquat[[1, 2, 3, 0]])[:3, :3]
        turned = inertial.pose[:3, :3] @ inertial.inertia @ inertial.pose[:3, :3].T
        assert np.isclose(inertial.mass, body.mass[0])
        np.testing.assert_allclose(turned, axes @ np.diag(body.inertia) @ axes.T, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(inertial.pose[:3, 3], body.ipos)


def test_a_missing_mesh_is_named_and_the_rest_goes_on(write):
    robot = robots.load(write(ROBOT.replace("part.obj", "none.obj")))
    (error,) = texts(robot, "error")
    assert "robot.xml:21: link arm: " in error and "none.obj" in error and "left out" in error
    assert not link(robot, "arm").collisions and len(link(robot, "ball").collisions) == 2


def test_a_moving_body_without_a_mass_gets_a_warning(write):
    text = ROBOT.replace('<geom type="cylinder" size="0.1 0.2"/>', "")
    (warning,) = texts(robots.load(write(text)), "warning")
    assert "link led" in warning and "is zero" in warning


def test_what_mujoco_fits_or_cannot_be_covered_is_named(write):
    text = ROBOT.replace('type="ellipsoid" size="0.1 0.2 0.3"', 'type="ellipsoid" mesh="file"')
    (warning,) = texts(robots.load(write(text)), "warning")
    assert "link ball" in warning and "stick out" in warning
    field = '<hfield name="hills" nrow="2" ncol="2" size="1 1 1 1"/></asset>'
    text = ROBOT.replace("</asset>", field).replace('type="plane" size="1 1 1"', 'type="hfield" hfield="hills"')
    (error,) = texts(robots.load(write(text)), "error")
    assert "type hfield" in error


def test_what_mujoco_refuses_is_refused_in_its_words(write):
    with pytest.raises(prolate.Error, match=r"robot\.xml: MuJoCo: .*none") as error:
        robots.load(write(ROBOT.replace('class="small" fromto', 'class="none" fromto')))
    assert error.value.code == "bad_file"


@pytest.mark.filterwarnings("ignore:XML contains a 'NaN'")
@pytest.mark.parametrize(("old", "new"), [('axis="0 1 1"', 'axis="0 nan 1"'), ('pos="0 1 0"', 'pos="0 nan 0"')])
def test_numbers_that_are_not_finite_are_refused(write, old, new):
    assert old in ROBOT
    with pytest.raises(prolate.Error, match=r"robot\.xml: MuJoCo") as error:
        robots.load(write(ROBOT.replace(old, new)))
    assert error.value.code == "bad_file"


def test_what_other_readers_lose(tmp_path):
    """Copies, ends, and what a class says of a mesh's scale and a geom's place: findings/*mjcf*.sh."""
    (tmp_path / "part.obj").write_text(TETRAHEDRON)
    path = tmp_path / "robot.xml"
    path.write_text("""<mujoco>
<default>
  <default class="small"><mesh scale="0.001 0.002 0.003"/></default>
  <default class="place"><geom type="box" size="0.1 0.2 0.3" pos="1 0 0" euler="0 90 0"/></default>
</default>
<asset><mesh name="part" class="small" file="part.obj"/></asset>
<worldbody>
  <replicate count="2" offset="0 0 5">
    <body name="rack"><joint name="j"/><replicate count="3" offset="0 2 0"><geom class="place"/></replicate></body>
  </replicate>
  <body name="rod"><joint/><geom type="ellipsoid" fromto="0 0 0 4 0 0" size="0.1"/>
    <geom type="box" fromto="0 0 0 4 0 0" size="0.1"/><geom type="mesh" mesh="part"/></body>
</worldbody>
</mujoco>""")
    robot = robots.load(path)
    for rack in ("rack0", "rack1"):
        boxes = link(robot, rack).collisions
        assert [box.shape for box in boxes] == 3 * [robots.BoxShape((0.2, 0.4, 0.6))]
        np.testing.assert_allclose([box.pose[:3, 3] for box in boxes], [[1, 0, 0], [1, 2, 0], [1, 4, 0]])
        np.testing.assert_allclose([np.abs(box.pose[:3, 0]) for box in boxes], 3 * [[0, 0, 1]], atol=1e-12)
    ellipsoid, box, mesh = link(robot, "rod").collisions
    assert ellipsoid.shape == robots.EllipsoidShape((0.1, 0.1, 2)) and box.shape == robots.BoxShape((0.2, 0.2, 4))
    for geometry in (ellipsoid, box):
        np.testing.assert_allclose(geometry.pose[:3, 3], [2, 0, 0])
        np.testing.assert_allclose(np.abs(geometry.pose[:3, 2]), [1, 0, 0], atol=1e-12)
    corners = [[float(x) for x in line.split()[1:]] for line in TETRAHEDRON.splitlines() if line.startswith("v ")]
    placed = mesh.shape.vertices @ mesh.pose[:3, :3].T + mesh.pose[:3, 3]
    gaps = np.linalg.norm(placed[:, None] - np.array(corners) * [0.001, 0.002, 0.003], axis=2)
    assert gaps.min(axis=0).max() < 1e-9 and gaps.min(axis=1).max() < 1e-9
