"""Collision detection on ellipsoid trees.

:func:`bake` makes a tree of a mesh, each level of which is proved to cover it. :func:`collide`, :func:`distance`,
:func:`contacts`, :func:`sweep`, :func:`raycast` and :func:`overlap` ask about trees at many poses at once,
:class:`World` about many bodies, and :mod:`prolate.pairs` about single ellipsoids. docs/python.md is the tour.
"""

from . import pairs
from ._bake import bake, bake_mesh
from ._bake_many import Asset, BakeResult, bake_many
from ._errors import Error
from ._mesh import Mesh, load_mesh
from ._queries import (
    Bounds,
    Box,
    Capsule,
    Contacts,
    Distances,
    HalfSpace,
    Hits,
    Sphere,
    Sweeps,
    Verdict,
    bounds,
    collide,
    contacts,
    distance,
    overlap,
    raycast,
    sweep,
)
from ._tree import Diagnosis, Ellipsoids, LevelInfo, LevelProof, Mass, Proof, Tree, TreeInfo, load
from ._world import World, WorldPairs, WorldVerdicts

__version__ = "0.1.0"

__all__ = [
    "Asset",
    "BakeResult",
    "Bounds",
    "Box",
    "Capsule",
    "Contacts",
    "Diagnosis",
    "Distances",
    "Ellipsoids",
    "Error",
    "HalfSpace",
    "Hits",
    "LevelInfo",
    "LevelProof",
    "Mass",
    "Mesh",
    "Proof",
    "Sphere",
    "Sweeps",
    "Tree",
    "TreeInfo",
    "Verdict",
    "World",
    "WorldPairs",
    "WorldVerdicts",
    "__version__",
    "bake",
    "bake_many",
    "bake_mesh",
    "bounds",
    "collide",
    "contacts",
    "distance",
    "load",
    "load_mesh",
    "overlap",
    "pairs",
    "raycast",
    "sweep",
]
