"""Bodies that bones move: covers hold them at any matrices, and what cannot be is refused by name."""

from __future__ import annotations

import numpy as np
import pytest
from test_deform import ball

import prolate
from prolate import Verdict

REST = [0, 0, 0, 0, 0, 0, 1]
VERTICES, FACES = ball(12)
VERTICES = (VERTICES * [2, 0.4, 0.4]).astype(np.float32)
UPPER = np.clip(VERTICES[:, 0] + 0.5, 0, 1)
JOINTS = np.tile(np.arange(2), (len(VERTICES), 1))
WEIGHTS = np.stack([1 - UPPER, UPPER], axis=1)


@pytest.fixture(scope="module")
def trees() -> list[prolate.Tree]:
    baked = [
        prolate.bake(VERTICES, FACES, ellipsoids=24, quality="fast", threads=1),
        prolate.bake(VERTICES, FACES, exact=True, threads=1),
    ]
    return [tree.with_skin(VERTICES, FACES, joints=JOINTS, weights=WEIGHTS) for tree in baked]


def bent(angle: float) -> np.ndarray:
    """The second bone turned about z."""
    out = np.tile(np.eye(4), (2, 1, 1))
    out[1, :2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return out


def test_moves_as_the_bones_say(trees: list[prolate.Tree]) -> None:
    other = prolate.bake(VERTICES * [0.15, 0.75, 0.75], FACES, exact=True, threads=1)
    beside = [0, 1.5, 0, 0, 0, 0, 1]  # where the limb goes if it is bent by a right angle
    poses = np.stack([bent(0), bent(np.pi / 2), bent(-np.pi / 2)])
    for tree, known in zip(trees, (2, 3)):  # covers of a joint that is bent are wider
        assert tree.bone_count == 2
        found = prolate.collide_deformed(tree, REST, other, beside, bones_a=poses)
        assert found.tolist()[:known] == [Verdict.SEPARATED, Verdict.OVERLAPPING, Verdict.SEPARATED][:known]
        assert prolate.collide_deformed(other, beside, tree, REST, bones_b=poses[1][:, :3]) is Verdict.OVERLAPPING
        assert prolate.collide_deformed(tree, REST, other, beside) is Verdict.SEPARATED
        hits = prolate.raycast_deformed(tree, REST, [0, 5, 0], [0, -1, 0], bones=poses)
        assert hits.t[1] < 3.1 < hits.t[0]
        distances = prolate.distance_deformed(tree, REST, other, [0, 4, 0, 0, 0, 0, 1], bones_a=poses)
        assert (distances.lower <= distances.upper).all()
        assert distances.lower[1] < distances.lower[0] - 1
    assert other.bone_count == 0


def test_covers_miss_nothing_that_triangles_meet(trees: list[prolate.Tree]) -> None:
    cover, exact = trees
    random = np.random.default_rng(1)
    bones = random.uniform(-1, 1, (300, 2, 3, 4))  # any affine maps
    poses = np.concatenate([random.uniform(-2, 2, (300, 3)), random.normal(size=(300, 4))], axis=1)
    truth = prolate.collide_deformed(exact, REST, exact, poses, bones_a=bones, bones_b=bones[::-1])
    found = prolate.collide_deformed(cover, REST, cover, poses, bones_a=bones, bones_b=bones[::-1])
    assert 0 < (truth == Verdict.OVERLAPPING).sum() < 300
    assert (found[truth == Verdict.OVERLAPPING] == Verdict.OVERLAPPING).all()


def test_bones_and_modes_together() -> None:
    plain = prolate.bake(VERTICES, FACES, exact=True, threads=1)
    modes = (VERTICES * [0, 0, 1])[None]
    tree = plain.with_modes(VERTICES, FACES, modes=modes, ranges=[2]).with_skin(
        VERTICES, FACES, joints=JOINTS, weights=WEIGHTS
    )
    # Thicker along z by the mode, then stretched by the bones.
    bones = np.tile(np.diag([1.0, 1, 2, 1]), (2, 1, 1))
    hit = prolate.raycast_deformed(tree, REST, [0, 0, 5], [0, 0, -1], q=[1], bones=bones)
    assert hit.t == pytest.approx(5 - 0.4 * 2 * 2, abs=1e-5)


def test_what_cannot_be_is_refused_by_name(trees: list[prolate.Tree]) -> None:
    tree = trees[0]
    plain = prolate.bake(VERTICES, FACES, ellipsoids=8, quality="fast", threads=1)

    def with_skin(joints: object = JOINTS, weights: object = WEIGHTS, bones: int | None = None) -> None:
        plain.with_skin(VERTICES, FACES, joints=joints, weights=weights, bones=bones)  # type: ignore[arg-type]

    for bad, words in (
        (WEIGHTS * 1.5, "add up to 1"),
        (WEIGHTS - 0.5, "below 0"),
        (np.where(WEIGHTS > 0.5, np.nan, WEIGHTS), "not finite"),
    ):
        with pytest.raises(prolate.Error, match=words):
            with_skin(weights=bad)
    with pytest.raises(ValueError, match=r"shape \(V, W\)"):
        with_skin(weights=WEIGHTS[:, :1])
    with pytest.raises(prolate.Error, match="number of vertices"):
        with_skin(JOINTS[:-1], WEIGHTS[:-1])
    with pytest.raises(ValueError, match="integers from 0 to 1023"):
        with_skin(JOINTS - 1)
    with pytest.raises(prolate.Error, match="does not exist"):
        with_skin(bones=1)
    with pytest.raises(prolate.Error, match="skin already"):
        tree.with_skin(VERTICES, FACES, joints=JOINTS, weights=WEIGHTS)
    with pytest.raises(ValueError, match="bones_a: must have shape"):
        prolate.collide_deformed(tree, REST, tree, REST, bones_a=np.eye(4))
    with pytest.raises(ValueError, match="bones_a"):
        prolate.collide_deformed(tree, REST, tree, REST, bones_a=np.tile(np.eye(4), (3, 1, 1)))
    with pytest.raises(ValueError, match="the tree has no bones"):
        prolate.collide_deformed(tree, REST, plain, REST, bones_b=bent(0))
    wild = bent(0)
    wild[1, 0, 0] = np.nan
    assert prolate.collide_deformed(tree, REST, tree, [50, 0, 0, 0, 0, 0, 1], bones_a=wild) is Verdict.UNDECIDED
