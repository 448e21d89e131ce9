#!/usr/bin/env bash
# MuJoCo 4.0.0 drops all contacts of a step, not the surplus, when they do not fit into its arena.
#
# A good guess: memory that is too small for all contacts stops the simulation with an error, or costs some of the
# contacts. A body that lies on the floor stays there.
# What it does: contacts are found (d.ncon), but none becomes a constraint (d.nefc is 0), and the step goes on. All
# bodies fall through the floor, also those far away from where the contacts are too many. A counter of d.warning and a
# line in MUJOCO_LOG.TXT say so. The default arena, 14 MB here, is full at some thousand contacts; two covers of 90
# ellipsoids each that overlap have 8,280. <size memory="256M"/> is the cure.
#
# Seen (two bodies of 90 ellipsoids on a plane, and a ball beside them that lies on it; 100 steps):
#     arena by default: 100 warnings, 0 constraints, ball at -0.148
#     arena of 256M: 0 warnings, 1380 constraints, ball at 0.050
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet mujoco==4.0.0 numpy==2.3.5
cat >check.py <<'PYTHON'
import mujoco

def after(memory):
    size = '<size memory="%s"/>' % memory if memory else ""
    cover = "".join('<geom type="ellipsoid" size=".1 .08 .06" pos="%g %g 0" mass=".01"/>' % (i % 12 / 250, i // 12 / 250)
                    for i in range(90))
    bodies = "".join('<body pos="0 0 %g"><freejoint/>%s</body>' % (z, cover) for z in (0.055, 0.16))
    model = mujoco.MjModel.from_xml_string(
        '<mujoco>%s<worldbody><geom type="plane" size="5 5 .1"/>%s'
        '<body pos="2 0 .05"><freejoint/><geom type="sphere" size=".05"/></body></worldbody></mujoco>' % (size, bodies))
    data = mujoco.MjData(model)
    for _ in range(100):
        mujoco.mj_step(model, data)
    full = data.warning[mujoco.mjtWarning.mjWARN_CNSTRFULL].number
    print("arena %s: %d warnings, %d constraints, ball at %.3f"
          % ("of " + memory if memory else "by default", full, data.nefc, data.qpos[16]))
    return full, data.nefc, data.qpos[16]

small, large = after(""), after("256M")
raise SystemExit(0 if small[0] and small[1] == 0 and small[2] < 0 and large[1] and abs(large[2] - 0.05) < 1e-3 else 1)
PYTHON
python/bin/python check.py
