"""A solid as few convex pieces, for covers by several hulls.

A lattice divides the solid; what is in a cell is within the hull of finitely many points, whatever else is known: a
corner of (solid in cell) is a corner of a triangle cut to the cell, or a corner of the cell in the solid. Then the two
neighbours are joined whose common hull adds least volume, again and again (Ghosh et al., "Fast Approximate Convex
Decomposition Using Relative Concavity", 2013, and others join pieces so). All hulls lie in the hull of the solid: what
is flat there stays so.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .. import Tree, signed_distance
from ._fits import around
from ._model import Matrix
from ._solids import cut, inverse, moved

CELLS = 400  #: of the lattice, about

_Cell = tuple[int, int, int]


class Pieces:
    """Points whose hulls hold a solid together; ``at(count)`` are those of as many pieces."""

    def __init__(self, vertices: Matrix, faces: NDArray[np.int64], solid: Tree, threads: int = 0) -> None:
        """Of the solid between triangles, which are not flat; ``solid`` is an exact tree of them."""
        self.cells = _cells(vertices, faces, solid, threads)
        self._joins = list(_joined(self.cells))

    def at(self, count: int) -> list[Matrix]:
        """The points (n, 3) of each of ``count`` pieces, or of fewer if there are no more."""
        groups = {i: [points] for i, points in enumerate(self.cells.values())}
        for step, (a, b) in enumerate(self._joins):
            if len(groups) <= count:
                break
            groups[len(self.cells) + step] = groups.pop(a) + groups.pop(b)
        return [np.concatenate(group) for group in groups.values()]


def _cells(vertices: Matrix, faces: NDArray[np.int64], solid: Tree, threads: int) -> dict[_Cell, Matrix]:
    """The points of each cell of a lattice, along a small box around the solid, that the solid comes to."""
    pose = around(vertices, "box").pose
    vertices = moved(inverse(pose), vertices)
    low, high = vertices.min(0), vertices.max(0)
    size = np.maximum(high - low, 1e-3 * (high - low).max())
    counts = _counts(size)
    planes = [low[axis] + size[axis] * np.arange(counts[axis] + 1) / counts[axis] for axis in range(3)]
    corners = np.stack(np.meshgrid(*planes, indexing="ij"), -1)
    # The tree is of vertices in float32; what is outside by less than that rounds is taken for inside.
    depth = signed_distance(solid, moved(pose, corners.reshape(-1, 3)), threads=threads).lower
    inside = depth.reshape(counts + 1) <= 1e-6 * float(size.max())
    found: dict[_Cell, Matrix] = {}
    for x, slab in enumerate(_slabs(vertices[faces], 0, planes[0])):
        for y, bar in enumerate(_slabs(slab, 1, planes[1])):
            for z, part in enumerate(_slabs(bar, 2, planes[2])):
                here = (slice(x, x + 2), slice(y, y + 2), slice(z, z + 2))
                if len(part) or inside[here].all():  # no surface: all of the cell, or nothing
                    points = np.concatenate([part.reshape(-1, 3), corners[here][inside[here]]])
                    found[x, y, z] = np.unique(moved(pose, points), axis=0)
    return found


def _counts(size: NDArray[np.float64]) -> NDArray[np.int64]:
    """Of cells along the edges of a box: cells are cubes, about, but none is thinner than what is flat."""
    edge = float(size.prod() / CELLS) ** (1 / 3)
    while True:
        counts: NDArray[np.int64] = np.maximum(np.round(size / edge), 1).astype(np.int64)
        if counts.prod() <= 1.5 * CELLS:
            return counts
        edge *= 1.05


def _slabs(triangles: Matrix, axis: int, planes: NDArray[np.float64]) -> Iterator[Matrix]:
    """The triangles (n, 3, 3), cut at the inner planes."""
    for at in planes[1:-1]:
        part, triangles = cut(triangles, triangles[:, :, axis] - at)
        yield part
    yield triangles


def _joined(cells: dict[_Cell, Matrix]) -> Iterator[tuple[int, int]]:
    """Which two pieces are joined, step by step; those of step i become piece ``len(cells) + i``."""
    number = {cell: i for i, cell in enumerate(cells)}
    hulls = {i: _hull(points) for i, points in enumerate(cells.values())}
    near: dict[int, set[int]] = {i: set() for i in hulls}
    for (x, y, z), i in number.items():
        for other in ((x + 1, y, z), (x, y + 1, z), (x, y, z + 1)):
            if other in number:
                near[i].add(number[other])
                near[number[other]].add(i)
    queue: list[tuple[float, int, int]] = []

    def propose(a: int, b: int) -> None:
        together = _hull(np.concatenate([hulls[a][0], hulls[b][0]]))[1]
        heapq.heappush(queue, (together - hulls[a][1] - hulls[b][1], a, b))

    for i in near:
        for j in near[i]:
            if i < j:
                propose(i, j)
    new = len(cells) - 1
    while len(hulls) > 1:
        if not queue:  # parts that are apart
            for i in hulls:
                near[i] = set(hulls) - {i}
                for j in near[i]:
                    if i < j:
                        propose(i, j)
        _, a, b = heapq.heappop(queue)
        if a not in hulls or b not in hulls:
            continue
        yield a, b
        new += 1
        hulls[new] = _hull(np.concatenate([hulls.pop(a)[0], hulls.pop(b)[0]]))
        near[new] = (near.pop(a) | near.pop(b)) - {a, b}
        for j in near[new]:
            near[j] = near[j] - {a, b} | {new}
            propose(new, j)


def _hull(points: Matrix) -> tuple[Matrix, float]:
    """Its corners and volume; flat points stay as they are."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:
        return points, 0.0
    return points[hull.vertices], float(hull.volume)
