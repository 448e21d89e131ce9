"""Collision detection on ellipsoid trees.

:func:`bake` makes a tree of a mesh, each level of which is proved to cover it. :func:`collide`, :func:`distance`,
:func:`contacts`, :func:`sweep`, :func:`raycast` and :func:`overlap` ask about trees at many poses at once,
:func:`collide_solids`, :func:`distance_solids` and :func:`depth_solids` about the solids that covers stand for,
:func:`collide_deformed`, :func:`distance_deformed` and :func:`raycast_deformed` about bodies that deform,
:class:`World` about many bodies, and :mod:`prolate.pairs` about single ellipsoids. docs/python.md is the tour.
"""

from . import pairs
from ._answers import Bounds, Contacts, Distances, Hits, SignedDistances, SolidDepths, SolidDistances, Sweeps, Verdict
from ._bake import BallRange, bake, bake_mesh, ball_range, least_clearance
from ._bake_many import Asset, BakeResult, bake_many
from ._errors import Error
from ._info import Asked, Diagnosis, Ellipsoids, LevelInfo, LevelProof, Mass, Proof, TreeInfo
from ._mesh import Mesh, load_mesh
from ._primitives import box_tree, convex_tree, cylinder_tree, ellipsoid_tree, sphere_tree
from ._queries import (
    bounds,
    collide,
    collide_deformed,
    collide_solids,
    contacts,
    contains,
    depth_solids,
    distance,
    distance_deformed,
    distance_solids,
    overlap,
    raycast,
    raycast_deformed,
    signed_distance,
    sweep,
)
from ._shapes import Box, Capsule, HalfSpace, Sphere
from ._tree import Tree, load
from ._world import (
    EventKind,
    World,
    WorldContacts,
    WorldDistances,
    WorldHits,
    WorldOverlaps,
    WorldPairs,
    WorldSweeps,
    WorldVerdicts,
)

__version__ = "0.1.0"

__all__ = [
    "Asked",
    "Asset",
    "BakeResult",
    "BallRange",
    "Bounds",
    "Box",
    "Capsule",
    "Contacts",
    "Diagnosis",
    "Distances",
    "Ellipsoids",
    "Error",
    "EventKind",
    "HalfSpace",
    "Hits",
    "LevelInfo",
    "LevelProof",
    "Mass",
    "Mesh",
    "Proof",
    "SignedDistances",
    "SolidDepths",
    "SolidDistances",
    "Sphere",
    "Sweeps",
    "Tree",
    "TreeInfo",
    "Verdict",
    "World",
    "WorldContacts",
    "WorldDistances",
    "WorldHits",
    "WorldOverlaps",
    "WorldPairs",
    "WorldSweeps",
    "WorldVerdicts",
    "__version__",
    "bake",
    "bake_many",
    "bake_mesh",
    "ball_range",
    "bounds",
    "box_tree",
    "collide",
    "collide_deformed",
    "collide_solids",
    "contacts",
    "contains",
    "convex_tree",
    "cylinder_tree",
    "depth_solids",
    "distance",
    "distance_deformed",
    "distance_solids",
    "ellipsoid_tree",
    "least_clearance",
    "load",
    "load_mesh",
    "overlap",
    "pairs",
    "raycast",
    "raycast_deformed",
    "signed_distance",
    "sphere_tree",
    "sweep",
]
