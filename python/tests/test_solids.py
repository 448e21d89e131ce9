"""Solids from covers outside and inside, against exact trees."""

from __future__ import annotations

import numpy as np
import pytest

import prolate
from conftest import IDENTITY, box_mesh, poses
from prolate import Verdict

HALF_A, HALF_B = (1.0, 0.6, 0.4), (0.5, 0.5, 0.9)


@pytest.fixture(scope="module")
def bodies():
    """(covers, exact) of two boxes."""
    out = []
    for half in (HALF_A, HALF_B):
        mesh = box_mesh(half)
        out.append(
            (prolate.bake(*mesh, ellipsoids=8, inner=20, quality="fast"), prolate.bake(*mesh, exact=True, inner=8))
        )
    return out


def test_the_inner_cover_lies_inside(bodies):
    tree, exact = bodies[0]
    inner = tree.inner
    assert inner is not None and inner.info.is_inner and not tree.info.is_inner
    assert 0.7 * tree.info.volume < inner.info.levels[-1].union_volume < tree.info.volume
    cut = inner.cut()
    reach = np.linalg.norm(cut.factor, axis=2)  # half extents of each
    assert (np.abs(cut.center) + reach <= np.array(HALF_A)).all()
    proof = tree.verify(*box_mesh(HALF_A))
    assert proof and proof.inner_inside and proof.protruding_node is None
    smaller = tree.verify(*box_mesh(np.array(HALF_A) * 0.99))
    assert not smaller and not smaller.inner_inside and smaller.protruding_node is not None
    assert exact.inner is not None and exact.has_triangles
    assert prolate.bake(*box_mesh(HALF_A), levels=1, quality="fast").inner is None


def test_bad_input():
    vertices, faces = box_mesh(HALF_A)
    with pytest.raises(prolate.Error, match="open mesh") as failure:
        prolate.bake(vertices, faces[1:], levels=1, inner=8)
    assert failure.value.code == "bad_mesh"
    for bad in (0, 65537, "many"):
        with pytest.raises((ValueError, TypeError), match="inner"):
            prolate.bake(vertices, faces, levels=1, inner=bad)


@pytest.mark.parametrize("offset", [0, 1e6])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_verdicts_are_those_of_the_triangles(bodies, offset, dtype):
    (a, exact_a), (b, exact_b) = bodies
    rng = np.random.default_rng(7)
    at_a, at_b = poses(rng, 500, 0.6), poses(rng, 500, 0.6)
    at_a[:, :3] += offset
    at_b[:, :3] += offset
    at_a, at_b = at_a.astype(dtype), at_b.astype(dtype)
    found = prolate.collide_solids(a, at_a, b, at_b, threads=2)
    wanted = prolate.collide(exact_a, at_a, exact_b, at_b)
    decided = found != Verdict.UNDECIDED
    assert decided.mean() > 0.7
    assert (found[decided] == wanted[decided]).all()
    assert (prolate.collide_solids(exact_a, at_a, exact_b, at_b) == wanted).all()

    apart = prolate.distance(exact_a, at_a, exact_b, at_b)
    bounds = prolate.distance_solids(a, at_a, b, at_b, tolerance=1e-3)
    assert (bounds.lower <= apart.upper + 1e-6).all() and (bounds.upper >= apart.lower - 1e-6).all()
    assert ((bounds.verdict == Verdict.SEPARATED) == (bounds.lower > 0)).all()
    met = bounds.verdict == Verdict.OVERLAPPING
    assert (bounds.upper[met] <= 1e-3).all() and (apart.verdict[met] == Verdict.OVERLAPPING).all()
    coarse = prolate.collide_solids(a, at_a, b, at_b, max_level=0)
    assert (coarse[coarse != 2] == wanted[coarse != 2]).all()


@pytest.mark.parametrize("offset", [0, 1e5])
def test_depths_and_ways_out(bodies, offset):
    (a, exact_a), (b, exact_b) = bodies
    rng = np.random.default_rng(8)
    at_a, at_b = poses(rng, 200, 0.4), poses(rng, 200, 0.4)
    at_a[:, :3] += offset
    at_b[:, :3] += offset
    depths = prolate.depth_solids(a, at_a, b, at_b, threads=2)
    assert (depths.verdict == prolate.collide_solids(a, at_a, b, at_b)).all()
    assert (depths.lower <= depths.upper).all()
    assert (depths.verdict[depths.lower > 0] == Verdict.OVERLAPPING).all() and (depths.lower > 0).sum() > 50
    out = np.isfinite(depths.upper)
    assert out.sum() > 50
    lengths = np.linalg.norm(depths.way_out, axis=1)
    assert np.allclose(lengths[out], depths.upper[out], rtol=1e-6) and (lengths[~out] == 0).all()
    moved = at_b[out].copy()
    moved[:, :3] += depths.way_out[out]
    assert (prolate.collide(exact_a, at_a[out], exact_b, moved) == Verdict.SEPARATED).all()
    along = rng.normal(size=(len(at_b), 3))
    moved = at_b.copy()
    moved[:, :3] += along * (0.99 * depths.lower / np.linalg.norm(along, axis=1))[:, None]
    met = depths.lower > 0
    assert (prolate.collide(exact_a, at_a[met], exact_b, moved[met]) == Verdict.OVERLAPPING).all()
    one = prolate.depth_solids(a, IDENTITY, b, IDENTITY)
    assert 0 < one.lower < one.upper and one.way_out.shape == (3,)


def test_pairs_of_a_world(bodies):
    covers, exact = prolate.World(), prolate.World()
    floor = prolate.HalfSpace((0, 0, 1), -0.6)
    at = poses(np.random.default_rng(9), 30, 1.0)
    for world, i in ((covers, 0), (exact, 1)):
        world.insert(floor)
        for k, pose in enumerate(at):
            world.insert(bodies[k % 2][i], pose)
    ids, found = covers.collide_solids()
    wanted = {tuple(row): verdict for row, verdict in zip(*(x.tolist() for x in exact.collide()))}
    for row, verdict in zip(ids.tolist(), found.tolist()):
        assert verdict in (Verdict.UNDECIDED, wanted.get(tuple(row), Verdict.SEPARATED))
    assert (found != Verdict.UNDECIDED).mean() > 0.6
    assert (covers.collide_solids(threads=2).verdict == found).all()
    assert (covers.collide_solids(budget=0).verdict == Verdict.UNDECIDED).all()


def test_single_poses_and_wrong_arguments(bodies):
    tree = bodies[0][0]
    assert prolate.collide_solids(tree, IDENTITY, tree, IDENTITY) is Verdict.OVERLAPPING
    far = IDENTITY.copy()
    far[0] = 5
    assert prolate.collide_solids(tree, IDENTITY, tree, far) is Verdict.SEPARATED
    assert prolate.collide_solids(tree, IDENTITY, tree, far, margin=4) is Verdict.OVERLAPPING
    assert prolate.collide_solids(tree, IDENTITY, tree, far, budget=0) is Verdict.UNDECIDED
    one = prolate.distance_solids(tree, IDENTITY, tree, far)
    assert 2 < one.lower <= 3 <= one.upper < 3.5 and one.verdict == Verdict.SEPARATED
    assert np.isinf(prolate.distance_solids(tree, IDENTITY, tree, far, max_distance=1).upper)
    with pytest.raises(TypeError, match="a: "):
        prolate.collide_solids("tree", IDENTITY, tree, far)
    with pytest.raises(ValueError, match="tolerance"):
        prolate.distance_solids(tree, IDENTITY, tree, far, tolerance=-1)
