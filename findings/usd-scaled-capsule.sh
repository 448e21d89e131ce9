#!/usr/bin/env bash
# OpenUSD 26.11's UsdPhysics parser reads a capsule that is stretched along its axis as one with short caps, and a
# stretched sphere as the sphere around it.
#
# A good guess: a collider is the shape that is drawn, or at least contains it. The physics description is what
# simulators are handed.
# What it does: it keeps the kind of shape. The radius grows by the largest scale across the axis, the length between
# the caps' centers by the scale along it; so the caps, which are drawn stretched too, are cut. A sphere takes the
# largest of its three scales: it contains what is drawn, but an ellipsoid written as a scaled sphere is lost.
# Each description also has a `localScale`; to apply it again would be wrong, since the numbers have it already.
#
# Seen (radius 1, height 2, scale 1 1 3; sphere of radius 1, scale 3 1 0.5):
#     capsule: drawn up to z = 6, collides up to z = 4
#     sphere:  drawn up to 3 1 0.5, collides up to 3 3 3
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet usd-core==26.11
cat >check.py <<'PYTHON'
from pxr import Gf, Usd, UsdGeom, UsdPhysics

stage = Usd.Stage.CreateInMemory()

def add(kind, path, scale):
    shape = kind.Define(stage, path)
    shape.CreateRadiusAttr(1)
    if kind is UsdGeom.Capsule: shape.CreateHeightAttr(2)
    UsdGeom.Xformable(shape).AddScaleOp().Set(Gf.Vec3f(*scale))
    UsdPhysics.CollisionAPI.Apply(shape.GetPrim())
    return shape

def drawn(shape): # largest corner of its box in the world
    box = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(shape), Usd.TimeCode.Default())
    matrix = UsdGeom.Xformable(shape).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
    return matrix.Transform(Gf.Vec3d(box[1]))

capsule, sphere = add(UsdGeom.Capsule, "/capsule", (1, 1, 3)), add(UsdGeom.Sphere, "/sphere", (3, 1, 0.5))
read = {}
for paths, descriptions in UsdPhysics.LoadUsdPhysicsFromRange(stage, ["/"]).values():
    for path, description in zip(paths, descriptions): read[str(path)] = description
c, s = read["/capsule"], read["/sphere"]
print("capsule: drawn up to z = %g, collides up to z = %g" % (drawn(capsule)[2], c.halfHeight + c.radius))
print("sphere:  drawn up to %g %g %g, collides up to %g %g %g" % (*drawn(sphere), s.radius, s.radius, s.radius))
raise SystemExit(0 if drawn(capsule)[2] == 6 and c.halfHeight + c.radius == 4 and s.radius == 3 else 1)
PYTHON
python/bin/python -W ignore::DeprecationWarning check.py
