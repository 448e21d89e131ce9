#!/usr/bin/env bash
# Coal 3.0.3: meshes that are less than a micrometre apart collide, with a penetration as deep as the bodies are wide.
#
# A good guess: a gap smaller than a tolerance may count as contact, but its depth is then as small; and the tolerance
# follows the size of the bodies.
# What it does: triangle against triangle is decided with 1e-6 absolute, whatever the unit or size, and the contact that
# it reports has the depth that the whole triangles have along the normal, 80 % of the cubes here. coal.distance() of
# the same two meshes is right, down to where the same 1e-6 ends it: cubes of 10 um that are 0.9 um apart are 0 apart.
# So decide "do they touch" by distance(), and bring micrometre parts into a larger unit.
#
# Seen (two cubes, the second shifted by the side and a gap, 0.3 and 0.2 sides across):
#     side 1, gap 1e-07:     collides, depth 0.8; distance 1e-07
#     side 1, gap 1.1e-06:   apart; distance 1.1e-06
#     side 1e-05, gap 9e-07: collides, depth 8e-06; distance 0
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet coal==3.0.3 numpy==2.3.5
cat >check.py <<'PYTHON'
import coal, numpy

def cube(side):
    corners = [numpy.array(c, float) * side for c in numpy.ndindex(2, 2, 2)]
    model = coal.BVHModelOBBRSS()
    model.beginModel(12, 8)
    for a, b, c, d in [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]:
        model.addTriangle(corners[a], corners[b], corners[c])
        model.addTriangle(corners[a], corners[c], corners[d])
    model.endModel()
    return model

def query(side, gap):
    place = coal.Transform3s()
    place.setTranslation(numpy.array([side + gap, 0.3 * side, 0.2 * side]))
    bodies = cube(side), coal.Transform3s(), cube(side), place
    contact, nearest = coal.CollisionResult(), coal.DistanceResult()
    meets = coal.collide(*bodies, coal.CollisionRequest(), contact) > 0
    distance = coal.distance(*bodies, coal.DistanceRequest(), nearest)
    depth = -contact.getContact(0).penetration_depth if meets else 0
    print("%-23s%s; distance %.3g" % ("side %g, gap %g:" % (side, gap),
          "collides, depth %.3g" % depth if meets else "apart", distance))
    return meets, depth, distance

near, apart, small = query(1, 1e-7), query(1, 1.1e-6), query(1e-5, 9e-7)
as_seen = near[0] and near[1] > 0.5 and abs(near[2] - 1e-7) < 1e-12 and not apart[0] and small[0] and small[2] == 0
raise SystemExit(0 if as_seen else 1)
PYTHON
python/bin/python check.py
