#!/usr/bin/env bash
# Pinocchio 4.1.0 (with coal 3.0.3) leaves a mesh inside out that a URDF mirrors.
#
# A good guess: scale="1 -1 1" gives the mirrored solid; its faces are turned, so that they still look outwards.
# What it does: it mirrors the vertices and keeps the order of each triangle's corners. Every normal then points into
# the solid, and its volume, center of mass and inertia (computeVolume() and its neighbours) have the wrong sign.
# Robots' left limbs are often the right ones mirrored.
#
# Seen (a cube of 1 m, as it is and mirrored in y):
#     scale 1 1 1:  volume by the faces 1, coal's computeVolume() 1
#     scale 1 -1 1: volume by the faces -1, coal's computeVolume() -1
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet pin==4.1.0 coal==3.0.3 numpy==2.3.5
cat >check.py <<'PYTHON'
import numpy, pinocchio, struct

corners = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
with open("cube.stl", "wb") as f:
    f.write(bytes(80) + struct.pack("<I", len(faces)))
    for t in faces: f.write(struct.pack("<12f2x", 0, 0, 0, *(x for i in t for x in corners[i])))

def volume(scale):
    open("robot.urdf", "w").write(
        '<robot name="r"><link name="l"><collision><geometry><mesh filename="cube.stl" scale="%s"/></geometry>'
        '</collision></link></robot>' % scale)
    model = pinocchio.buildModelFromUrdf("robot.urdf")
    shapes = pinocchio.buildGeomFromUrdf(model, "robot.urdf", pinocchio.GeometryType.COLLISION, package_dirs=["."])
    mesh = shapes.geometryObjects[0].geometry
    points = numpy.array([mesh.vertex(i) for i in range(mesh.num_vertices)])
    triangles = [[mesh.tri_indices(i)[k] for k in range(3)] for i in range(mesh.num_tris)]
    by_faces = sum(numpy.linalg.det(points[t]) for t in triangles) / 6
    print("%-13s volume by the faces %g, coal's computeVolume() %g"
          % ("scale " + scale + ":", round(by_faces, 6), round(mesh.computeVolume(), 6)))
    return by_faces

plain, mirrored = volume("1 1 1"), volume("1 -1 1")
raise SystemExit(0 if plain > 0.9 and mirrored < -0.9 else 1)
PYTHON
python/bin/python check.py
