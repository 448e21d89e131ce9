"""Covers of robots: that they hold what they must, stick out by no more than they say, and are chosen as documented."""

from __future__ import annotations

import signal
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from robot_parts import arm, baked, distance_to_l, l_shape, points_of_l, pose, wedge

from prolate.robots._baking import _measured
from prolate.robots._covers import SINGLE, Cover, Options, Solid
from prolate.robots._fits import _uninterrupted, around, hull_within, thickened
from prolate.robots._measure import beyond, farthest
from prolate.robots._model import BoxShape, Description, EllipsoidShape, Geometry, Link, MeshShape, SphereShape
from prolate.robots._pieces import Pieces
from prolate.robots._proof import holds_ellipsoids, holds_points, holds_solid
from prolate.robots._robot import Robot
from prolate.robots._solids import cut, grown, hull_triangles, inverse, merged, moved, polyhedron, volume


def cloud(seed: int) -> np.ndarray:
    """Points of a bent, tapered part."""
    random = np.random.default_rng(seed)
    return moved(pose(seed), random.normal(size=(300, 3)) * [0.2, 0.05, 0.03] ** random.uniform(0.9, 1.1, (300, 1)))


@pytest.mark.parametrize("kind", SINGLE)
@pytest.mark.parametrize("seed", range(4))
def test_fits_hold_their_points(kind: str, seed: int) -> None:
    points = cloud(seed)
    body = around(points, kind)
    assert holds_points(body, points)
    # A polyhedron around the body has all of its points; by volume it is hardly larger.
    vertices, faces = polyhedron(body.shape)
    assert 1 - 1e-12 <= volume(MeshShape(vertices, faces)) / volume(body.shape) <= 1.05
    assert not holds_points(grown(body, -1e-6), points)


@pytest.mark.parametrize("most", [8, 16, 32])
def test_hulls_of_few_vertices_hold_the_points_from_outside(most: int) -> None:
    sizes = []
    for seed in range(4):
        random = np.random.default_rng(seed)
        points = random.normal(size=(400, 3))
        points = moved(pose(seed), points / np.linalg.norm(points, axis=1)[:, None] * [0.3, 0.2, 0.1])
        hull = hull_within(points, most)
        assert isinstance(hull.shape, MeshShape) and len(hull.shape.vertices) <= most
        assert holds_points(grown(hull, 1e-12), points)
        sizes.append(volume(hull.shape) / volume(around(points, "box").shape))
    assert max(sizes) <= 1.001  # a box is a hull of eight


@pytest.mark.skipif(
    threading.current_thread() is not threading.main_thread()
    or signal.getsignal(signal.SIGINT) is not signal.default_int_handler,
    reason="interrupts come to the main thread, and are ignored in the background of a shell",
)
def test_an_interrupt_while_a_library_is_imported_counts_afterwards() -> None:
    done = []
    with pytest.raises(KeyboardInterrupt), _uninterrupted():
        signal.raise_signal(signal.SIGINT)
        done.append(True)
    assert done and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with _uninterrupted():
        pass


def test_hulls_of_few_enough_vertices_are_exact() -> None:
    hull = hull_within(l_shape().vertices, 16)
    assert volume(hull.shape) == pytest.approx(0.1 * (0.3 * 0.4 - 0.2 * 0.3 / 2))


def test_the_proof_of_ellipsoids_sees_a_millionth() -> None:
    solid = Solid(Link("one"), [Geometry(l_shape(), pose(1))], Options(quality="fast"))
    cover = solid.leaves(ellipsoids=6)
    assert cover.tree is not None and cover.proved
    inner = cover.tree.cut()
    assert holds_ellipsoids(cover.geometries, inner, solid.rounding)
    shift = np.zeros((4, 4))
    shift[:3, 3] = 1e-6
    for change in (
        lambda one: replace(one, shape=EllipsoidShape(tuple(r * (1 - 1e-5) for r in one.shape.radii))),
        lambda one: replace(one, pose=one.pose @ pose(3, 0)),
        lambda one: replace(one, pose=one.pose + shift),
    ):
        spoiled = list(cover.geometries)
        spoiled[3] = change(spoiled[3])
        assert not holds_ellipsoids(spoiled, inner, solid.rounding)
    assert not holds_ellipsoids(cover.geometries[1:], inner, solid.rounding)


@pytest.mark.parametrize("only", [None, "ellipsoids", "spheres", "hull", "box", "capsule", "cylinder", "sphere"])
def test_covers_hold_all_points_and_say_how_far_they_stick_out(only: str | None, bakes: Path) -> None:
    robot = baked(only, bakes)
    assert robot.proved and list(robot.covers) == ["base", "elbow", "hand"]
    cover, place = robot.covers["base"], pose(1)
    assert (beyond(cover.geometries, moved(place, points_of_l(4000))) <= 0).all()
    around_it = moved(place, np.random.default_rng(2).uniform(-0.4, 0.8, (40000, 3)))
    inside = around_it[beyond(cover.geometries, around_it) <= 0]
    farthest = distance_to_l(moved(inverse(place), inside)).max()
    assert farthest <= cover.clearance <= 1.5 * farthest
    limit = 0.1 if only is None else 0.2
    assert cover.clearance <= limit or only in ("sphere", "capsule", "cylinder", "box")
    assert cover.kind == (only or "hull")
    assert ("base" in [note.link for note in robot.notes]) == (cover.clearance > limit)


def test_what_is_convex_gets_its_hull_and_primitives_stay(bakes: Path) -> None:
    robot = Robot(arm()).bake(clearance="10cm", finer={"elbow": "5mm"}, cache=bakes)
    elbow = robot.covers["elbow"]
    assert elbow.kind == "hull" and elbow.outside_ratio < 1e-3 and elbow.clearance <= 0.005
    assert elbow.geometries[0] is robot.description.links[1].collisions[1]
    assert robot.covers["base"].kind == "hull" and len(robot.covers["base"].geometries) > 1
    rounder = baked("spheres", bakes).covers["elbow"]
    assert rounder.kind == "spheres" and not any(isinstance(one.shape, BoxShape) for one in rounder.geometries)


def test_a_budget_is_kept_and_spent_where_it_gains(bakes: Path) -> None:
    few, many = (Robot(arm()).bake(ellipsoids=count, cache=bakes) for count in (4, 20))
    for robot, count in ((few, 4), (many, 20)):
        assert robot.proved and sum(cover.cost for cover in robot.covers.values()) <= count
    assert len(few.covers["elbow"].geometries) == len(many.covers["elbow"].geometries) == 2  # nothing can gain there
    assert len(few.covers["base"].geometries) == 1 and len(many.covers["base"].geometries) > 1
    assert many.covers["base"].outside_volume < few.covers["base"].outside_volume
    smooth = Robot(arm()).bake(ellipsoids=20, only="ellipsoids", cache=bakes)
    assert smooth.proved and 8 < sum(cover.cost for cover in smooth.covers.values()) <= 20


def test_farthest_is_a_bound_and_not_a_loose_one() -> None:
    solid = Solid(Link("one"), [Geometry(l_shape())], Options())
    hull = hull_within(solid.vertices, 16)
    true = 0.12  # of (0.22, 0.22) from both arms
    assert true <= farthest([hull], solid.exact) <= 1.03 * true
    assert farthest([hull], solid.exact, 1.03 * true) <= 1.03 * true
    assert farthest([hull], solid.exact, 0.97 * true) > 0.97 * true


@pytest.mark.parametrize("bump", [0.0, -0.01])
def test_how_far_a_hull_sticks_out_of_what_is_nearly_convex(bump: float) -> None:
    """Of a ball of triangles, one corner of which is pushed in."""
    vertices, faces = polyhedron(SphereShape(0.1))
    vertices[7] *= 1 + bump / 0.1
    solid = Solid(Link("ball"), [Geometry(MeshShape(moved(pose(3), vertices), faces))], Options())
    assert -bump / 2 <= solid.flaw <= -4 * bump + 1e-8
    cover = next(one for one in solid.convex if one.kind == "hull")
    assert -bump / 2 <= solid.farthest(cover) <= -2 * bump + 2 * solid.growth + 1e-8
    box = Cover("box", (around(solid.points, "box"),), 0, True)
    true = np.linalg.norm(merged(box.geometries)[0] - pose(3)[:3, 3], axis=1).max() - 0.1
    assert true - 2e-3 <= solid.farthest(box) <= true + 2e-3  # the polyhedron's faces are up to so far from the ball


def test_what_is_not_convex_has_no_small_flaw() -> None:
    assert Solid(Link("one"), [Geometry(l_shape())], Options()).flaw >= 0.12


def test_the_cache_gives_the_same_covers_and_believes_nothing_damaged(tmp_path: Path) -> None:
    robot = Robot(arm())
    first = robot.bake(clearance=0.2, only="ellipsoids", cache=tmp_path)
    again = robot.bake(clearance=0.2, only="ellipsoids", cache=tmp_path)
    for name, cover in first.covers.items():
        for one, other in zip(cover.geometries, again.covers[name].geometries):
            assert np.array_equal(one.pose, other.pose)
            if not isinstance(one.shape, MeshShape):
                assert one.shape == other.shape
        assert again.covers[name].tree == cover.tree
    entries = list(tmp_path.glob("*.covers"))
    assert len(entries) == 3
    for entry in entries:
        entry.write_bytes(entry.read_bytes().replace(b"0.1", b"0.2", 1))
    mended = robot.bake(clearance=0.2, only="ellipsoids", cache=tmp_path)
    assert mended.proved and mended.covers["base"].clearance == first.covers["base"].clearance


def test_a_link_that_cannot_be_baked_does_not_stop_the_others() -> None:
    description = arm()
    broken = MeshShape(wedge().vertices, np.array([[0, 1, 99]]))
    links = (replace(description.links[0], collisions=(Geometry(broken),)), *description.links[1:])
    for goal in ({"clearance": 0.02}, {"ellipsoids": 12}, {"exact": True}):
        robot = Robot(replace(description, links=links)).bake(**goal, only="hull")
        assert list(robot.covers) == ["elbow", "hand"] and not robot.proved
        assert [note.link for note in robot.notes if note.kind == "error"] == ["base"]


def test_exact_trees_are_of_all_geometries() -> None:
    robot = Robot(arm()).bake(exact=True)
    assert robot.proved and all(cover.tree.has_triangles for cover in robot.covers.values())
    assert len(robot.covers["elbow"].tree.mesh.faces) == 4 + 12


def test_bad_arguments() -> None:
    robot = Robot(arm())
    with pytest.raises(ValueError, match="only one of them"):
        robot.bake(clearance=0.1, exact=True)
    with pytest.raises(ValueError, match="'cone' is none of"):
        robot.bake(only="cone")
    with pytest.raises(ValueError, match="8 or more"):
        robot.bake(max_hull_vertices=4)
    with pytest.raises(ValueError, match=r"finer\['hand'\]"):
        robot.bake(finer={"hand": "5 miles"})
    with pytest.raises(ValueError, match="no link"):
        robot.bake(finer={"foot": 0.001})


def bowl(floor: bool = True) -> MeshShape:
    """Four walls, 2 cm thick, of a box of 40 x 30 x 20 cm that is open above, and a floor; closed, far from convex."""
    slabs = [((0, 0, 0), (0.4, 0.02, 0.2)), ((0, 0.28, 0), (0.4, 0.3, 0.2))]
    slabs += [((0, 0, 0), (0.02, 0.3, 0.2)), ((0.38, 0, 0), (0.4, 0.3, 0.2))]
    slabs += [((0, 0, 0), (0.4, 0.3, 0.02))] if floor else []
    place = pose(3)
    parts = []
    for low, high in np.array(slabs):
        center = np.eye(4)
        center[:3, 3] = (low + high) / 2
        x, y, z = high - low
        parts.append(Geometry(BoxShape((x, y, z)), place @ center))
    return MeshShape(*merged(parts))


def surface_points(mesh: MeshShape, number: int) -> np.ndarray:
    """Random points of the triangles."""
    random = np.random.default_rng(5)
    chosen = mesh.vertices[mesh.faces[random.integers(len(mesh.faces), size=number)]]
    return (chosen * random.dirichlet(np.ones(3), number)[:, :, None]).sum(1)


@pytest.mark.parametrize("count", [1, 3, 8, 24, 1000])
def test_pieces_hold_the_solid_together_and_stay_in_its_hull(count: int) -> None:
    place = pose(1)
    mesh = MeshShape(moved(place, l_shape().vertices), l_shape().faces)
    solid = Solid(Link("l", (), ()), [Geometry(mesh)], Options())
    pieces = Pieces(solid.vertices, solid.faces, solid.exact).at(count)
    assert 1 <= len(pieces) <= count
    hulls = [Geometry(MeshShape(*hull_triangles(points))) for points in pieces]
    points = moved(place, points_of_l(4000))
    assert (beyond(hulls, points) <= 1e-9).all()
    assert max(beyond([Geometry(MeshShape(*hull_triangles(mesh.vertices)))], np.concatenate(pieces))) <= 1e-9
    if count == 3:  # an L is two boxes
        assert sum(volume(hull.shape) for hull in hulls) == pytest.approx(solid.volume, rel=0.2)


@pytest.mark.parametrize("closed", [True, False])
def test_a_shell_is_covered_by_hulls_that_are_proved_and_no_larger_than_its_own(closed: bool) -> None:
    mesh = bowl()
    if not closed:
        mesh = MeshShape(mesh.vertices, mesh.faces[::2])  # every other triangle: no inside
    found = Robot(arm_of(mesh)).bake(ellipsoids=40).covers["shell"]
    assert found.proved and found.kind == "hull" and 5 <= len(found.geometries) <= 40
    assert (beyond(found.geometries, surface_points(mesh, 3000)) <= 0).all()
    around_it = Geometry(MeshShape(*hull_triangles(mesh.vertices)))
    corners = np.concatenate([moved(one.pose, one.shape.vertices) for one in found.geometries])
    assert beyond([around_it], corners).max() <= (1e-5 if closed else 5e-4)  # flat sides stay flat
    if closed:
        assert found.outside_ratio < 0.4


def test_flat_pieces_get_a_volume() -> None:
    flat = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0.1, 0.1, 0]])
    for points in (flat, flat[:3], flat[:2], flat[:1]):
        placed = moved(pose(2), points)
        body = grown(hull_within(thickened(placed, 0.1), 32), 1e-7)
        assert holds_points(body, placed, 1e-8) and volume(body.shape) < 1e-5


def arm_of(mesh: MeshShape) -> Description:
    """A robot of one link."""
    return replace(arm(), links=(Link("shell", (Geometry(mesh),), ()),), joints=())


def test_links_of_the_same_meshes_are_baked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    shell = arm_of(bowl()).links[0]
    twins = replace(arm(), links=(shell, replace(shell, name="twin")), joints=())
    made = []
    monkeypatch.setattr("prolate.robots._baking._measured", lambda *them: made.append(them) or _measured(*them))
    covers = Robot(twins).bake(ellipsoids=2).covers
    assert len(made) == 1 and covers["shell"].name == "shell" and covers["twin"].name == "twin"


def slabs_around(place: np.ndarray, thick: float) -> list[Geometry]:
    """Six boxes along the faces of a cube of 1 m, so thick."""
    found = []
    for axis in range(3):
        for side in (0.0, 1.0 - thick):
            low, high = np.zeros(3), np.ones(3)
            low[axis], high[axis] = side, side + thick
            corners = np.array([[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)])
            found.append(Geometry(MeshShape(*hull_triangles(moved(place, corners)))))
    return found


def cube_of(place: np.ndarray) -> Solid:
    body = np.eye(4)
    body[:3, 3] = 0.5
    mesh = MeshShape(*merged([Geometry(BoxShape((1.0, 1.0, 1.0)), place @ body)]))
    return Solid(Link("cube"), [Geometry(mesh)], Options())


def holds(bodies: list[Geometry], solid: Solid, by: float = 1e-5) -> bool:
    """All bodies grown by as much."""
    return holds_solid([grown(one, by) for one in bodies], solid.vertices[solid.faces], solid.exact, by)


def test_the_proof_of_several_hulls_sees_what_is_left_open() -> None:
    place = pose(4)
    solid = cube_of(place)
    assert holds(slabs_around(place, 0.5), solid)
    assert not holds(slabs_around(place, 0.4), solid)  # a room within
    assert not holds(slabs_around(place, 0.49999), solid, 1e-6)
    for without in range(6):  # what is left of them holds the cube, but for five quarters of one side's half
        rest = slabs_around(place, 0.5)
        del rest[without]
        assert holds(rest, solid)
        assert not holds([one for i, one in enumerate(slabs_around(place, 0.3)) if i != without], solid)
    halves = [slabs_around(place, 0.5)[0], slabs_around(place, 0.5)[1]]
    assert holds(halves, solid)
    shift = np.eye(4)
    shift[:3, 3] = 3e-5 * place[:3, 0]
    apart = [halves[0], replace(halves[1], pose=shift)]
    assert not holds(apart, solid) and holds(apart, solid, 6e-5)


@pytest.mark.parametrize("count", [3, 12])
def test_the_proof_of_pieces_holds_and_notices_a_smaller_one(count: int) -> None:
    mesh = bowl()
    solid = Solid(Link("bowl"), [Geometry(mesh)], Options())
    cover = next(one for one in solid.hulls(64) if len(one.geometries) >= count)
    assert solid.is_proved(cover)
    for i in range(0, len(cover.geometries), 3):
        smaller = list(cover.geometries)
        smaller[i] = grown(smaller[i], -1e-3)
        assert not solid.is_proved(replace(cover, geometries=tuple(smaller)))
        assert not solid.is_proved(replace(cover, geometries=(*smaller[:i], *smaller[i + 1 :])))


def test_cuts_lose_nothing() -> None:
    random = np.random.default_rng(1)
    triangles = random.normal(size=(400, 3, 3))
    triangles[:100, 0, 2], triangles[100:150, :2, 2], triangles[150:160, :, 2] = 0, 0, 0  # corners in the plane
    below, above = cut(triangles, triangles[:, :, 2])

    def area(of: np.ndarray) -> float:
        return np.linalg.norm(np.cross(of[:, 1] - of[:, 0], of[:, 2] - of[:, 0]), axis=1).sum() / 2

    flat = area(triangles[150:160])  # is in both
    assert area(below) + area(above) == pytest.approx(area(triangles) + flat)
    assert (below[:, :, 2] <= 1e-12).all() and (above[:, :, 2] >= -1e-12).all()
