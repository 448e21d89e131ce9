"""From a mesh to a tree."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Union

from . import _core
from ._mesh import Mesh, Placement, arrays_of, factors, metres, placed
from ._tree import Progress, Tree, baked_tree

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def bake(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    levels: int | None = None,
    ellipsoids: int | None = None,
    tolerance: float | None = None,
    distance: float | None = None,
    exact: bool = False,
    primitive: Literal["ellipsoid", "sphere"] = "ellipsoid",
    quality: Literal["fast", "normal", "best"] = "normal",
    method: Literal["voxel", "analytic"] = "voxel",
    degree: int = 8,
    leaf_triangles: int = 4,
    alpha: float = 0.5,
    beta: float = 0.5,
    weld: float | None = None,
    seed: int = 1,
    unit: Union[str, float, None] = None,
    scale: ArrayLike | None = None,
    recentre: bool = False,
    threads: int = 0,
    progress: Progress = None,
) -> Tree:
    """Make an ellipsoid tree of a mesh; every level is proved to cover it.

    The goal is one of ``levels``, ``ellipsoids``, a closeness (``tolerance``, ``distance`` or both) and ``exact``; by
    default 3 levels. The same mesh and options give the same bytes, for any number of threads.

    Parameters
    ----------
    vertices : array (V, 3)
        float32 is used where it lies, if contiguous; all else is rounded to it. Metres, unless ``unit`` says otherwise.
    faces : integer array (F, 3)
        Vertex indices, counter-clockwise seen from outside. int32 and uint32 are used where they lie.
    levels : int, optional
        Levels below the root, 1 ... 31.
    ellipsoids : int, optional
        Number of leaves, 1 ... 65536: the best set of that many, with a tree above it.
    tolerance : float, optional
        Largest outside volume of the leaves / volume of the solid.
    distance : float, optional
        Largest distance of the leaves from the solid, in % of the diagonal of the mesh's box.
    exact : bool
        Store the triangles in the leaves; queries then answer for them.
    primitive : {"ellipsoid", "sphere"}
    quality : {"fast", "normal", "best"}
    method : {"voxel", "analytic"}
        How outside volumes are found; analytic needs a closed mesh.
    degree : int
        Most children of a node, 2 ... 64.
    leaf_triangles : int
        Of an exact tree: most triangles in a leaf, 1 ... 127.
    alpha, beta : float
        Weights of the surface error and of the outside volume.
    weld : float, optional
        Join vertices of open edges within this length, metres, if that closes the mesh; 0: never. By default eight
        steps of float32.
    seed : int
        Of the random numbers.
    unit : {"mm", "cm", "m", "in", "ft"} or float, optional
        Of the vertices; a float is its length in metres.
    scale : float or (3,), optional
        Further factors along the axes; an odd number of negative ones mirrors.
    recentre : bool
        Move the mesh near (0, 0, 0), in double precision. ``tree.info.origin`` says from where; answers are relative
        to it.
    threads : int
        0 = all cores.
    progress : callable, optional
        Called as ``progress(stage, fraction, nodes)`` some ten times a second, from the calling thread; returning
        False cancels.

    Returns
    -------
    Tree
        ``tree.info.diagnosis`` says what was found in the mesh.

    Raises
    ------
    Error
        ``code`` is ``"bad_mesh"``, ``"cancelled"``, ``"unsupported"``, ``"out_of_memory"`` or ``"internal"``.
    ValueError, TypeError
        Naming the argument and the index.

    Notes
    -----
    Other Python threads run meanwhile. Ctrl-C ends it within a second.
    """
    return bake_mesh(
        (vertices, faces),
        levels=levels, ellipsoids=ellipsoids, tolerance=tolerance, distance=distance, exact=exact,
        primitive=primitive, quality=quality, method=method, degree=degree, leaf_triangles=leaf_triangles,
        alpha=alpha, beta=beta, weld=weld, seed=seed, unit=unit, scale=scale, recentre=recentre,
        threads=threads, progress=progress,
    )  # fmt: skip


_OPTIONS = (
    "levels", "ellipsoids", "tolerance", "distance", "exact", "primitive", "quality", "method", "degree",
    "leaf_triangles", "alpha", "beta", "weld", "seed", "threads",
)  # fmt: skip


_FRAME = ("unit", "scale", "recentre")


class Prepared(NamedTuple):
    """A mesh and options as the library takes them."""

    vertices: Any
    faces: Any
    placement: Placement | None
    options: dict[str, object]


def core_options(options: dict[str, Any]) -> dict[str, object]:
    """All options of the library's bake, with the defaults of :func:`bake`."""
    defaults: dict[str, Any] = dict(bake.__kwdefaults__ or {})
    unknown = set(options) - set(defaults)
    if unknown:
        raise TypeError(f"bake() got an unexpected keyword argument {min(unknown)!r}")
    given = {**defaults, **options}
    return {**{name: given[name] for name in _OPTIONS}, "exact": bool(given["exact"])}


def prepared(mesh: Any, options: dict[str, Any]) -> Prepared:
    """Scaled and moved as the options say; a :class:`Mesh` has been."""
    vertices, faces = arrays_of(mesh)
    core = core_options(options)
    if isinstance(mesh, Mesh):
        for name in _FRAME:
            if options.get(name):
                raise ValueError(f"{name}: belongs to load_mesh(), which has read the mesh")
        return Prepared(vertices, faces, (mesh.scale, mesh.origin), core)
    x, y, z = factors(options.get("scale"))
    length = metres(options.get("unit")) or 1.0
    moved = placed(vertices, faces, (x * length, y * length, z * length), bool(options.get("recentre", False)))
    return Prepared(*moved, core)


def bake_mesh(mesh: Any, **options: Any) -> Tree:
    """:func:`bake` of a mesh object.

    Parameters
    ----------
    mesh : object
        A :class:`Mesh` of :func:`load_mesh` (whose unit and origin the tree remembers), a mesh of trimesh, Open3D or
        MeshLab, or ``(vertices, faces)``.
    **options
        Those of :func:`bake`.

    Raises
    ------
    Error, ValueError, TypeError
        As :func:`bake`.
    """
    ready = prepared(mesh, options)
    return baked_tree(*_core.bake(*ready, options.get("progress")))
