#!/usr/bin/env bash
# PyBullet 3.2.7 cuts lines of URDF files at 8191 bytes; numbers on the cut change.
#
# A good guess: a line break is white space in XML, so a robot written on one line is the robot.
# What it does: lines are read into a buffer of 8192 bytes, and a new line is put where it was full. Between two elements
# that is harmless; inside a number it makes two numbers of it. Nothing is said, and the robot loads.
#
# Seen (one link with a box of mass 12345, the line padded by blanks so that the cut comes after "12"):
#     line of  147 bytes: mass 12345
#     line of 8282 bytes: mass 12
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet pybullet==3.2.7 numpy==2.3.5
cat >check.py <<'PYTHON'
import pybullet

def mass(name, cut):  # `cut`: bytes of the line before the third digit of the mass
    head = '<robot name="r"><link name="l"><inertial><mass '
    attribute = 'value="12'
    head += " " * max(0, cut - len(head) - len(attribute)) + attribute
    text = head + '345"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>\n'
    open(name, "w").write(text)
    body = pybullet.loadURDF(name)
    value = pybullet.getDynamicsInfo(body, -1)[0]
    print("line of %4d bytes: mass %g" % (len(text), value))
    return value

pybullet.connect(pybullet.DIRECT)
short, long = mass("short.urdf", 0), mass("long.urdf", 8191)
raise SystemExit(0 if short == 12345 and long != 12345 else 1)
PYTHON
python/bin/python check.py
