"""Trees of simple solids, which need no bake."""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import _core
from ._tree import Tree, baked_tree

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def box_tree(half: ArrayLike) -> Tree:
    """The box of half extents ``half`` (3,), metres, above 0: an exact tree of 12 triangles.

    Sizes of all primitives are rounded up to float32. They are bodies like all others, in some microseconds.
    """
    return baked_tree(_core.box_tree(half), None)


def cylinder_tree(radius: float, half_height: float) -> Tree:
    """A prism of 32 sides around the cylinder along z, metres; it sticks out by at most 0.5 % of the radius."""
    return baked_tree(_core.cylinder_tree(radius, half_height), None)


def convex_tree(points: ArrayLike, faces: ArrayLike) -> Tree:
    """The convex polyhedron with these triangles: an exact tree.

    Parameters
    ----------
    points : array (N, 3)
        Metres; rounded to float32.
    faces : integer array (M, 3)
        Counter-clockwise seen from outside. (``scipy.spatial.ConvexHull`` does not order its ``simplices`` so.)

    Raises
    ------
    Error
        ``code`` is ``"bad_mesh"``, ``where`` the face: not closed, not convex, or without an area.
    """
    return baked_tree(_core.convex_tree(points, faces), None)


def ellipsoid_tree(radii: ArrayLike) -> Tree:
    """One ellipsoid that holds the one of these semi-axes (3,) along x, y and z, and is larger by at most 2e-4."""
    return baked_tree(_core.ellipsoid_tree(radii), None)


def sphere_tree(radius: float) -> Tree:
    """One ellipsoid that holds the ball of this radius, and is larger by at most 2e-4."""
    return baked_tree(_core.sphere_tree(radius), None)
