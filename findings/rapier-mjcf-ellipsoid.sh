#!/usr/bin/env bash
# Rapier 0.36.1 (rapier3d, its MJCF loader) takes an ellipsoid for the icosahedron inside it.
#
# A good guess: Rapier has no ellipsoids, so it refuses one, warns, or takes a shape that contains it: a cover that was
# proved in MuJoCo's file still is one.
# What it does: the geom becomes a convex polyhedron of twelve vertices *on* the ellipsoid, without a word. It lacks 39 %
# of the volume, reaches 15 % less far along each axis, and a density gives it 61 % of the mass. Radii 1.2584 times as
# large make an icosahedron that contains the ellipsoid (1 / 0.79465, its inscribed sphere).
#
# Seen (half axes 0.3 0.2 0.1, density 1000):
#     12 vertices, largest coordinates 0.255 0.170 0.085
#     mass 15.2, of the ellipsoid 25.1
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet rapier3d==0.36.1 numpy==2.3.5
cat >robot.xml <<'XML'
<mujoco>
  <worldbody>
    <body name="egg"><freejoint/><geom type="ellipsoid" size="0.3 0.2 0.1" density="1000"/></body>
  </worldbody>
</mujoco>
XML
cat >check.py <<'PYTHON'
import math, numpy, rapier3d
from rapier3d.loaders import mjcf

robot, _ = mjcf.MjcfRobot.from_file("robot.xml")
colliders = rapier3d.ColliderSet()
robot.insert_using_impulse_joints(rapier3d.RigidBodySet(), colliders, rapier3d.ImpulseJointSet())
(_, collider), = colliders
points = numpy.array(collider.shape.as_convex_polyhedron().points)
mass = collider.shape.compute_mass_properties(1000).mass
right = 1000 * 4 / 3 * math.pi * 0.3 * 0.2 * 0.1
print("%d vertices, largest coordinates %.3f %.3f %.3f" % (len(points), *abs(points).max(axis=0)))
print("mass %.1f, of the ellipsoid %.1f" % (mass, right))
on_it = numpy.allclose(numpy.linalg.norm(points / [0.3, 0.2, 0.1], axis=1), 1, atol=1e-5)
raise SystemExit(0 if on_it and len(points) == 12 and mass < 0.62 * right else 1)
PYTHON
python/bin/python check.py
