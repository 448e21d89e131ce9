"""The page of a robot: what it computes by itself, run by node, against the library."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from conftest import box_mesh, matrix
from prolate.robots import (
    BoxShape,
    CapsuleShape,
    CylinderShape,
    Description,
    Geometry,
    Joint,
    Link,
    MeshShape,
    Robot,
    SphereShape,
    render,
    view_page,
)
from prolate.robots._xml import rpy_matrix

# What the script finds in a browser: a document that holds the robot, and a picture that takes everything.
BROWSER = """
const any = new Proxy(function () {}, {
  get: (target, key) => (key === Symbol.toPrimitive ? () => 1 : key === Symbol.iterator ? function* () {} : any),
  apply: () => any, set: () => true,
});
const document = {getElementById: (id) => (id === 'robot' ? {textContent: ROBOT} : any), createElement: () => any};
const window = any, location = {hash: ''};
"""
REPORT = """
console.log(JSON.stringify({
  found: CONFIGURATIONS.map((q) => ({frames: framesOf(q), pairs: touchingPairs(framesOf(q))})),
  turns: ANGLES.map((a) => [quaternionOf(a), quaternionOf(anglesOf(quaternionOf(a)))]),
}));
"""

# Roll, pitch, yaw; also with a pitch of a quarter turn.
ANGLES = [[0, 0, 0], [0.5, -1.2, 3], [-3, 0.1, -2], [0.4, np.pi / 2, -0.9], [2, -np.pi / 2, 1]]


def robot_of(shapes, kinds):
    """A chain of one shape a link, turned and moved in its link's frame."""
    rng = np.random.default_rng(3)

    def pose(spread):
        q = rng.normal(size=4)
        return matrix([*rng.normal(size=3) * spread, *q / np.linalg.norm(q)])

    links = tuple(Link(f"l<{i}>", (Geometry(shape, pose(0.05)),)) for i, shape in enumerate(shapes))
    joints = []
    for i, kind in enumerate(kinds):
        axis = rng.normal(size=3)
        joints.append(
            Joint(f"j{i}", kind, links[i].name, links[i + 1].name, pose(0.08), tuple(axis / np.linalg.norm(axis)),
                  tuple(rng.normal(size=3) * 0.1), zero=0.3 if kind == "revolute" else 0.0, lower=-2, upper=2)
        )  # fmt: skip
    return Description("a </script> robot", links, tuple(joints), Path("robot"), "urdf")


def hull(size):
    vertices, faces = box_mesh((size, size, 2 * size))
    return MeshShape(vertices, faces)


@pytest.fixture(scope="module")
def baked():
    shapes = [BoxShape((0.2, 0.1, 0.3)), hull(0.1), BoxShape((0.1, 0.3, 0.1)), hull(0.08), BoxShape((0.1, 0.1, 0.2)),
              CylinderShape(0.1, 0.3), CapsuleShape(0.08, 0.2), SphereShape(0.12)]  # fmt: skip
    kinds = ("revolute", "planar", "prismatic", "ball", "continuous", "floating", "revolute")
    return Robot(robot_of(shapes, kinds)).bake(exact=True), Robot(robot_of(shapes, kinds)).bake(clearance=0.01)


def test_the_page_holds_the_robot_and_loads_nothing(baked):
    page = view_page(baked[1])
    assert page.count("</script>") == 2 and "@ROBOT@" not in page
    assert not re.search(r'\b(src|href)="(?!data:)', page)
    data = json.loads(re.search(r'id="robot">(.*?)</script>', page, re.DOTALL)[1])
    assert data["name"] == "a </script> robot" and len(data["links"]) == 8
    assert [link["row"][0] for link in data["links"]] == [cover.kind for cover in baked[1].covers.values()]
    # Covers stick out by no more than they say, and the colours' scale ends there.
    assert 0 <= data["most"] <= max(cover.clearance for cover in baked[1].covers.values()) + 0.01


def test_the_page_computes_what_the_library_does(baked, tmp_path):
    if shutil.which("node") is None:
        pytest.skip("no node to run the page's script with")
    checks = baked[1].checks
    q = checks.kinematics.random(60, seed=4)
    q[:, [1, 2, 4, 10, 11, 12]] *= 0.1  # all lengths, so that links meet
    page = view_page(baked[1])
    data = re.search(r'id="robot">(.*?)</script>', page, re.DOTALL)[1]
    script = re.search(r'<script nonce="robot">(.*?)</script>', page, re.DOTALL)[1]
    program = tmp_path / "page.js"
    program.write_text(
        f"const ROBOT = {json.dumps(data)}, CONFIGURATIONS = {json.dumps(q.tolist())}, ANGLES = {json.dumps(ANGLES)};"
        f"{BROWSER}{script}{REPORT}"
    )
    done = subprocess.run(["node", str(program)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    found, turns = json.loads(done.stdout).values()
    for angles, both in zip(ANGLES, turns):  # of sliders, there and back
        for quaternion in both:
            np.testing.assert_allclose(matrix([0, 0, 0, *quaternion])[:3, :3], rpy_matrix(angles), atol=1e-12)

    frames = checks.fk(q)
    pairs, each = checks.pairs(), checks.collide(q, first_only=False)
    flat = {f"l<{i}>" for i in range(5)}  # links of flat faces, whose trees are no larger than the bodies
    touched = 0
    for i, one in enumerate(found):
        for link, rows in enumerate(one["frames"]):
            assert np.abs(np.reshape(rows, (3, 4)) - matrix(frames[link, i])[:3]).max() < 1e-12
        there = {tuple(pair) for pair in one["pairs"]}
        for k, pair in enumerate(pairs):
            meets = (int(pair.link[2:-1]), int(pair.other[2:-1])) in there
            touched += meets
            assert each[i, k] or not meets
            if {pair.link, pair.other} <= flat:
                assert each[i, k] == meets
    assert touched > 50


def two_boxes():
    """A box of 0.4 x 0.2 x 0.2 that stands, and a smaller one that slides along x."""
    links = (Link("a", (Geometry(BoxShape((0.4, 0.2, 0.2))),)), Link("b"), Link("c", (Geometry(BoxShape((0.2,) * 3)),)))
    joints = (Joint("rest", "fixed", "a", "b"), Joint("x", "prismatic", "b", "c", axis=(1, 0, 0), lower=-1, upper=1))
    first = Joint("turn", "revolute", "b", "d")
    last = Link("d", (Geometry(BoxShape((0.01,) * 3)),))
    return Robot(Description("two", (*links, last), (*joints, first), Path("two"), "urdf")).bake(exact=True)


def test_a_picture_shows_what_is_there():
    robot = two_boxes()
    # From the side: a spans x from -0.2 to 0.2, c from 0.4 to 0.6, both z from -0.1 to 0.1; white around them.
    apart = render(robot, [0.5, 0.0], size=(400, 200), view=(-90, 0), covers="none", samples=1)
    assert apart.shape == (200, 400, 3) and apart.dtype == np.uint8
    drawn = (apart < 255).any(axis=2)
    scale = 0.92 * 400 / 0.8
    columns = np.flatnonzero(drawn.any(axis=0))
    assert abs(columns[-1] - columns[0] + 1 - 0.8 * scale) <= 2
    assert abs(drawn.sum() - (0.4 + 0.2) * 0.2 * scale**2) < 500
    gap = int(200 + (0.3 - 0.2) * scale)  # in the middle between the two
    assert not drawn[:, gap].any() and drawn[100, gap - 60] and drawn[100, gap + 60]


def test_a_picture_is_red_where_links_touch():
    robot = two_boxes()

    def red(picture):
        part = picture.astype(int)
        return (part[..., 0] > 1.8 * part[..., 1]) & (part[..., 0] > 1.8 * part[..., 2])

    options = {"size": (120, 80), "samples": 1, "covers": "none"}
    assert red(render(robot, [0.0, 0.3], **options)).sum() > 500  # c is around d
    assert not red(render(robot, [0.5, 0.0], **options)).any()
    assert (render(robot, size=(20, 10), meshes=False, covers="none") == 255).all()
    with pytest.raises(ValueError, match="covers: 'red'"):
        render(robot, covers="red")


def test_heat_is_of_the_cover(baked):
    plain = render(baked[1], size=(60, 40), covers="colour", meshes=False, samples=1)
    hot = render(baked[1], size=(60, 40), covers="heat", meshes=False, samples=1)
    assert ((plain < 255).any(axis=2) == (hot < 255).any(axis=2)).all() and (plain != hot).any()
