"""What the tests of pages share: meshes, the command, a window, and looks at it."""
import base64
import json
import math
import os
import struct
import subprocess
import sys
import unittest

from browser import Browser, missing
from picture import Picture

PROLATE, FOLDER = sys.argv[1:3]
SKIPPED = 77


def boxes(count, pitch=3.0):
    """An OBJ of so many boxes in two rows, well apart."""
    lines = []
    for box in range(count):
        x, y = pitch * (box // 2), pitch * (box % 2)
        for corner in range(8):
            lines.append(f"v {x + (corner & 1) * 1.2} {y + (corner >> 1 & 1) * 0.9} {(corner >> 2) * 0.6}")
        for quad in ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)):
            lines.append("f " + " ".join(str(8 * box + corner + 1) for corner in quad))
    return "\n".join(lines) + "\n"


def bumpy(around=48, down=24, size=1):
    """An OBJ of a closed ball with bumps: a mesh that ellipsoids of any number can still approximate better."""
    lines, index = [f"v 0 0 {1.2 * size}", f"v 0 0 {-1.2 * size}"], lambda i, j: 3 + (i % around) + around * (j - 1)
    for j in range(1, down):
        for i in range(around):
            a, b = 2 * math.pi * i / around, math.pi * j / down
            r = size * (1.2 + 0.3 * math.sin(b) * math.sin(4 * a) * math.sin(5 * b))
            lines.append(f"v {r * math.sin(b) * math.cos(a)} {r * math.sin(b) * math.sin(a)} {r * math.cos(b)}")
    for i in range(around):
        lines += [f"f 1 {index(i, 1)} {index(i + 1, 1)}", f"f 2 {index(i + 1, down - 1)} {index(i, down - 1)}"]
        for j in range(1, down - 1):
            lines.append(f"f {index(i, j)} {index(i, j + 1)} {index(i + 1, j + 1)} {index(i + 1, j)}")
    return "\n".join(lines) + "\n"


def write_modes(name, modes):
    """An .npy file of modes: for each a list of displacements, one a vertex."""
    header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': ({len(modes)}, {len(modes[0])}, 3), }}"
    header += " " * (-(len(header) + 11) % 64) + "\n"
    with open(path(name), "wb") as file:
        file.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode())
        for mode in modes:
            for displacement in mode:
                file.write(struct.pack("<3f", *displacement))


def vertices(mesh):
    """Those of the text of an OBJ."""
    return [tuple(map(float, line.split()[1:])) for line in mesh.splitlines() if line.startswith("v ")]


def rigged_bar(rings=13):
    """A glTF of a closed square bar along y, 0 ... 3, and three joints in it, each one's end above the last."""
    at, joints, weights, triangles = [], [], [], []
    for ring in range(rings):
        y = 3 * ring / (rings - 1)
        for x, z in ((-0.3, -0.2), (0.3, -0.2), (0.3, 0.2), (-0.3, 0.2)):
            at.append((x, y, z))
            upper = max(0.0, min(2.0, y - 0.5))  # blends around y = 1 and 2
            bone, share = (0, upper) if upper < 1 else (1, upper - 1)
            joints.append((bone, bone + 1, 0, 0))
            weights.append((1 - share, share, 0, 0))
    quads = [(0, 1, 2, 3), (4 * rings - 1, 4 * rings - 2, 4 * rings - 3, 4 * rings - 4)]
    for ring in range(rings - 1):
        for side in range(4):
            a, b = 4 * ring + side, 4 * ring + (side + 1) % 4
            quads.append((a, a + 4, b + 4, b))
    for a, b, c, d in quads:
        triangles += [a, b, c, a, c, d]
    inverse_bind = [(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -y, 0, 1) for y in (0, 1, 2)]
    blocks = [struct.pack(f"<{3 * len(at)}f", *sum(at, ())), struct.pack(f"<{4 * len(at)}H", *sum(joints, ())),
              struct.pack(f"<{4 * len(at)}f", *sum(weights, ())), struct.pack(f"<{len(triangles)}I", *triangles),
              struct.pack("<48f", *sum(inverse_bind, ()))]
    views, offset = [], 0
    for block in blocks:
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": len(block)})
        offset += len(block)
    kinds = [(5126, len(at), "VEC3"), (5123, len(at), "VEC4"), (5126, len(at), "VEC4"),
             (5125, len(triangles), "SCALAR"), (5126, 3, "MAT4")]
    accessors = [{"bufferView": i, "componentType": kind, "count": count, "type": words}
                 for i, (kind, count, words) in enumerate(kinds)]
    accessors[0].update(min=[min(axis) for axis in zip(*at)], max=[max(axis) for axis in zip(*at)])
    names = ("root", "elbow", "wrist")
    return json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0, "skin": 0}, {"name": "root", "children": [2]},
                  {"name": "elbow", "translation": [0, 1, 0], "children": [3]},
                  {"name": "wrist", "translation": [0, 1, 0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}, "indices": 3}]}],
        "skins": [{"joints": [1, 2, 3], "inverseBindMatrices": 4}],
        "buffers": [{"byteLength": offset,
                     "uri": "data:application/octet-stream;base64," + base64.b64encode(b"".join(blocks)).decode()}],
        "bufferViews": views, "accessors": accessors}), names


def run(*arguments):
    subprocess.run([PROLATE, *arguments], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def path(name):
    return os.path.join(FOLDER, name)


def bake(name, mesh, *options, kind="obj"):
    """A mesh and its tree."""
    with open(path(f"{name}.{kind}"), "w", encoding="utf-8") as file:
        file.write(mesh)
    run("bake", path(f"{name}.{kind}"), "-o", path(name + ".etree"), "--quality", "fast", *options)


class PageTest(unittest.TestCase):
    """Opens a page afresh for each test, and sees to it that the console stays clean."""
    page = None
    browser = None  # one window for all

    def setUp(self):
        self.browser.open(path(self.page))
        self.browser.wait_for("window.viewer")

    def tearDown(self):
        self.browser.release()
        self.settle()
        if "--screenshots" in sys.argv:
            with open(path(self.id() + ".png"), "wb") as file:
                file.write(self.browser.screenshot())
        self.assertEqual([entry for entry in self.browser.console() if entry[0] == "SEVERE"], [])

    def js(self, text, *arguments):
        return self.browser.script("return " + text, *arguments)

    def settle(self):
        """Waits for the picture at rest."""
        self.browser.wait_for("viewer.atRest")

    def canvas(self):
        """Its width and height: it begins at the window's corner."""
        return self.js("[viewer.renderer.canvas.clientWidth, viewer.renderer.canvas.clientHeight]")

    def shot(self):
        """The picture at rest, with smooth edges however long they take: a busy machine has the same picture."""
        self.settle()
        self.js("viewer.tooSlow && (viewer.smoothTime = 0, viewer.draw(true), 0)")
        return Picture(self.browser.screenshot())

    def blobs(self):
        return self.shot().blobs(self.canvas()[0])

    def set_slider(self, name, value):
        self.browser.script("const slider = document.getElementById(arguments[0]); slider.value = arguments[1];"
                            "slider.dispatchEvent(new Event('input'))", name, value)


def main():
    """Runs the tests of the calling file; exits with SKIPPED if no browser is installed."""
    if reason := missing():
        print(f"skipped: {reason}")
        sys.exit(SKIPPED)
    os.makedirs(FOLDER, exist_ok=True)
    with Browser(1000, 700) as PageTest.browser:
        unittest.main(argv=[sys.argv[0]] + [a for a in sys.argv[3:] if a != "--screenshots"], verbosity=2)
