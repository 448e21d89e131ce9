#!/usr/bin/env bash
# trimesh 5.2.0 reads normalised positions of glTF as plain integers, and sparse ones without their values.
#
# A good guess: an accessor with "normalized": true gives 1 for the greatest integer, and a sparse accessor gives its
# base with the listed elements replaced; both are in glTF 2.0 (the integers by KHR_mesh_quantization, required here).
# What it does: the first mesh is 65,535 times too large; the second lacks every element that the sparse part sets.
# Both load without a word.
#
# Seen (a tetrahedron with corners at 0 and 1, written in either way):
#     quantised:   extents 65535 65535 65535
#     sparse:      extents 0 0 0
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv python && python/bin/python -m pip install --quiet trimesh==5.2.0 numpy==2.3.5
cat >check.py <<'PYTHON'
import base64, json, struct, trimesh

def load(name, data, position, views, required):
    index = struct.pack("<12H", 0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3)
    views = views + [{"buffer": 0, "byteOffset": len(data), "byteLength": len(index)}]
    data += index
    file = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "accessors": [position, {"bufferView": len(views) - 1, "componentType": 5123, "count": 12,
                                     "type": "SCALAR"}],
            "bufferViews": views,
            "buffers": [{"byteLength": len(data),
                         "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}]}
    if required: file["extensionsUsed"] = file["extensionsRequired"] = required
    json.dump(file, open(name + ".gltf", "w"))
    extent = trimesh.load(name + ".gltf").extents
    print("%-12s extents" % (name + ":"), *("%g" % x for x in extent))
    return extent

one = 65535
corners = [(0, 0, 0), (one, 0, 0), (0, one, 0), (0, 0, one)]
data = b"".join(struct.pack("<4H", *p, 0) for p in corners)
quantised = load("quantised", data, {"bufferView": 0, "componentType": 5123, "normalized": True, "count": 4,
                                     "type": "VEC3", "min": [0] * 3, "max": [one] * 3},
                 [{"buffer": 0, "byteOffset": 0, "byteLength": len(data), "byteStride": 8}],
                 ["KHR_mesh_quantization"])
# Four corners of zeros; the sparse part then sets three of them.
base = bytes(48)
where = struct.pack("<3H", 1, 2, 3) + bytes(2)
values = struct.pack("<9f", 1, 0, 0, 0, 1, 0, 0, 0, 1)
sparse = load("sparse", base + where + values,
              {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0] * 3, "max": [1] * 3,
               "sparse": {"count": 3, "indices": {"bufferView": 1, "componentType": 5123},
                          "values": {"bufferView": 2}}},
              [{"buffer": 0, "byteOffset": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 6},
               {"buffer": 0, "byteOffset": 56, "byteLength": 36}], [])
raise SystemExit(0 if max(quantised) > 2 and max(sparse) < 0.5 else 1)
PYTHON
python/bin/python check.py
