"""The page of `prolate view` for one tree, in headless Chromium: what it shows, and what it does.

    view_test.py PROLATE FOLDER [--screenshots] [TEST...]      exits with 77 if no browser is installed
"""
import math
import os
import re

from page_test import PageTest, bake, boxes, bumpy, main, path, rigged_bar, run, vertices, write_modes


class OneTree(PageTest):
    page = "one.html"

    @classmethod
    def setUpClass(cls):
        bake("boxes", boxes(8), "--degree", "8", "--levels", "2", "--inner", "16")
        run("view", path("boxes.etree"), path("boxes.obj"), "-o", path(cls.page))

    def setUp(self):
        super().setUp()
        if self._testMethodName != "test_sections_show_the_inner_cover":  # begins cut open
            self.browser.script("viewer.state.set({section: false, colour: 'branch'})")

    def test_shows_as_many_ellipsoids_as_the_level_has(self):
        self.set_slider("level", 1)
        self.assertEqual(self.blobs(), 8)
        self.assertEqual(self.js("viewer.renderer.drawn"), 8)
        self.assertEqual(self.js("viewer.renderer.visibleNodes()"), 8)
        self.assertIn("8 ellipsoids", self.js("document.getElementById('level-text').textContent"))
        self.set_slider("level", 0)
        self.assertEqual(self.blobs(), 1)
        self.set_slider("level", 2)
        self.settle()
        self.assertEqual(self.js("viewer.renderer.drawn"), 64)
        self.assertGreater(self.js("viewer.renderer.visibleNodes()"), 24)

    def test_opacity_and_wires(self):
        self.set_slider("level", 1)
        full = len(self.shot().inked(self.canvas()[0]))
        self.set_slider("cover-opacity", 0)
        mesh = self.shot()
        self.assertEqual(mesh.blobs(self.canvas()[0]), 8, "the mesh is inside, in eight parts")
        only_mesh = len(mesh.inked(self.canvas()[0]))
        self.assertLess(only_mesh, 0.9 * full)
        self.browser.keys("e")
        self.assertLess(len(self.shot().inked(self.canvas()[0])), 0.5 * only_mesh, "wires have gaps")
        self.set_slider("mesh-opacity", 0)
        self.assertEqual(self.blobs(), 0)
        self.set_slider("cover-opacity", 1)
        self.browser.keys("w")
        self.assertLess(len(self.shot().inked(self.canvas()[0])), 0.5 * full)

    def test_colour_by_outside_distance(self):
        self.set_slider("level", 1)
        before = self.shot()
        self.browser.keys("c")
        self.assertEqual(self.js("viewer.state.colour"), "outside")
        self.assertFalse(self.js("document.getElementById('legend').hidden"))
        after, width = self.shot(), self.canvas()[0]
        inked = before.inked(width)
        changed = sum(before.pixel(*at) != after.pixel(*at) for at in inked)
        self.assertGreater(changed, 0.5 * len(inked))

    def test_section_cuts_away(self):
        self.set_slider("level", 1)
        self.browser.keys("x")
        self.assertEqual(self.blobs(), 4, "the half in front of the cut is gone")
        self.browser.keys("f")
        self.assertEqual(self.blobs(), 4)
        self.set_slider("section-at", 0.999)
        self.assertEqual(self.blobs(), 0)
        self.browser.keys("s")
        self.assertEqual(self.blobs(), 8)

    def test_sections_show_the_inner_cover(self):
        self.set_slider("level", 2)
        self.assertTrue(self.js("viewer.state.section"), "at first, too")
        self.assertRegex(self.js("document.getElementById('level-figures').textContent"), r"16 ellipsoids, \d")
        self.settle()
        with_inner, width = self.shot(), self.canvas()[0]
        self.assertTrue(self.js("viewer.state.inner"))
        self.browser.keys("i")
        self.settle()
        without = self.shot()
        inked = with_inner.inked(width)
        changed = sum(with_inner.pixel(*at) != without.pixel(*at) for at in inked)
        self.assertGreater(changed, 0.02 * len(inked))
        self.assertEqual(len(inked), len(without.inked(width)), "it lies inside")
        self.browser.keys("i")

    def test_hover_describes_the_node(self):
        self.set_slider("level", 1)
        self.settle()
        x, y = min(self.shot().inked(self.canvas()[0]))  # at the left border of the picture's ink
        self.browser.hover(x + 8, y)
        self.browser.wait_for("!document.getElementById('tip').hidden")
        text = self.js("document.getElementById('tip').textContent")
        for word in ("Node", "level1", "radii", "outside volume", "sub-volume"):
            self.assertIn(word, text)
        # A box's share is an eighth of the solid, and its ellipsoid holds more than the box.
        self.assertRegex(text, r"1[23]\.?\d* % of all")
        self.browser.hover(3, 3)
        self.browser.wait_for("document.getElementById('tip').hidden")

    def test_mouse_and_touch_move_the_camera(self):
        width, height = self.canvas()
        view = "[viewer.camera.azimuth, viewer.camera.elevation, viewer.camera.distance, ...viewer.camera.target]"
        start = self.js(view)
        self.browser.drag((width / 2, height / 2), (width / 2 + 80, height / 2 + 20))
        turned = self.js(view)
        self.assertLess(turned[0], start[0] - 20)
        self.assertGreater(turned[1], start[1])
        self.assertEqual(turned[2:], start[2:])
        self.browser.drag((width / 2, height / 2), (width / 2 - 50, height / 2), touch=True)
        self.assertGreater(self.js(view)[0], turned[0] + 10)
        self.browser.drag((width / 2, height / 2), (width / 2 + 60, height / 2), button=2)
        self.assertNotEqual(self.js(view)[3:], start[3:])
        self.browser.wheel(width / 2, height / 2, -300)
        self.browser.wait_for(f"viewer.camera.distance < {0.8 * start[2]}")
        self.browser.keys("r")
        self.assertEqual(self.js(view), start)

    def test_the_camera_fits_any_number_of_nodes(self):
        fit = "(viewer.camera.fit(() => Array.from({length: arguments[0]}, (_, i) => [-1, i % 7 / 6]), 1)," \
              " viewer.camera.distance)"
        self.assertEqual(self.js(fit, 300_000), self.js(fit, 7))

    def test_keys_and_their_sheet(self):
        self.browser.keys("1")
        self.assertEqual(self.js("viewer.state.level"), 1)
        self.browser.keys("]")
        self.assertEqual(self.js("viewer.state.level"), 2)
        self.browser.keys("?")
        self.assertTrue(self.js("document.getElementById('help').open"))
        self.assertIn("coarser, finer", self.js("document.getElementById('help').textContent"))
        self.browser.keys("0")
        self.assertEqual(self.js("viewer.state.level"), 2, "the sheet is in front")
        self.browser.keys("?")
        self.assertFalse(self.js("document.getElementById('help').open"))

    def test_refuses_to_load_anything(self):
        self.assertEqual(self.js("performance.getEntriesByType('resource').length"), 0)
        blocked = self.js("fetch('https://example.org/').then(() => 'sent', () => 'blocked')")
        self.assertEqual(blocked, "blocked")
        self.assertIn("Content Security Policy", str(self.browser.console()))


class TreeAlone(PageTest):
    page = "alone.html"
    name = "a</script><b>&\"'é.etree"

    @classmethod
    def setUpClass(cls):
        bake("two", boxes(2), "--degree", "2", "--levels", "1")
        os.replace(path("two.etree"), path(cls.name.replace("/", "")))
        run("view", path(cls.name.replace("/", "")), "-o", path(cls.page))

    def test_without_mesh_and_with_an_odd_name(self):
        self.assertEqual(self.js("document.getElementById('title').textContent"), self.name.replace("/", ""))
        self.assertEqual(self.blobs(), 2)
        self.assertTrue(self.js("document.querySelector('[data-value=outside]').disabled"))
        self.assertTrue(self.js("document.getElementById('mesh-row').hidden"))


class ExactTree(PageTest):
    page = "exact.html"

    @classmethod
    def setUpClass(cls):
        bake("exact", boxes(4), "--exact")
        run("view", path("exact.etree"), "-o", path(cls.page))

    def test_brings_its_own_mesh(self):
        self.set_slider("cover-opacity", 0)
        self.assertEqual(self.blobs(), 4)
        self.assertFalse(self.js("document.querySelector('[data-value=outside]').disabled"))


class Deforming(PageTest):
    """A ball that bends and swells: whatever its coordinates, the ellipsoids hold the mesh that is shown."""
    page = "deforming.html"
    options = ("--degree", "8", "--levels", "2")
    # The farthest vertex from the ellipsoid shown that holds it deepest, in radial coordinates.
    farthest = """(() => {
        const [body] = viewer.scene.bodies, rows = body.cut(viewer.state.level);
        let most = 0;
        for (let v = 0; v < body.vertices.length; v += 3) {
            let least = Infinity;
            for (const row of rows) {
                const [cx, cy, cz, l11, l21, l22, l31, l32, l33] = body.ellipsoid.subarray(9 * row, 9 * row + 9);
                const x = (body.vertices[v] - cx) / l11, y = (body.vertices[v + 1] - cy - l21 * x) / l22;
                const z = (body.vertices[v + 2] - cz - l31 * x - l32 * y) / l33;
                least = Math.min(least, Math.hypot(x, y, z));
            }
            most = Math.max(most, least);
        }
        return most;
    })()"""

    @classmethod
    def setUpClass(cls):
        mesh = bumpy(24, 12)
        at = vertices(mesh)
        write_modes("modes.npy", [[(0, 0.4 * x * x, 0) for x, _, _ in at],
                                  [(0.2 * x, -0.1 * y, z * z) for x, y, z in at]])
        bake("deforming", mesh, "--modes", path("modes.npy"), "--range", "0.5,0.3", *cls.options)
        run("view", path("deforming.etree"), path("deforming.obj"), "--modes", path("modes.npy"), "-o", path(cls.page))

    def deform(self, *q):
        self.browser.script("viewer.deform(arguments[0])", q)
        self.settle()

    def test_the_cover_holds_the_mesh(self):
        self.assertFalse(self.js("viewer.scene.bodies[0].moved"))
        self.assertLess(self.js(self.farthest), 1 + 1e-5)
        rest = self.js("Array.from(viewer.scene.bodies[0].vertices)")
        for q in ((0.5, 0), (-0.5, 0.3), (0.2, -0.3), (0.01, 0.01)):
            self.deform(*q)
            self.assertLess(self.js(self.farthest), 1 + 1e-5, q)
            self.set_slider("level", 1)
            self.assertLess(self.js(self.farthest), 1 + 1e-5, (q, "on level 1"))
            self.set_slider("level", 2)
            moved = self.js("Array.from(viewer.scene.bodies[0].vertices)")
            x, y, z = rest[3:6]
            for value, wanted in zip(moved[3:6], (x + 0.2 * x * q[1], y + 0.4 * x * x * q[0] - 0.1 * y * q[1],
                                                  z + z * z * q[1])):
                self.assertAlmostEqual(value, wanted, places=5)
        self.deform(0, 0)
        self.assertEqual(self.js("Array.from(viewer.scene.bodies[0].vertices)"), rest)

    def test_sliders_and_keys(self):
        self.assertEqual(self.js("document.querySelectorAll('#modes .row').length"), 2)
        ends = self.js("[document.getElementById('mode-1').min, document.getElementById('mode-1').max]")
        for end, wanted in zip(ends, (-0.3, 0.3)):
            self.assertAlmostEqual(float(end), wanted, places=6)
        before = self.shot()
        self.set_slider("mode-0", 0.5)
        self.assertEqual(self.js("viewer.state.coordinates"), [0.5, 0])
        after, width = self.shot(), self.canvas()[0]
        self.assertNotEqual(before.inked(width), after.inked(width))
        self.browser.keys("a")
        self.browser.wait_for("viewer.state.playing && viewer.state.coordinates[0] < 0")
        self.browser.keys("q")
        self.assertEqual(self.js("[viewer.state.playing, ...viewer.state.coordinates]"), [False, 0, 0])
        self.assertEqual(self.shot().inked(width), before.inked(width))

    def test_sections_are_filled(self):
        self.deform(0.5, 0.3)
        self.browser.script("viewer.state.set({section: true})")
        self.set_slider("cover-opacity", 0)
        width, height = self.canvas()
        picture = self.shot()
        flat = [picture.pixel(width // 2 + dx, height // 2 + dy) for dx in (-20, 0, 20) for dy in (-20, 0, 20)]
        self.assertEqual(len(set(flat)), 1, "the cut is flat and has no light")
        self.assertLess(max(flat[0]), 250, "and is no paper")
        self.set_slider("mesh-opacity", 0)
        self.assertEqual(self.blobs(), 0)


class DeformingExact(Deforming):
    """An exact tree knows how its vertices move."""
    page = "deforming_exact.html"
    options = ("--exact",)

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        run("view", path("deforming.etree"), "-o", path(cls.page))


class DeformingCover(Deforming):
    """Without modes the mesh cannot be shown as it moves."""
    page = "deforming_cover.html"

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        run("view", path("deforming.etree"), path("deforming.obj"), "-o", path(cls.page))

    def test_the_cover_holds_the_mesh(self):
        self.deform(0.5, 0)
        self.assertFalse(self.js("viewer.scene.bodies[0].showsMesh"))
        self.assertIn("view --modes", self.js("document.getElementById('deformation-note').textContent"))

    def test_sections_are_filled(self):
        self.skipTest("the mesh is not shown")


class Bones(PageTest):
    """A bar of three bones: ellipsoids hold the mesh however they turn, and bones take those below along."""
    page = "bones.html"
    options = ("--ellipsoids", "16")

    @classmethod
    def setUpClass(cls):
        mesh, cls.names = rigged_bar()
        bake("bones", mesh, "--skin", *cls.options, kind="gltf")
        run("view", path("bones.etree"), path("bones.gltf"), "-o", path(cls.page))

    deform = Deforming.deform

    def test_the_cover_holds_the_mesh(self):
        for angles in ((0,) * 9, (0, 0, 0.4, 0, 0, 0, 0, 0, 0), (0, 0, 0, 0, 0, 1.2, 0, 0, 0),
                       (0.1, 0.2, 0.3, 0.5, -0.9, 0.4, -1.5, 0.2, 1)):
            self.deform(*angles)
            self.assertLess(self.js(Deforming.farthest), 1 + 1e-5, angles)

    def test_bones_turn_about_joints_and_take_others_along(self):
        self.assertEqual(self.js("[...document.querySelectorAll('#modes label')].map((label) => label.textContent)"),
                         list(self.names))
        rest = self.js("Array.from(viewer.scene.bodies[0].vertices)")
        self.set_slider("mode-1", 0.9)  # the elbow, about z
        bent = self.js("Array.from(viewer.scene.bodies[0].vertices)")
        for v in range(0, len(rest), 3):
            x, y, z = rest[v:v + 3]
            if y < 0.5:  # of the root alone
                self.assertEqual(bent[v:v + 3], rest[v:v + 3])
            elif y > 2.5:  # of the wrist alone
                turned = (x * math.cos(0.9) - (y - 1) * math.sin(0.9),
                          1 + x * math.sin(0.9) + (y - 1) * math.cos(0.9), z)
                for value, wanted in zip(bent[v:v + 3], turned):
                    self.assertAlmostEqual(value, wanted, places=5)
        self.browser.keys("q", "a")
        self.browser.wait_for("viewer.state.playing && viewer.state.coordinates[2] !== 0")
        self.browser.keys("q")
        self.assertFalse(self.js("viewer.scene.bodies[0].moved"))


class BonesOfExactTrees(Bones):
    page = "bones_exact.html"
    options = ("--exact",)


class Figures(PageTest):
    """No assertion on times: they are printed."""
    page = "figures.html"

    @classmethod
    def setUpClass(cls):
        bake("many", bumpy(), "--degree", "8", "--levels", "3")
        run("view", path("many.etree"), path("many.obj"), "-o", path(cls.page))

    def test_first_frame_and_size(self):
        first = self.js("performance.getEntriesByName('first-frame')[0].startTime")
        nodes = self.js("viewer.scene.bodies[0].nodeCount")
        print(f"first frame of a tree of {nodes} nodes after {first:.0f} ms")
        with open(path(self.page), encoding="utf-8") as file:
            page = file.read()
        numbers = re.search(r'<script id="numbers"[^>]*>\n(.*?)</script>', page)[1]
        print(f"page {len(page)} bytes, of these {len(numbers)} data")
        self.assertGreater(nodes, 400)
        self.assertLess(len(page) - len(numbers), 3_000_000)


if __name__ == "__main__":
    main()
