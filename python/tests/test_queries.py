"""Queries against the separating axis test of boxes, in double precision."""

from __future__ import annotations

import gc
import os
import resource
import threading

import numpy as np
import pytest

import prolate
from conftest import HALF_A, HALF_B, IDENTITY, box_gap, box_mesh, matrix, poses
from prolate import Verdict

CALLS = int(os.environ.get("PROLATE_CALLS", "24000"))  # that must not leak


@pytest.mark.parametrize("offset", [0, 1e3, 1e7, 1e12])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_collide_agrees_with_the_separating_axis_test(box_a, box_b, offset, dtype):
    rng = np.random.default_rng(2)
    at_a, at_b = poses(rng, 400, 0.8), poses(rng, 400, 0.8)
    at_a[:, :3] += offset
    at_b[:, :3] += offset
    at_a, at_b = at_a.astype(dtype), at_b.astype(dtype)
    verdicts = prolate.collide(box_a, at_a, box_b, at_b)
    gaps = np.array([box_gap(HALF_A, p, HALF_B, q) for p, q in zip(at_a.astype(float), at_b.astype(float))])
    doubt = 1e-6 + 1e-15 * offset
    assert (verdicts[gaps > doubt] == Verdict.SEPARATED).all()
    assert (verdicts[gaps < -doubt] == Verdict.OVERLAPPING).all()
    assert offset > 1e6 or {0, 1} <= set(verdicts)


def test_never_separated_within_what_float32_rounds(box_a, box_b):
    """Gaps of some 1e-9, far below float32, at poses that float32 would move by 1e-7."""
    rng = np.random.default_rng(3)
    turn = poses(rng, 300, 0)
    for sign in (-1, 1):
        at_a = np.tile(IDENTITY, (300, 1))
        at_b = at_a.copy()
        at_b[:, 0] = HALF_A[0] + HALF_B[0] + sign * 1e-9
        placed_a, placed_b = ([m @ matrix(p) for m, p in zip(map(matrix, turn), at)] for at in (at_a, at_b))
        verdicts = prolate.collide(box_a, np.array(placed_a), box_b, np.array(placed_b))
        if sign < 0:
            assert (verdicts == Verdict.OVERLAPPING).all()
        wide = prolate.collide(box_a, np.array(placed_a), box_b, np.array(placed_b), margin=1e-5)
        assert (wide == Verdict.OVERLAPPING).all()


def test_all_forms_of_poses_agree(box_a, box_b):
    rng = np.random.default_rng(4)
    at = poses(rng, 50, 0.8)
    wanted = prolate.collide(box_a, IDENTITY, box_b, at)
    matrices = np.array([matrix(p) for p in at])
    wxyz = at[:, [0, 1, 2, 6, 3, 4, 5]]
    identity_wxyz = IDENTITY[[0, 1, 2, 6, 3, 4, 5]]
    assert (prolate.collide(box_a, np.eye(4), box_b, matrices) == wanted).all()
    assert (prolate.collide(box_a, IDENTITY.tolist(), box_b, at.tolist()) == wanted).all()
    assert (prolate.collide(box_a, identity_wxyz, box_b, wxyz, order="wxyz") == wanted).all()
    assert (prolate.collide(box_a, identity_wxyz, box_b, wxyz.astype(np.float32), order="wxyz") == wanted).all()
    assert (prolate.collide(box_a, IDENTITY, box_b, np.asfortranarray(at)) == wanted).all()
    assert (prolate.collide(box_b, at, box_a, IDENTITY) == wanted).all()
    single = prolate.collide(box_a, IDENTITY, box_b, at[0])
    assert isinstance(single, Verdict) and single == wanted[0]
    assert prolate.collide(box_a, IDENTITY, box_b, at[:1]).shape == (1,)
    assert prolate.collide(box_a, IDENTITY, box_b, at[:0]).shape == (0,)
    out = np.full(50, 9, np.uint8)
    assert prolate.collide(box_a, IDENTITY, box_b, at, out=out) is out and (out == wanted).all()
    for threads in (0, 2, 7):
        assert (prolate.collide(box_a, IDENTITY, box_b, at, threads=threads) == wanted).all()


def test_float32_exact_doubles_give_the_same_bits(box_a, box_b):
    rng = np.random.default_rng(5)
    at = poses(rng, 200, 1.0, np.float32)
    narrow, wide = (prolate.distance(box_a, IDENTITY, box_b, at.astype(t)) for t in (np.float32, np.float64))
    assert all(np.array_equal(x, y, equal_nan=True) for x, y in zip(narrow, wide))


def test_limits(box_a, box_b, cover):
    at = IDENTITY + [2.2, 0, 0, 0, 0, 0, 0]
    assert prolate.collide(box_a, IDENTITY, box_a, at) == Verdict.SEPARATED
    assert prolate.collide(box_a, IDENTITY, box_a, at, margin=0.21) == Verdict.OVERLAPPING
    assert prolate.collide(box_a, IDENTITY, box_a, at, margin=np.inf) == Verdict.OVERLAPPING
    assert prolate.collide(box_a, IDENTITY, box_b, IDENTITY, budget=0) == Verdict.UNDECIDED
    near = IDENTITY + [0, 0.6, 0, 0, 0, 0, 0]
    assert prolate.collide(cover, IDENTITY, cover, near, max_level=0) == Verdict.OVERLAPPING


@pytest.mark.parametrize("offset", [0, 1e6])
def test_distance_bounds_hold(box_a, box_b, offset):
    rng = np.random.default_rng(6)
    at_a, at_b = poses(rng, 200, 1.0), poses(rng, 200, 1.5)
    at_a[:, :3] += offset
    at_b[:, :3] += offset
    found = prolate.distance(box_a, at_a, box_b, at_b, threads=2)
    for i in range(200):
        gap = box_gap(HALF_A, at_a[i], HALF_B, at_b[i])
        if gap > 0:
            assert found.upper[i] >= gap - 1e-9 * (1 + offset / 1e3)  # the axes give a lower bound of the distance
            assert found.lower[i] <= found.upper[i] <= found.lower[i] * (1 + 1e-5) + 1e-5
            ends = found.point_b[i] - found.point_a[i]
            assert abs(np.linalg.norm(ends) - found.upper[i]) < 1e-5
            local = np.linalg.inv(matrix(at_a[i])) @ [*found.point_a[i], 1]
            assert (np.abs(local[:3]) <= HALF_A + 1e-6 + 1e-9 * offset).all()
        elif gap < -1e-6:
            assert found.verdict[i] == Verdict.OVERLAPPING and found.lower[i] == 0
    one = prolate.distance(box_a, at_a[0], box_b, at_b[0])
    assert one.lower == found.lower[0] and one.point_a.shape == (3,)


def test_contacts_are_ragged_and_push_apart(box_a, box_b):
    at = np.tile(IDENTITY, (3, 1))
    at[:, 2] = [HALF_A[2] + HALF_B[2] - 0.01, 5, HALF_A[2] + HALF_B[2] - 0.02]
    found = prolate.contacts(box_a, IDENTITY, box_b, at)
    assert found.offsets.tolist() == [0, 4, 4, 8] and found.verdict.tolist() == [1, 0, 1]
    assert np.allclose(found.normal, [0, 0, 1], atol=1e-6)
    assert np.allclose(found.depth, [0.01] * 4 + [0.02] * 4, atol=1e-6)
    assert (np.abs(found.point_a[:, :2]) <= 0.3 + 1e-6).all() and len(set(found.id[:4].tolist())) == 4
    far = np.array([1e6, 2e6, 3e6, 0, 0, 0, 0])
    moved = prolate.contacts(box_a, IDENTITY + far, box_b, at + far)
    assert np.allclose(moved.point_a - far[:3], found.point_a, atol=1e-6)
    assert prolate.contacts(box_a, IDENTITY, box_b, at[1]).offsets.tolist() == [0, 0]


def test_sweep_finds_the_time_of_impact(box_a, box_b):
    start = IDENTITY + [5, 0, 0, 0, 0, 0, 0]
    end = IDENTITY + [-5, 0, 0, 0, 0, 0, 0]
    for far in (0.0, 1e6):
        by = np.array([far, 0, 0, 0, 0, 0, 0])
        found = prolate.sweep(box_a, IDENTITY + by, IDENTITY + by, box_b, start + by, end + by)
        assert found.verdict == Verdict.OVERLAPPING and abs(found.toi - 0.37) < 1e-4
    beside = prolate.sweep(box_a, IDENTITY, IDENTITY, box_b, start + [0, 2, 0, 0, 0, 0, 0], end + [0, 2, 0, 0, 0, 0, 0])
    assert beside.verdict == Verdict.SEPARATED and beside.toi == 1 and np.isinf(beside.time_upper)
    rng = np.random.default_rng(7)
    starts, ends = poses(rng, 60, 3), poses(rng, 60, 3)
    many = prolate.sweep(box_a, IDENTITY, IDENTITY, box_b, starts, ends)
    for i in np.flatnonzero(many.verdict == Verdict.SEPARATED):
        for pose in (starts[i], ends[i]):
            assert box_gap(HALF_A, IDENTITY, HALF_B, pose) > -1e-6


def test_raycast_hits_boxes(box_a):
    rng = np.random.default_rng(8)
    for far in (0.0, 1e7):
        at = poses(rng, 1, 1.0)[0]
        at[:3] += far
        m = matrix(at)
        origins = m[:3, 3] + rng.normal(size=(500, 3)) * 3
        directions = m[:3, 3] + rng.uniform(-0.6, 0.6, (500, 3)) - origins
        hits = prolate.raycast(box_a, at, origins, directions)
        o = (origins - m[:3, 3]) @ m[:3, :3]
        d = directions @ m[:3, :3]
        with np.errstate(divide="ignore"):
            t = np.sort([(-HALF_A - o) / d, (HALF_A - o) / d], axis=0)
        enter, leave = t[0].max(axis=1), t[1].min(axis=1)
        outside = (np.abs(o) > HALF_A).any(axis=1)
        hit = outside & (leave > enter + 1e-4) & (enter > 0)
        assert hit.sum() > 100
        assert np.allclose(hits.t[hit], enter[hit], atol=1e-5 + 1e-9 * far)
        assert (hits.verdict[hit] == Verdict.OVERLAPPING).all() and (hits.triangle[hit] >= 0).all()
        miss = outside & (leave < enter - 1e-4)
        assert (
            (hits.verdict[miss] == Verdict.SEPARATED).all()
            and np.isinf(hits.t[miss]).all()
            and (hits.node[miss] == -1).all()
        )
        assert np.allclose((hits.normal[hit] * directions[hit]).sum(1) < 0, True)
    one = prolate.raycast(box_a, IDENTITY, [5, 0, 0], [-1, 0, 0])
    assert one.t == 4 and one.point.tolist() == [1, 0, 0] and one.normal.tolist() == [1, 0, 0]
    assert prolate.raycast(box_a, IDENTITY, [5, 0, 0], [-1, 0, 0], 0.5).t == pytest.approx(3.5)
    assert prolate.raycast(box_a, IDENTITY, [5, 0, 0], [-1, 0, 0], max_t=3).verdict == Verdict.SEPARATED


def test_overlap_with_shapes(box_a):
    rng = np.random.default_rng(9)
    at = poses(rng, 300, 1.2)
    center = np.array([0.3, -0.2, 0.1])
    local = np.array([(np.linalg.inv(matrix(p)) @ [*center, 1])[:3] for p in at])
    away = np.linalg.norm(np.maximum(np.abs(local) - HALF_A, 0), axis=1)
    found = prolate.overlap(box_a, at, prolate.Sphere(center, 0.4))
    clear = np.abs(away - 0.4) > 1e-5
    assert (found[clear] == (away < 0.4)[clear]).all() and len(set(found)) == 2
    capsule = prolate.overlap(box_a, at, prolate.Capsule(center, center, 0.4))
    assert (capsule[clear] == found[clear]).all()
    half = np.array([0.2, 0.4, 0.6])
    box_pose = poses(rng, 1, 0.3)[0]
    gaps = np.array([box_gap(HALF_A, p, half, box_pose) for p in at])
    boxes = prolate.overlap(box_a, at, prolate.Box(box_pose, half))
    clear = np.abs(gaps) > 1e-5
    assert (boxes[clear] == (gaps < 0)[clear]).all()
    normal, offset = np.array([1.0, 2.0, -2.0]), 0.3
    lowest = np.array([p[:3] @ normal / 3 - np.abs(normal @ matrix(p)[:3, :3] / 3) @ HALF_A for p in at])
    below = prolate.overlap(box_a, at, prolate.HalfSpace(normal, offset))
    clear = np.abs(lowest - offset) > 1e-5
    assert (below[clear] == (lowest < offset)[clear]).all()
    assert prolate.overlap(box_a, IDENTITY, prolate.Sphere((0, 0, 0), 0.01)) is Verdict.OVERLAPPING
    far = np.array([1e7, 0, 0])
    touching = prolate.overlap(box_a, IDENTITY + [1e7, 0, 0, 0, 0, 0, 0], prolate.Sphere(far + [1.5, 0, 0], 0.5 - 1e-5))
    assert touching == Verdict.SEPARATED


@pytest.mark.parametrize("far", [0.0, 1e7])
def test_ground_under_boxes(box_a, far):
    rng = np.random.default_rng(17)
    at = poses(rng, 300, 0.8)
    at[:, :3] += far
    ground = prolate.HalfSpace([2.0, -1.0, 2.0], far - 0.2)
    normal = np.array([2.0, -1.0, 2.0]) / 3
    matrices = np.array([matrix(p) for p in at])
    gap = at[:, :3] @ normal - ground.offset - np.abs(normal @ matrices[:, :3, :3]) @ HALF_A
    found = prolate.distance(box_a, at, ground)
    apart = gap > 1e-6
    doubt = 1e-6 + 1e-15 * far
    assert (found.lower[apart] <= gap[apart] + doubt).all() and (found.upper[apart] >= gap[apart] - doubt).all()
    assert (found.upper[apart] - found.lower[apart] < 1e-5).all()
    assert (found.verdict[apart] == Verdict.SEPARATED).all() and (found.verdict[gap < 0] == Verdict.OVERLAPPING).all()
    assert np.allclose(found.normal[apart], -normal, atol=1e-5)
    touch = prolate.contacts(box_a, at, ground)
    for i in range(300):
        rows = slice(touch.offsets[i], touch.offsets[i + 1])
        assert (touch.verdict[i] == Verdict.OVERLAPPING) == (rows.stop > rows.start)
        if gap[i] < -1e-6:
            assert touch.depth[rows].max() == pytest.approx(-gap[i], abs=1e-5)
            assert np.allclose(touch.normal[rows], -normal, atol=1e-5)
    assert (prolate.overlap(box_a, at, ground) == found.verdict).all()
    with pytest.raises(TypeError, match="poses_b"):
        prolate.distance(box_a, at, ground, IDENTITY)


def box_distance(half, local):
    """Signed distance from a box."""
    q = np.abs(local) - half
    return np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(axis=-1), 0)


@pytest.mark.parametrize("far", [0.0, 1e7])
def test_signed_distances_are_those_of_boxes(box_a, far):
    rng = np.random.default_rng(14)
    at = poses(rng, 1, 1.0)[0]
    at[0] += far
    local = rng.normal(size=(2000, 3)) * 1.2
    m = matrix(at)
    world = local @ m[:3, :3].T + m[:3, 3]
    local = (world - m[:3, 3]) @ m[:3, :3]  # of the points as rounded to float64
    truth = box_distance(HALF_A, local)
    found = prolate.signed_distance(box_a, world, at, threads=2)
    assert (found.lower <= truth + 1e-12 + 1e-15 * far).all() and (found.upper >= truth - 1e-12 - 1e-15 * far).all()
    assert (found.upper - found.lower < 1e-5).all()
    assert (found.verdict[truth > 1e-6] == Verdict.SEPARATED).all()
    assert (found.verdict[truth < 0] == Verdict.OVERLAPPING).all()
    assert np.allclose(np.linalg.norm(found.point - world, axis=1), np.abs(truth), atol=1e-6 + 1e-9 * far)
    outside = truth > 1e-3
    away = (world - found.point)[outside] / truth[outside, None]
    assert np.allclose(away, found.gradient[outside], atol=1e-2)
    sides = prolate.contains(box_a, world, at)
    assert (sides == found.verdict).all()
    assert prolate.contains(box_a, [0, 0, 0]) is Verdict.OVERLAPPING
    assert prolate.signed_distance(box_a, [0, 0, 0]).upper == pytest.approx(-HALF_A[2])
    with pytest.raises(ValueError, match=r"points\[1\]"):
        prolate.contains(box_a, [[0, 0, 0], [0, np.inf, 0]])


def test_points_far_beyond_float32_are_never_called_outside(box_a):
    """Inside by less than what float32 would move them."""
    rng = np.random.default_rng(15)
    for pose in poses(rng, 20, 1e4):
        m = matrix(pose)
        local = rng.uniform(-0.9, 0.9, (50, 3)) * HALF_A
        local[:, 0] = HALF_A[0] - 1e-9
        world = local @ m[:3, :3].T + m[:3, 3]
        assert (prolate.contains(box_a, world, pose) == Verdict.OVERLAPPING).all()
        assert (prolate.signed_distance(box_a, world, pose).verdict == Verdict.OVERLAPPING).all()


def test_primitives_are_what_they_are_called(box_a, box_b):
    rng = np.random.default_rng(16)
    box = prolate.box_tree(HALF_A)
    at = poses(rng, 300, 0.9)
    assert (prolate.collide(box, IDENTITY, box_b, at) == prolate.collide(box_a, IDENTITY, box_b, at)).all()
    points = rng.uniform(-1, 1, (3000, 3))
    round_ = np.hypot(points[:, 0], points[:, 1])
    in_cylinder = (round_ <= 0.5) & (np.abs(points[:, 2]) <= 0.7)
    found = prolate.contains(prolate.cylinder_tree(0.5, 0.7), points)
    assert (found[in_cylinder] == Verdict.OVERLAPPING).all()
    assert (found[(round_ > 0.5025) | (np.abs(points[:, 2]) > 0.7001)] == Verdict.SEPARATED).all()
    fine = prolate.contains(prolate.cylinder_tree(0.5, 0.7, sides=1024), points)
    assert (fine[round_ > 0.50001] == Verdict.SEPARATED).all() and (fine[in_cylinder] == Verdict.OVERLAPPING).all()
    for tree, radii in (
        (prolate.ellipsoid_tree([0.9, 0.5, 0.2]), [0.9, 0.5, 0.2]),
        (prolate.sphere_tree(0.6), [0.6] * 3),
    ):
        radial = np.linalg.norm(points / radii, axis=1)
        found = prolate.contains(tree, points)
        assert (found[radial <= 1] == Verdict.OVERLAPPING).all()
        assert (found[radial > 1.001] == Verdict.SEPARATED).all()
    corners, faces = box_mesh(HALF_B)
    convex = prolate.convex_tree(corners, faces)
    assert (prolate.collide(box_a, IDENTITY, convex, at) == prolate.collide(box_a, IDENTITY, box_b, at)).all()
    with pytest.raises(ValueError, match="half"):
        prolate.box_tree([1, 0, 1])
    with pytest.raises(ValueError, match="radius"):
        prolate.sphere_tree(-1)
    for sides in (0, 33, 2048):
        with pytest.raises(ValueError, match="sides"):
            prolate.cylinder_tree(1, 1, sides)
    with pytest.raises(ValueError, match="faces"):
        prolate.convex_tree(corners, faces + 1)
    with pytest.raises(prolate.Error, match="faces"):
        prolate.convex_tree(corners, faces[:-1])


def test_primitives_take_part_in_all_queries(box_a):
    """A wall, a ball and a pipe that nobody baked, against a mesh."""
    at = IDENTITY + [3, 0, 0, 0, 0, 0, 0]
    for tree, reach in ((prolate.box_tree([0.5, 2, 2]), 0.5), (prolate.sphere_tree(0.7), 0.7)):
        gap = 3 - HALF_A[0] - reach
        found = prolate.distance(box_a, IDENTITY, tree, at)
        assert found.lower <= gap <= found.upper + 1e-3 and found.upper == pytest.approx(gap, abs=1e-3)
        swept = prolate.sweep(box_a, IDENTITY, IDENTITY, tree, at, IDENTITY)
        assert swept.toi == pytest.approx(gap / 3, abs=1e-3)
        touch = prolate.contacts(box_a, IDENTITY, tree, at - [gap + 0.01, 0, 0, 0, 0, 0, 0])
        assert touch.depth.max() == pytest.approx(0.01, abs=1e-3) and np.allclose(touch.normal, [1, 0, 0], atol=1e-2)
    pipe = prolate.cylinder_tree(0.5, 4)
    hits = prolate.raycast(pipe, IDENTITY, [[3, 0, 0], [3, 0.6, 0]], [-1, 0, 0])
    assert hits.t[0] == pytest.approx(2.5, abs=3e-3) and np.isinf(hits.t[1])
    assert prolate.overlap(pipe, IDENTITY, prolate.Box(at, [2.4, 1, 1])) is Verdict.SEPARATED


def test_bounds_hold_the_body(box_a):
    rng = np.random.default_rng(10)
    at = poses(rng, 50, 1e6)
    found = prolate.bounds(box_a, at)
    for i, pose in enumerate(at):
        m = matrix(pose)
        reach = np.abs(m[:3, :3]) @ HALF_A
        assert (found.lower[i] <= m[:3, 3] - reach).all() and (found.upper[i] >= m[:3, 3] + reach).all()
        assert (found.upper[i] - found.lower[i] <= 2.05 * reach + 1e-6).all()


def test_single_ellipsoids_are_spheres_when_round():
    rng = np.random.default_rng(11)
    for far in (0.0, 1e6):
        at = poses(rng, 100, 2)
        at[:, 0] += far
        pairs = rng.integers(0, 100, (500, 2))
        pairs = pairs[pairs[:, 0] != pairs[:, 1]]
        gap = np.linalg.norm(at[pairs[:, 0], :3] - at[pairs[:, 1], :3], axis=1) - 1.0
        clear = np.abs(gap) > 1e-5
        found = prolate.pairs.collide([0.5, 0.5, 0.5], at, pairs)
        assert (found[clear] == (gap < 0)[clear]).all()
        distance = prolate.pairs.distance((0.5, 0.5, 0.5), at, pairs, tolerance=1e-4)
        assert (distance.lower <= gap + 1e-6).all() and (distance.upper[gap > 0] >= gap[gap > 0] - 1e-6).all()
        ends = np.linalg.norm(distance.point_a - at[pairs[:, 0], :3], axis=1)
        assert np.allclose(ends, 0.5, atol=1e-3)


def test_pairs_of_a_cut_cover_the_tree(cover):
    cut = cover.cut()
    at = np.hstack([cut.center, cut.quaternion])
    n = len(at)
    shifted = at + [0, 0.7, 0, 0, 0, 0, 0]
    pairs = np.array([[i, n + j] for i in range(n) for j in range(n)])
    verdicts = prolate.pairs.collide(np.vstack([cut.radii] * 2), np.vstack([at, shifted]), pairs)
    whole = prolate.collide(cover, IDENTITY, cover, IDENTITY + [0, 0.7, 0, 0, 0, 0, 0])
    assert verdicts.max() == whole


def test_world(box_a, box_b):
    world = prolate.World()
    ids = [world.insert(box_a, IDENTITY + [4.0 * i, 0, 0, 0, 0, 0, 0]) for i in range(5)]
    assert len(world) == 5 and len(world.collide().ids) == 0
    probe = world.insert(box_b, IDENTITY + [4.0, 0, 0.2, 0, 0, 0, 0])
    found = world.collide(threads=2)
    assert found.ids.tolist() == [[ids[1], probe]] and found.verdict.tolist() == [1]
    assert world.pairs().begins.tolist() == [False]
    world.move([probe], [IDENTITY + [8.0, 0, 0.2, 0, 0, 0, 0]])
    assert [ids[2], probe] in world.collide().ids.tolist()
    world.remove(probe)
    assert len(world.collide().ids) == 0 and len(world) == 5
    for act in (lambda: world.remove(probe), lambda: world.move([probe], [IDENTITY])):
        with pytest.raises(prolate.Error) as caught:
            act()
        assert caught.value.code == "bad_id"
    hidden = world.insert(box_b, IDENTITY, layers=2, mask=2)
    assert len(world.collide().ids) == 0
    assert "6 bodies" in repr(world)
    world.remove(hidden)


def test_world_keeps_trees_alive(cover):
    world = prolate.World()
    for _ in range(2):
        world.insert(prolate.Tree.from_bytes(bytes(cover)), IDENTITY)
    gc.collect()
    assert world.collide().verdict.tolist() == [1]


def test_threads_share_trees_and_worlds(box_a, box_b):
    rng = np.random.default_rng(12)
    at = poses(rng, 2000, 0.8)
    wanted = prolate.collide(box_a, IDENTITY, box_b, at)
    world = prolate.World()
    ids = [world.insert(box_a, p) for p in at[:20]]
    wrong = []

    def work(k):
        for _ in range(5):
            if not (prolate.collide(box_a, IDENTITY, box_b, at, threads=k % 3) == wanted).all():
                wrong.append(k)
            world.move(ids, at[20 * k : 20 * k + 20])
            world.collide()

    threads = [threading.Thread(target=work, args=(k,)) for k in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


@pytest.mark.parametrize(
    ("call", "error", "match"),
    [
        (lambda t: prolate.collide("t", IDENTITY, t, IDENTITY), TypeError, "^a: .*Tree"),
        (lambda t: prolate.collide(t, IDENTITY, None, IDENTITY), TypeError, "^b: "),
        (lambda t: prolate.collide(t, IDENTITY[:6], t, IDENTITY), ValueError, r"^poses_a: .*\(6,\)"),
        (lambda t: prolate.collide(t, IDENTITY, t, np.zeros((3, 7))), ValueError, r"^poses_b\[0\]: .*quaternion"),
        (lambda t: prolate.collide(t, IDENTITY, t, np.full((3, 7), np.nan)), ValueError, r"^poses_b\[0\]: "),
        (lambda t: prolate.collide(t, IDENTITY, t, np.diag([2, 2, 2, 1])), ValueError, "^poses_b: .*scales"),
        (
            lambda t: prolate.collide(t, IDENTITY, t, [np.eye(4), np.diag([1, 1, -1, 1])]),
            ValueError,
            r"^poses_b\[1\]: .*mirrors",
        ),
        (
            lambda t: prolate.collide(t, [IDENTITY] * 2, t, [IDENTITY] * 3),
            ValueError,
            "poses_b: has 3 poses and poses_a 2",
        ),
        (lambda t: prolate.collide(t, "pose", t, IDENTITY), TypeError, "^poses_a: "),
        (lambda t: prolate.collide(t, 1j * IDENTITY, t, IDENTITY), TypeError, "^poses_a: "),
        (lambda t: prolate.collide(t, IDENTITY, t, IDENTITY, margin=-1), ValueError, "^margin: "),
        (lambda t: prolate.collide(t, IDENTITY, t, IDENTITY, margin=np.nan), ValueError, "^margin: "),
        (lambda t: prolate.collide(t, IDENTITY, t, IDENTITY, budget=-1), ValueError, "^budget: "),
        (lambda t: prolate.collide(t, IDENTITY, t, IDENTITY, max_level=1.5), TypeError, "^max_level: "),
        (lambda t: prolate.collide(t, IDENTITY, t, IDENTITY, order="xyz"), ValueError, "^order: "),
        (lambda t: prolate.collide(t, IDENTITY, t, [IDENTITY], threads=5000), ValueError, "^threads: "),
        (lambda t: prolate.collide(t, IDENTITY, t, [IDENTITY], out=np.zeros(1)), TypeError, "^out: "),
        (lambda t: prolate.collide(t, IDENTITY, t, [IDENTITY], out=np.zeros(2, np.uint8)), ValueError, "^out: "),
        (lambda t: prolate.raycast(t, IDENTITY, [0, 0, 0], [0, 0, 0]), ValueError, r"^directions\[0\]: "),
        (lambda t: prolate.raycast(t, IDENTITY, np.zeros((2, 3)), np.ones((3, 3))), ValueError, "raycast"),
        (lambda t: prolate.overlap(t, IDENTITY, "ball"), TypeError, "^shape: "),
        (lambda t: prolate.overlap(t, IDENTITY, prolate.Sphere((0, 0), 1)), ValueError, "^shape.center: "),
        (lambda t: prolate.overlap(t, IDENTITY, prolate.Sphere((0, 0, 0), -1)), ValueError, "^shape.radius: "),
        (lambda t: prolate.overlap(t, IDENTITY, prolate.HalfSpace((0, 0, 0), 0)), ValueError, "^shape.normal: "),
        (lambda t: prolate.pairs.collide([1, 1, 1], [IDENTITY], [[0, 1]]), ValueError, r"^pairs\[0\]: names body 1"),
        (lambda t: prolate.pairs.collide([1, 1, 0], [IDENTITY], [[0, 0]]), ValueError, r"^radii\[0\]: "),
        (lambda t: prolate.World(slack=2), ValueError, "^slack: "),
        (lambda t: prolate.World().insert(t, [IDENTITY] * 2), ValueError, "^pose: "),
        (lambda t: prolate.World().move([1], [IDENTITY] * 2), ValueError, "^poses: "),
    ],
)
def test_bad_arguments_are_named(box_a, call, error, match):
    with pytest.raises(error, match=match):
        call(box_a)


def refused(a, b, at):
    with pytest.raises(ValueError, match="poses_a"):
        prolate.collide(a, IDENTITY[:3], b, at)


def test_no_leak_in_many_calls(box_a, box_b):
    at = poses(np.random.default_rng(13), 4, 1)
    calls = [
        lambda: prolate.collide(box_a, IDENTITY, box_b, at[0]),
        lambda: prolate.collide(box_a, IDENTITY, box_b, at),
        lambda: prolate.distance(box_a, IDENTITY, box_b, at),
        lambda: prolate.contacts(box_a, IDENTITY, box_b, at),
        lambda: prolate.raycast(box_a, IDENTITY, at[:, :3], at[:, :3]),
        lambda: prolate.Tree.from_bytes(box_a.buffer),
        lambda: box_a.cut(1),
        lambda: refused(box_a, box_b, at),
    ]

    def grown(repeat):
        for call in calls:
            for _ in range(repeat):
                call()
        gc.collect()
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    before = grown(200)
    assert grown(CALLS // len(calls)) - before < 4000  # KiB
