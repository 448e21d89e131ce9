#!/usr/bin/env bash
# Coal 3.0.3's broad phases leave the request's security margin out: no contact within it unless the boxes meet.
#
# A good guess: CollisionRequest.security_margin means the same in coal.collide() of two objects and in a manager's
# collide() with that request in its callback: what is nearer than the margin is in contact.
# What it does: the managers compare the objects' boxes as they are, and ask the callback, which has the margin, only if
# these meet. All six do, the naive one too. A planner that keeps 10 cm away by the margin keeps as little as none away
# once it takes a manager. What to do: setSweptSphereRadius() on the shapes, half the margin each; the boxes have it.
#
# Seen (contacts of two balls of radius 0.5 that are 0.05 apart):
#     pair, margin 0.1:             1
#     managers, margin 0.1:         Naive 0, DynamicAABBTree 0, DynamicAABBTreeArray 0, SSaP 0, IntervalTree 0, SaP 0
#     managers, swept radius 0.05:  Naive 1, DynamicAABBTree 1, DynamicAABBTreeArray 1, SSaP 1, IntervalTree 1, SaP 1
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet coal==3.0.3 numpy==2.3.5
cat >check.py <<'PYTHON'
import coal, numpy

MANAGERS = "Naive", "DynamicAABBTree", "DynamicAABBTreeArray", "SSaP", "IntervalTree", "SaP"

def ball(x, swept):
    shape = coal.Sphere(0.5)
    shape.setSweptSphereRadius(swept)
    return coal.CollisionObject(shape, coal.Transform3s(numpy.eye(3), numpy.array([x, 0.0, 0.0])))

def managers(margin, swept):
    found = []
    right, left = ball(1.05, swept), ball(0.0, swept) # in an order that SaP can do
    for kind in MANAGERS:
        manager = getattr(coal, kind + "CollisionManager")()
        for item in right, left: manager.registerObject(item)
        manager.setup()
        callback = coal.CollisionCallBackDefault()
        callback.data.request.security_margin = margin
        manager.collide(callback)
        found.append(callback.data.result.numContacts())
    return found

request = coal.CollisionRequest()
request.security_margin = 0.1
pair = coal.collide(ball(1.05, 0), ball(0, 0), request, coal.CollisionResult())
print("pair, margin 0.1:            ", pair)
seen = managers(0.1, 0), managers(0, 0.05)
for name, found in zip(("margin 0.1:        ", "swept radius 0.05: "), seen):
    print("managers, " + name, ", ".join("%s %d" % each for each in zip(MANAGERS, found)))
raise SystemExit(0 if pair == 1 and seen == ([0] * 6, [1] * 6) else 1)
PYTHON
python/bin/python check.py
