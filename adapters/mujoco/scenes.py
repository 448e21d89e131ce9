"""Scenes that convex hulls cannot play, in MuJoCo:  scenes.py PLUGIN PROLATE FOLDER

A peg falls through a hole, a torus hangs in another one, a nut turns down a bolt, simple geoms rest on a plate with a
hole. Each as trees (the plugin), as MuJoCo's own signed distances, as convex hulls of CoACD's parts, and as the hulls
that MuJoCo makes of meshes. Prints for each: contacts and steps a second, the deepest contact that the engine saw, and
what came of it. Fails if trees do not play as they should.

PLUGIN: libprolate_mujoco.so, PROLATE: the command, FOLDER: where meshes and trees go.
"""

import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

Mesh = tuple[np.ndarray, np.ndarray]  # vertices (n, 3), metres; triangles (m, 3), counter-clockwise from outside

PITCH, RADIUS = 1 / 12, 0.255  # of the threads, metres: those of MuJoCo's own bolt


# --- meshes ----------------------------------------------------------------------------------------------------------


def ring(profile: list[tuple[float, float]], around: int = 32) -> Mesh:
    """The solid that a closed polygon of (radius, z), counter-clockwise, sweeps around z; radii above 0."""
    angle = 2 * np.pi * np.arange(around) / around
    vertices = np.array([(r * np.cos(a), r * np.sin(a), z) for a in angle for r, z in profile])
    n, triangles = len(profile), []
    for i in range(around):
        for j in range(n):
            a, b = i * n + j, (i + 1) % around * n + j
            c, d = i * n + (j + 1) % n, (i + 1) % around * n + (j + 1) % n
            triangles += [(a, b, d), (a, d, c)]
    return vertices, np.array(triangles)


def peg(radius: float, half: float, around: int = 32) -> Mesh:
    angle = 2 * np.pi * np.arange(around) / around
    circle = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    vertices = [(x, y, z) for z in (-half, half) for x, y in circle] + [(0, 0, -half), (0, 0, half)]
    low, high, triangles = 2 * around, 2 * around + 1, []
    for i in range(around):
        j = (i + 1) % around
        triangles += [(i, j, around + j), (i, around + j, around + i), (low, j, i), (high, around + i, around + j)]
    return np.array(vertices), np.array(triangles)


def torus(major: float, minor: float, around: int = 48, across: int = 24) -> Mesh:
    angles = 2 * np.pi * np.arange(across) / across
    return ring([(major + minor * math.cos(v), minor * math.sin(v)) for v in angles], around)


class Thread:
    """A helix of ridges and valleys: row k is half a pitch above row k - 1, ridges have the even numbers."""

    def __init__(self, ridge: float, valley: float, rows: int, around: int = 96):
        turn = np.arange(around) / around
        self.around, self.rows = around, rows
        self.vertices = np.array(
            [
                (
                    (valley if k % 2 else ridge) * np.cos(2 * np.pi * t),
                    (valley if k % 2 else ridge) * np.sin(2 * np.pi * t),
                    PITCH * (k / 2 + t),
                )
                for k in range(rows)
                for t in turn
            ]
        )
        self.triangles = []  # seen from the outside
        for k in range(rows - 3):
            for i in range(around):
                a, b, c, d = self.at(k, i), self.at(k, i + 1), self.at(k + 1, i), self.at(k + 1, i + 1)
                self.triangles += [(a, b, d), (a, d, c)]

    def at(self, row: int, i: int) -> int:
        """After a turn, a row goes on two rows higher."""
        return (row + 2 * (i // self.around)) * self.around + i % self.around

    def rim(self, row: int) -> list[int]:
        """The edge of rows from `row` on: a turn of the helix, and straight back."""
        return [self.at(row, i) for i in range(self.around + 1)] + [self.at(row + 1, 0)]


def bolt() -> Mesh:
    rows = 27
    thread = Thread(RADIUS, RADIUS - PITCH / 2, rows)
    vertices, triangles = list(thread.vertices), list(thread.triangles)
    for row, z, reverse in ((0, 0.0, True), (rows - 3, PITCH * (rows - 1) / 2, False)):
        vertices.append(np.array([0, 0, z]))
        rim = thread.rim(row)
        for a, b in zip(rim, rim[1:] + rim[:1]):
            triangles.append((len(vertices) - 1, b, a) if reverse else (len(vertices) - 1, a, b))
    return np.array(vertices), np.array(triangles)


def nut(clearance: float = 0.006, first: int = 12, rows: int = 10, outer: float = 0.45) -> Mesh:
    """Around the bolt, from its row `first` on, a ring."""
    thread = Thread(RADIUS + clearance, RADIUS - PITCH / 2 + clearance, rows)
    n = thread.around
    vertices = list(thread.vertices + np.array([0, 0, PITCH * first / 2]))
    triangles = [(c, b, a) for a, b, c in thread.triangles]
    middle = PITCH * (first + rows / 2 - 0.5) / 2 + PITCH / 4
    walls = []
    for row, z, reverse in ((0, middle - 0.14, True), (rows - 3, middle + 0.14, False)):
        wall = len(vertices)
        walls.append(wall)
        vertices += [
            np.array([outer * math.cos(2 * math.pi * i / n), outer * math.sin(2 * math.pi * i / n), z])
            for i in range(n)
        ]
        rim = thread.rim(row)
        flat = []
        for i in range(n):
            a, b = wall + i, wall + (i + 1) % n
            flat += [(rim[i], a, b), (rim[i], b, rim[i + 1])]
        flat += [(rim[n], wall, rim[n + 1]), (rim[n + 1], wall, rim[0])]
        triangles += [(c, b, a) for a, b, c in flat] if reverse else flat
    for i in range(n):
        a, b, c, d = (wall + k for wall in walls for k in (i, (i + 1) % n))
        triangles += [(a, b, d), (a, d, c)]
    return np.array(vertices), np.array(triangles)


def write(mesh: Mesh, path: Path) -> None:
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh[0]]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh[1]]
    path.write_text("\n".join(lines) + "\n")


# --- scenes ----------------------------------------------------------------------------------------------------------


@dataclass
class Part:
    """A body of one mesh."""

    name: str
    mesh: Mesh
    own: str = ""  # MuJoCo's own SDF plugin, and its configuration
    own_quat: str = "1 0 0 0"  # of that one's shape
    own_pos: str = "0 0 0"
    pos: str = "0 0 0"
    quat: str = "1 0 0 0"
    moves: bool = False


@dataclass
class Scene:
    name: str
    parts: list[Part]
    seconds: float
    outcome: Callable[["Run"], tuple[bool, str]]
    more: str = ""  # into the world
    friction: float = 0.5


@dataclass
class Run:
    model: mujoco.MjModel
    data: mujoco.MjData
    turned: float = 0.0  # of the first body that moves, about z, radians
    deepest: float = 0.0  # of a contact, as the engine sees it, metres
    contacts: float = 0.0  # mean
    steps_a_second: float = 0.0
    start: np.ndarray = field(default_factory=lambda: np.zeros(0))


class Player:
    """Makes models of scenes, and runs them."""

    def __init__(self, folder: Path, prolate: str):
        self.folder, self.prolate = folder, prolate
        self.hulls: dict[str, int] = {}

    def prepare(self, part: Part) -> None:
        obj = self.folder / f"{part.name}.obj"
        write(part.mesh, obj)
        subprocess.run(
            [self.prolate, "bake", obj, "--exact", "-q", "--force", "-o", obj.with_suffix(".etree")], check=True
        )

    def decompose(self, part: Part) -> int:
        """CoACD's parts, as files; 0 if it is not installed."""
        if part.name not in self.hulls:
            try:
                import coacd
            except ImportError:
                return 0
            coacd.set_log_level("error")
            hulls = coacd.run_coacd(coacd.Mesh(*part.mesh), threshold=0.05)
            for i, hull in enumerate(hulls):
                write((np.asarray(hull[0]), np.asarray(hull[1])), self.folder / f"{part.name}_{i}.obj")
            self.hulls[part.name] = len(hulls)
        return self.hulls[part.name]

    def body(self, part: Part, kind: str) -> tuple[str, str, str]:
        """Of one part: extensions, assets, and the body."""
        extension, asset, mass = "", "", 'density="1000"'
        plugin, mesh = "", f'<mesh name="{part.name}" file="{part.name}.obj"'
        if kind == "prolate":
            file = self.folder / f"{part.name}.etree"
            extension = (
                f'<plugin plugin="prolate.tree"><instance name="{part.name}"><config key="file" value="{file}"/>'
                "</instance></plugin>"
            )
            plugin = f'<plugin instance="{part.name}"/>'
            asset = f"{mesh}>{plugin}</mesh>"
            geoms = f'<geom type="sdf" mesh="{part.name}" {mass}>{plugin}</geom>'
        elif kind == "SDF" and part.own:
            name, *config = part.own.split()
            keys = "".join(f'<config key="{k}" value="{v}"/>' for k, v in (c.split("=") for c in config))
            extension = f'<plugin plugin="{name}"><instance name="{part.name}">{keys}</instance></plugin>'
            plugin = f'<plugin instance="{part.name}"/>'
            asset = f'<mesh name="{part.name}">{plugin}</mesh>'
            geoms = (
                f'<geom type="sdf" mesh="{part.name}" pos="{part.own_pos}" quat="{part.own_quat}" {mass}>'
                f"{plugin}</geom>"
            )
        elif kind == "CoACD":
            count = self.decompose(part)
            asset = "".join(f'<mesh name="{part.name}_{i}" file="{part.name}_{i}.obj"/>' for i in range(count))
            geoms = "".join(f'<geom type="mesh" mesh="{part.name}_{i}" {mass}/>' for i in range(count))
        else:
            asset = f"{mesh}/>"
            geoms = f'<geom type="{"sdf" if kind == "SDF" else "mesh"}" mesh="{part.name}" {mass}/>'
        joint = "<freejoint/>" if part.moves else ""
        body = f'<body name="{part.name}" pos="{part.pos}" quat="{part.quat}">{joint}{geoms}</body>'
        return extension, asset, body

    def model(self, scene: Scene, kind: str) -> mujoco.MjModel:
        extensions, assets, bodies = map("".join, zip(*(self.body(part, kind) for part in scene.parts)))
        return mujoco.MjModel.from_xml_string(f"""
            <mujoco>
              <compiler meshdir="{self.folder}"/>
              <option timestep="0.002"/>
              <extension>{extensions}</extension>
              <asset>{assets}</asset>
              <default>
                <geom solref="0.01 1" solimp=".95 .99 .0001" friction="{scene.friction}"/>
              </default>
              <worldbody>{bodies}{scene.more}</worldbody>
            </mujoco>""")

    def run(self, scene: Scene, kind: str) -> Run:
        model = self.model(scene, kind)
        run = Run(model, mujoco.MjData(model))
        data, steps, taken, angle = run.data, round(scene.seconds / model.opt.timestep), 0.0, None
        mujoco.mj_forward(model, data)
        run.start = data.xpos.copy()
        moving = next((i for i in range(model.nbody) if model.body_dofnum[i] == 6), None)
        for _ in range(steps):
            before = time.thread_time()
            mujoco.mj_step(model, data)
            taken += time.thread_time() - before
            run.contacts += data.ncon / steps
            if data.ncon:
                run.deepest = max(run.deepest, -float(data.contact.dist.min()))
            if moving is not None:
                axes = data.xmat[moving]
                now = math.atan2(axes[3], axes[0])
                if angle is not None:
                    run.turned += (now - angle + math.pi) % (2 * math.pi) - math.pi
                angle = now
        run.steps_a_second = steps / taken
        return run


# --- what should come of them ----------------------------------------------------------------------------------------


def peg_fell(run: Run) -> tuple[bool, str]:
    z = float(run.data.body("peg").xpos[2])
    return z < -0.1 and run.deepest < 0.02, f"peg at z = {z:+.3f} m ({'through' if z < -0.1 else 'on the plate'})"


def linked(run: Run) -> tuple[bool, str]:
    """Does the core of the free torus cross the disc of the fixed one an odd number of times?"""
    fixed, free = run.data.body("fixed"), run.data.body("free")
    angle = 2 * np.pi * np.arange(720) / 720
    circle = 0.35 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    seen = (circle @ free.xmat.reshape(3, 3).T + free.xpos - fixed.xpos) @ fixed.xmat.reshape(3, 3)
    other = np.roll(seen, -1, axis=0)
    crosses = (seen[:, 2] < 0) != (other[:, 2] < 0)
    inside = np.hypot(seen[:, 0], seen[:, 1]) < 0.35
    is_linked = int((crosses & inside).sum()) % 2 == 1
    speed = float(np.linalg.norm(run.data.qvel[:3]))
    return is_linked and run.deepest < 0.02, f"{'linked' if is_linked else 'APART'}, {speed:.2f} m/s"


def turned_down(run: Run) -> tuple[bool, str]:
    """A nut that goes down by a pitch a turn has not slipped over the threads."""
    fell = float(run.start[run.model.body("nut").id][2] - run.data.body("nut").xpos[2])
    pitches, turns = fell / PITCH, -run.turned / (2 * math.pi)
    good = abs(pitches - turns) < 0.1 and turns > 0.2
    return good, f"{pitches:.2f} pitches down in {turns:.2f} turns"


def rest(run: Run) -> tuple[bool, str]:
    speed, low = float(np.abs(run.data.qvel).max()), float(run.data.xpos[2:, 2].min())
    return speed < 0.05 and low > 0.05 and run.deepest < 0.01, f"speed {speed:.4f}, lowest at z = {low:+.3f} m"


def scenes() -> list[Scene]:
    plate = ring([(0.053, -0.05), (0.3, -0.05), (0.3, 0.05), (0.053, 0.05)])
    wide = ring([(0.1, -0.05), (0.6, -0.05), (0.6, 0.05), (0.1, 0.05)])
    tilted = f"{math.cos(0.004):.6f} {math.sin(0.004):.6f} 0 0"
    simple = "".join(
        f'<body pos="{0.35 * math.cos(i * 1.2566):.4f} {0.35 * math.sin(i * 1.2566):.4f} 0.2"><freejoint/>'
        f'<geom type="{kind}" size="{size}" condim="6"/></body>'
        for i, (kind, size) in enumerate(
            [
                ("sphere", "0.07"),
                ("box", "0.07 0.06 0.05"),
                ("capsule", "0.05 0.06"),
                ("cylinder", "0.06 0.06"),
                ("ellipsoid", "0.09 0.08 0.06"),
            ]
        )
    )
    own_torus = "mujoco.sdf.torus radius1=0.35 radius2=0.15"
    return [
        Scene(
            "peg in a hole",
            [
                Part("plate", plate),
                Part("peg", peg(0.05, 0.15), pos="0.001 0 0.25", quat=tilted, moves=True),
            ],
            2,
            peg_fell,
            '<geom type="plane" size="1 1 1" pos="0 0 -0.5"/>',
            friction=0.2,
        ),
        Scene(
            "linked tori",
            [
                Part("fixed", torus(0.35, 0.15), own_torus, quat="0.70710678 0.70710678 0 0"),
                Part("free", torus(0.35, 0.15), own_torus, pos="0.35 0 0", moves=True),
            ],
            5,
            linked,
        ),
        Scene(
            "nut on a bolt",
            [
                Part("bolt", bolt(), "mujoco.sdf.bolt radius=0.255", own_quat="0 1 0 0"),
                Part("nut", nut(), "mujoco.sdf.nut radius=0.26", own_quat="0 1 0 0", own_pos="0 0 0.83", moves=True),
            ],
            4,
            turned_down,
            friction=0.01,
        ),
        Scene("simple geoms on a plate", [Part("wide", wide)], 3, rest, simple),
    ]


def main() -> int:
    plugin, prolate, folder = (str(Path(given).resolve()) for given in sys.argv[1:4])
    Path(folder).mkdir(parents=True, exist_ok=True)
    os.chdir(folder)  # MuJoCo logs its warnings where it stands
    mujoco.mj_loadPluginLibrary(plugin)
    for library in Path(mujoco.__file__).parent.glob("plugin/*sdf*"):
        mujoco.mj_loadPluginLibrary(str(library))
    player, failed = Player(Path(folder), prolate), 0
    print(f"MuJoCo {mujoco.__version__}, one thread (its own CPU time), steps of 2 ms")
    for scene in scenes():
        for part in scene.parts:
            player.prepare(part)
        sizes = ", ".join(f"{part.name} of {len(part.mesh[1])} triangles" for part in scene.parts)
        print(f"\n{scene.name} ({sizes}, {scene.seconds:g} s)")
        for kind in ("prolate", "SDF", "CoACD", "hull"):
            if kind == "CoACD" and not all(player.decompose(part) for part in scene.parts):
                print(f"  {kind:<8} skipped: the package coacd is not installed")
                continue
            run = player.run(scene, kind)
            good, text = scene.outcome(run)
            failed += kind == "prolate" and not good
            note = "" if good else "  FAILED" if kind == "prolate" else "  (not as it should)"
            print(
                f"  {kind:<8} {run.contacts:6.1f} contacts  {run.steps_a_second:8.0f} steps/s"
                f"  deepest {1000 * run.deepest:7.3f} mm  {text}{note}"
            )
    print("\nFAILED" if failed else "\nall scenes of trees play as they should")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
