#!/usr/bin/env bash
# Newton 1.8.0 drops USD's newer capsules and cylinders, and what a PointInstancer places; nothing is said.
#
# A good guess: each prim with PhysicsCollisionAPI becomes a shape, or a warning tells that it does not.
# What it does: add_usd() takes what OpenUSD's physics parser hands it by kind. The parser names Capsule_1 and Cylinder_1,
# the revised schemas of OpenUSD (two radii each, alike if none is written), kinds of their own, which Newton does not
# know. The parser passes over a PointInstancer and all below it, and Newton does not look there either. The bodies are
# there without a shape and a mass. What to do: write Capsule and Cylinder, and instanceable references for copies.
#
# Seen (a body each; shapes and mass):
#     Capsule: 1 shape, 1309 kg
#     Capsule_1: 0 shapes, 0 kg
#     Cylinder: 1 shape, 6283 kg
#     Cylinder_1: 0 shapes, 0 kg
#     3 cubes by references: 3 shapes, 3000 kg
#     3 cubes by PointInstancer: 0 shapes, 0 kg
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
export WARP_CACHE_PATH=$PWD/cache
python3 -m venv python
python/bin/python -m pip install --quiet newton==1.8.0 warp-lang==1.19.0 newton-usd-schemas==0.6.0 \
    usd-core==26.11 numpy==2.3.5
cat >check.py <<'PYTHON'
import warnings
warnings.simplefilter("error") # a warning would be news
import warp
warp.config.log_level = warp.LOG_ERROR
import newton
from pxr import Gf, Usd, UsdGeom, UsdPhysics

def collider(prim):
    UsdPhysics.CollisionAPI.Apply(prim.GetPrim())
    return prim

def unit_cube(stage, path):
    cube = collider(UsdGeom.Cube.Define(stage, path))
    cube.CreateSizeAttr(1)
    cube.CreateExtentAttr([(-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)])

def references(stage):
    stage.CreateClassPrim("/cube")
    unit_cube(stage, "/cube/shape")
    for x in 0, 2, 4:
        copy = UsdGeom.Xform.Define(stage, "/body/at_%d" % x)
        copy.AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
        copy.GetPrim().GetReferences().AddInternalReference("/cube")
        copy.GetPrim().SetInstanceable(True)

def instancer(stage):
    copies = UsdGeom.PointInstancer.Define(stage, "/body/copies")
    unit_cube(stage, "/body/copies/cube")
    copies.CreatePrototypesRel().AddTarget("/body/copies/cube")
    copies.CreateProtoIndicesAttr([0, 0, 0])
    copies.CreatePositionsAttr([(0, 0, 0), (2, 0, 0), (4, 0, 0)])

def shapes(name, fill):
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1)
    UsdPhysics.Scene.Define(stage, "/scene")
    UsdPhysics.RigidBodyAPI.Apply(UsdGeom.Xform.Define(stage, "/body").GetPrim())
    fill(stage)
    builder = newton.ModelBuilder()
    builder.add_usd(stage)
    print("%s: %d shape%s, %.0f kg" % (name, builder.shape_count, "s" * (builder.shape_count != 1), builder.body_mass[0]))
    return builder.shape_count

kinds = UsdGeom.Capsule, UsdGeom.Capsule_1, UsdGeom.Cylinder, UsdGeom.Cylinder_1
found = [shapes(kind.__name__, lambda stage, kind=kind: collider(kind.Define(stage, "/body/shape"))) for kind in kinds]
found += [shapes("3 cubes by references", references), shapes("3 cubes by PointInstancer", instancer)]
raise SystemExit(0 if found == [1, 0, 1, 0, 3, 0] else 1)
PYTHON
python/bin/python check.py
