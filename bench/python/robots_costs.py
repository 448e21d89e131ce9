"""How long MuJoCo takes for two touching bodies of each kind that covers are made of: microseconds a pair."""

from __future__ import annotations

import time

import mujoco
import numpy as np

PAIRS = 30
KINDS = {
    "ellipsoid": 'type="ellipsoid" size=".1 .08 .06"',
    "sphere": 'type="sphere" size=".08"',
    "capsule": 'type="capsule" size=".06 .05"',
    "cylinder": 'type="cylinder" size=".07 .07"',
    "box": 'type="box" size=".08 .06 .05"',
}
SIZES = (8, 32, 128, 256)


def hull(count: int, random: np.random.Generator) -> str:
    """An asset: points on an ellipsoid."""
    points = random.normal(size=(count, 3))
    points *= [0.1, 0.08, 0.06] / np.linalg.norm(points, axis=1)[:, None]
    return f'<mesh name="{count}" vertex="{" ".join(map(repr, map(float, points.ravel())))}"/>'


def microseconds(one: str, other: str) -> float:
    """The best of several, for the collision detection of PAIRS pairs that hardly reach each other."""
    random = np.random.default_rng(1)
    assets = "".join(hull(count, random) for count in SIZES)
    bodies = ""
    for i in range(2 * PAIRS):
        place = np.array([i // 2 % 6, i // 12, 0]) * 0.5 + (i % 2) * np.array([0.11, 0.05, 0.04])
        turn = random.normal(size=4)
        geom = (one, other)[i % 2]
        bodies += (
            f'<body pos="{" ".join(map(str, place))}" quat="{" ".join(map(str, turn))}"><freejoint/>'
            f'<geom {geom} mass="1"/></body>'
        )
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option ccd_tolerance="1e-10" ccd_iterations="100"/><size memory="64M"/>'
        f"<asset>{assets}</asset><worldbody>{bodies}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    best = np.inf
    for _ in range(20):
        start = time.perf_counter()
        for _ in range(10):
            mujoco.mj_collision(model, data)
        best = min(best, (time.perf_counter() - start) / 10)
    return best / PAIRS * 1e6


if __name__ == "__main__":
    kinds = KINDS | {f"hull of {count}": f'type="mesh" mesh="{count}"' for count in SIZES}
    print(f"MuJoCo {mujoco.__version__}: two of the kind, and one with an ellipsoid")
    for name, geom in kinds.items():
        print(f"{name:12} {microseconds(geom, geom):6.1f} {microseconds(geom, KINDS['ellipsoid']):6.1f}")
