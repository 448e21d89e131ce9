"""From the links of a robot to their covers: what the cache has, what must be baked, and what cannot be."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Union

from .. import Error
from ._baked import BakedRobot, LinkCover, is_solid
from ._cache import find, keep, key_of
from ._covers import KEEPS, Cover, Options, Solid, by_budget, by_clearance
from ._measure import mean_distance
from ._model import Description, Geometry, Link, Note, PlaneShape

Progress = Union[Callable[[int, int], object], None]


class Job:
    """One bake of a robot."""

    def __init__(self, description: Description, options: Options, progress: Progress) -> None:
        self.description, self.options, self.progress = description, options, progress
        self.links = [link for link in description.links if is_solid(link)]
        self.covers: dict[str, LinkCover] = {}
        self.notes: list[Note] = []
        self._solids: dict[str, Solid] = {}

    def exact(self) -> BakedRobot:
        """Keep all geometries."""
        for link in self.links:
            with self._noting(link):
                kept = tuple(one for one in link.collisions if not isinstance(one.shape, PlaneShape))
                solid = Solid(link, kept, self.options)
                self._add(LinkCover(link.name, "exact", kept, rounding=solid.rounding, baked=solid.exact))
        return self._done()

    def by_clearance(self, limits: Mapping[str, float]) -> BakedRobot:
        """Link by link."""
        for link in self.links:
            key = key_of([link], (limits[link.name], self.options))
            with self._noting(link):
                found = find(self.options.cache, key)
                if found is None:
                    found = [self._chosen(link, limits[link.name])]
                    keep(self.options.cache, key, found)
                self._add(replace(found[0], name=link.name), link)  # another link may have the same meshes
                self._warn(link, limits[link.name])
        return self._done()

    def by_budget(self, budget: float) -> BakedRobot:
        """All links together."""
        key = key_of(self.links, (budget, [link.name for link in self.links], self.options))
        found = find(self.options.cache, key)
        if found is None:
            begun = {link.name: self._begun(link) for link in self.links if self._meant(link)}
            solids = {name: solid for name, solid in begun.items() if solid is not None}
            spare = budget - sum(len(self._own(link)) for link in self.links)
            covers = by_budget(list(solids.values()), spare)
            known: dict[tuple[Solid, Cover], LinkCover] = {}
            for solid, cover in zip(solids.values(), covers):
                if (solid, cover) not in known:
                    known[solid, cover] = _measured(solid, cover, solid.farthest(cover))
            found = [replace(known[one], name=name) for name, one in zip(solids, zip(solids.values(), covers))]
            if len(solids) == len(begun):
                keep(self.options.cache, key, found)
        by_name = {cover.name: cover for cover in found}
        for link in self.links:
            if link.name in by_name or not self._meant(link):
                self._add(by_name.get(link.name, LinkCover(link.name, "own", ())), link)
        return self._done()

    def _warn(self, link: Link, limit: float) -> None:
        cover = self.covers[link.name]
        if cover.clearance > limit:
            count = len(cover.geometries)
            more = "max_ellipsoids, a finer quality or other kinds may help"
            text = f"{count} {cover.kind} stick out by up to {1000 * cover.clearance:.2f} mm; {more}"
            self.notes.append(Note("warning", text, link.where, link.name))

    def _chosen(self, link: Link, limit: float) -> LinkCover:
        if not self._meant(link):
            return LinkCover(link.name, "own", ())
        solid = Solid(link, self._meant(link), self.options)
        return _measured(solid, *by_clearance(solid, limit))

    def _begun(self, link: Link) -> Solid | None:
        """A solid that can be baked; links of the same geometries share one."""
        with self._noting(link):
            key = key_of([link], None)
            if key not in self._solids:
                solid = Solid(link, self._meant(link), self.options)
                _ = solid.exact, solid.first
                self._solids[key] = solid
            return self._solids[key]
        return None

    def _add(self, cover: LinkCover, link: Link | None = None) -> None:
        """Together with the primitives of the link, which are their own covers."""
        if link is not None and (own := self._own(link)):
            baked = cover.baked if not cover.geometries else None
            cover = replace(cover, geometries=(*own, *cover.geometries), baked=baked)
        self.covers[cover.name] = cover

    @contextlib.contextmanager
    def _noting(self, link: Link) -> Iterator[None]:
        """What stands in the way of one link does not stop the others."""
        try:
            yield
        except (Error, ValueError) as error:
            if isinstance(error, Error) and error.code == "cancelled":
                raise
            self.notes.append(Note("error", f"has no cover: {error}", link.where, link.name))
        done = len(self.covers) + sum(note.kind == "error" for note in self.notes)
        if self.progress is not None:
            self.progress(done, len(self.links))

    def _own(self, link: Link) -> list[Geometry]:
        """The primitives that stay what they are."""
        return [one for one in link.collisions if KEEPS.get(type(one.shape), set()) & set(self.options.kinds)]

    def _meant(self, link: Link) -> list[Geometry]:
        """What needs a cover."""
        own = self._own(link)
        return [one for one in link.collisions if one not in own and not isinstance(one.shape, PlaneShape)]

    def _done(self) -> BakedRobot:
        return BakedRobot(self.description, self.covers, tuple(self.notes))


def _measured(solid: Solid, cover: Cover, clearance: float) -> LinkCover:
    outside = max(cover.volume - solid.volume, 0.0)
    closed = not solid.exact.info.surface_mode
    return LinkCover(
        name=solid.link.name,
        kind=cover.kind,
        geometries=cover.geometries,
        outside_volume=outside,
        outside_ratio=outside / solid.volume if closed and solid.volume > 0 else float("nan"),
        clearance=clearance,
        mean_distance=mean_distance(cover.geometries, solid.exact, solid.options.threads),
        proved=solid.is_proved(cover),
        rounding=solid.rounding,
        baked=cover.tree,
    )
