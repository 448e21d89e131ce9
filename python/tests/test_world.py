"""Worlds against the queries of two bodies, asked for all pairs."""

from __future__ import annotations

import itertools
import threading

import numpy as np
import pytest

import prolate
from conftest import IDENTITY, matrix, poses
from prolate import EventKind, Verdict

BOX, BALL = prolate.box_tree([0.5, 0.3, 0.2]), prolate.sphere_tree(0.4)


def scene(count=40, seed=20):
    """Boxes and balls: a world with margins of 0.2, their trees and poses by id."""
    world, bodies = prolate.World(), {}
    for i, pose in enumerate(poses(np.random.default_rng(seed), count, 1.5, np.float32)):
        tree = (BOX, BALL)[i % 2]
        bodies[world.insert(tree, pose, margin=0.2)] = (tree, pose)
    return world, bodies


def both(bodies, ids):
    return (*bodies[int(ids[0])], *bodies[int(ids[1])])


def test_pairs_are_answered_as_two_bodies_are():
    world, bodies = scene()
    ids, verdict = world.collide()
    listed = {tuple(row) for row in ids.tolist()}
    assert {0, 1} == set(verdict)
    for row, found in zip(ids, verdict):
        assert prolate.collide(*both(bodies, row)) == found
    for pair in itertools.combinations(sorted(bodies), 2):
        assert pair in listed or prolate.distance(*both(bodies, pair)).lower > 0.4
    again, apart = world.distance(threads=2)
    assert (again == ids).all()
    for i, row in enumerate(ids):
        alone = prolate.distance(*both(bodies, row))
        assert (alone.lower, alone.upper) == (apart.lower[i], apart.upper[i])
    assert (world.collide(threads=3).verdict == verdict).all()
    assert (world.collide(budget=0).verdict == Verdict.UNDECIDED).all()


def test_contacts_of_pairs_and_what_becomes_of_them():
    world, bodies = scene()
    ids, found, event_ids, kind = world.contacts()
    touching = found.verdict == Verdict.OVERLAPPING
    assert touching.any() and (kind == EventKind.BEGAN).all() and (event_ids == ids[touching]).all()
    for i, row in enumerate(ids):
        alone = prolate.contacts(*both(bodies, row))
        rows = slice(found.offsets[i], found.offsets[i + 1])
        assert np.array_equal(alone.depth, found.depth[rows]) and np.array_equal(alone.point_a, found.point_a[rows])
    again = world.contacts()
    assert (again.event_kind == EventKind.STAYS).all() and (again.event_ids == event_ids).all()
    assert (again.found.id == found.id).all()
    gone, moved = event_ids[0]
    world.remove(int(gone))
    world.move([int(moved)], [IDENTITY + [1e3, 0, 0, 0, 0, 0, 0]])
    world.pairs()  # brings the pairs up to date; what has ended is not lost
    last = world.contacts()
    ended = {tuple(row) for row in last.event_ids[last.event_kind == EventKind.ENDED].tolist()}
    assert ended == {tuple(row) for row in event_ids.tolist() if gone in row or moved in row}


def test_rays_probes_and_sweeps_find_the_first_body():
    world, bodies = scene()
    rng = np.random.default_rng(21)
    origins, aims = rng.normal(size=(2, 200, 3)).astype(np.float32) * [[[6]], [[1]]]
    directions = (aims - origins).astype(np.float32)
    hits = world.raycast(origins, directions, threads=2)
    each = [prolate.raycast(tree, pose, origins, directions).t for tree, pose in bodies.values()]
    assert np.allclose(hits.found.t, np.min(each, axis=0), rtol=1e-6)
    first = np.array(list(bodies))[np.argmin(each, axis=0)]
    assert (hits.id == np.where(np.isfinite(hits.found.t), first, 0)).all() and (hits.id > 0).sum() > 50

    ball = [prolate.Sphere(center, 0.5) for center in aims]
    offsets, ids = world.overlap(ball, threads=2)
    for i, sphere in enumerate(ball):
        meets = [n for n, (tree, pose) in bodies.items() if prolate.overlap(tree, pose, sphere) != Verdict.SEPARATED]
        assert ids[offsets[i] : offsets[i + 1]].tolist() == meets
    everything = world.overlap(prolate.Box(IDENTITY, [50, 50, 50]))
    assert everything.ids.tolist() == sorted(bodies)

    start, end = (poses(rng, 30, spread, np.float32) for spread in (4, 1))
    swept = world.sweep(BALL, start, end, tolerance=1e-4)
    alone = np.array(
        [prolate.sweep(BALL, start, end, tree, pose, pose, tolerance=1e-4).toi for tree, pose in bodies.values()]
    )
    assert np.allclose(swept.found.toi, alone.min(axis=0), atol=1e-3) and (swept.id > 0).any()
    meets = world.overlap(BALL, end)
    assert meets.offsets.shape == (31,) and world.overlap(BALL, end[0]).offsets.tolist() == [0, meets.offsets[1]]


def test_ground_and_compounds():
    world = prolate.World()
    ground = world.insert(prolate.HalfSpace((0, 0, 1), 0))
    parts = [(BALL, IDENTITY + [2, 0, 0, 0, 0, 0, 0])]
    body = world.insert(BOX, IDENTITY + [0, 0, 0.19, 0, 0, 0, 0], parts=parts)
    ball = world.part(body, 1)
    assert len(world) == 3 and world.body_of(ball) == body and world.part(body, 0) == body and world.part(body, 2) == 0
    found = world.contacts()
    assert found.ids.tolist() == [[ground, body], [ground, ball]]
    assert found.found.depth.max() == pytest.approx(0.21, abs=1e-3) and np.allclose(found.found.normal, [0, 0, 1])
    world.move([body], [matrix(IDENTITY + [0, 0, 5, 0, 0, 0, 0])])
    assert world.raycast([2, 0, 9], [0, 0, -1]).id == ball
    world.refilter(body, layers=2, mask=2)
    assert world.raycast([2, 0, 9], [0, 0, -1], mask=1).id == ground
    for call, match in (
        (lambda: world.insert(prolate.HalfSpace((0, 0, 1), 0), IDENTITY), "pose"),
        (lambda: world.insert(BOX, IDENTITY, parts=[BALL]), "parts"),
        (lambda: world.overlap(prolate.HalfSpace((0, 0, 1), 0)), "what"),
        (lambda: world.overlap(prolate.Sphere((0, 0, 0), 1), IDENTITY), "poses"),
    ):
        with pytest.raises(TypeError, match=match):
            call()
    with pytest.raises(prolate.Error):
        world.move([ground], [IDENTITY])


def test_threads_may_share_a_world():
    world, bodies = scene()
    failed = []

    def work(seed):
        rng = np.random.default_rng(seed)
        try:
            for _ in range(30):
                mine = world.insert(BOX, poses(rng, 1, 1)[0])
                world.move([mine], poses(rng, 1, 1))
                world.contacts(threads=2)
                world.raycast(rng.normal(size=(5, 3)), rng.normal(size=(5, 3)))
                world.remove(mine)
                world.collide()
        except Exception as error:
            failed.append(error)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failed and len(world) == len(bodies)
