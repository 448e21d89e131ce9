#!/usr/bin/env bash
# trimesh 5.2.0 and Drake 1.51.1 put a skinned glTF mesh where its own node is, and leave its morph weights out.
#
# A good guess: a mesh with a skin stands where its joints hold it. glTF 2.0 ("Joint Hierarchy") says that only the joints'
# transforms apply to it, and that the transform of the node that it hangs on is ignored. And a mesh with default morph
# weights ("Morph Targets") has its targets added before anybody animates it.
# What they do: both place the mesh by its node, not by its joints, and as if all weights were 0; without a word. Physics
# made of such a file stands elsewhere, and has another shape, than the pictures of it. (Drake turns glTF's y to its z.)
#
# Seen (a tetrahedron with corners at 0 and 1; in the first file the node is at x = 5 and the only joint at z = 10, in the
# second the corner at z = 1 has a target that lifts it by 4, with weight 1), least and largest corner:
#     trimesh skin.gltf    5 0 0 .. 6 1 1       by glTF 0 0 10 .. 1 1 11
#     trimesh morph.gltf   0 0 0 .. 1 1 1       by glTF 0 0 0 .. 1 1 5
#     drake   skin.gltf    5 -1 0 .. 6 0 1      by glTF 0 -11 0 .. 1 -10 1
#     drake   morph.gltf   0 -1 0 .. 1 0 1      by glTF 0 -5 0 .. 1 0 1
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet trimesh==5.2.0 drake==1.51.1 numpy==2.3.5
cat >check.py <<'PYTHON'
import base64, json, struct
import numpy as np, trimesh
from pydrake.geometry import Convex


class File:
    """One tetrahedron on node 0; accessors are added one by one."""

    def __init__(self):
        self.data, self.views, self.accessors = b"", [], []
        corners = struct.pack("<12f", 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1)
        triangles = struct.pack("<12H", 0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3)
        self.primitive = {"attributes": {"POSITION": self.add(corners, 5126, 4, "VEC3", min=[0] * 3, max=[1] * 3)},
                          "indices": self.add(triangles, 5123, 12, "SCALAR")}
        self.mesh = {"primitives": [self.primitive]}
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                     "meshes": [self.mesh]}

    def add(self, data, component, count, kind, **more):
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data
        self.accessors.append({"bufferView": len(self.views) - 1, "componentType": component, "count": count,
                               "type": kind} | more)
        return len(self.accessors) - 1

    def write(self, name):
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        json.dump(self.json | {"bufferViews": self.views, "accessors": self.accessors,
                               "buffers": [{"byteLength": len(self.data), "uri": uri}]}, open(name, "w"))


skin = File()
skin.primitive["attributes"] |= {"JOINTS_0": skin.add(bytes(16), 5121, 4, "VEC4"),
                                 "WEIGHTS_0": skin.add(struct.pack("<16f", *[1, 0, 0, 0] * 4), 5126, 4, "VEC4")}
bind = skin.add(struct.pack("<16f", *np.eye(4).flat), 5126, 1, "MAT4")
skin.json["nodes"] = [{"mesh": 0, "skin": 0, "translation": [5, 0, 0]}, {"translation": [0, 0, 10]}]
skin.json["scenes"][0]["nodes"] = [0, 1]
skin.json["skins"] = [{"joints": [1], "inverseBindMatrices": bind}]
skin.write("skin.gltf")

morph = File()
lift = struct.pack("<12f", *[0] * 11, 4)
morph.primitive["targets"] = [{"POSITION": morph.add(lift, 5126, 4, "VEC3", min=[0] * 3, max=[0, 0, 4])}]
morph.mesh["weights"] = [1.0]
morph.write("morph.gltf")


def drake(name):
    hull = Convex(name).GetConvexHull()
    corners = np.array([hull.vertex(i) for i in range(hull.num_vertices())])
    return corners.min(0), corners.max(0)


def show(reader, name, box):
    print("%-7s %-12s" % (reader, name), *("%g" % x for x in np.round(box[0], 6) + 0.0), "..",
          *("%g" % x for x in np.round(box[1], 6) + 0.0))
    return np.array(box)


by_node = [[5, 0, 0], [6, 1, 1]], [[5, -1, 0], [6, 0, 1]]
without = [[0, 0, 0], [1, 1, 1]], [[0, -1, 0], [1, 0, 1]]
seen = [np.allclose(show("trimesh", "skin.gltf", trimesh.load("skin.gltf").bounds), by_node[0]),
        np.allclose(show("trimesh", "morph.gltf", trimesh.load("morph.gltf").bounds), without[0]),
        np.allclose(show("drake", "skin.gltf", drake("skin.gltf")), by_node[1]),
        np.allclose(show("drake", "morph.gltf", drake("morph.gltf")), without[1])]
raise SystemExit(0 if all(seen) else 1)
PYTHON
python/bin/python check.py
