"""A robot, and how it gets its covers."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, Literal, Union

from .._errors import check_callable, path_of, truth
from .._mesh import length
from ._baked import BakedRobot
from ._baking import Job, Progress
from ._covers import KINDS, Kind, Options
from ._model import Description
from ._read import load as read


class Robot:
    """A robot as it was described: links, joints and geometries, in ``description``; immutable."""

    def __init__(self, description: Description) -> None:
        self.description = description

    @classmethod
    def load(cls, path: Union[str, os.PathLike[str]], **options: Any) -> Robot:
        """Read a file; arguments and errors as of :func:`prolate.robots.load`."""
        return cls(read(path, **options))

    def bake(
        self,
        *,
        clearance: Union[str, float, None] = None,
        ellipsoids: int | None = None,
        exact: bool = False,
        only: Union[Kind, tuple[Kind, ...], None] = None,
        finer: Mapping[str, Union[str, float]] | None = None,
        max_hull_vertices: int = 256,
        max_ellipsoids: int = 64,
        quality: Literal["fast", "normal", "best"] = "fast",
        cache: Union[str, os.PathLike[str], None] = None,
        threads: int = 0,
        progress: Progress = None,
    ) -> BakedRobot:
        """Cover each link; what covers it is proved to.

        Primitives of allowed kinds stay what they are. All else of a link gets one cover: one convex body, hulls of
        its meshes or of convex pieces, or several ellipsoids (or spheres). The goal is one of ``clearance``,
        ``ellipsoids`` and ``exact``; by default a clearance of 5 mm.

        What a cover costs is counted in ellipsoids: each body is one, and a convex hull one for each 256 vertices, but
        at least one.

        Parameters
        ----------
        clearance : float or str, optional
            How far a cover may stick out of its meshes: metres, or a text such as ``"5mm"``. A link gets the convex
            body of least outside volume times cost that sticks out by no more, or hulls of pieces, or ellipsoids.
        ellipsoids : int, optional
            What all covers may cost together, spread over the links where the next step gains most outside volume. A
            further hull must gain 5 % of a link's.
        exact : bool
            Keep the meshes; trees are then exact, as planners want them.
        only : kind or tuple of kinds, optional
            Of ``"ellipsoids"``, ``"spheres"``, ``"hull"``, ``"box"``, ``"capsule"``, ``"cylinder"`` and ``"sphere"``.
        finer : mapping of str to length, optional
            Clearances of some links, by their names.
        max_hull_vertices : int
            Of a convex hull, 8 or more. A hull of more is simplified from outside.
        max_ellipsoids : int
            Most ellipsoids, or hulls of pieces (64 at most), of a link. One that would need more for a clearance gets
            a warning in ``notes``.
        quality : {"fast", "normal", "best"}
            Of bakes; see :func:`prolate.bake`.
        cache : path-like, optional
            A folder that keeps what was baked by its content. Its entries may be deleted at any time.
        threads : int
            0 = all cores.
        progress : callable, optional
            Called as ``progress(done, count)`` after each link.

        Raises
        ------
        ValueError, TypeError
            For an argument. What stands in the way of one link becomes an error in ``notes``, and the others go on.

        Thread-safe.
        """
        check_callable("progress", progress)
        if sum([clearance is not None, ellipsoids is not None, truth("exact", exact)]) > 1:
            raise ValueError("clearance, ellipsoids, exact: only one of them can be the goal")
        options = Options(
            kinds=_kinds(only),
            max_hull_vertices=max_hull_vertices,
            max_ellipsoids=max_ellipsoids,
            quality=quality,
            threads=threads,
            cache=None if cache is None else os.path.abspath(path_of("cache", cache)),
        )
        if ellipsoids is not None and ellipsoids < 1:
            raise ValueError(f"ellipsoids: must be 1 or more, not {ellipsoids}")
        if not 0 <= threads <= 1024:
            raise ValueError(f"threads: must be 0 ... 1024, not {threads}")
        if max_hull_vertices < 8:
            raise ValueError(f"max_hull_vertices: must be 8 or more, not {max_hull_vertices}")
        if not 1 <= max_ellipsoids <= 65536:
            raise ValueError(f"max_ellipsoids: must be 1 ... 65536, not {max_ellipsoids}")
        limit = 0.005 if clearance is None else _positive("clearance", clearance)
        for name in finer or {}:
            if all(link.name != name for link in self.description.links):
                raise ValueError(f"finer: the robot has no link {name!r}")
        closer = {name: _positive(f"finer[{name!r}]", value) for name, value in (finer or {}).items()}
        job = Job(self.description, options, progress)
        if exact:
            return job.exact()
        if ellipsoids is not None:
            return job.by_budget(ellipsoids)
        return job.by_clearance({link.name: closer.get(link.name, limit) for link in self.description.links})


def _positive(name: str, value: Union[str, float]) -> float:
    metres = length(name, value)
    if not isinstance(metres, (int, float)) or not 0 < metres < float("inf"):
        raise ValueError(f"{name}: must be a length above 0, not {value!r}")
    return float(metres)


def _kinds(only: Union[Kind, tuple[Kind, ...], None]) -> tuple[Kind, ...]:
    kinds = KINDS if only is None else (only,) if isinstance(only, str) else tuple(only)
    for kind in kinds:
        if kind not in KINDS:
            raise ValueError(f"only: {kind!r} is none of {', '.join(KINDS)}")
    if not kinds:
        raise ValueError("only: names no kind")
    return kinds
