"""Six robots of example-robot-data: read, covered, written, and dropped on the floor in MuJoCo, by ./run robots.

Figures of docs/robots.md come from here.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

import prolate
from prolate.robots._baked import BakedRobot
from prolate.robots._robot import Robot
from prolate.robots._touch import touches
from prolate.robots._write_mjcf import write_mjcf

ROBOTS = {  # folder and file of the package, and whether it stands on a floor by itself
    "panda": ("panda_description/urdf/panda.urdf", False),
    "go2": ("go2_description/urdf/go2.urdf", True),
    "talos": ("talos_data/robots/talos_reduced.urdf", True),
    "allegro": ("allegro_hand_description/urdf/allegro_left_hand.urdf", False),
    "iris": ("iris_description/robots/iris.urdf", True),
    "tiago": ("tiago_description/robots/tiago.urdf", True),
}


def data_folder() -> Path:
    """Of the installed package."""
    found = sorted(Path(sys.prefix).rglob("example-robot-data/robots"))
    if not found:
        sys.exit("example-robot-data is not installed; ./run robots does that")
    return found[0]


def on_the_floor(path: Path) -> mujoco.MjModel:
    """The robot above a plane, as low as it can be without touching."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    return spec.compile()


def lowest(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """The least height of a geom, by its distance from the floor."""
    floor = model.ngeom - 1 if model.geom_type[model.ngeom - 1] == mujoco.mjtGeom.mjGEOM_PLANE else 0
    solid = [i for i in range(model.ngeom) if i != floor and model.geom_contype[i]]
    return min(mujoco.mj_geomDistance(model, data, floor, i, 10.0, None) for i in solid)


def stiff(robot: BakedRobot) -> BakedRobot:
    """The robot with all joints fixed."""
    description = robot.description
    joints = tuple(replace(joint, kind="fixed", mimic=None) for joint in description.joints)
    return replace(robot, description=replace(description, joints=joints))


def resting_height(robot: BakedRobot, folder: Path) -> float:
    """Of the root after a fall of 1 cm with stiff joints, and 2 s; metres."""
    path = folder / "stiff.xml"
    write_mjcf(stiff(robot), path, floating=True, visuals=False)
    model = on_the_floor(path)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    data.qpos[2] += 0.01 - lowest(model, data)
    for _ in range(int(2 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return float(data.qpos[2])


def fall(robot: BakedRobot, exclude: list[tuple[str, str]], folder: Path, seconds: float) -> tuple[float, float]:
    """Steps a second of CPU while the limp robot falls and lies, and contacts a step."""
    path = folder / "limp.xml"
    write_mjcf(robot, path, floating=True, visuals=False, exclude=exclude)
    model = on_the_floor(path)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    data.qpos[2] += 0.05 - lowest(model, data)
    contacts, steps, start = 0, int(seconds / model.opt.timestep), time.process_time()
    for _ in range(steps):
        mujoco.mj_step(model, data)
        contacts += data.ncon
    if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
        print(f"    {path}: MuJoCo lost the simulation")
    return steps / (time.process_time() - start), contacts / steps


def touching(robot: BakedRobot, folder: Path) -> list[tuple[str, str]]:
    """Pairs of links whose covers touch where all joints are at 0 (or nearest to it)."""
    path = folder / "touching.xml"
    write_mjcf(robot, path, visuals=False)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = {tuple(sorted((model.geom(c.geom1).bodyid[0], model.geom(c.geom2).bodyid[0]))) for c in data.contact}
    return [(model.body(a).name, model.body(b).name) for a, b in sorted(names)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", default=list(ROBOTS), help="by default all six")
    parser.add_argument("--budget", type=int, default=200)
    parser.add_argument("--quality", default="fast")
    parser.add_argument("--seconds", type=float, default=1.0, help="of each fall")
    parser.add_argument("--rounds", type=int, default=7, help="falls of each")
    parser.add_argument("--clearance", action="store_true", help="covers of 5 mm, too")
    parser.add_argument("--tables", action="store_true", help="a line for each link")
    options = parser.parse_args()
    root = data_folder()
    for name in options.robots:
        file, stands = ROBOTS[name]
        with tempfile.TemporaryDirectory() as place:
            one(name, root / file, stands, Path(place), options)


def one(name: str, file: Path, stands: bool, folder: Path, options: argparse.Namespace) -> None:
    for goal in ({"ellipsoids": options.budget}, {"clearance": 0.005})[: 1 + options.clearance]:
        for again in ("", ", again"):
            start, wall = time.process_time(), time.perf_counter()
            robot = Robot.load(file, visuals=False)
            baked = robot.bake(**goal, quality=options.quality, cache=folder / "cache")
            write_mjcf(baked, folder / f"{name}.xml", visuals=False)
            print(
                f"{name}, {goal}{again}: {time.process_time() - start:.1f} CPU s, {time.perf_counter() - wall:.1f} s, "
                f"{len(baked.covers)} links, {sum(len(c.geometries) for c in baked.covers.values())} bodies, cost "
                f"{sum(c.cost for c in baked.covers.values()):.0f}, "
                f"mean {1000 * np.mean([c.mean_distance for c in baked.covers.values()]):.2f} mm, "
                f"worst mean {1000 * max(c.mean_distance for c in baked.covers.values()):.2f} mm, "
                f"{'all proved' if baked.proved else 'NOT ALL PROVED'}, {len(baked.notes)} notes"
            )
        for note in baked.notes:
            print(f"    {note}")
        if options.tables:
            print(baked.table())
        own = robot.bake(exact=True)
        exclude = touching(own, folder)
        more = [pair for pair in touching(baked, folder) if pair not in exclude]
        print(f"    touching at 0: {len(exclude)} pairs of links, by covers {len(more)} more")
        never = [pair for pair, why in touches(own, baked).disabled().items() if why == "never"]
        both = exclude + more
        ways = ((own, both), (baked, both), (baked, both + never))
        # In turns, and the median of the turns' ratios: other programs disturb these.
        falls = np.array([[fall(*way, folder, options.seconds) for way in ways] for _ in range(options.rounds)])
        (by_hulls, contacts_of_hulls), (by_covers, contacts), _ = np.median(falls, axis=0)
        ratios = falls[:, 1:, 0] / falls[:, :1, 0]
        ratio, without = (f"{np.median(one):.2f}, {one.min():.2f} to {one.max():.2f}" for one in ratios.T)
        print(
            f"    MuJoCo: {by_covers:.0f} steps a second by covers, {by_hulls:.0f} by the meshes' hulls ({ratio}); "
            f"contacts a step {contacts:.1f} and {contacts_of_hulls:.1f}"
        )
        print(f"    without the {len(never)} pairs of links that never touched in 10,000 samples: {without}")
        if stands:
            heights = [resting_height(r, folder) for r in (own, baked)]
            print(f"    rests {1000 * (heights[1] - heights[0]):+.2f} mm higher by covers than by the meshes' hulls")
    sys.stdout.flush()


if __name__ == "__main__":
    print(f"prolate {prolate.__version__}, MuJoCo {mujoco.__version__}")
    main()
