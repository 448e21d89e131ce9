"""Forward kinematics and checks of robots, against slow references in double precision."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import prolate
from conftest import matrix
from prolate.robots import (
    BoxShape,
    Checks,
    Description,
    Geometry,
    Joint,
    Kinematics,
    Link,
    Mimic,
    PointCloud,
    Robot,
    Scene,
)

KINDS = ("revolute", "prismatic", "continuous", "planar", "planar", "planar", "ball", "floating", "fixed", "revolute")


def frame(rng, spread=0.3):
    """A random rigid 4x4."""
    q = rng.normal(size=4)
    return matrix([*rng.normal(size=3) * spread, *q / np.linalg.norm(q)])


def unit(rng):
    v = rng.normal(size=3)
    return tuple(v / np.linalg.norm(v))


def chain(rng, kinds, branch=False):
    """A robot with one joint of each kind, anchors, zeros, and at the end one that mimics the first."""
    joints = [
        Joint(f"j{i}", kind, f"l{i if not branch else i // 2}", f"l{i + 1}", frame(rng), unit(rng),
              tuple(rng.normal(size=3) * 0.1), zero=rng.normal() if kind in ("revolute", "prismatic") else 0.0)
        for i, kind in enumerate(kinds)
    ]  # fmt: skip
    last = len(kinds)
    joints.append(
        Joint("m", "revolute", f"l{last}", f"l{last + 1}", frame(rng), unit(rng), mimic=Mimic("j0", -1.5, 0.25))
    )
    links = tuple(Link(f"l{i}") for i in range(last + 2))
    return Description("chain", links, tuple(joints), Path("chain"), "urdf")


def arm(rng, count=5, size=0.3):
    """A robot of boxes, each of which turns about an axis through the last one's tip, and their half extents."""
    halves = [np.array([0.04, 0.05, size / 2]) * rng.uniform(0.7, 1.3, 3) for _ in range(count)]
    joints = []
    for i in range(1, count):
        origin = frame(rng, 0)
        origin[:3, 3] = [0, 0, halves[i - 1][2] + 0.08]
        joints.append(Joint(f"j{i}", "revolute", f"l{i - 1}", f"l{i}", origin, unit(rng), lower=-2.5, upper=2.5))
    links = tuple(Link(f"l{i}") for i in range(count))
    return Description("arm", links, tuple(joints), Path("arm"), "urdf"), halves


def trees(halves):
    return {f"l{i}": prolate.box_tree(half) for i, half in enumerate(halves)}


def turn(axis, angle):
    """4x4 of a rotation (Rodrigues)."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    out = np.eye(4)
    out[:3, :3] += np.sin(angle) * k + (1 - np.cos(angle)) * k @ k
    return out


def shift(by):
    out = np.eye(4)
    out[:3, 3] = by
    return out


def motion(joint, q):
    axis = np.array(joint.axis)
    if joint.kind in ("revolute", "continuous"):
        return turn(axis, q[0] - joint.zero)
    if joint.kind == "prismatic":
        return shift(axis * (q[0] - joint.zero))
    if joint.kind == "planar":
        up = 1 if axis[2] >= 0 else -1
        to_axis = np.cross([0, 0, up], axis)
        sine = np.linalg.norm(to_axis)
        basis = turn(to_axis / sine, np.arctan2(sine, up * axis[2]))[:3, :3] @ np.diag([1, up, up])
        return shift(basis[:, 0] * q[0] + basis[:, 1] * q[1]) @ turn(axis, q[2])
    if joint.kind == "ball":
        return matrix([0, 0, 0, *q])
    return matrix(q) if joint.kind == "floating" else np.eye(4)


def frames(description, q):
    """The reference: 4x4 of each link, one joint after the other."""
    at, first = {description.links[0].name: np.eye(4)}, {}
    position = 0
    for joint in description.joints:
        first[joint.name] = position
        position += joint.coordinates
    for joint in description.joints:
        own = q[first[joint.name] :][: joint.coordinates]
        if joint.mimic:
            own = [joint.mimic.multiplier * q[first[joint.mimic.joint]] + joint.mimic.offset]
        anchor = np.array(joint.anchor)
        at[joint.child] = (
            at[joint.parent] @ joint.origin @ shift(anchor) @ motion(joint, own) @ shift(-anchor)
        )  # fmt: skip
    return [at[link.name] for link in description.links]


@pytest.mark.parametrize("branch", [False, True])
def test_frames_of_all_kinds_of_joints(branch):
    description = chain(np.random.default_rng(1), KINDS, branch)
    kinematics = Kinematics(description)
    q = kinematics.random(21, seed=2)  # two eights and a part
    found = kinematics.fk(q)
    assert found.shape == (len(KINDS) + 2, 21, 7)
    for i, row in enumerate(q):
        for link, want in enumerate(frames(description, row)):
            assert np.abs(matrix(found[link, i]) - want).max() < 1e-13
    assert (kinematics.fk(q[3]) == found[:, 3]).all()
    assert (kinematics.fk(q, threads=2) == found).all()


def test_quaternions_of_any_length():
    kinematics = Kinematics(chain(np.random.default_rng(1), ("revolute", "ball", "floating")))
    q = kinematics.random(4)
    longer = q * np.array([1.0] + [3.0] * 4 + [1.0] * 3 + [0.2] * 4)
    assert np.abs(kinematics.fk(q) - kinematics.fk(longer)).max() < 1e-14


def test_bad_configurations_are_named():
    kinematics = Kinematics(chain(np.random.default_rng(1), ("revolute", "ball")))
    q = kinematics.random(3)
    with pytest.raises(ValueError, match=r"q: must have shape \(5,\) or \(N, 5\), not \(3, 4\)"):
        kinematics.fk(q[:, 1:])
    q[2, 0] = np.nan
    with pytest.raises(ValueError, match=r"q\[2\]: is not finite"):
        kinematics.fk(q)
    q[2] = 0
    with pytest.raises(ValueError, match=r"q\[2\]: has a quaternion of 0 from coordinate 1 on"):
        kinematics.fk(q)


def test_mimics_that_go_nowhere_are_refused():
    links = tuple(Link(name) for name in "abc")

    def robot(a, b):
        joints = (Joint("x", "revolute", "a", "b", mimic=a), Joint("y", "revolute", "b", "c", mimic=b))
        return Description("r", links, joints, Path("r"), "urdf")

    with pytest.raises(ValueError, match="joint x mimics z, which there is none of"):
        Kinematics(robot(Mimic("z"), None))
    with pytest.raises(ValueError, match="joint x mimics itself"):
        Kinematics(robot(Mimic("y"), Mimic("x")))
    assert Kinematics(robot(None, Mimic("x"))).nq == 1


def gaps_of(half_a, a, half_b, b):
    """The signed gaps (N,) of two boxes at poses a, b (N, 4, 4), along the best of the 15 axes of the separating axis
    test."""
    sides = [m[:, :3, k] for m in (a, b) for k in range(3)]
    axes = np.stack(sides + [np.cross(u, v) for u in sides[:3] for v in sides[3:]], axis=1)
    length = np.linalg.norm(axes, axis=2, keepdims=True)
    axes = axes / np.where(length < 1e-9, np.inf, length)
    reach = np.abs(axes @ a[:, :3, :3]) @ half_a + np.abs(axes @ b[:, :3, :3]) @ half_b
    apart = np.abs(np.einsum("nak,nk->na", axes, b[:, :3, 3] - a[:, :3, 3])) - reach
    return np.where(length[..., 0] < 1e-9, -np.inf, apart).max(axis=1)


@pytest.fixture(scope="module")
def among_boxes():
    """An arm, boxes around it, and for each configuration and pair the gap."""
    rng = np.random.default_rng(5)
    description, halves = arm(rng)
    checks = Checks(description, trees(halves))
    boxes, scene = {}, Scene()
    for i in range(6):
        q = rng.normal(size=4)
        pose = np.concatenate([rng.uniform(-0.9, 0.9, 3), q / np.linalg.norm(q)])
        boxes[f"box {i}"] = (pose, rng.uniform(0.02, 0.15, 3))
        scene.add(prolate.Box(*boxes[f"box {i}"]))
    q = checks.kinematics.random(400, seed=3)
    at = checks.fk(q)
    pairs = checks.pairs(scene)
    placed = {name: np.array([matrix(pose) for pose in at[i]]) for i, name in enumerate(checks.kinematics.links)}
    half = dict(zip(placed, halves))
    for name, (pose, size) in boxes.items():
        placed[name], half[name] = np.broadcast_to(matrix(pose), (len(q), 4, 4)), size
    gaps = [gaps_of(half[p.link], placed[p.link], half[p.other], placed[p.other]) for p in pairs]
    gaps = np.array(gaps).T
    return checks, scene, q, pairs, gaps


def test_collide_agrees_with_separating_axes(among_boxes):
    checks, scene, q, pairs, gaps = among_boxes
    assert len(pairs) == 5 * 6 + 6  # neighbours in the chain of five are left out
    each = checks.collide(q, scene, first_only=False)
    assert each.shape == gaps.shape
    wrong = (each != (gaps <= 0)) & (np.abs(gaps) > 1e-6)
    assert not wrong.any()
    assert 0.05 < each.any(axis=1).mean() < 0.95
    assert (checks.collide(q, scene) == each.any(axis=1)).all()
    assert (checks.collide(q, scene, threads=1) == checks.collide(q, scene, threads=2)).all()
    assert checks.collide(q[7], scene) == each[7].any()


def test_covers_never_miss_and_slack_counts(among_boxes):
    checks, scene, q, _, gaps = among_boxes
    wide = Checks(
        checks.kinematics.description,
        {name: prolate.box_tree(half) for name, half in zip(checks.kinematics.links, arm(np.random.default_rng(5))[1])},
        slack=dict.fromkeys(checks.kinematics.links, 0.01),
    )
    found = wide.collide(q, scene, first_only=False)
    assert found[gaps < 0.0099].all()
    assert not found[gaps > 0.0201].any()  # both links of a pair have it


def test_distance_bounds_the_gap(among_boxes):
    checks, scene, q, pairs, gaps = among_boxes
    found = checks.distance(q, scene)
    least = gaps.min(axis=1)
    # Along separating axes, the gap is at most the distance, and equal to it between faces.
    assert (found.upper >= np.maximum(least, 0) - 1e-6).all()
    assert ((least <= 0) == (found.lower <= 0)).all()
    apart = least > 0
    assert (found.upper - found.lower <= 2e-6 * found.upper + 1e-7)[apart].all()
    near = checks.distance(q, scene, max_distance=0.01)
    assert (near.lower[found.lower > 0.011] >= 0.01).all()
    assert np.abs(near.lower - found.lower)[found.upper < 0.009].max() < 1e-6
    i = int(np.argmax(apart))
    assert found.pair[i] >= 0 and pairs[found.pair[i]].link in checks.kinematics.links


def test_far_from_the_origin_nothing_is_lost():
    """A gap of a tenth of a millimetre, a thousand kilometres away."""
    links = (Link("l0"), Link("l1"))
    base = Joint("b", "floating", "l0", "l1")
    checks = Checks(Description("r", links, (base,), Path("r"), "urdf"), {"l1": prolate.box_tree([0.1, 0.1, 0.1])})
    far = 1e6
    scene = Scene().add(prolate.Box([far, 0, 0, 0, 0, 0, 1], [0.1, 0.1, 0.1]))
    q = np.array([[far + 0.2001, 0, 0, 0, 0, 0, 1], [far + 0.1999, 0, 0, 0, 0, 0, 1]])
    assert checks.collide(q, scene).tolist() == [False, True]


@pytest.mark.parametrize(
    "shape, meets_at",
    [
        (prolate.Sphere([0, 0, 1], 0.2), 0.7),
        (prolate.Capsule([-1, 0, 1], [1, 0, 1], 0.2), 0.7),
        (prolate.HalfSpace([0, 0, -2], -1), 0.9),
        (prolate.Box([0, 0, 1, 0, 0, 0, 1], [0.2, 0.2, 0.2]), 0.7),
        (PointCloud([[0, 0, 1.0], [5, 5, 5]], 0.2), 0.7),
        (prolate.box_tree([0.2, 0.2, 0.2]), -0.3),
    ],
)
def test_shapes_and_their_poses(shape, meets_at):
    """A box of half side 0.1 that slides up along z: where it begins to touch a shape, in two frames."""
    lift = Joint("z", "prismatic", "root", "box")
    description = Description("lift", (Link("root"), Link("box")), (lift,), Path("lift"), "urdf")
    checks = Checks(description, {"box": prolate.box_tree([0.1, 0.1, 0.1])})
    scene = Scene().add(shape)
    z = np.array([[meets_at - 0.01], [meets_at + 0.01]])
    assert checks.collide(z, scene).tolist() == [False, True]
    moved = Scene().add(shape, [0.05, -0.05, 0.5, 0, 0, 1, 0])
    assert checks.collide(z + 0.5, moved).tolist() == [False, True]
    found = checks.distance(z, scene)
    assert found.lower[1] == 0 and 0.0099 < found.lower[0] <= found.upper[0] < 0.0101


def test_points_against_a_reference(among_boxes):
    checks, _, q, _, _ = among_boxes
    halves = arm(np.random.default_rng(5))[1]
    rng = np.random.default_rng(8)
    points = rng.uniform(-0.8, 0.8, (300, 3))
    scene = Scene().add(PointCloud(points, 0.01), [0.1, 0, 0, 0, 0, 0, 1])
    at = checks.fk(q[:100])
    least = np.full(100, np.inf)
    for i in range(100):
        for link, half in enumerate(halves):
            m = matrix(at[link, i])
            local = (points + [0.1, 0, 0] - m[:3, 3]) @ m[:3, :3]
            least[i] = min(least[i], np.linalg.norm(np.maximum(np.abs(local) - half, 0), axis=1).min() - 0.01)
    alone = Checks(checks.kinematics.description, trees(halves), allowed=[p[:2] for p in checks.pairs()])
    sure = np.abs(least) > 1e-6
    assert (alone.collide(q[:100], scene) == (least <= 0))[sure].all()
    found = alone.distance(q[:100], scene)
    assert (found.lower <= np.maximum(least, 0) + 1e-7).all() and (found.upper >= np.maximum(least, 0) - 1e-7).all()
    assert (found.upper - found.lower)[least > 0].max() < 1e-5


def test_motions_that_samples_find_to_collide_are_never_free(among_boxes):
    checks, scene, _, _, _ = among_boxes
    q0, q1 = checks.kinematics.random(120, seed=10), checks.kinematics.random(120, seed=11)
    q1 = q0 + 0.2 * (q1 - q0)
    verdict = checks.motion_verdicts(q0, q1, scene)
    steps = np.linspace(0, 1, 1001)[:, None, None]
    between = (q0 + steps * (q1 - q0)).reshape(-1, checks.nq)
    hit = checks.collide(between, scene).reshape(len(steps), -1).any(axis=0)
    assert (verdict[hit] != prolate.Verdict.SEPARATED).all()
    # Where no sample collides, nearly all are certified; what is left passes within a few micrometres.
    assert (verdict[~hit] == prolate.Verdict.SEPARATED).mean() > 0.97
    assert 0.1 < hit.mean() < 0.9
    assert (checks.validate_motion(q0, q1, scene) == (verdict == 0)).all()
    assert (checks.motion_verdicts(q0, q1, scene, budget=0) != 0)[hit].all()


def test_nothing_tunnels_and_ends_count():
    """A box that jumps over a sheet, or ends in one."""
    lift = Joint("z", "prismatic", "root", "box")
    description = Description("lift", (Link("root"), Link("box")), (lift,), Path("lift"), "urdf")
    checks = Checks(description, {"box": prolate.box_tree([0.1, 0.1, 0.1])})
    scene = Scene().add(prolate.Box([0, 0, 0.777, 0, 0, 0, 1], [1, 1, 1e-4]))
    assert checks.validate_motion([[0], [0], [2]], [[5], [0.67], [0.88]], scene).tolist() == [False, True, True]
    assert checks.validate_motion([[0], [0.8]], [[0.6772], [5]], scene).tolist() == [False, False]


def test_motions_of_floating_bases_turn_evenly():
    """A bar that turns in place by slerp sweeps over a post, or just not."""
    base = Joint("b", "floating", "root", "bar")
    description = Description("bar", (Link("root"), Link("bar")), (base,), Path("bar"), "urdf")
    checks = Checks(description, {"bar": prolate.box_tree([1, 0.05, 0.05])})
    start = [0, 0, 0, 0, 0, 0, 1]
    end = [0, 0, 0, 0, 0, np.sin(0.5), np.cos(0.5)]  # by 1 radian about z
    for angle, free in ((0.5, False), (1.2, True)):
        at = [0.8 * np.cos(angle), 0.8 * np.sin(angle), 0, 0, 0, 0, 1]
        scene = Scene().add(prolate.Box(at, [0.02, 0.02, 0.5]))
        assert checks.validate_motion(start, end, scene).tolist() == [free]
        assert checks.validate_motion(start, [-x for x in end], scene).tolist() == [free]


def test_pairs_that_are_left_out():
    rng = np.random.default_rng(5)
    description, halves = arm(rng)
    checks = Checks(description, trees(halves), allowed=[("l0", "l2"), ("l3", "floor")])
    scene = Scene().add(prolate.HalfSpace([0, 0, 1], -5), name="floor")
    named = {(pair.link, pair.other) for pair in checks.pairs(scene)}
    assert ("l0", "l2") not in named and ("l0", "l1") not in named and ("l0", "l3") in named
    assert ("l3", "floor") not in named and ("l2", "floor") in named


def test_what_stands_still_is_decided_once():
    rng = np.random.default_rng(5)
    description, halves = arm(rng)
    checks = Checks(description, trees(halves))
    under = Scene().add(prolate.Box([0, 0, 0, 0, 0, 0, 1], [0.01, 0.01, 0.01]))  # in the root
    q = checks.kinematics.random(20)
    assert checks.collide(q, under).all()
    assert not checks.validate_motion(q, q, under).any()
    assert (checks.distance(q, under).upper < 1e-9).all()


def test_bad_shapes_leave_the_scene_as_it_was():
    scene = Scene()
    for shape, error, text in (
        (3, TypeError, "shape: must be a Tree, Box"),
        (prolate.Box([0, 0, 0, 0, 0, 0, 1], [0, 1, 1]), ValueError, "shape.half"),
        (prolate.Sphere([0, 0, 0], -1), ValueError, "shape.radius"),
        (PointCloud(np.empty((0, 3)), 0.1), ValueError, "shape.points: there are none"),
    ):
        with pytest.raises(error, match=text):
            scene.add(shape)
    with pytest.raises(ValueError, match="pose"):
        scene.add(prolate.Sphere([0, 0, 0], 1), [0, 0, 0, 0, 0, 0, 0])
    with pytest.raises(ValueError, match="scales"):
        scene.add(prolate.box_tree([1, 1, 1]), np.diag([2.0, 2, 2, 1]))
    assert len(scene) == 0 and not scene.names


def test_trees_of_unknown_links_are_refused():
    description, halves = arm(np.random.default_rng(5))
    with pytest.raises(ValueError, match="no link l9"):
        Checks(description, {"l9": prolate.box_tree(halves[0])})


def test_baked_robots_answer(among_boxes):
    checks, scene, q, _, gaps = among_boxes
    description, halves = arm(np.random.default_rng(5))
    links = [replace(k, collisions=(Geometry(BoxShape(tuple(2 * h))),)) for k, h in zip(description.links, halves)]
    baked = Robot(replace(description, links=tuple(links))).bake(exact=True)
    least = gaps.min(axis=1)
    assert (baked.collide(q, scene) == (least <= 0))[np.abs(least) > 1e-6].all()
    assert (baked.fk(q) == checks.fk(q)).all()
    assert np.abs(baked.distance(q, scene).lower - checks.distance(q, scene).lower).max() < 1e-6
    short = q + 0.02 * (q[::-1] - q)
    assert (baked.validate_motion(q, short, scene) == checks.validate_motion(q, short, scene)).mean() > 0.99
