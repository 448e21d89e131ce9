#!/usr/bin/env bash
# trimesh 5.2.0's collision checks leave the scale of a scene's nodes out, and their mirroring.
#
# A good guess: scene_to_collision() checks the scene that is drawn, whose bounds `scene.bounds` gives. glTF's nodes have
# scales of their own, and files in millimetres or with one unit cube for all boxes live by them.
# What it does: it hands each node's matrix to FCL (python-fcl 0.7.0.11) as it stands. FCL wants a rotation there, and
# neither side checks: a convex part collides with what is near as if its scale were 1, two concave ones are placed still
# otherwise, and nothing is said. The same holds for the matrices given to CollisionManager.add_object() and
# set_transform(). What to do: apply each node's matrix to a copy of its mesh, and add that without one (below: "baked").
#
# Seen (two parts of a GLB file: do they meet, and their distance, or minus the depth if known):
#     box scaled by 10 10 1:      nodes False 2.04, baked True -0.10
#     ring scaled by 2:           nodes False 1.15, baked True -0.08
#     rings, one scaled by 2:     nodes False 2.05, baked True 0.00
#     wedge mirrored, -1 1 1:     nodes False 0.50, baked True -0.56
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet trimesh==5.2.0 python-fcl==0.7.0.11 numpy==2.3.5 scipy==1.17.1
cat >check.py <<'PYTHON'
import numpy, trimesh
from trimesh.collision import CollisionManager, scene_to_collision

box, ball = trimesh.creation.box((1, 1, 1)), trimesh.creation.icosphere(subdivisions=2, radius=0.5)
ring = trimesh.creation.torus(1, 0.25)
wedge = trimesh.Trimesh([[0, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])

def answers(manager):
    return manager.in_collision_internal(), float(manager.min_distance_internal())

def check(name, part, scale, other, place):
    scene = trimesh.Scene()
    scene.add_geometry(part, node_name="part", transform=numpy.diag([*scale, 1.0]))
    scene.add_geometry(other, node_name="other", transform=trimesh.transformations.translation_matrix(place))
    scene.export("scene.glb")
    scene = trimesh.load_scene("scene.glb")
    baked = CollisionManager()
    for node in scene.graph.nodes_geometry:
        matrix, mesh = scene.graph[node]
        baked.add_object(node, scene.geometry[mesh].copy().apply_transform(matrix))
    nodes, right = answers(scene_to_collision(scene)[0]), answers(baked)
    print("%-27s nodes %s %.2f, baked %s %.2f" % (name + ":", *nodes, *right))
    return not nodes[0] and nodes[1] > 0.4 and right[0] and right[1] <= 0

same = [check("box scaled by 10 10 1", box, (10, 10, 1), ball, (3, 0, 0.9)),
        check("ring scaled by 2", ring, (2, 2, 2), ball, (2.9, 0, 0)),
        check("rings, one scaled by 2", ring, (2, 2, 2), ring, (2.9, 0, 0)),
        check("wedge mirrored, -1 1 1", wedge, (-1, 1, 1), ball, (-1, 0.2, 0.2))]
raise SystemExit(0 if all(same) else 1)
PYTHON
python/bin/python check.py
