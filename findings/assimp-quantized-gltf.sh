#!/usr/bin/env bash
# Assimp 5.2.5 (Debian 12) reads quantised positions of glTF as if their bytes were floats.
#
# A good guess: a file that names KHR_mesh_quantization under "extensionsRequired" is read rightly or refused; glTF 2.0
# says that a loader which does not support a required extension must fail.
# What it does: it succeeds. A position of three 16-bit integers is taken for three floats, so that coordinates are
# nonsense (mostly denormals, and whatever the next vertex's bytes mean).
#
# Seen (a tetrahedron with corners at 0 and 1, as normalised unsigned 16-bit integers, 8 bytes apart):
#     assimp export: exit code 0
#     largest coordinate 1, read as 9.18341e-41
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
apt-get download -q assimp-utils=5.2.5~ds0-1+b1 libassimp5=5.2.5~ds0-1+b1 libdraco7=1.5.5+dfsg-2 libminizip1=1.1-8+deb12u1
for package in *.deb; do dpkg -x "$package" unpacked; done
LD_LIBRARY_PATH=$(echo "$PWD"/unpacked/usr/lib/*-linux-gnu) && export LD_LIBRARY_PATH
cat >check.py <<'PYTHON'
import base64, json, struct, subprocess
one = 65535
corners = [(0, 0, 0), (one, 0, 0), (0, one, 0), (0, 0, one)]
points = b"".join(struct.pack("<4H", *p, 0) for p in corners)  # rows of 8 bytes: rows must begin at multiples of 4
indices = struct.pack("<12H", 0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3)
data = points + indices
json.dump({
    "asset": {"version": "2.0"},
    "extensionsUsed": ["KHR_mesh_quantization"], "extensionsRequired": ["KHR_mesh_quantization"],
    "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "accessors": [
        {"bufferView": 0, "componentType": 5123, "normalized": True, "count": 4, "type": "VEC3",
         "min": [0, 0, 0], "max": [one, one, one]},
        {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}],
    "bufferViews": [
        {"buffer": 0, "byteOffset": 0, "byteLength": len(points), "byteStride": 8, "target": 34962},
        {"buffer": 0, "byteOffset": len(points), "byteLength": len(indices), "target": 34963}],
    "buffers": [{"byteLength": len(data),
                 "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}],
}, open("in.gltf", "w"))
done = subprocess.run(["unpacked/usr/bin/assimp", "export", "in.gltf", "out.stl"], capture_output=True)
print("assimp export: exit code", done.returncode)
if done.returncode: raise SystemExit(1)  # refused: as it should be
largest = max(abs(float(x)) for line in open("out.stl") if line.split()[:1] == ["vertex"] for x in line.split()[1:])
print("largest coordinate 1, read as %g" % largest)
raise SystemExit(0 if abs(largest - 1) > 0.5 else 1)
PYTHON
python3 check.py
