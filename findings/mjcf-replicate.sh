#!/usr/bin/env bash
# Newton 1.8.0, Rapier 0.36.1, Pinocchio 4.1.0 and Drake 1.51.1 drop all that stands in an MJCF's <replicate>.
#
# A good guess: a reader of MJCF makes the copies, as MuJoCo does, or refuses the file, or warns.
# What they do: they step over the element with everything in it, geoms and bodies alike, and say nothing. A fence, a
# staircase or the fingers of a hand written with it are not there to collide with. Nor does it help all of them to let
# MuJoCo write the file anew: it puts the copies into <frame>s, which Newton and Rapier read. Drake warns that it ignores
# them, Pinocchio ignores them without a word. What to do: write plain geoms and bodies with a place of their own.
#
# Seen (geoms of a body with a box and three copies of a ball; anew.xml is the same from MjSpec.to_xml()):
#     robot.xml: mujoco 4 newton 1 rapier 1 pinocchio 1 drake 1
#     anew.xml: mujoco 4 newton 4 rapier 4 pinocchio 2 drake 2 (warns)
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
export WARP_CACHE_PATH=$PWD/cache
python3 -m venv python
python/bin/python -m pip install --quiet newton==1.8.0 warp-lang==1.19.0 rapier3d==0.36.1 pin==4.1.0 drake==1.51.1 \
    mujoco==4.0.0 numpy==2.3.5
cat >robot.xml <<'XML'
<mujoco model="rack">
  <worldbody>
    <body name="rack">
      <joint name="slide" type="slide" axis="1 0 0"/>
      <geom name="board" type="box" size="1 0.1 0.1"/>
      <replicate count="3" offset="0.5 0 0">
        <geom name="knob" type="sphere" size="0.1" pos="-0.5 0 0.2"/>
      </replicate>
    </body>
  </worldbody>
</mujoco>
XML
cat >check.py <<'PYTHON'
import sys

def mujoco(path):
    import mujoco
    return mujoco.MjModel.from_xml_path(path).ngeom

def newton(path):
    import warp
    warp.config.log_level = warp.LOG_ERROR
    import newton
    builder = newton.ModelBuilder()
    builder.add_mjcf(path)
    return builder.shape_count

def rapier(path):
    import rapier3d
    from rapier3d.loaders import mjcf
    robot, _ = mjcf.MjcfRobot.from_file(path)
    colliders = rapier3d.ColliderSet()
    robot.insert_using_impulse_joints(rapier3d.RigidBodySet(), colliders, rapier3d.ImpulseJointSet())
    return len(colliders)

def pinocchio(path):
    import pinocchio
    model = pinocchio.buildModelFromMJCF(path)
    return pinocchio.buildGeomFromMJCF(model, path, pinocchio.COLLISION).ngeoms

def drake(path):
    from pydrake.geometry import Role
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.systems.framework import DiagramBuilder
    plant, graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.001)
    Parser(plant).AddModels(path)
    return len(graph.model_inspector().GetAllGeometryIds(Role.kProximity))

def anew(path):
    import mujoco
    open("anew.xml", "w").write(mujoco.MjSpec.from_file(path).to_xml())

result = globals()[sys.argv[1]](sys.argv[2])
if result is not None: print(result)
PYTHON
python/bin/python check.py anew robot.xml
for file in robot.xml anew.xml; do
    line="$file:"
    for reader in mujoco newton rapier pinocchio drake; do # one process each: some bring libraries of the same name
        python/bin/python check.py $reader $file >said.txt 2>&1
        line+=" $reader $(tail -1 said.txt)"
        if grep -qE "replicate|'frame'" said.txt; then line+=" (warns)"; fi
    done
    echo "$line" | tee -a seen.txt
done
diff seen.txt - <<'SEEN'
robot.xml: mujoco 4 newton 1 rapier 1 pinocchio 1 drake 1
anew.xml: mujoco 4 newton 4 rapier 4 pinocchio 2 drake 2 (warns)
SEEN
