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


def cylinder_tree(radius: float, half_height: float, sides: int = 32) -> Tree:
    """A prism of ``sides``, a power of two from 8 to 1024, around the cylinder along z; metres.

    It holds the cylinder, and sticks out of it by at most ``5.3 / sides**2`` of the radius: 0.5 % with 32 sides. So
    *separated* and lower bounds hold of the cylinder; upper bounds of distances may be too small by that much, and
    depths too large.
    """
    return baked_tree(_core.cylinder_tree(radius, half_height, sides), None)


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
