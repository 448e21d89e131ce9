#!/usr/bin/env bash
# Newton 1.8.0 puts an MJCF's ellipsoid or box with `fromto` as a ball or a cube into its body's origin; Rapier 0.36.1
# drops the ellipsoid, and makes the box flat.
#
# A good guess: fromto="x y z x y z" gives the two ends of a long geom, and size its half width; MuJoCo has it for
# capsules, cylinders, ellipsoids and boxes, and a reader that lacks it for some says so, as Drake 1.51.1 does.
# What they do: Newton looks at fromto for capsules and cylinders only (so its source, import_mjcf). For the others
# it takes the one number of size for all three half axes, and leaves the place alone. A link of a meter becomes a ball
# at the joint. Rapier places the geom right, but takes zero for the half axes that size does not have. Neither says
# anything. What to do: write pos, quat and three numbers, as MuJoCo 4.0.0 and Pinocchio 4.1.0 have read it.
#
# Seen (boxes around a geom from 0 0 0 to 1 0 0, half as wide as 0.1):
#     capsule:   MuJoCo -0.1 -0.1 -0.1 to 1.1 0.1 0.1, Newton the same, Rapier the same
#     ellipsoid: MuJoCo 0 -0.1 -0.1 to 1 0.1 0.1, Newton -0.1 -0.1 -0.1 to 0.1 0.1 0.1, Rapier nothing
#     box:       MuJoCo 0 -0.1 -0.1 to 1 0.1 0.1, Newton -0.1 -0.1 -0.1 to 0.1 0.1 0.1, Rapier 0 0 -0.1 to 1 0 0.1
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
export WARP_CACHE_PATH=$PWD/cache
python3 -m venv python
python/bin/python -m pip install --quiet newton==1.8.0 warp-lang==1.19.0 rapier3d==0.36.1 mujoco==4.0.0 numpy==2.3.5
cat >check.py <<'PYTHON'
import mujoco, numpy, rapier3d, warp
warp.config.log_level = warp.LOG_ERROR
import newton
from rapier3d.loaders import mjcf

def around(kind, place, turn, half): # the box around a shape with those half axes
    if kind == "ellipsoid":
        reach = numpy.linalg.norm(turn * half, axis=1)
    elif kind == "capsule":
        reach = abs(turn[:, 2]) * half[1] + half[0]
    else:
        reach = abs(turn) @ half
    return [place - reach, place + reach]

def in_mujoco(kind):
    model = mujoco.MjModel.from_xml_path("robot.xml")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return around(kind, data.geom_xpos[0], data.geom_xmat[0].reshape(3, 3), model.geom_size[0])

def in_newton(kind):
    builder = newton.ModelBuilder()
    builder.add_mjcf("robot.xml")
    pose = builder.shape_transform[0]
    turn = numpy.array(warp.quat_to_matrix(warp.quat(*pose[3:7]))).reshape(3, 3)
    return around(kind, numpy.array(pose[:3]), turn, numpy.array(builder.shape_scale[0]))

def in_rapier(kind):
    robot, _ = mjcf.MjcfRobot.from_file("robot.xml")
    colliders = rapier3d.ColliderSet()
    robot.insert_using_impulse_joints(rapier3d.RigidBodySet(), colliders, rapier3d.ImpulseJointSet())
    boxes = [collider.compute_aabb() for _, collider in colliders]
    return [numpy.array([corner.x, corner.y, corner.z]) for box in boxes for corner in (box.mins, box.maxs)]

def text(box):
    corners = [" ".join("%g" % x for x in numpy.round(corner, 4) + 0.0) for corner in box]
    return " to ".join(corners) or "nothing"

seen = {}
for kind in "capsule", "ellipsoid", "box":
    with open("robot.xml", "w") as file:
        file.write('<mujoco><worldbody><body name="link"><freejoint/><geom type="%s" fromto="0 0 0 1 0 0" size="0.1"/>'
                   '</body></worldbody></mujoco>' % kind)
    seen[kind] = [text(read(kind)) for read in (in_mujoco, in_newton, in_rapier)]
    print("%-10s MuJoCo %s, Newton %s, Rapier %s" % (kind + ":", *seen[kind]))
right, ball = "0 -0.1 -0.1 to 1 0.1 0.1", "-0.1 -0.1 -0.1 to 0.1 0.1 0.1"
good = len(set(seen["capsule"])) == 1 and seen["ellipsoid"] == [right, ball, "nothing"] and \
    seen["box"] == [right, ball, "0 0 -0.1 to 1 0 0.1"]
raise SystemExit(0 if good else 1)
PYTHON
python/bin/python check.py
