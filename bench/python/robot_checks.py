"""Checks of robots against Pinocchio and Coal: the same frames and verdicts, and how soon.

    python bench/python/robot_checks.py ROBOTS [--robots panda,go2] [--count 2000] [--motions 200]

ROBOTS is the folder ``robots`` of PyPI's example-robot-data; needs ``pin``. Around each robot stand 20 random boxes.
Times are CPU seconds of one thread. A frame, a verdict or a motion that is wrong ends with exit code 1.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

import prolate
from prolate import robots

FILES = {
    "panda": "panda_description/urdf/panda.urdf",
    "go2": "go2_description/urdf/go2.urdf",
    "talos": "talos_data/robots/talos_reduced.urdf",
    "allegro": "allegro_hand_description/urdf/allegro_left_hand.urdf",
    "iris": "iris_description/robots/iris_simple.urdf",
    "tiago": "tiago_description/robots/tiago.urdf",
}
SPREAD = {"talos": 0.3, "allegro": 0.3}  # of those that hit themselves nearly everywhere else
BOXES = 20
# Coal calls meshes that are 1e-6 apart touching; its distances are exact, so they decide what is closer than this.
NEAR = 2e-6


class Peer:
    """The robot in Pinocchio, with a pair of geometries for each pair of ours."""

    def __init__(self, description: robots.Description, packages: list[str]) -> None:
        self.description = description
        path = str(description.source)
        self.model = pin.buildModelFromUrdf(path)  # joints that mimic others are set here, in q_of()
        self.data = self.model.createData()
        self.geometry = pin.buildGeomFromUrdf(self.model, path, pin.GeometryType.COLLISION, package_dirs=packages)
        self.parts: dict[str, list[int]] = {}
        for i, one in enumerate(self.geometry.geometryObjects):
            self.parts.setdefault(self.model.frames[one.parentFrame].name, []).append(i)

    def add_boxes(self, boxes: dict[str, prolate.Box]) -> None:
        for name, box in boxes.items():
            placed = pin.GeometryObject(name, 0, 0, pin.XYZQUATToSE3(box.pose), coal.Box(*(2 * box.half)))
            self.parts[name] = [self.geometry.addGeometryObject(placed)]

    def set_pairs(self, pairs: list[robots.Pair]) -> None:
        for pair in pairs:
            for a in self.parts.get(pair.link, []):
                for b in self.parts.get(pair.other, []):
                    self.geometry.addCollisionPair(pin.CollisionPair(a, b))
        self.geometry_data = self.geometry.createData()

    def q_of(self, q: np.ndarray) -> np.ndarray:
        """Our configurations, (N, nq), in Pinocchio's order; an angle without limits is a cosine and a sine there."""
        values, first = {}, 0
        for joint in self.description.joints:
            values[joint.name] = q[:, first] if joint.coordinates else None
            first += joint.coordinates
        out = np.tile(pin.neutral(self.model), (len(q), 1))
        for joint in self.description.joints:
            if joint.kind == "fixed":
                continue
            value = values[joint.name]
            if joint.mimic:
                value = joint.mimic.multiplier * values[joint.mimic.joint] + joint.mimic.offset
            own = self.model.joints[self.model.getJointId(joint.name)]
            columns = [value] if own.nq == 1 else [np.cos(value), np.sin(value)]
            out[:, own.idx_q : own.idx_q + own.nq] = np.stack(columns, axis=1)
        return out

    def frames(self, q: np.ndarray) -> np.ndarray:
        ids = [self.model.getFrameId(link.name, pin.FrameType.BODY) for link in self.description.links]
        out = np.empty((len(ids), len(q), 4, 4))
        for i, row in enumerate(self.q_of(q)):
            pin.framesForwardKinematics(self.model, self.data, row)
            for k, frame in enumerate(ids):
                out[k, i] = self.data.oMf[frame].homogeneous
        return out

    def collide(self, rows: np.ndarray) -> np.ndarray:
        """Stops at the first hit, as ours does; forward kinematics included, as in ours."""
        model, data, geometry, geometry_data = self.model, self.data, self.geometry, self.geometry_data
        return np.array([pin.computeCollisions(model, data, geometry, geometry_data, row, True) for row in rows])

    def distance(self, row: np.ndarray) -> float:
        """Of the nearest pair; 0 where meshes cross."""
        pin.updateGeometryPlacements(self.model, self.data, self.geometry, self.geometry_data, row)
        count = len(self.geometry.collisionPairs)
        found = (pin.computeDistance(self.geometry, self.geometry_data, i).min_distance for i in range(count))
        return max(min(found), 0.0)


def checks_of(baked: robots.BakedRobot, allowed: Iterable[tuple[str, str]] = ()) -> robots.Checks:
    trees = {name: cover.tree for name, cover in baked.covers.items()}
    slack = {name: cover.rounding for name, cover in baked.covers.items()}
    return robots.Checks(baked.description, trees, slack=slack, allowed=allowed)


def boxes_around(checks: robots.Checks, q: np.ndarray, rng: np.random.Generator, count: int) -> dict[str, prolate.Box]:
    """Boxes of half sides of 3 to 15 % of what the robot reaches, turned in all ways.

    None that it touches in more than a tenth of its configurations: such a scene would be decided at once.
    """
    reach = np.abs(checks.fk(q)[:, :, :3]).max()
    alone = checks.collide(q).mean()
    out: dict[str, prolate.Box] = {}
    while len(out) < count:
        turn = rng.normal(size=4)
        pose = np.concatenate([rng.uniform(-reach, reach, 3), turn / np.linalg.norm(turn)])
        box = prolate.Box(pose, rng.uniform(0.03, 0.15, 3) * reach)
        if checks.collide(q, robots.Scene().add(box)).mean() - alone < 0.1:
            out[f"box {len(out)}"] = box
    return out


def configurations(checks: robots.Checks, count: int, seed: int, spread: float) -> np.ndarray:
    """Random ones, that part of the way from home. (No robot here has quaternions.)"""
    home = checks.kinematics.home
    return home + spread * (checks.kinematics.random(count, seed) - home)


def microseconds(call: Callable[[], object], count: int, rounds: int = 3) -> float:
    """CPU time of one of `count`, the best of some rounds."""
    best = np.inf
    for _ in range(rounds):
        start = time.process_time()
        call()
        best = min(best, time.process_time() - start)
    return 1e6 * best / count


def compare(name: str, folder: Path, args: argparse.Namespace) -> bool:
    """Prints what was found of one robot; is all of it right?"""
    packages = {"example-robot-data": folder.parent}
    description = robots.load(folder / FILES[name], packages=packages, visuals=False)
    robot = robots.Robot(description)
    baked = robot.bake(exact=True)
    lone = checks_of(baked)
    # Pairs that touch nearly always are parts of one another; they would decide every configuration.
    sample = lone.collide(configurations(lone, 1000, 4, args.spread), first_only=False).mean(axis=0)
    always = [pair[:2] for pair, part in zip(lone.pairs(), sample) if part > 0.9]
    exact = checks_of(baked, always)
    boxes = boxes_around(exact, configurations(exact, 500, 1, args.spread), np.random.default_rng(3), BOXES)
    scene = robots.Scene()
    for key, box in boxes.items():
        scene.add(box, name=key)
    pairs = exact.pairs(scene)
    peer = Peer(description, [str(folder.parent), str(folder.parent.parent), str(folder)])
    peer.add_boxes(boxes)
    peer.set_pairs(pairs)

    q = configurations(exact, args.count, 1, args.spread)
    some = q[:200]
    ours = np.array([[pin.XYZQUATToSE3(pose).homogeneous for pose in link] for link in exact.fk(some)])
    off = np.abs(ours - peer.frames(some)).max()
    rows = peer.q_of(q)
    found = exact.collide(q, scene, threads=1)
    start = time.process_time()
    theirs = peer.collide(rows)
    slow = 1e6 * (time.process_time() - start) / len(q)
    differ = [(i, peer.distance(rows[i])) for i in np.flatnonzero(found != theirs)]
    missed = sum(not found[i] and distance == 0 for i, distance in differ)
    invented = sum(found[i] and distance > NEAR for i, distance in differ)

    many = configurations(exact, 100_000, 2, args.spread)
    fast = microseconds(lambda: exact.collide(many, scene, threads=1), len(many))
    print(f"{name}: {len(pairs)} pairs of {len(baked.covers)} links and {BOXES} boxes")
    print(f"  frames: off by {off:.1e} m at most")
    print(f"  {len(q)} configurations, {theirs.mean():.0%} touch: {missed} missed, {invented} invented", end=", ")
    print(f"{len(differ) - missed - invented} closer than Coal tells")
    print(f"  exact: {fast:.2f} us each, Pinocchio and Coal {slow:.0f} us, {slow / fast:.0f} times", end=" ")
    print(f"(there, {len(peer.geometry.collisionPairs)} pairs of parts)")
    if args.clearance:
        covers = checks_of(robot.bake(clearance=args.clearance, cache=args.cache), always)
        quick = microseconds(lambda: covers.collide(many, scene, threads=1), len(many))
        answer = covers.collide(many, scene)
        lost = int((exact.collide(many, scene) & ~answer).sum())
        missed += lost
        print(f"  covers of {args.clearance}: {quick:.2f} us each, {slow / quick:.0f} times", end=", ")
        print(f"{answer.mean():.0%} may touch, {lost} missed")
    tunnelled = motions(exact, scene, args)
    return off < 1e-9 and missed == 0 and invented == 0 and tunnelled == 0


def motions(checks: robots.Checks, scene: robots.Scene, args: argparse.Namespace) -> int:
    """Random motions, a fifth of the way from one random configuration to another, against dense samples."""
    q0, q1 = (configurations(checks, args.motions, seed, args.spread) for seed in (5, 6))
    q1 = q0 + 0.2 * (q1 - q0)
    start = time.process_time()
    verdict = checks.motion_verdicts(q0, q1, scene, threads=1)
    each = 1e6 * (time.process_time() - start) / max(len(q0), 1)
    steps = np.linspace(0, 1, args.samples)[:, None]
    hit = np.array([checks.collide(a + steps * (b - a), scene).any() for a, b in zip(q0, q1)], dtype=bool)
    free = verdict == prolate.Verdict.SEPARATED
    tunnelled = int((hit & free).sum())
    print(
        f"  {len(q0)} motions, {each:.0f} us each: {hit.sum()} hit something in {args.samples} samples, {tunnelled} of "
        f"these called free; of the others {(free & ~hit).sum()} certified, {(~free & ~hit).sum()} not"
    )
    return tunnelled


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="ROBOTS")
    parser.add_argument("--robots", default=",".join(FILES))
    parser.add_argument("--count", type=int, default=2000, help="configurations that Pinocchio is asked about, too")
    parser.add_argument("--clearance", default="", help="covers of this clearance as well, such as 5mm")
    parser.add_argument("--cache", type=Path, help="folder that keeps them")
    parser.add_argument("--spread", type=float, help="how far from home configurations are, as part of all")
    parser.add_argument("--motions", type=int, default=200)
    parser.add_argument("--samples", type=int, default=10_000, help="of a motion")
    args = parser.parse_args()
    good = []
    for name in args.robots.split(","):
        spread = SPREAD.get(name, 1.0) if args.spread is None else args.spread
        good.append(compare(name, args.folder, argparse.Namespace(**{**vars(args), "spread": spread})))
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
