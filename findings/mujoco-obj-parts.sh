#!/usr/bin/env bash
# MuJoCo 4.0.0 takes the faces of the first part only of an OBJ file that has two.
#
# A good guess: "o NAME" lines group faces and change nothing about which there are; a loader reads all of them.
# What it does: the mesh has the vertices of both parts, but the faces of the first. The convex hull, which collides,
# goes around both; mass, inertia and rays know only the first. Nothing is said.
#
# Seen (two unit cubes 3 m apart, 12 triangles each; with "o" lines, and without):
#     without parts: 16 vertices, 24 faces; mass 2000, a ray hits the second cube
#     two parts:     16 vertices, 12 faces; mass 1000, no ray hits the second cube
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet mujoco==4.0.0 numpy==2.3.5
cat >check.py <<'PYTHON'
import mujoco, numpy

def cube(x, first):
    corners = [(x + i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return "".join("v %g %g %g\n" % p for p in corners) + "".join(
        "f %d %d %d\n" % tuple(i + first for i in t) for t in faces)

def load(name, text):
    open(name + ".obj", "w").write(text)
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><asset><mesh name="m" inertia="exact" file="%s.obj"/></asset><worldbody><body><freejoint/>'
        '<geom type="mesh" mesh="m"/></body></worldbody></mujoco>' % name)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hit = numpy.zeros(1, numpy.int32)
    far = mujoco.mj_ray(model, data, numpy.array([3.5, 0.4, 9.0]), numpy.array([0.0, 0, -1]), None, 1, -1, hit)
    vertices, faces, mass = model.nmeshvert, model.nmeshface, model.body_mass[1]
    print("%-14s %d vertices, %d faces; mass %.0f, %s the second cube"
          % (name + ":", vertices, faces, mass, "a ray hits" if far >= 0 else "no ray hits"))
    return faces, mass

whole = load("without parts", cube(0, 1) + cube(3, 9))
parts = load("two parts", "o one\n" + cube(0, 1) + "o two\n" + cube(3, 9))
raise SystemExit(0 if whole[0] == 24 and parts[0] == 12 else 1)
PYTHON
python/bin/python check.py
