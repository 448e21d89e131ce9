"""How far a cover sticks out of a solid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .. import Tree, signed_distance
from ._model import Geometry, Matrix
from ._solids import Faces, hull_of, inverse, merged, moved, outside


def beyond(cover: Sequence[Geometry], points: Matrix) -> NDArray[np.float64]:
    """At most how far each of the points (n, 3) is outside of all geometries; 0 or less in any, and only there."""
    found: NDArray[np.float64] = np.min([outside(one.shape, moved(inverse(one.pose), points)) for one in cover], axis=0)
    return found


def farthest(
    cover: Sequence[Geometry], solid: Tree, limit: float | None = None, threads: int = 0, cells: int = 20_000
) -> float:
    """An upper bound of how far any point of the cover is from the solid, metres.

    The cover's box is divided into cells, those again that may matter, until so many would be that the answer could
    only be refined slowly. Distances grow by no more than one metre a metre, so a cell of half diagonal r around a
    point at distance d has none above d + r. An open solid has no inside, so only the cover's surface is looked at.

    Parameters
    ----------
    solid : Tree
        An exact tree.
    limit : float, optional
        Only decide whether any point is farther than this, metres: the answer is a bound just good enough for that.
    """
    corners = merged(cover)[0]
    low, high = corners.min(0), corners.max(0)
    edge = float((high - low).max()) / 8
    counts = np.maximum(np.ceil((high - low) / edge), 1).astype(int)
    centers = low + (np.indices(counts).reshape(3, -1).T + 0.5) * edge
    halves = np.indices((2, 2, 2)).reshape(3, -1).T - 0.5
    settled, hollow = 0.0, solid.info.surface_mode
    while True:
        reach = edge * 3**0.5 / 2
        depth = beyond(cover, centers)
        near = (np.abs(depth) if hollow else depth) <= reach
        centers, depth = centers[near], depth[near]
        apart = signed_distance(solid, centers, threads=threads)
        least = float(np.max(apart.lower, where=depth <= 0, initial=0.0))
        most = np.maximum(apart.upper + reach, 0)
        open_ = most > max(limit or 0.0, least)
        settled = max(settled, float(np.max(most, where=~open_, initial=0.0)))
        if (limit is not None and least > limit) or not open_.any() or 8 * open_.sum() > cells:
            return max(settled, float(most.max(initial=0.0)))
        edge /= 2
        centers = (centers[open_, None] + halves * edge).reshape(-1, 3)


def flaw(vertices: Matrix, faces: Faces, solid: Tree) -> float:
    """How far the convex hull of a solid sticks out of it at most, metres; infinite where nothing is known.

    Say that each triangle is no more than e below the plane of one of the hull's faces, and that a ball of radius r > e
    around p lies in the solid. From p to a point x of the hull that is outside, a line leaves the solid somewhere, last
    at s. Over the plane near s, p has a height of -r or less, s of -e or more and x of 0 or less. So x is at most
    |s - p| e / (r - e) from s.
    """
    planes = hull_of(vertices).equations
    if solid.info.surface_mode or len(faces) * len(planes) > 2e8:
        return float("inf")
    corners = vertices[faces]
    depth = 0.0
    for first in range(0, len(corners), 1000):
        some = corners[first : first + 1000]
        near = planes[(some.mean(1) @ planes[:, :3].T + planes[:, 3]).argmax(1)]
        depth = max(depth, -float((np.einsum("nki,ni->nk", some, near[:, :3]) + near[:, 3:]).min()))
    middle = vertices.mean(0)
    inner = -float(signed_distance(solid, middle[None]).upper[0])
    if inner <= depth:
        return float("inf")
    return float(np.linalg.norm(vertices - middle, axis=1).max()) * depth / (inner - depth)


def mean_distance(cover: Sequence[Geometry], solid: Tree, threads: int = 0, samples: int = 4000) -> float:
    """How far the cover's surface is from the solid (an exact tree) on average, metres, by so many random points."""
    random = np.random.default_rng(1)
    vertices, faces = merged(cover)
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = corners[random.choice(len(area), samples, p=area / area.sum())]
    points = (chosen * random.dirichlet(np.ones(3), samples)[:, :, None]).sum(1)
    points = points[beyond(cover, points) >= -1e-9 * np.ptp(vertices)]  # and in no other geometry
    return float(np.maximum(signed_distance(solid, points, threads=threads).upper, 0).mean())
