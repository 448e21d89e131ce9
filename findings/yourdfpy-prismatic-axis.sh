#!/usr/bin/env bash
# yourdfpy 0.0.60 lets a prismatic joint move farther than its coordinate says if its axis is not of unit length.
#
# A good guess: an axis is a direction. URDF's specification wants it normalised, readers normalise what is not, and a
# joint at 0.5 has moved by 0.5 m.
# What it does: it normalises the axes of revolute joints, and multiplies those of prismatic ones as they stand: with the
# axis "0 3 4" a joint at 0.5 has moved by 2.5 m. Nothing is said. Pinocchio 4.1.0 moves it by 0.5 m.
#
# Seen (one joint at 0.5, axis "0 3 4"):
#     yourdfpy:  prismatic 2.5 m, revolute 0.5 rad
#     Pinocchio: prismatic 0.5 m, revolute 0.5 rad
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet yourdfpy==0.0.60 pin==4.1.0 numpy==2.3.5
cat >check.py <<'PYTHON'
import numpy, pinocchio, yourdfpy

def moved(kind):
    text = ('<robot name="r"><link name="base"/><link name="tip"/><joint name="j" type="%s"><parent link="base"/>'
            '<child link="tip"/><axis xyz="0 3 4"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>' % kind)
    open("robot.urdf", "w").write(text)
    robot = yourdfpy.URDF.load("robot.urdf")
    robot.update_cfg([0.5])
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, numpy.array([0.5]))
    frames = robot.get_transform("tip"), data.oMf[model.getFrameId("tip")].homogeneous
    if kind == "prismatic":
        return [float(numpy.linalg.norm(frame[:3, 3])) for frame in frames]
    return [float(numpy.arccos((numpy.trace(frame[:3, :3]) - 1) / 2)) for frame in frames]

slides, turns = moved("prismatic"), moved("revolute")
for name, slide, turn in zip(("yourdfpy", "Pinocchio"), slides, turns):
    print("%-10s prismatic %.3g m, revolute %.3g rad" % (name + ":", slide, turn))
ok = numpy.allclose(slides, (2.5, 0.5)) and numpy.allclose(turns, 0.5)
raise SystemExit(0 if ok else 1)
PYTHON
python/bin/python check.py
