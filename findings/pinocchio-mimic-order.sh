#!/usr/bin/env bash
# Pinocchio 4.1.0 reads a mimic joint, or refuses the whole robot, by what its joints are called.
#
# A good guess: URDF names the joint that a <mimic> follows; where either stands in the file, and what they are called,
# means nothing. A gripper whose two fingers hang on one palm reads with mimic=True.
# What it does: it adds joints to the tree in the alphabetical order of their names. The follower is read if the joint
# that it follows comes before it. Otherwise buildModelFromXML() raises an error.
#
# Seen (two fingers on one link, the second written follows the first, mimic=True):
#     a <- b: 1 coordinate
#     b <- a: The parent joint of the mimic joint is not in the kinematic tree
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet pin==4.1.0 numpy==2.3.5
cat >check.py <<'PYTHON'
import pinocchio

def finger(name, link, follows=""):
    return ('<joint name="%s" type="revolute"><parent link="palm"/><child link="%s"/><axis xyz="0 0 1"/>%s'
            '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
            % (name, link, '<mimic joint="%s"/>' % follows if follows else ""))

def coordinates(leader, follower, mimic):
    links = "".join('<link name="%s"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" '
                    'izz="1"/></inertial></link>' % name for name in ("palm", "left", "right"))
    robot = '<robot name="r">%s%s%s</robot>' % (links, finger(leader, "left"), finger(follower, "right", leader))
    return pinocchio.buildModelFromXML(robot, mimic=mimic).nq

assert coordinates("a", "b", False) == coordinates("b", "a", False) == 2
first = coordinates("a", "b", True)
print("a <- b: %d coordinate" % first)
try:
    second = coordinates("b", "a", True)
except ValueError as error:
    second = str(error)
print("b <- a:", second)
raise SystemExit(0 if first == 1 and "not in the kinematic tree" in str(second) else 1)
PYTHON
python/bin/python check.py
