"""What is written, read by the targets themselves: Pinocchio with Coal, Newton, PyBullet, Drake; for ./run robots.

A small robot at general rotations is written, loaded, and asked: random points of its solids, in the world, must be in
the shapes as the target has and places them. MuJoCo's part is in python/tests/test_robots_write_mjcf.py.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python" / "tests"))
from robot_parts import arm, baked, frames, points_of_l, pose, wedge

from prolate.robots import BakedRobot, add_to_newton, geometry_model, write_sdf, write_urdf
from prolate.robots._model import (
    BoxShape,
    CapsuleShape,
    CylinderShape,
    EllipsoidShape,
    Geometry,
    MeshShape,
    SphereShape,
)
from prolate.robots._solids import hull_triangles, inverse, moved, outside

Q = {"turn": 0.7, "push": 0.15}
SOLIDS = {"base": moved(pose(1), points_of_l(1000)), "hand": moved(pose(4), wedge().vertices)}
KINDS = [None, "ellipsoids", "spheres", "hull", "capsule", "cylinder"]


def check(target: str, shapes: dict[str, list[Geometry]]) -> None:
    """``shapes`` are in the world."""
    places = frames(arm(), Q)
    for link, points in SOLIDS.items():
        world = moved(places[link], points)
        beyond = np.min([outside(one.shape, moved(inverse(one.pose), world)) for one in shapes[link]], axis=0)
        if beyond.max() > 0:
            sys.exit(f"{target}: a point of {link} is {beyond.max():.2e} m outside of its cover")


def pinocchio(robot: BakedRobot, folder: Path) -> dict[str, list[Geometry]]:
    import pinocchio as pin

    write_urdf(robot, folder / "arm.urdf")
    model = pin.buildModelFromUrdf(str(folder / "arm.urdf"))
    geometries = geometry_model(robot, model)
    data, placed = model.createData(), geometries.createData()
    pin.updateGeometryPlacements(model, data, geometries, placed, np.array([Q["turn"], Q["push"]]))
    found: dict[str, list[Geometry]] = {}
    for one, place in zip(geometries.geometryObjects, placed.oMg):
        found.setdefault(model.frames[one.parentFrame].name, []).append(
            Geometry(_of_coal(one.geometry), place.homogeneous)
        )
    return found


def _of_coal(shape: object) -> object:
    import coal

    if isinstance(shape, coal.Ellipsoid):
        return EllipsoidShape(tuple(shape.radii))
    if isinstance(shape, coal.Sphere):
        return SphereShape(shape.radius)
    if isinstance(shape, coal.Box):
        return BoxShape(tuple(2 * shape.halfSide))
    if isinstance(shape, coal.Capsule):
        return CapsuleShape(shape.radius, 2 * shape.halfLength)
    if isinstance(shape, coal.Cylinder):
        return CylinderShape(shape.radius, 2 * shape.halfLength)
    points = np.array([shape.point(i) for i in range(shape.num_points)])
    return MeshShape(*hull_triangles(points))


def newton(robot: BakedRobot, folder: Path) -> dict[str, list[Geometry]]:
    import newton as nt
    import warp as wp

    builder = nt.ModelBuilder()
    builder.rigid_gap = 0.0
    bodies = {}
    for link, place in frames(arm(), Q).items():
        from prolate.robots._writing import quaternion

        w, x, y, z = quaternion(place[:3, :3])
        bodies[link] = builder.add_body(xform=wp.transform(wp.vec3(*place[:3, 3]), wp.quat(x, y, z, w)), mass=1.0)
    shapes = add_to_newton(robot, builder, bodies)
    model = builder.finalize(device="cpu")
    kinds, scales = model.shape_type.numpy(), model.shape_scale.numpy().astype(np.float64)
    places, owners = model.shape_transform.numpy(), model.shape_body.numpy()
    names = {number: link for link, number in bodies.items()}
    found: dict[str, list[Geometry]] = {}
    for i in shapes:
        body = _matrix(model.body_q.numpy()[owners[i]])
        shape = _of_newton(nt, int(kinds[i]), scales[i], model.shape_source[i])
        found.setdefault(names[owners[i]], []).append(Geometry(shape, body @ _matrix(places[i])))
    return found


def _matrix(row: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    place = np.eye(4)
    place[:3, :3], place[:3, 3] = Rotation.from_quat(row[3:].astype(np.float64)).as_matrix(), row[:3]
    return place


def _of_newton(nt: object, kind: int, scale: np.ndarray, source: object) -> object:
    geo = nt.GeoType
    if kind == geo.ELLIPSOID:
        return EllipsoidShape(tuple(scale))
    if kind == geo.SPHERE:
        return SphereShape(scale[0])
    if kind == geo.BOX:
        return BoxShape(tuple(2 * scale))
    if kind == geo.CAPSULE:
        return CapsuleShape(scale[0], 2 * scale[1])
    if kind == geo.CYLINDER:
        return CylinderShape(scale[0], 2 * scale[1])
    return MeshShape(*hull_triangles(np.asarray(source.vertices, np.float64) * scale))


def ask_pybullet(robot: BakedRobot, folder: Path, label: str) -> None:
    """PyBullet does not tell its meshes, so a grain is put at each point, and asked whether it touches the link."""
    import pybullet as pb

    path = folder / "arm.urdf"
    write_urdf(robot, path)
    pb.connect(pb.DIRECT)
    body = pb.loadURDF(str(path), useFixedBase=True)
    names = {"base": -1}
    for i in range(pb.getNumJoints(body)):
        info = pb.getJointInfo(body, i)
        names[info[12].decode()] = i
        pb.resetJointState(body, i, Q[info[1].decode()])
    # The origin of PyBullet's base is its centre of mass.
    _, inertial, turn = pb.getDynamicsInfo(body, -1)[2:5]
    pb.resetBasePositionAndOrientation(body, inertial, turn)
    grain = pb.createMultiBody(0, pb.createCollisionShape(pb.GEOM_SPHERE, radius=1e-5))
    for link, points in SOLIDS.items():
        for point in moved(frames(arm(), Q)[link], points[-100:]):
            pb.resetBasePositionAndOrientation(grain, point, [0, 0, 0, 1])
            if not pb.getClosestPoints(grain, body, 0.0, -1, names[link]):
                sys.exit(f"{label}: a point of {link} is outside of its cover")
    pb.disconnect()


def ask_drake(robot: BakedRobot, folder: Path, label: str) -> None:
    """By the distances of points from geometries, which Drake calculates to a few micrometres for ellipsoids."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.systems.framework import DiagramBuilder

    write_urdf(robot, folder / "arm.urdf", ellipsoids="drake", visuals=False)
    write_sdf(robot, folder / "arm.sdf", visuals=False)
    for path in (folder / "arm.urdf", folder / "arm.sdf"):
        builder = DiagramBuilder()
        plant, scene = AddMultibodyPlantSceneGraph(builder, 0.0)
        Parser(plant).AddModels(str(path))
        if path.suffix == ".urdf":
            plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
        plant.Finalize()
        diagram = builder.Build()
        context = diagram.CreateDefaultContext()
        plant.SetPositions(plant.GetMyContextFromRoot(context), [Q["turn"], Q["push"]])
        query = scene.get_query_output_port().Eval(scene.GetMyContextFromRoot(context))
        for link, points in SOLIDS.items():
            solid = plant.GetCollisionGeometriesForBody(plant.GetBodyByName(link))
            for point in moved(frames(arm(), Q)[link], points[-100:]):
                apart = [one.distance for one in query.ComputeSignedDistanceToPoint(point) if one.id_G in solid]
                if min(apart) > 3e-6:
                    sys.exit(f"{label}, {path.suffix}: a point of {link} is {min(apart):.1e} m outside of its cover")


def main() -> None:
    with tempfile.TemporaryDirectory() as cache:
        for target in (pinocchio, newton, ask_pybullet, ask_drake):
            for only in KINDS:
                robot, label = baked(only, Path(cache)), f"{target.__name__.removeprefix('ask_')}, {only}"
                with tempfile.TemporaryDirectory() as folder:  # PyBullet remembers files by their names
                    if target in (ask_pybullet, ask_drake):
                        target(robot, Path(folder), label)
                    else:
                        check(label, target(robot, Path(folder)))
            name = target.__name__.removeprefix("ask_")
            print(f"{name}: covers of all kinds hold the links, where it places them")


if __name__ == "__main__":
    main()
