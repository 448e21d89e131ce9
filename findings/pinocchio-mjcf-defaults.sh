#!/usr/bin/env bash
# Pinocchio 4.1.0 reads an MJCF's mesh without the scale of its default class, and a geom without its class's place.
#
# A good guess: an attribute that an element lacks comes from its class, for every attribute, as Pinocchio has it for a
# geom's type and size. MuJoCo Menagerie's gripper robotiq_2f85 has its meshes in millimetres so, and its pads' places.
# What it does: it takes <mesh>'s scale, and <geom>'s pos, quat, euler and the like, from the element alone. The mesh is a
# thousand times as large as meant, the geom lies where its body does, and nothing is said. What to do: read the file
# with MuJoCo 4.0.0, or write these attributes into each element.
#
# Seen (boxes around the geoms; a tetrahedron of 100 x 200 x 300 mm, and a box of half sizes 0.1 0.2 0.3):
#     scale at the mesh:      MuJoCo 0 0 0 to 0.1 0.2 0.3, Pinocchio 0 0 0 to 0.1 0.2 0.3
#     scale of all meshes:    MuJoCo 0 0 0 to 0.1 0.2 0.3, Pinocchio 0 0 0 to 100 200 300
#     scale of its class:     MuJoCo 0 0 0 to 0.1 0.2 0.3, Pinocchio 0 0 0 to 100 200 300
#     size of its class:      MuJoCo -0.1 -0.2 -0.3 to 0.1 0.2 0.3, Pinocchio -0.1 -0.2 -0.3 to 0.1 0.2 0.3
#     place of its class:     MuJoCo 0.7 -0.2 -0.1 to 1.3 0.2 0.1, Pinocchio -0.1 -0.2 -0.3 to 0.1 0.2 0.3
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet pin==4.1.0 mujoco==4.0.0 numpy==2.3.5
cat >part.obj <<'OBJ'
v 0 0 0
v 100 0 0
v 0 200 0
v 0 0 300
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
OBJ
cat >check.py <<'PYTHON'
import coal, mujoco, numpy, pinocchio

def in_mujoco():
    model = mujoco.MjModel.from_xml_path("robot.xml")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    if model.nmesh:
        points = model.mesh_vert
    else:
        points = model.geom_size[0] * numpy.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    points = points @ data.geom_xmat[0].reshape(3, 3).T + data.geom_xpos[0]
    return [points.min(axis=0), points.max(axis=0)]

def in_pinocchio():
    model = pinocchio.buildModelFromMJCF("robot.xml")
    geometry = pinocchio.buildGeomFromMJCF(model, "robot.xml", pinocchio.COLLISION).geometryObjects[0]
    place = coal.Transform3s(geometry.placement.rotation, geometry.placement.translation)
    part = coal.CollisionObject(geometry.geometry, place)
    return [part.getAABB().min_, part.getAABB().max_]

def same(name, default, mesh, geom):
    asset = '<asset><mesh name="part" file="part.obj" %s/></asset>' % mesh if "part" in geom else ""
    with open("robot.xml", "w") as file:
        file.write('<mujoco><default><default class="c"/>%s</default>%s<worldbody><body name="link"><joint name="j"/>'
                   '<geom name="g" %s/></body></worldbody></mujoco>' % (default, asset, geom))
    boxes = [numpy.round(box, 6) + 0.0 for box in (in_mujoco(), in_pinocchio())]
    print("%-23s MuJoCo %s to %s, Pinocchio %s to %s" % (
        name + ":", *(" ".join("%g" % x for x in corner) for box in boxes for corner in box)))
    return numpy.allclose(*boxes)

small, box, mesh = 'scale="0.001 0.001 0.001"', 'type="box" size="0.1 0.2 0.3"', 'type="mesh" mesh="part"'
seen = [same("scale at the mesh", "", small, mesh),
        same("scale of all meshes", "<mesh %s/>" % small, "", mesh),
        same("scale of its class", '<default class="mm"><mesh %s/></default>' % small, 'class="mm"', mesh),
        same("size of its class", "<geom %s/>" % box, "", ""),
        same("place of its class", '<geom %s pos="1 0 0" euler="0 90 0"/>' % box, "", "")]
raise SystemExit(0 if seen == [True, False, False, True, False] else 1)
PYTHON
python/bin/python check.py
