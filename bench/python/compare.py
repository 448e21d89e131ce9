"""Queries from Python beside other packages: the same meshes and poses, verdicts checked.

    compare.py [--poses 100] [--seconds 1] [--data FOLDER] [--only NAME]

For each pair of meshes, poses are drawn so that the surfaces are *far*, *near* (apart by less than a tenth of the
diagonal) or *touching*. Each package is asked pose by pose, from Python, with its objects made beforehand. Its time is
the median over the poses of the least of several turns, and the turns go round the packages. One that takes more than
50 ms is asked at three poses only. "single, C++" is the call that prolate's single call makes, without Python; "batch"
is prolate asked for 2,000 poses by one call. Ratios are to prolate's single call. "import" is how much more
processor time a fresh Python takes that imports a package (with numpy, where that brings it), median of 11. Verdicts
and distances are compared with coal.distance, which is exact for meshes; poses nearer than 1e-6 of the diagonal are not
judged.

Meshes are surfaces to Coal and FCL, so poses with one body inside the other are left out.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import prolate


def matrix(pose):
    x, y, z, w = pose[3:]
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, 3] = pose[:3]
    return out


class Pair:
    """Two bodies; each package makes of them what it needs. `ask` makes a function of a pose that asks once."""

    def __init__(self, a, b):
        self.a, self.b = a, b


def prolate_collide(pair):
    a, b, identity = pair.a.tree, pair.b.tree, np.array([0, 0, 0, 0, 0, 0, 1.0])
    return lambda pose: lambda: prolate.collide(a, identity, b, pose) == 1


def prolate_distance(pair):
    a, b, identity = pair.a.tree, pair.b.tree, np.array([0, 0, 0, 0, 0, 0, 1.0])
    return lambda pose: lambda: prolate.distance(a, identity, b, pose).upper


def coal_model(mesh):
    import coal

    model = coal.BVHModelOBBRSS()
    model.beginModel(len(mesh.faces), len(mesh.vertices))
    vertices = coal.StdVec_Vec3s()
    for v in mesh.vertices.astype(float):
        vertices.append(v)
    faces = coal.StdVec_Triangle()
    for f in mesh.faces:
        faces.append(coal.Triangle(int(f[0]), int(f[1]), int(f[2])))
    model.addSubModel(vertices, faces)
    model.endModel()
    return model


def coal_pose(pose):
    import coal

    m = matrix(pose)
    return coal.Transform3s(m[:3, :3], m[:3, 3])


def coal_collide(pair):
    import coal

    a, b, identity = coal_model(pair.a.mesh), coal_model(pair.b.mesh), coal.Transform3s()
    request, result = coal.CollisionRequest(), coal.CollisionResult()

    def ask(pose):
        at = coal_pose(pose)

        def call():
            result.clear()
            return coal.collide(a, identity, b, at, request, result) > 0

        return call

    return ask


def coal_distance(pair):
    import coal

    a, b, identity = coal_model(pair.a.mesh), coal_model(pair.b.mesh), coal.Transform3s()
    request, result = coal.DistanceRequest(), coal.DistanceResult()

    def ask(pose):
        at = coal_pose(pose)

        def call():
            result.clear()
            return coal.distance(a, identity, b, at, request, result)

        return call

    return ask


def fcl_object(mesh):
    import fcl

    model = fcl.BVHModel()
    model.beginModel(len(mesh.vertices), len(mesh.faces))
    model.addSubModel(mesh.vertices.astype(float), mesh.faces.astype(np.int64))
    model.endModel()
    return model


def fcl_ask(pair, function, request, result, read):
    import fcl

    a = fcl.CollisionObject(fcl_object(pair.a.mesh))
    model = fcl_object(pair.b.mesh)

    def ask(pose):
        m = matrix(pose)
        b = fcl.CollisionObject(model, fcl.Transform(m[:3, :3], m[:3, 3]))

        def call():
            return read(function(a, b, request, result()))

        return call

    return ask


def fcl_collide(pair):
    import fcl

    return fcl_ask(pair, fcl.collide, fcl.CollisionRequest(), fcl.CollisionResult, lambda n: n > 0)


def fcl_distance(pair):
    import fcl

    return fcl_ask(pair, fcl.distance, fcl.DistanceRequest(), fcl.DistanceResult, lambda d: d)


def trimesh_collide(pair):
    import trimesh

    manager = trimesh.collision.CollisionManager()
    a, b = (trimesh.Trimesh(x.mesh.vertices, x.mesh.faces, process=False) for x in (pair.a, pair.b))
    manager.add_object("a", a)

    def ask(pose):
        m = matrix(pose)
        return lambda: manager.in_collision_single(b, m)

    return ask


def rapier_collide(pair):
    import rapier3d as rapier

    a, b = ((x.mesh.vertices, x.mesh.faces.astype(np.uint32)) for x in (pair.a, pair.b))
    shape = rapier.SharedShape.trimesh(*b)
    world = rapier.PhysicsWorld()
    world.add_collider(rapier.Collider.trimesh(*a))
    world.update_query_pipeline()
    found = []

    def hit(handle):
        found.append(handle)
        return False

    def ask(pose):
        turn = rapier.Rotation3.from_quaternion(*(float(pose[k]) for k in (6, 3, 4, 5)))
        at = rapier.Isometry3(rapier.Vec3(*(float(x) for x in pose[:3])), turn)

        def call():
            found.clear()
            world.query_pipeline.intersect_shape(at, shape, hit)
            return bool(found)

        return call

    return ask


def mujoco_distance(pair):
    """mj_geomDistance of the meshes' convex hulls, which is all that MuJoCo knows of meshes."""
    import mujoco

    spec = mujoco.MjSpec()
    for name, body in (("a", pair.a), ("b", pair.b)):
        spec.add_mesh(
            name=name, uservert=body.mesh.vertices.astype(float).ravel(), userface=body.mesh.faces.astype(int).ravel()
        )
        one = spec.worldbody.add_body(name=name)
        one.add_freejoint()
        one.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, name=name)
    model = spec.compile()
    data = mujoco.MjData(model)
    ends = np.zeros(6)

    def ask(pose):
        data.qpos[:] = [0, 0, 0, 1, 0, 0, 0, *pose[:3], pose[6], *pose[3:6]]
        mujoco.mj_kinematics(model, data)
        xpos, xmat = data.geom_xpos.copy(), data.geom_xmat.copy()

        def call():
            data.geom_xpos[:], data.geom_xmat[:] = xpos, xmat
            return mujoco.mj_geomDistance(model, data, 0, 1, 1e3, ends)

        return call

    return ask


COLLIDE = {
    "prolate": prolate_collide,
    "coal": coal_collide,
    "python-fcl": fcl_collide,
    "trimesh": trimesh_collide,
    "rapier3d": rapier_collide,
}
DISTANCE = {
    "prolate": prolate_distance,
    "coal": coal_distance,
    "python-fcl": fcl_distance,
    "mujoco (convex hulls)": mujoco_distance,
}


class Body:
    def __init__(self, path):
        mesh = prolate.load_mesh(path)
        size = np.ptp(mesh.vertices, axis=0)
        self.mesh = mesh._replace(vertices=(mesh.vertices / np.linalg.norm(size)).astype(np.float32))
        self.tree = prolate.bake_mesh(self.mesh, exact=True)


def draw_poses(rng, pair, kind, count):
    """Along random lines through the other body's middle, at the distance that the kind asks for."""
    middle = [(body.mesh.vertices.max(0) + body.mesh.vertices.min(0)) / 2 for body in (pair.a, pair.b)]
    identity = np.array([0, 0, 0, 0, 0, 0, 1.0])
    out = []
    while len(out) < count:
        q = rng.normal(size=4)
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        pose = np.array([0, 0, 0, *(q / np.linalg.norm(q))])
        turned = matrix(pose)[:3, :3] @ middle[1]

        def at(t, pose=pose, turned=turned, direction=direction):
            return np.array([*(middle[0] + t * direction - turned), *pose[3:]])

        touch = prolate.sweep(pair.a.tree, identity, identity, pair.b.tree, at(3), at(0), tolerance=1e-6)
        t = 3 * (1 - touch.toi)
        shift = {"far": rng.uniform(0.5, 1.5), "near": rng.uniform(0.001, 0.1), "touching": -rng.uniform(0.0005, 0.02)}[
            kind
        ]
        chosen = at(t + shift)
        verdict = prolate.collide(pair.a.tree, identity, pair.b.tree, chosen)
        if (verdict == prolate.Verdict.OVERLAPPING) == (kind == "touching"):
            out.append(chosen)
    return np.array(out)


def timed(calls, seconds):
    """For each package the median over its calls of the least time of a call; turns go round the packages."""
    least = {name: [float("inf")] * len(list_) for name, list_ in calls.items()}
    end = time.perf_counter() + seconds * len(calls)
    turn = 0
    while turn < 3 or time.perf_counter() < end:
        for name, list_ in calls.items():
            best = least[name]
            for i, call in enumerate(list_):
                for _ in range(3):  # the first one finds the caches cold
                    start = time.perf_counter_ns()
                    call()
                    took = time.perf_counter_ns() - start
                    if took < best[i]:
                        best[i] = took
        turn += 1
    return {name: statistics.median(best) for name, best in least.items()}


def batch_times(pair, poses, options):
    """Nanoseconds a pose of calls for 2,000 poses or more: in C++, and from Python in float32 and float64; in turns."""
    identity, least = np.array([0, 0, 0, 0, 0, 0, 1.0]), {}
    many = np.tile(poses, (max(1, 2000 // len(poses)), 1))
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / name for name in ("a.etree", "b.etree", "poses")]
        pair.a.tree.save(paths[0])
        pair.b.tree.save(paths[1])
        paths[2].write_bytes(many.astype(np.float32).tobytes())
        for _ in range(5):
            if options.native:
                done = subprocess.run(
                    [options.native, *paths, str(options.seconds / 5)], capture_output=True, check=True
                )
                for name, took in zip(("batch, C++", "single, C++"), map(float, done.stdout.split())):
                    least[name] = min(least.get(name, float("inf")), took)
            for name, form in (("batch, float32", many.astype(np.float32)), ("batch, float64", many)):
                end = time.perf_counter() + options.seconds / 5
                while time.perf_counter() < end:
                    start = time.perf_counter_ns()
                    prolate.collide(pair.a.tree, identity.astype(form.dtype), pair.b.tree, form)
                    took = (time.perf_counter_ns() - start) / len(many)
                    least[name] = min(least.get(name, float("inf")), took)
    return least


def few_if_slow(calls):
    start = time.perf_counter()
    calls[0]()
    return calls[:3] if time.perf_counter() - start > 0.05 else calls


def compare(title, makers, pair, poses, options, judge):
    calls = {}
    for name, maker in makers.items():
        try:
            ask = maker(pair)
            calls[name] = few_if_slow([ask(pose) for pose in poses])
        except (ImportError, NotImplementedError) as error:
            print(f"{title:<34} {name:<22} left out: {error}")
    times = timed(calls, options.seconds)
    if title.startswith("collide"):
        times.update(batch_times(pair, poses, options))
    for name, ns in times.items():
        wrong = judge(calls[name]) if name in calls else ""
        print(f"{title:<34} {name:<22} {ns / 1e3:>10.2f} us {ns / times['prolate']:>8.2f} {wrong}", flush=True)


def import_times():
    def used():  # by ended children, seconds of all cores
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    programs = {"": "pass", **{name: f"import {name}" for name in ("prolate", "numpy", "coal", "fcl", "mujoco")}}
    times = {name: [] for name in programs}
    for _ in range(11):
        for name, program in programs.items():
            before = used()
            failed = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False).returncode
            times[name].append(float("nan") if failed else used() - before)
    bare = statistics.median(times.pop(""))
    for name, took in times.items():
        print(f"{'import':<34} {name:<22} {1e3 * (statistics.median(took) - bare):>10.1f} ms", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poses", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=1, help="for each package and kind of poses")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--native", help="the program of bench/python/native.cpp")
    parser.add_argument("--only", default="", help="pairs whose name has this")
    options = parser.parse_args()
    rng = np.random.default_rng(1)
    bodies = {}
    import_times()
    print(f"{'query':<34} {'package':<22} {'median':>13} {'ratio':>8} wrong")
    for name_a, name_b in (("knight", "knight"), ("horse", "horse"), ("bunny", "horse")):
        if options.only not in f"{name_a}-{name_b}":
            continue
        for name in (name_a, name_b):
            bodies.setdefault(name, Body(options.data / f"{name}.obj"))
        pair = Pair(bodies[name_a], bodies[name_b])
        exact = coal_distance(pair)
        for kind in ("far", "near", "touching"):
            poses = draw_poses(rng, pair, kind, options.poses)
            truth = [exact(pose)() for pose in poses]

            def judge_collide(calls, truth=truth):
                answers = [call() for call in calls]
                return f"{sum(a == (d > 0) for a, d in zip(answers, truth) if not 0 < d < 1e-6)} of {len(calls)}"

            def judge_distance(calls, truth=truth):
                answers = [call() for call in calls]
                return f"{sum(abs(a - d) > 1e-5 for a, d in zip(answers, truth))} of {len(calls)}"

            compare(f"collide {name_a}-{name_b} {kind}", COLLIDE, pair, poses, options, judge_collide)
            if kind != "touching":
                compare(f"distance {name_a}-{name_b} {kind}", DISTANCE, pair, poses, options, judge_distance)


if __name__ == "__main__":
    main()
