"""Bodies that deform: covers hold them wherever they move, and what cannot be is refused by name."""

from __future__ import annotations

import numpy as np
import pytest

import prolate
from prolate import Verdict

REST = [0, 0, 0, 0, 0, 0, 1]


def ball(n: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """A closed ball of 2 n triangles around its equator, and caps."""
    u, v = np.meshgrid(np.arange(2 * n) * np.pi / n, np.linspace(-1.2, 1.2, n))
    rings = np.stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)], axis=-1).reshape(-1, 3)
    vertices = np.concatenate([rings, [[0, 0, -1], [0, 0, 1]]]).astype(np.float32)
    faces = []
    for i in range(n - 1):
        for j in range(2 * n):
            a, b = i * 2 * n + j, i * 2 * n + (j + 1) % (2 * n)
            faces += [[a, b, b + 2 * n], [a, b + 2 * n, a + 2 * n]]
    last = (n - 1) * 2 * n
    for j in range(2 * n):
        faces += [[(j + 1) % (2 * n), j, len(rings)], [last + j, last + (j + 1) % (2 * n), len(rings) + 1]]
    return vertices, np.array(faces, np.uint32)


VERTICES, FACES = ball()
MODES = np.stack([VERTICES * [1, 0, 0], np.roll(VERTICES, 1, axis=1) ** 2])
RANGES = [0.5, 0.25]


@pytest.fixture(scope="module")
def trees() -> list[prolate.Tree]:
    baked = [
        prolate.bake(VERTICES, FACES, ellipsoids=8, quality="fast", threads=1),
        prolate.bake(VERTICES, FACES, exact=True, threads=1),
    ]
    return [tree.with_modes(VERTICES, FACES, modes=MODES, ranges=RANGES) for tree in baked]


def test_moves_as_the_modes_say(trees: list[prolate.Tree]) -> None:
    for tree, known in zip(trees, (2, 3)):  # covers do not shrink
        assert tree.mode_ranges.tolist() == RANGES
        # Stretched along x, it reaches 1.5 instead of 1.
        beside = [2.3, 0, 0, 0, 0, 0, 1]
        q = np.array([[0.0, 0], [0.5, 0], [-0.5, 0]])
        found = prolate.collide_deformed(tree, REST, tree, beside, q_a=q)
        assert found.tolist()[:known] == [Verdict.SEPARATED, Verdict.OVERLAPPING, Verdict.SEPARATED][:known]
        assert prolate.collide_deformed(tree, REST, tree, beside) is Verdict.SEPARATED
        assert prolate.collide_deformed(tree, REST, tree, beside, q_a=q[1]) is Verdict.OVERLAPPING
        poses = np.tile(np.array(REST, float), (3, 1))
        poses[:, 0] = [2.3, 4, 2.3]
        found = prolate.collide_deformed(tree, REST, tree, poses, q_a=q, q_b=q, threads=2)
        assert found.tolist()[:known] == [Verdict.SEPARATED] * known


def test_covers_miss_nothing_that_triangles_meet(trees: list[prolate.Tree]) -> None:
    cover, exact = trees
    random = np.random.default_rng(1)
    q = random.uniform(-1, 1, (300, 2)) * RANGES
    poses = np.concatenate([random.uniform(-1.6, 1.6, (300, 3)), random.normal(size=(300, 4))], axis=1)
    truth = prolate.collide_deformed(exact, REST, exact, poses, q_a=q, q_b=q[::-1])
    found = prolate.collide_deformed(cover, REST, cover, poses, q_a=q, q_b=q[::-1])
    assert 0 < (truth == Verdict.OVERLAPPING).sum() < 300
    assert (found[truth == Verdict.OVERLAPPING] == Verdict.OVERLAPPING).all()


def test_distances_and_rays_are_those_of_what_has_moved(trees: list[prolate.Tree]) -> None:
    cover, exact = trees
    # Stretched along x, it reaches half as far again.
    reach = float(VERTICES[:, 0].max())
    poses = np.array([[4, 0, 0, 0, 0, 0, 1], [2.2, 0, 0, 0, 0, 0, 1]])
    q = np.array([[0.5, 0], [0.5, 0]])
    found = prolate.distance_deformed(exact, REST, exact, poses, q_a=q)
    assert found.verdict.tolist() == [Verdict.SEPARATED, Verdict.OVERLAPPING]
    assert found.lower[0] <= 4 - 2.5 * reach <= found.upper[0] + 1e-5
    assert found.upper[0] - found.lower[0] < 1e-5
    assert found.lower[1] == 0
    assert found.point_a[0] == pytest.approx([1.5 * reach, 0, 0], abs=0.5)
    of_covers = prolate.distance_deformed(cover, REST, cover, poses, q_a=q)
    assert (of_covers.lower <= found.upper).all()
    assert of_covers.lower[0] > 0.5
    single = prolate.distance_deformed(exact, REST, exact, poses[0])
    assert single.upper == pytest.approx(4 - 2 * reach, abs=1e-5)

    rays = prolate.raycast_deformed(exact, REST, [5, 0, 0], [-1, 0, 0], q=[[0.5, 0], [0, 0], [-0.5, 0]])
    assert rays.t == pytest.approx(5 - reach * np.array([1.5, 1, 0.5]), abs=1e-5)
    assert rays.normal[0] == pytest.approx([1, 0, 0], abs=0.4)
    assert prolate.raycast_deformed(exact, REST, [5, 0, 0], [-1, 0, 0], q=[0.5, 0]).t == pytest.approx(
        rays.t[0], abs=1e-9
    )
    assert (prolate.raycast_deformed(cover, REST, [5, 0, 0], [-1, 0, 0], q=q).t <= rays.t[0] + 1e-5).all()
    assert prolate.raycast_deformed(cover, REST, [5, 0, 0], [1, 0, 0], q=[0.5, 0]).verdict == Verdict.SEPARATED


def test_bounds_hold_of_poses_as_they_are_given(trees: list[prolate.Tree]) -> None:
    """Far from the origin, with coordinates that make the body larger."""
    random = np.random.default_rng(2)
    n = 200
    q = random.choice([-1.0, 1.0], (n, 2)) * RANGES
    turn = random.normal(size=(n, 4))
    shift = random.uniform(-2, 2, (n, 3))
    here = np.concatenate([np.zeros((n, 3)), turn], axis=1)
    there = np.concatenate([shift, np.roll(turn, 1, axis=0)], axis=1)
    near = prolate.distance_deformed(trees[1], here, trees[1], there, q_a=q)
    for poses in (here, there):
        poses[:, :3] += [4e6, -3e6, 1e6]
    far = prolate.distance_deformed(trees[1], here, trees[1], there, q_a=q)
    assert (far.lower <= near.upper + 1e-9).all()
    assert (far.upper >= near.lower - 1e-9).all()
    assert (far.verdict == Verdict.SEPARATED).any()


def test_out_of_range_is_undecided(trees: list[prolate.Tree]) -> None:
    far = [100, 0, 0, 0, 0, 0, 1]
    for bad in (0.51, -0.51, np.nan, np.inf):
        assert prolate.collide_deformed(trees[0], REST, trees[0], far, q_a=[bad, 0]) is Verdict.UNDECIDED
        found = prolate.distance_deformed(trees[0], REST, trees[0], far, q_b=[bad, 0])
        assert (found.verdict, found.lower, found.upper) == (Verdict.UNDECIDED, 0, np.inf)
        assert np.isnan(found.point_a).all()
        hit = prolate.raycast_deformed(trees[0], REST, far[:3], [-1, 0, 0], q=[bad, 0])
        assert (hit.verdict, hit.t) == (Verdict.UNDECIDED, np.inf)


def test_refuses_what_cannot_be(trees: list[prolate.Tree]) -> None:
    rigid = prolate.bake(VERTICES, FACES, ellipsoids=2, quality="fast", threads=1)
    with pytest.raises(ValueError, match="modes: must have shape"):
        rigid.with_modes(VERTICES, FACES, modes=MODES[:, 1:], ranges=RANGES)
    with pytest.raises(ValueError, match="ranges: must have shape"):
        rigid.with_modes(VERTICES, FACES, modes=MODES, ranges=[1])
    with pytest.raises(ValueError, match="above 0"):
        rigid.with_modes(VERTICES, FACES, modes=MODES, ranges=[1, 0])
    with pytest.raises(ValueError, match="thousandfold"):
        rigid.with_modes(VERTICES, FACES, modes=MODES, ranges=[1, 1e6])
    with pytest.raises(prolate.Error, match="not finite"):
        rigid.with_modes(VERTICES, FACES, modes=MODES * np.nan, ranges=RANGES)
    with pytest.raises(prolate.Error, match="another mesh"):
        rigid.with_modes(2 * VERTICES, FACES, modes=MODES, ranges=RANGES)
    with pytest.raises(prolate.Error, match="already"):
        trees[0].with_modes(VERTICES, FACES, modes=MODES, ranges=RANGES)
    with pytest.raises(ValueError, match="q_a"):
        prolate.collide_deformed(rigid, REST, rigid, REST, q_a=[1])
    with pytest.raises(ValueError, match="q_a"):
        prolate.collide_deformed(trees[0], REST, trees[0], REST, q_a=[1, 2, 3])
    with pytest.raises(ValueError, match="poses_a: has 2 poses, not 1 or 3"):
        prolate.distance_deformed(trees[0], [REST, REST], trees[0], REST, q_b=np.zeros((3, 2)))
    with pytest.raises(ValueError, match="q: the tree has no modes"):
        prolate.raycast_deformed(rigid, REST, [5, 0, 0], [-1, 0, 0], q=[1])
    with pytest.raises(ValueError, match="coordinates, origins"):
        prolate.raycast_deformed(trees[0], REST, [[5, 0, 0]] * 3, [-1, 0, 0], q=np.zeros((2, 2)))


def test_takes_scaled_meshes() -> None:
    tree = prolate.bake(1000 * VERTICES, FACES, unit="mm", ellipsoids=2, quality="fast", threads=1)
    moving = tree.with_modes(1000 * VERTICES, FACES, modes=1000 * MODES, ranges=RANGES)
    assert moving.mode_ranges.tolist() == RANGES
    assert prolate.collide_deformed(moving, REST, moving, [4, 0, 0, 0, 0, 0, 1], q_a=RANGES) is Verdict.SEPARATED
