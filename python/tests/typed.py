"""What type checkers must accept: mypy --strict and pyright read this file, nobody runs it."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import prolate


def use(vertices: np.ndarray[tuple[int, int], np.dtype[np.float64]], faces: list[list[int]]) -> float:
    tree: prolate.Tree = prolate.bake(vertices, faces, levels=3, quality="fast", progress=lambda s, f, n: f < 0.5)
    tree.save(Path("tree.etree"))
    again = prolate.Tree.from_bytes(bytes(tree))
    verdicts = prolate.collide(tree, [0, 0, 0, 0, 0, 0, 1], again, np.eye(4), margin=0.1, order="wxyz")
    if verdicts == prolate.Verdict.SEPARATED:
        return 0.0
    found = prolate.distance(tree, np.eye(4), again, np.eye(4), threads=0)
    hits = prolate.raycast(tree, np.eye(4), np.zeros((5, 3)), np.ones((5, 3)))
    prolate.overlap(tree, np.eye(4), prolate.Sphere((0, 0, 0), 1))
    results = prolate.bake_many([prolate.Asset("a.obj", {"exact": True})], executor=ProcessPoolExecutor(), cache="c")
    trees = [result.tree for result in results if result.tree is not None]
    world = prolate.World()
    identifier: int = world.insert(trees[0], np.eye(4))
    world.move([identifier], [np.eye(4)])
    ids, verdict = world.collide()
    cut: prolate.Ellipsoids = tree.cut(-1)
    pairs = prolate.pairs.collide(cut.radii, np.hstack([cut.center, cut.quaternion]), [[0, 1]])
    counts = pairs.sum() + len(ids) + len(verdict)
    return float(found.lower.sum() + hits.t.sum() + tree.info.levels[-1].outside_ratio + counts)
