# The C++ side (python/src). It checks its arguments itself, so most of them are plain objects here.
from collections.abc import Callable
from typing import Any, Optional

import numpy as np
from numpy.typing import NDArray

LIBRARY_VERSION: int
FORMAT_VERSION: int
BUILDER_VERSION: int

_Floats = NDArray[np.float64]
_Bytes = NDArray[np.uint8]
_Index = NDArray[np.int64]
_Progress = Optional[Callable[[str, float, int], object]]
_Placement = Optional[tuple[tuple[float, float, float], tuple[float, float, float]]]
_Ids = NDArray[np.uint64]
_ContactArrays = tuple[_Index, _Floats, _Floats, _Floats, _Floats, _Index, _Ids]
_HitArrays = tuple[_Floats, _Floats, _Floats, _Index, _Index, _Bytes]
_PairArrays = tuple[_Floats, _Floats, _Floats, _Floats, _Floats, _Bytes]

class Tree:
    def __init__(self, buffer: object, check_hash: bool) -> None: ...
    @property
    def buffer(self) -> _Bytes: ...
    @property
    def level_count(self) -> int: ...
    @property
    def node_count(self) -> int: ...
    @property
    def has_triangles(self) -> bool: ...
    def level_end(self, level: int) -> int: ...
    def inner_range(self) -> Optional[tuple[int, int]]: ...
    def mode_range_array(self) -> NDArray[np.float32]: ...
    def count_bones(self) -> int: ...
    def info_dict(self) -> dict[str, Any]: ...
    def cut_arrays(self, level: object) -> tuple[_Floats, _Floats, _Floats, _Floats, _Floats, _Index, _Index]: ...
    def mesh_arrays(self) -> tuple[NDArray[np.float32], NDArray[np.uint32]]: ...

class World:
    def __init__(self, slack: object) -> None: ...
    def __len__(self) -> int: ...
    def insert(
        self, shape: object, pose: object, parts: object, margin: object, layers: object, mask: object, order: object
    ) -> int: ...
    def remove(self, id: object) -> None: ...
    def move(self, ids: object, poses: object, order: object) -> None: ...
    def refilter(self, id: object, layers: object, mask: object) -> None: ...
    def body_of(self, id: object) -> int: ...
    def part(self, id: object, i: object) -> int: ...
    def pairs(self) -> tuple[_Ids, NDArray[np.bool_]]: ...
    def collide(self, margin: object, max_level: object, budget: object, threads: object) -> tuple[_Ids, _Bytes]: ...
    def collide_solids(self, margin: object, budget: object, threads: object) -> tuple[_Ids, _Bytes]: ...
    def distance(
        self, tolerance: object, max_distance: object, budget: object, threads: object
    ) -> tuple[_Ids, _PairArrays]: ...
    def contacts(
        self, margin: object, budget: object, threads: object
    ) -> tuple[_Ids, _ContactArrays, _Bytes, _Ids, _Bytes]: ...
    def raycast(
        self,
        origins: object,
        directions: object,
        radius: object,
        max_t: object,
        mask: object,
        budget: object,
        threads: object,
    ) -> tuple[_Ids, _HitArrays, bool]: ...
    def sweep(
        self,
        tree: object,
        start: object,
        end: object,
        margin: object,
        tolerance: object,
        mask: object,
        budget: object,
        threads: object,
        order: object,
    ) -> tuple[_Ids, _PairArrays, _Floats, bool]: ...
    def overlap_shapes(
        self, shapes: object, margin: object, mask: object, budget: object, threads: object
    ) -> tuple[_Index, _Ids]: ...
    def overlap_tree(
        self,
        tree: object,
        poses: object,
        margin: object,
        mask: object,
        budget: object,
        threads: object,
        order: object,
    ) -> tuple[_Index, _Ids]: ...

class Robot:
    def __init__(
        self,
        columns: tuple[Any, ...],
        links: int,
        nq: int,
        trees: list[Optional[Tree]],
        slack: object,
        pairs: object,
    ) -> None: ...
    def fk(self, q: object, threads: object) -> _Floats: ...

class RobotScene:
    def __init__(self) -> None: ...
    def add_tree(self, tree: object, pose: object) -> None: ...
    def add_box(self, half: object, pose: object) -> None: ...
    def add_capsule(self, a: object, b: object, radius: object, pose: object) -> None: ...
    def add_half_space(self, row: object) -> None: ...
    def add_points(self, points: object, radius: object, pose: object) -> None: ...

class RobotChecks:
    def __init__(self, robot: Robot, scene: RobotScene, allowed: object) -> None: ...
    def pairs(self) -> _Index: ...
    def collide(self, q: object, each: bool, threads: object) -> _Bytes: ...
    def distance(
        self, q: object, tolerance: object, max_distance: object, threads: object
    ) -> tuple[_Floats, _Floats, _Index]: ...
    def motion(self, q0: object, q1: object, depth: object, budget: object, threads: object) -> _Bytes: ...

def bake(
    vertices: object, faces: object, placement: _Placement, options: dict[str, object], progress: _Progress
) -> tuple[_Bytes, dict[str, Any]]: ...
def bake_key(vertices: object, faces: object, placement: _Placement, options: dict[str, object]) -> tuple[int, int]: ...
def options_hash(options: dict[str, object]) -> int: ...
def least_clearance(diagonal: object, quality: object) -> float: ...
def ball_range(longest_side: object) -> tuple[float, float]: ...
def verify(
    tree: object, vertices: object, faces: object, placement: _Placement, threads: object, progress: _Progress
) -> dict[str, Any]: ...
def load_mesh(
    path: bytes, unit: object, scale: object, recentre: bool
) -> tuple[
    NDArray[np.float32],
    NDArray[np.uint32],
    tuple[tuple[float, float, float], tuple[float, float, float]],
    list[str],
    list[str],
]: ...
def mesh_file_hash(path: bytes, unit: object, scale: object, recentre: bool) -> Optional[int]: ...
def save(path: bytes, tree: Tree, /) -> None: ...
def collide(
    a: object,
    poses_a: object,
    b: object,
    poses_b: object,
    margin: object,
    max_level: object,
    budget: object,
    threads: object,
    out: object,
    order: object,
) -> int | _Bytes: ...
def distance(
    a: object,
    poses_a: object,
    b: object,
    poses_b: object,
    tolerance: object,
    max_distance: object,
    max_level: object,
    budget: object,
    threads: object,
    order: object,
) -> tuple[_PairArrays, bool]: ...
def collide_solids(
    a: object,
    poses_a: object,
    b: object,
    poses_b: object,
    margin: object,
    max_level: object,
    budget: object,
    threads: object,
    order: object,
) -> int | _Bytes: ...
def collide_deformed(
    a: object,
    poses_a: object,
    q_a: object,
    bones_a: object,
    b: object,
    poses_b: object,
    q_b: object,
    bones_b: object,
    margin: object,
    max_level: object,
    budget: object,
    threads: object,
    order: object,
) -> int | _Bytes: ...
def distance_deformed(
    a: object,
    poses_a: object,
    q_a: object,
    bones_a: object,
    b: object,
    poses_b: object,
    q_b: object,
    bones_b: object,
    tolerance: object,
    max_distance: object,
    max_level: object,
    budget: object,
    threads: object,
    order: object,
) -> tuple[_PairArrays, bool]: ...
def raycast_deformed(
    tree: object,
    pose: object,
    q: object,
    bones: object,
    origins: object,
    directions: object,
    radius: object,
    max_t: object,
    max_level: object,
    budget: object,
    threads: object,
    order: object,
) -> tuple[_HitArrays, bool]: ...
def add_modes(
    tree: object, vertices: object, faces: object, placement: object, modes: object, ranges: object
) -> _Bytes: ...
def add_skin(
    tree: object,
    vertices: object,
    faces: object,
    placement: object,
    joints: object,
    weights: object,
    bones: object,
) -> _Bytes: ...
def distance_solids(
    a: object,
    poses_a: object,
    b: object,
    poses_b: object,
    tolerance: object,
    max_distance: object,
    max_level: object,
    budget: object,
    threads: object,
    order: object,
) -> tuple[tuple[_Floats, _Floats, _Bytes], bool]: ...
def depth_solids(
    a: object,
    poses_a: object,
    b: object,
    poses_b: object,
    max_level: object,
    budget: object,
    threads: object,
    order: object,
) -> tuple[tuple[_Floats, _Floats, _Floats, _Bytes], bool]: ...
def sweep(
    a: object,
    start_a: object,
    end_a: object,
    b: object,
    start_b: object,
    end_b: object,
    margin: object,
    tolerance: object,
    max_level: object,
    budget: object,
    threads: object,
    order: object,
) -> tuple[_PairArrays, _Floats, bool]: ...
def raycast(
    tree: object,
    pose: object,
    origins: object,
    directions: object,
    radius: object,
    max_t: object,
    max_level: object,
    budget: object,
    threads: object,
    order: object,
) -> tuple[_HitArrays, bool]: ...
def overlap(
    tree: object,
    poses: object,
    kind: str,
    numbers: object,
    margin: object,
    max_level: object,
    budget: object,
    threads: object,
    out: object,
    order: object,
) -> int | _Bytes: ...
def ground_distance(
    a: object,
    poses_a: object,
    half_space: object,
    tolerance: object,
    max_distance: object,
    budget: object,
    threads: object,
    order: object,
) -> tuple[_PairArrays, bool]: ...
def ground_contacts(
    a: object,
    poses_a: object,
    half_space: object,
    margin: object,
    max_level: object,
    budget: object,
    threads: object,
    order: object,
) -> tuple[_ContactArrays, _Bytes]: ...
def bounds(tree: object, poses: object, margin: object, order: object) -> tuple[_Floats, _Floats, bool]: ...
def contacts(
    a: object,
    poses_a: object,
    b: object,
    poses_b: object,
    margin: object,
    max_level: object,
    budget: object,
    threads: object,
    order: object,
) -> tuple[_ContactArrays, _Bytes]: ...
def signed_distance(
    tree: object, points: object, pose: object, max_distance: object, budget: object, threads: object, order: object
) -> tuple[tuple[_Floats, _Floats, _Floats, _Floats, _Index, _Index, _Bytes], bool]: ...
def contains(tree: object, points: object, pose: object, threads: object, order: object) -> int | _Bytes: ...
def box_tree(half: object) -> _Bytes: ...
def cylinder_tree(radius: object, half_height: object, sides: object) -> _Bytes: ...
def convex_tree(points: object, faces: object) -> _Bytes: ...
def ellipsoid_tree(radii: object) -> _Bytes: ...
def sphere_tree(radius: object) -> _Bytes: ...
def pairs_collide(radii: object, poses: object, pairs: object, margin: object, order: object) -> _Bytes: ...
def pairs_distance(
    radii: object, poses: object, pairs: object, tolerance: object, order: object
) -> tuple[_Floats, _Floats, _Floats, _Floats, _Floats]: ...
