"""From a mesh to a tree."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Union

from . import _core
from ._errors import check_callable, truth
from ._mesh import Mesh, Placement, arrays_of, factors, length, metres, placed
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
    clearance: Union[str, float, None] = None,
    keep_holes: Union[str, float, None] = None,
    fill: Union[str, float, None] = None,
    exact: bool = False,
    inner: int | None = None,
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

    The goal is one of ``levels``, ``ellipsoids``, a closeness (one or several of ``tolerance``, ``distance``,
    ``clearance`` and ``keep_holes``) and ``exact``; by default 3 levels. ``ellipsoids`` together with a closeness means
    at most that many, and fewer if they are close enough. The same mesh and options give the same bytes, for any number
    of threads.

    Parameters
    ----------
    vertices : array (V, 3)
        float32 is used where it lies, if contiguous; all else is rounded to it. Metres, unless ``unit`` says otherwise.
    faces : integer array (F, 3)
        Vertex indices, counter-clockwise seen from outside. int32 and uint32 are used where they lie.
    levels : int, optional
        Levels below the root, 1 ... 31.
    ellipsoids : int, optional
        Number of leaves, 1 ... 65536: the best set of that many, with a tree above it. With a closeness: the most.
    tolerance : float, optional
        Largest outside volume of the leaves / volume of the solid.
    distance : float, optional
        Largest distance of the leaves from the solid, in % of the diagonal of the mesh's box.
    clearance : float or str, optional
        The same limit as a length: metres, or a text with its unit such as ``"5mm"`` (mm, cm, m, in, ft).
        :func:`least_clearance` says how small it may be.
    keep_holes : float or str, optional
        Radius of a ball, a length like ``clearance``. It passes the leaves, proved, wherever one larger by a seventh
        (or by 1/110 of the box's longest side) passes holes of the mesh, and between its parts. :func:`ball_range` says
        how large it may be. Not with ``fill``.
    fill : float or str, optional
        Radius of a ball, a length like ``clearance``. What the ball cannot reach from outside without touching the mesh
        counts as solid, so an open mesh has an inside, too. All figures are then about the filled solid.
    exact : bool
        Store the triangles in the leaves; queries then answer for them.
    inner : int, optional
        Also make an inner cover, :attr:`Tree.inner`, of at most so many ellipsoids, 1 ... 65536, that lie inside the
        solid, proved. The mesh must be closed, or filled. See :func:`collide_solids`.
    primitive : {"ellipsoid", "sphere"}
    quality : {"fast", "normal", "best"}
        Effort of the search. Of an exact tree, fast takes a sixth less CPU time, for queries up to a quarter slower;
        best is as normal.
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
        levels=levels, ellipsoids=ellipsoids, tolerance=tolerance, distance=distance, clearance=clearance,
        keep_holes=keep_holes, fill=fill, exact=exact, inner=inner,
        primitive=primitive, quality=quality, method=method, degree=degree, leaf_triangles=leaf_triangles,
        alpha=alpha, beta=beta, weld=weld, seed=seed, unit=unit, scale=scale, recentre=recentre,
        threads=threads, progress=progress,
    )  # fmt: skip


_OPTIONS = (
    "levels", "ellipsoids", "tolerance", "distance", "clearance", "keep_holes", "fill", "exact", "inner",
    "primitive", "quality", "method", "degree", "leaf_triangles", "alpha", "beta", "weld", "seed", "threads",
)  # fmt: skip


_LENGTHS = ("clearance", "keep_holes", "fill")
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
    lengths = {name: length(name, given[name]) for name in _LENGTHS}
    return {**{name: given[name] for name in _OPTIONS}, **lengths, "exact": truth("exact", given["exact"])}


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
    step = metres(options.get("unit")) or 1.0
    moved = placed(vertices, faces, (x * step, y * step, z * step), truth("recentre", options.get("recentre", False)))
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
    check_callable("progress", options.get("progress"))
    ready = prepared(mesh, options)
    return baked_tree(*_core.bake(*ready, options.get("progress")))


class BallRange(NamedTuple):
    """The radii, metres, that ``fill`` and ``keep_holes`` may have: finer gaps cannot be told, larger balls are larger
    than the mesh."""

    least: float
    most: float


def least_clearance(diagonal: float, quality: Literal["fast", "normal", "best"] = "normal") -> float:
    """The least ``clearance`` that :func:`bake` can be asked for, of a mesh whose box has this diagonal; metres."""
    return _core.least_clearance(diagonal, quality)


def ball_range(longest_side: float) -> BallRange:
    """How large the balls of ``fill`` and ``keep_holes`` may be, of a mesh whose box has this longest side; metres."""
    return BallRange(*_core.ball_range(longest_side))
