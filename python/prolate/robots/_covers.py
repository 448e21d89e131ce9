"""Covers of one link, and which of them to take.

What a cover costs is how long a target takes to ask about it, in ellipsoids: each body counts one, and a convex hull
one for each 256 vertices that it has, but one at least.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import Any, Literal

import numpy as np

from .. import Asset, Ellipsoids, Tree, least_clearance, signed_distance
from .._bake_many import bake_asset
from ._fits import around, hull_within, thickened
from ._measure import farthest, flaw
from ._model import (
    BoxShape,
    CapsuleShape,
    CylinderShape,
    EllipsoidShape,
    Geometry,
    Link,
    Matrix,
    MeshShape,
    SphereShape,
)
from ._pieces import Pieces
from ._proof import holds_ellipsoids, holds_points, holds_solid
from ._solids import Faces, grown, hull_triangles, is_flat, merged, volume, volume_of_hull

Kind = Literal["ellipsoids", "spheres", "sphere", "box", "capsule", "cylinder", "hull"]
KEEPS: dict[type, set[Kind]] = {
    BoxShape: {"box"},
    CapsuleShape: {"capsule"},
    CylinderShape: {"cylinder"},
    SphereShape: {"sphere", "spheres"},
    EllipsoidShape: {"ellipsoids"},
}  #: a primitive of a link stays what it is if one of these kinds is allowed
SINGLE: tuple[Kind, ...] = ("box", "capsule", "cylinder", "sphere")
KINDS: tuple[Kind, ...] = ("hull", *SINGLE, "ellipsoids", "spheres")
WORTH = 0.01  #: part of a cover's volume that is worth no more of a cost
FURTHER = 0.05  #: part of a link's volume that a further hull must gain, as each costs time wherever the robot is
NEGLIGIBLE = 0.005  #: part of a cover's volume that is not worth a bake
COUNTS = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)  #: of convex pieces that are tried
VERTICES_OF_ONE = 256  #: of a hull that costs as much as one ellipsoid


@dataclass(frozen=True)
class Options:
    """Of all bakes of a robot."""

    kinds: tuple[Kind, ...] = KINDS
    max_hull_vertices: int = VERTICES_OF_ONE
    max_ellipsoids: int = 64
    quality: Literal["fast", "normal", "best"] = "fast"
    threads: int = field(default=0, repr=False)  # these two change no cover
    cache: str | None = field(default=None, repr=False)


@dataclass(frozen=True, eq=False)
class Cover:
    """Geometries in the frame of a link that hold its meshes. ``volume`` is that of their union, m^3, and ``tree`` one
    whose leaves they hold, where they were baked. ``proved`` is about the very numbers in ``geometries``."""

    kind: Kind
    geometries: tuple[Geometry, ...]
    volume: float
    proved: bool
    tree: Tree | None = None

    @property
    def cost(self) -> float:
        return sum(map(cost_of, self.geometries))


def cost_of(geometry: Geometry) -> float:
    """In ellipsoids."""
    shape = geometry.shape
    return max(1.0, len(shape.vertices) / VERTICES_OF_ONE) if isinstance(shape, MeshShape) else 1.0


class Solid:
    """Geometries of a link as one mesh, in the link's frame: those that need a cover.

    The library keeps vertices in float32; ``rounding`` is how far that moves them, metres. Covers are larger by
    ``growth``, metres, than what holds the meshes: by that rounding, and by what targets that calculate in float32
    lose.
    """

    vertices: Matrix
    faces: Faces

    def __init__(self, link: Link, geometries: Sequence[Geometry], options: Options) -> None:
        self.link, self.geometries, self.options = link, geometries, options
        self.vertices, self.faces = merged(geometries)
        self._leaves: dict[str, Cover] = {}
        self._hulls: dict[int, Cover] = {}
        self.rounding = float(np.linalg.norm(self.vertices - self.vertices.astype(np.float32), axis=1).max(initial=0.0))
        self.growth = self.rounding + 4e-7 * float(np.abs(self.vertices).max(initial=0.0))

    @cached_property
    def size(self) -> float:
        """The longest edge of a box around it, metres. What is flat becomes a part of that thick."""
        return float(np.ptp(self.vertices, axis=0).max())

    @cached_property
    def points(self) -> Matrix:
        """The corners of the convex hull; none of flat meshes."""
        try:
            return hull_triangles(self.vertices)[0]
        except ValueError:
            return np.empty((0, 3))

    @cached_property
    def exact(self) -> Tree:
        """The triangles as a tree."""
        return self.baked(exact=True)

    @cached_property
    def volume(self) -> float:
        """m^3; 0 of an open mesh."""
        return self.exact.info.volume

    def baked(self, **goal: Any) -> Tree:
        """Raises what :func:`prolate.bake` does."""
        goal = {"threads": self.options.threads, **goal}
        result = bake_asset(Asset((self.vertices, self.faces), goal), self.options.cache)
        if result.tree is None:
            assert result.error is not None
            raise result.error
        return result.tree

    # ---- covers ----

    def _parts(self) -> list[Cover]:
        """A hull for each geometry, if there are several."""
        if len(self.geometries) < 2 or len(self.geometries) > 16:
            return []
        most = self.options.max_hull_vertices
        hulls = []
        for one in self.geometries:
            vertices = merged([one])[0]
            if is_flat(vertices):
                return []
            hulls.append((grown(hull_within(thickened(vertices, self.size), most), self.growth), vertices))
        proved = all(holds_points(hull, vertices) for hull, vertices in hulls)
        bodies = tuple(hull for hull, _ in hulls)
        return [Cover("hull", bodies, sum(volume(hull.shape) for hull in bodies), proved)]

    @cached_property
    def has_hulls(self) -> bool:
        """Are hulls allowed, and possible?"""
        return "hull" in self.options.kinds and len(self.points) > 0

    @cached_property
    def _pieces(self) -> Pieces | None:
        """None where hulls are not allowed, or one is as good as the mesh."""
        if not self.has_hulls:
            return None
        hull = volume_of_hull(self.points)
        if hull - self.volume <= NEGLIGIBLE * hull:
            return None
        return Pieces(self.vertices, self.faces, self.exact, self.options.threads)

    def hulls(self, most: float) -> Iterator[Cover]:
        """By hulls of convex pieces, fewest first, that cost no more than ``most``, and are proved."""
        for count in COUNTS:
            if self._pieces is None or count > min(most, len(self._pieces.cells), self.options.max_ellipsoids):
                return
            if count not in self._hulls:
                self._hulls[count] = self._around_pieces(self._pieces.at(count))
            if self._hulls[count].proved and self._hulls[count].cost <= most:
                yield self._hulls[count]

    def _around_pieces(self, pieces: list[Matrix]) -> Cover:
        most = self.options.max_hull_vertices
        bodies = tuple(grown(hull_within(thickened(points, self.size), most), self.growth) for points in pieces)
        # By half: to cut triangles rounds, too, by much less.
        proved = all(holds_points(hull, points, self.growth / 2) for hull, points in zip(bodies, pieces))
        return Cover("hull", bodies, sum(volume(hull.shape) for hull in bodies), proved)

    @cached_property
    def convex(self) -> list[Cover]:
        """Those by one convex body, of the kinds asked for, or by a hull for each geometry."""
        kinds, most = self.options.kinds, self.options.max_hull_vertices
        if not len(self.points):
            return []
        found = []
        if self.has_hulls:
            found = [self._around("hull", hull_within(thickened(self.points, self.size), most)), *self._parts()]
        if not found or found[0].volume > (1 + WORTH) * volume_of_hull(self.points):  # or else none can be much smaller
            found += [self._around(kind, around(self.points, kind)) for kind in kinds if kind in SINGLE]
        return found

    @cached_property
    def first(self) -> Cover:
        """The cover of least cost, and of these the one of least volume."""
        proved = [cover for cover in self.convex if cover.proved]
        return min(proved, key=lambda one: (one.cost, one.volume)) if proved else self.leaves(ellipsoids=1)

    @cached_property
    def baked_kind(self) -> Literal["ellipsoids", "spheres"] | None:
        """Which of the two a bake may make."""
        kinds = self.options.kinds
        return "ellipsoids" if "ellipsoids" in kinds else "spheres" if "spheres" in kinds else None

    def leaves(self, **goal: Any) -> Cover:
        """By a bake with this goal, which is done once. Raises what it does."""
        known = repr(sorted(goal.items()))
        if known not in self._leaves:
            self._leaves[known] = self._baked_leaves(goal)
        return self._leaves[known]

    def _baked_leaves(self, goal: dict[str, Any]) -> Cover:
        kind = self.baked_kind or "ellipsoids"
        primitive = "ellipsoid" if kind == "ellipsoids" else "sphere"
        tree = self.baked(primitive=primitive, quality=self.options.quality, **goal)
        inner = tree.cut()
        bodies = tuple(grown(one, self.growth) for one in _bodies(inner, kind))
        proved = tree.info.proved and holds_ellipsoids(bodies, inner, self.rounding)
        return Cover(kind, bodies, tree.info.levels[-1].union_volume, proved, tree)

    def farthest(self, cover: Cover, limit: float | None = None) -> float:
        """How far the cover sticks out, metres: a bound; with a ``limit``, just good enough to tell if that is kept."""
        if cover.tree is not None:
            return cover.tree.info.levels[-1].hausdorff_max + self.growth
        at_corners = self._farthest_corner(cover)
        close = at_corners <= (limit or 0.0) or self.flaw <= max(self.growth, 0.01 * at_corners)
        if close and at_corners < float("inf"):
            return at_corners
        return min(at_corners, self._farthest_cell(cover, limit))

    @cached_property
    def flaw(self) -> float:
        """How far the solid is from being convex, metres: a bound."""
        return flaw(self.vertices, self.faces, self.exact) if len(self.points) else float("inf")

    def _farthest_corner(self, cover: Cover) -> float:
        """As :meth:`farthest`, for polyhedra around what is convex: distances from that are greatest at corners."""
        if not all(isinstance(one.shape, (BoxShape, MeshShape)) for one in cover.geometries):
            return float("inf")
        corners = merged(cover.geometries)[0]
        return self.flaw + float(signed_distance(self.exact, corners, threads=self.options.threads).upper.max())

    def _farthest_cell(self, cover: Cover, limit: float | None) -> float:
        return farthest(cover.geometries, self.exact, limit, self.options.threads, 20_000 if limit is None else 300_000)

    def is_proved(self, cover: Cover) -> bool:
        """Is it? Where several hulls cover the solid, of the hulls and triangles alone, too: how they were found, which
        ``proved`` is about, does not matter then."""
        if not cover.proved or cover.kind != "hull" or len(cover.geometries) < 2:
            return cover.proved
        triangles = self.vertices[self.faces]
        return holds_solid(cover.geometries, triangles, self.exact, self.growth, self.options.threads)

    def _around(self, kind: Kind, body: Geometry) -> Cover:
        body = grown(body, self.growth)
        return Cover(kind, (body,), volume(body.shape), holds_points(body, self.points))


def _bodies(inner: Ellipsoids, kind: Literal["ellipsoids", "spheres"]) -> Iterator[Geometry]:
    for center, radii, rotation in zip(inner.center, inner.radii, inner.rotation):
        pose = np.eye(4)
        pose[:3, 3] = center
        if kind == "spheres":
            yield Geometry(SphereShape(float(radii.max())), pose)
        else:
            pose[:3, :3] = rotation
            x, y, z = map(float, radii)
            yield Geometry(EllipsoidShape((x, y, z)), pose)


def by_clearance(solid: Solid, clearance: float) -> tuple[Cover, float]:
    """A cover that sticks out by ``clearance`` (metres) at most, or as little as can be; and how far at most.

    One convex body, if one does: that of least :func:`score`. Otherwise hulls of pieces, or else ellipsoids (or
    spheres), as few as do, or as many as there may be.
    """
    convex = sorted((cover for cover in solid.convex if cover.proved), key=lambda cover: score(cover, solid))
    several = solid.hulls(solid.options.max_ellipsoids)
    tried = []
    for cover in chain(convex, several):
        bound = solid.farthest(cover, clearance)
        if bound <= clearance:
            return cover, min(bound, solid.farthest(cover))  # either may be the finer one
        tried.append(cover)
    found = [(cover, solid.farthest(cover)) for cover in (*convex, *tried[len(convex) :][-1:])]
    if solid.baked_kind is not None or not convex:
        least = least_clearance(solid.exact.info.diagonal, solid.options.quality)
        cover = solid.leaves(clearance=max(clearance - solid.growth, least), ellipsoids=solid.options.max_ellipsoids)
        found.append((cover, solid.farthest(cover)))
    return min(found, key=lambda one: one[1])


def score(cover: Cover, solid: Solid) -> float:
    """What is better is less. A hundredth of the cover's own volume is added, as none is worth any price."""
    return (max(cover.volume - solid.volume, 0.0) + WORTH * cover.volume) * cover.cost


def by_budget(solids: Sequence[Solid], budget: float) -> list[Cover]:
    """A cover for each solid, that cost no more than ``budget`` together if that can be.

    Each begins with one body. Then a step is taken again and again where it gains most outside volume for what it costs
    more. What a step would gain is found out, by bakes, only where the most that it could gain is in the lead.
    """
    covers = [solid.first for solid in solids]
    spare = budget - sum(cover.cost for cover in covers)
    steps: dict[int, tuple[float, Cover | None]] = {
        i: (cover.volume - solid.volume, None) for i, (solid, cover) in enumerate(zip(solids, covers))
    }
    while steps:
        i = max(steps, key=lambda one: steps[one][0])
        step = steps.pop(i)[1]
        if step is None:
            step = _step(solids[i], covers[i], spare)
            if step is not None:
                steps[i] = (_gain(covers[i], step), step)
            continue
        if step.cost - covers[i].cost <= spare:  # or else others have spent it meanwhile
            spare -= step.cost - covers[i].cost
            covers[i] = step
        steps[i] = (covers[i].volume - solids[i].volume, None)
    return covers


def _gain(now: Cover, then: Cover) -> float:
    """Of volume, for each unit of cost."""
    return (now.volume - then.volume) / (then.cost - now.cost)


def _step(solid: Solid, now: Cover, spare: float) -> Cover | None:
    """The best of the next few that can be afforded; None if nothing gains.

    Hulls of pieces are flat where the solid is, and found in less time than ellipsoids; these are for when hulls are
    not allowed. The outside volume of n ellipsoids falls about like n^-0.8. So one bake tells how many to try next.
    """
    options = [cover for cover in solid.convex if cover.proved and cover.cost - now.cost <= spare]
    outside = max(min(one.volume for one in (now, *options)) - solid.volume, 0.0)
    if outside <= NEGLIGIBLE * now.volume:
        most = 0
    elif solid.has_hulls:
        pieces = solid.hulls(spare + now.cost)
        options += [one for one in pieces if one.cost > now.cost and _gain(now, one) > FURTHER * now.volume]
        most = 0
    else:
        most = min(int(spare + now.cost), solid.options.max_ellipsoids) if solid.baked_kind else 0
    count = 8 if now.cost < 8 else 2 * int(now.cost)
    while count <= most:
        found = solid.leaves(ellipsoids=count)
        options.append(found)
        enough = count * ((found.volume - solid.volume) / outside) ** 1.25
        if enough <= count:
            break
        count = max(2 * count, int(enough))
    better = [one for one in options if 0 < one.cost - now.cost <= spare and one.volume < now.volume]
    return max(better, key=lambda one: _gain(now, one)) if better else None
