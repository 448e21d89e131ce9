"""A robot written in each format and read again is the same robot."""

from __future__ import annotations

import numpy as np
import pytest
from robot_files import TETRAHEDRON, frames, link, texts

pytest.importorskip("lxml")
pytest.importorskip("scipy")
from prolate import robots

pytestmark = pytest.mark.usefixtures("own_folder")

INERTIAL = """<inertial><origin xyz="0.1 0.2 0.3" rpy="1 2 3"/><mass value="2"/>
<inertia ixx="3" ixy="0.1" ixz="0.2" iyy="4" iyz="0.3" izz="5"/></inertial>"""
SHAPES = """<collision><origin xyz="1 2 3" rpy="0.3 1.5707963267948966 0.1"/><geometry>
<cylinder radius="1" length="2"/></geometry></collision><collision><origin rpy="-1 0.5 2"/><geometry>
<mesh filename="part.obj" scale="1 -1 2"/></geometry></collision>"""
ROBOT = f"""<robot name="round"><link name="base">{INERTIAL}</link><link name="a">{INERTIAL}{SHAPES}</link>
<link name="b">{INERTIAL}{SHAPES}</link><link name="c">{INERTIAL}</link>
<joint name="ja" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/>
<axis xyz="1 2 -2"/><limit lower="-1" upper="2" velocity="3" effort="4"/></joint>
<joint name="jb" type="prismatic"><parent link="a"/><child link="b"/><origin rpy="0 -1.5707963267948966 1"/>
<axis xyz="0 0.6 0.8"/><limit lower="0.5" upper="1.5" velocity="3" effort="4"/></joint>
<joint name="jc" type="continuous"><parent link="a"/><child link="c"/><axis xyz="0 0 1"/></joint></robot>"""


@pytest.fixture(scope="module")
def exact(tmp_path_factory):
    folder = tmp_path_factory.mktemp("round")
    (folder / "part.obj").write_text(TETRAHEDRON)
    (folder / "robot.urdf").write_text(ROBOT)
    return robots.Robot(robots.load(folder / "robot.urdf")).bake(only="hull", clearance=10)


WRITERS = {"robot.xml": robots.write_mjcf, "robot.sdf": robots.write_sdf, "robot.urdf": robots.write_urdf}


@pytest.mark.parametrize("name", WRITERS)
def test_what_is_written_is_read_as_the_same_robot(exact, tmp_path, name):
    if name == "robot.xml":
        pytest.importorskip("mujoco")
    WRITERS[name](exact, tmp_path / name)
    one, other = exact.description, robots.load(tmp_path / name)
    assert not texts(other, "error") and not texts(other, "warning")
    assert [joint.name for joint in other.joints if joint.coordinates] == ["ja", "jb", "jc"]
    for q in np.random.default_rng(5).uniform([-1, 0.5, -3], [2, 1.5, 3], (10, 3)):
        ours, theirs = frames(one, q), frames(other, q)
        base = np.linalg.inv(theirs["base"])
        for part in ours:
            np.testing.assert_allclose(base @ theirs[part], ours[part], atol=1e-14)
    for part in one.links:
        again = link(other, part.name)
        assert again.inertial.mass == part.inertial.mass
        np.testing.assert_allclose(tensor(again), tensor(part), rtol=1e-9, atol=1e-12)
        covers = exact.covers[part.name].geometries if part.name in exact.covers else ()
        np.testing.assert_allclose(middles(again.collisions), middles(covers), atol=1e-6)


def tensor(part):
    """Inertia in the link's axes, and the centre of mass."""
    turn = part.inertial.pose[:3, :3]
    return np.vstack([turn @ part.inertial.inertia @ turn.T, part.inertial.pose[:3, 3]])


def middles(geometries):
    """The middles of all boxes around them, in the link's frame, sorted."""
    out = []
    for one in geometries:
        points = one.shape.vertices if isinstance(one.shape, robots.MeshShape) else np.zeros((1, 3))
        points = points @ one.pose[:3, :3].T + one.pose[:3, 3]
        out.append((points.min(axis=0) + points.max(axis=0)) / 2)
    return np.array(sorted(map(tuple, out))).reshape(-1, 3)
