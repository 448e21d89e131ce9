#!/usr/bin/env bash
# SAPIEN 3.0.3 obeys an SRDF's <disable_collisions> only if its reason is "Default".
#
# A good guess: the element disables the pair, and the reason beside it is a note for people, as for Pinocchio 4.1.0.
# What it does: it reads the SRDF of the URDF's name by itself, and drops every pair with another reason, as Always,
# Never, Adjacent and User, without a word. Links that touch by design (a cover around a joint, two parts screwed
# together) push each other apart from the first step.
#
# Seen (two boxes on sliders that reach 0.2 into each other, a step of 1/100 s, and 100 more):
#     Default: 0 contacts, sliders at 0.00 0.00
#     Always: 1 contacts, sliders at -0.10 0.10
#     Never: 1 contacts, sliders at -0.10 0.10
#     Adjacent: 1 contacts, sliders at -0.10 0.10
#     User: 1 contacts, sliders at -0.10 0.10
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
apt-get download -q libx11-6 libxcb1 libxau6 libxdmcp6 libbsd0 libmd0 # sapien's library is linked to libX11
for package in *.deb; do dpkg -x "$package" unpacked; done
LD_LIBRARY_PATH=$(echo "$PWD"/unpacked/usr/lib/*-linux-gnu) && export LD_LIBRARY_PATH
python3 -m venv python && python/bin/python -m pip install --quiet sapien==3.0.3 numpy==2.3.5
cat >check.py <<'PYTHON'
import pathlib, warnings
warnings.simplefilter("ignore")  # no Vulkan is needed
import sapien

inertial = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
robot = '<robot name="r"><link name="base">%s</link>' % inertial
for name, x in ("a", -0.4), ("b", 0.4):
    robot += ('<link name="%s">%s<collision><geometry><box size="1 1 1"/></geometry></collision></link>'
              '<joint name="slide %s" type="prismatic"><parent link="base"/><child link="%s"/><origin xyz="%g 0 0"/>'
              '<axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="9" velocity="9"/></joint>'
              % (name, inertial, name, name, x))
pathlib.Path("robot.urdf").write_text(robot + "</robot>")

def contacts(reason):
    pair = '<disable_collisions link1="a" link2="b" reason="%s"/>' % reason
    pathlib.Path("robot.srdf").write_text('<robot name="r">%s</robot>' % pair)
    scene = sapien.Scene([sapien.physx.PhysxCpuSystem()])
    body = scene.create_urdf_loader().load("robot.urdf")
    scene.step()
    found = len(scene.get_contacts())
    for _ in range(100):
        scene.step()
    print("%s: %d contacts, sliders at %.2f %.2f" % (reason, found, *(body.qpos + 0.0)))
    return found

found = [contacts(reason) for reason in ("Default", "Always", "Never", "Adjacent", "User")]
raise SystemExit(0 if found[0] == 0 and all(found[1:]) else 1)
PYTHON
python/bin/python check.py
