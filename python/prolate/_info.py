"""What a tree holds and says of itself."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Ellipsoids(NamedTuple):
    """The N ellipsoids of a cut; read-only arrays.

    Every cut covers the solid. Read in double precision, each ellipsoid of ``center``, ``radii`` and ``rotation`` holds
    the tree's own, of which ``center`` and ``factor`` are exact.

    Attributes
    ----------
    center : float64 (N, 3)
        Metres.
    radii : float64 (N, 3)
        Semi-axes, largest first, metres.
    rotation : float64 (N, 3, 3)
        Column i is the direction of radius i.
    quaternion : float64 (N, 4)
        The same rotation, ``x y z w``.
    factor : float64 (N, 3, 3)
        The lower triangular L of {center + L u : \\|u\\| <= 1}.
    node, parent : int64 (N,)
        The node's slot in the tree, and its parent's; -1 for the root.
    """

    center: NDArray[np.float64]
    radii: NDArray[np.float64]
    rotation: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    factor: NDArray[np.float64]
    node: NDArray[np.int64]
    parent: NDArray[np.int64]


class LevelInfo(NamedTuple):
    """One level of a tree, as measured when it was baked. Lengths in metres; NaN where unknown.

    Attributes
    ----------
    ellipsoids : int
        Of the cut: the nodes of the level, and the leaves above it.
    nodes : int
    bytes : int
        Size of the file up to the end of this level, a coarser tree.
    outside_ratio, outside_ratio_error : float
        Volume of (cut less solid) / volume of the solid, and the estimated error of that.
    union_volume : float
        Cubic metres.
    hausdorff_max, hausdorff_mean, hausdorff_p99 : float
        How far the cover sticks out of the solid: at most (an upper bound), on average, and of 99 % of its surface.
    """

    ellipsoids: int
    nodes: int
    bytes: int
    outside_ratio: float
    outside_ratio_error: float
    union_volume: float
    hausdorff_max: float
    hausdorff_mean: float
    hausdorff_p99: float


class Mass(NamedTuple):
    """Mass properties of a solid of density 1 kg / m^3, in the frame of its mesh; multiply them by another density.

    Attributes
    ----------
    volume, volume_error : float
        Cubic metres, and a bound of its error; 0 where there is no inside.
    center, center_error : tuple of 3 floats, float
        Centre of mass, metres, and a bound of the error of each coordinate.
    inertia, inertia_error : tuple of 3 tuples of 3 floats, float
        Tensor about the centre, along the mesh's axes, kg m^2, and a bound of the error of each entry.
    """

    volume: float
    center: tuple[float, float, float]
    inertia: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
    volume_error: float
    center_error: float
    inertia_error: float


class Diagnosis(NamedTuple):
    """What the bake found in a mesh, and did about it: counts, lengths in metres."""

    input_vertices: int
    input_triangles: int
    merged_vertices: int
    unused_vertices: int
    welded_vertices: int
    weld_distance: float
    degenerate_triangles: int
    open_edges: int
    non_manifold_edges: int
    closed: bool
    turned_shells: int
    size: tuple[float, float, float]


class Asked(NamedTuple):
    """What a bake was asked for, as :func:`bake` has it; None where it was not.

    ``distance`` is that or ``clearance``, whichever is less, in % of the diagonal.
    """

    levels: int | None
    ellipsoids: int | None
    tolerance: float | None
    distance: float | None
    keep_holes: float | None
    fill: float | None
    weld: float | None
    alpha: float
    beta: float


class TreeInfo(NamedTuple):
    """What a tree says of itself.

    Attributes
    ----------
    levels : tuple of LevelInfo
        The root first.
    exact : bool
        The leaves hold the mesh's triangles, and queries answer for these.
    proved : bool
        Every level was proved to cover before the tree was stored.
    surface_mode : bool
        The mesh was open: only its triangles are certain to be covered.
    goal_reached : bool
        False: the asked number or closeness could not be met; the tree comes as close as could be.
    is_inner : bool
        An inner cover (:attr:`Tree.inner`): each ellipsoid lies inside the solid.
    asked : Asked
    volume, volume_error : float
        Of the solid, by the columns that all ratios are measured with, cubic metres; 0 where there is no inside.
    mass : Mass
        More exact: volume, centre and inertia by integrals over the triangles.
    diagonal : float
        Of the mesh's box, metres.
    scale, origin : tuple of 3 floats
        Answers are relative to ``origin``: mesh = scale * file - origin.
    bytes, degree, node_count, triangle_count, vertex_count, is_prefix, primitive, quality, method, seed, resolution
        How large it is and how it was baked.
    source_hash, options_hash : int
        The key of a cache of bakes.
    diagnosis : Diagnosis or None
        Of the mesh; known of trees that this process, or one that it was pickled by, has baked.
    hole_radius : float or None
        Known of the same trees, if ``keep_holes`` was asked: the radius of the ball that does pass, metres.
    """

    levels: tuple[LevelInfo, ...]
    exact: bool
    proved: bool
    surface_mode: bool
    goal_reached: bool
    is_inner: bool
    asked: Asked
    volume: float
    volume_error: float
    mass: Mass
    diagonal: float
    scale: tuple[float, float, float]
    origin: tuple[float, float, float]
    bytes: int
    degree: int
    node_count: int
    triangle_count: int
    vertex_count: int
    is_prefix: bool
    primitive: str
    quality: str
    method: str
    seed: int
    resolution: int
    source_hash: int
    options_hash: int
    diagnosis: Diagnosis | None
    hole_radius: float | None


class LevelProof(NamedTuple):
    """Verdict on one level: ``covered``, or a ``counterexample`` (a point of the solid in no ellipsoid, ``depth`` away
    in radii), or neither if the subdivision gave up. ``pieces`` of the solid were looked at."""

    covered: bool
    counterexample: tuple[float, float, float] | None
    depth: float
    pieces: int


class Proof(NamedTuple):
    """Answer of :meth:`Tree.verify`; true if ``covered``.

    Attributes
    ----------
    covered : bool
        Every level covers, the bounding volumes hold what is below them, holes are kept, and the inner cover is inside.
    same_mesh : bool
        Of an exact tree: its triangles are the mesh's.
    bounded : bool
        The bounding volumes hold what is below them. If not, ``unbounded_node`` is the first node whose does not.
    holes_kept : bool
        Of a tree that was baked with ``keep_holes``: the ball passes wherever a somewhat larger one passes the mesh.
        If not, ``blocked`` (3,) is the center of a ball that is not certainly free.
    inner_inside : bool
        The ellipsoids of the inner cover, if there is one, lie inside the solid. If not, ``protruding_node`` is the
        first of its nodes that does not certainly do so.
    surface_mode : bool
        The mesh is open, so the proof is about its triangles.
    levels : tuple of LevelProof
    """

    covered: bool
    same_mesh: bool
    bounded: bool
    unbounded_node: int | None
    holes_kept: bool
    blocked: tuple[float, float, float] | None
    inner_inside: bool
    protruding_node: int | None
    surface_mode: bool
    levels: tuple[LevelProof, ...]

    def __bool__(self) -> bool:
        return self.covered
