"""Covers of a whole robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from .. import Error, Tree, bake
from ._checks import Checks, RobotDistances
from ._covers import cost_of
from ._model import Description, Geometry, Link, Note, PlaneShape
from ._solids import merged

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ._scene import Scene


def is_solid(link: Link) -> bool:
    """Has the link something that counts for contact? A plane is ground."""
    return any(not isinstance(one.shape, PlaneShape) for one in link.collisions)


@dataclass(frozen=True, eq=False)
class LinkCover:
    """What stands for a link.

    Attributes
    ----------
    name : str
        The link's.
    kind : str
        ``"ellipsoids"``, ``"spheres"``, ``"sphere"``, ``"box"``, ``"capsule"``, ``"cylinder"`` or ``"hull"``: what
        covers its meshes; ``"own"`` if it has none, only primitives, which stay as they are; ``"exact"`` if all stays.
    geometries : tuple of Geometry
        In the link's frame. Meshes are convex, unless the kind is ``"exact"``.
    outside_volume, outside_ratio : float
        Volume of what covers the meshes, less theirs, m^3, and relative to theirs; the ratio is NaN where they enclose
        nothing.
    clearance : float
        How far the cover sticks out, at most; metres.
    mean_distance : float
        How far the cover's surface is from the meshes on average, metres, by sampling.
    proved : bool
        The geometries, with the very numbers that they have, hold the meshes.
    rounding : float
        How far the meshes may stick out of ``tree``, metres: what float32 moves their vertices.
    """

    name: str
    kind: str
    geometries: tuple[Geometry, ...]
    outside_volume: float = 0.0
    outside_ratio: float = 0.0
    clearance: float = 0.0
    mean_distance: float = 0.0
    proved: bool = True
    rounding: float = 0.0
    baked: Tree | None = field(default=None, repr=False)

    @property
    def cost(self) -> float:
        """In ellipsoids, as :meth:`Robot.bake` counts it."""
        return sum(map(cost_of, self.geometries))

    @cached_property
    def tree(self) -> Tree:
        """The cover for this library's queries, in the link's frame: of ellipsoids the tree whose leaves they hold, of
        all else an exact tree of the polyhedra around the geometries."""
        try:
            return self.baked or bake(*merged(self.geometries), exact=True)
        except (Error, ValueError) as error:
            raise Error(f"link {self.name}: {error}", "bad_mesh") from None


@dataclass(frozen=True, eq=False)
class BakedRobot:
    """A robot with a cover for each link that has geometries; immutable. :meth:`Robot.bake` makes it.

    ``covers`` are by the names of links, in the order of the description. A link whose meshes could not be baked has
    none, and an error in ``notes``.
    """

    description: Description
    covers: Mapping[str, LinkCover]
    notes: tuple[Note, ...] = ()

    @property
    def proved(self) -> bool:
        """Is every link covered, and proved to be? Not so if the notes have an error: something of it is missing."""
        whole = all(note.kind != "error" for note in (*self.description.notes, *self.notes))
        covered = all(link.name in self.covers for link in self.description.links if is_solid(link))
        return whole and covered and all(cover.proved for cover in self.covers.values())

    @cached_property
    def checks(self) -> Checks:
        """What planners ask, of what is covered: see :attr:`proved`.

        Made when it is first asked for; ``Checks(...)`` itself takes pairs that may touch.
        """
        trees = {name: cover.tree for name, cover in self.covers.items()}
        return Checks(self.description, trees, slack={name: cover.rounding for name, cover in self.covers.items()})

    def fk(self, q: ArrayLike, **options: Any) -> NDArray[np.float64]:
        """:meth:`Checks.fk`."""
        return self.checks.fk(q, **options)

    def collide(self, q: ArrayLike, scene: Scene | None = None, **options: Any) -> NDArray[np.bool_]:
        """:meth:`Checks.collide`."""
        return self.checks.collide(q, scene, **options)

    def distance(self, q: ArrayLike, scene: Scene | None = None, **options: Any) -> RobotDistances:
        """:meth:`Checks.distance`."""
        return self.checks.distance(q, scene, **options)

    def validate_motion(
        self, q0: ArrayLike, q1: ArrayLike, scene: Scene | None = None, **options: Any
    ) -> NDArray[np.bool_]:
        """:meth:`Checks.validate_motion`."""
        return self.checks.validate_motion(q0, q1, scene, **options)

    def table(self) -> str:
        """A line of text for each link: kind, bodies, outside ratio, distances, proof."""
        lines = [f"{'link':32} {'kind':10} {'count':>5} {'outside':>8} {'most, mm':>8} {'mean, mm':>8}  proved"]
        for one in self.covers.values():
            ratio = "" if one.outside_ratio != one.outside_ratio else f"{100 * one.outside_ratio:.1f} %"
            lines.append(
                f"{one.name:32} {one.kind:10} {len(one.geometries):5} {ratio:>8} {1000 * one.clearance:8.2f} "
                f"{1000 * one.mean_distance:8.2f}  {'yes' if one.proved else 'NO'}"
            )
        return "\n".join(lines)
