"""The page of `prolate view` for two trees: bodies that are dragged, and what the runtime in the page says of them.

    queries_test.py PROLATE FOLDER [--screenshots] [TEST...]      exits with 77 if no browser is installed
"""
import json
import subprocess

from page_test import PROLATE, PageTest, bake, bumpy, main, path, run


class QueryTest(PageTest):
    def setUp(self):
        super().setUp()
        self.browser.wait_for("viewer.encounter?.answer")

    def place(self, pose):
        """Puts the second body there: translation, rotation."""
        self.browser.script("const pose = arguments[0], [, body] = viewer.scene.bodies; viewer.poseChanged();"
                            "body.pose = {translation: pose.slice(0, 3), rotation: pose.slice(3)}", pose)


class TwoTrees(QueryTest):
    page = "two.html"
    bodies = ("bumpy", "small")

    @classmethod
    def setUpClass(cls):
        bake("bumpy", bumpy(), "--degree", "8", "--levels", "2")
        bake("small", bumpy(16, 8), "--degree", "4", "--levels", "3")
        run("view", path("bumpy.etree"), path("bumpy.obj"), path("small.etree"), "-o", path(cls.page))

    def trees(self):
        return [path(name + ".etree") for name in self.bodies]

    def answer(self):
        self.settle()
        return self.js("{...viewer.encounter.answer, meeting: viewer.encounter.answer.meeting.map((set) => set.size)}")

    def middle_of(self, body):
        """Some point of the window where this body is, as far from its border as can be."""
        self.settle()
        return self.js("""(() => {
            const {renderer} = viewer, {clientWidth: w, clientHeight: h} = renderer.canvas, at = [];
            for (let y = 4; y < h; y += 8)
                for (let x = 4; x < w; x += 8) if (renderer.pick(x, y)?.body === arguments[0]) at.push([x, y]);
            return [0, 1].map((i) => at.reduce((sum, p) => sum + p[i], 0) / at.length);
        })()""", body)

    def test_starts_apart(self):
        answer = self.answer()
        self.assertEqual(answer["verdict"], "separated")
        self.assertGreater(answer["lower"], 0)
        self.assertLessEqual(answer["lower"], answer["upper"])
        self.assertEqual(self.js("viewer.marks.length"), 3, "a line and its two ends")
        self.assertEqual(self.js("document.getElementById('verdict-word').textContent"), "separated")
        gap = sum((a - b) ** 2 for a, b in zip(answer["pointA"], answer["pointB"])) ** 0.5
        self.assertAlmostEqual(gap, answer["upper"], places=4)

    def test_dragging_into_contact_turns_the_verdict(self):
        target = self.middle_of(0)
        self.browser.drag(self.middle_of(1), target)
        answer = self.answer()
        self.assertEqual(answer["verdict"], "overlapping")
        self.assertEqual(self.js("document.getElementById('verdict-word').textContent"), "overlapping")
        self.assertGreater(min(answer["meeting"]), 0, "nodes that meet are marked")
        x, y = self.middle_of(1)
        self.browser.drag((x, y), (x + 10, 20), (990, 20))
        self.assertEqual(self.answer()["verdict"], "separated")
        self.browser.keys("p")
        self.settle()
        self.assertEqual(self.js("viewer.scene.bodies[1].pose"), self.js("viewer.scene.startPose"))

    def test_turning_keeps_the_middle(self):
        rotation = "viewer.scene.bodies[1].pose.rotation"
        before = self.js(rotation)
        x, y = self.middle_of(1)
        self.browser.keys("d")
        self.browser.drag((x, y), (x + 60, y + 30))
        after = self.js(rotation)
        self.assertGreater(max(abs(a - b) for a, b in zip(before, after)), 0.1)
        self.assertAlmostEqual(sum(q * q for q in after), 1, places=6)
        near = self.middle_of(1)
        self.assertLess(max(abs(near[0] - x), abs(near[1] - y)), 20)
        self.browser.keys("Left", "Left", held="Shift")
        self.assertLess(self.middle_of(1)[0], near[0] - 10)

    def test_says_what_the_command_says(self):
        for pose in ((2.6, 0, 0, 0, 0, 0, 1), (1.9, 0.3, -0.2, 0.1, 0.2, 0.3, 0.9), (0.5, 0.5, 0.5, 0, 1, 0, 0),
                     (9, 0, 0, 0, 0, 0, 1)):
            self.place(pose)
            page = self.answer()
            told = subprocess.run([PROLATE, "collide", *self.trees(), "--json", "--pose", ",".join(map(str, pose))],
                                  check=True, capture_output=True)
            command = json.loads(told.stdout)
            self.assertEqual(page["verdict"], command["verdict"])
            self.assertEqual((page["pairTests"], page["blockTests"]), (command["pair_tests"], command["block_tests"]))
            # What each level adds makes up the whole; a search that stops at the first pair tests less, and so does one
            # that the spheres around the roots settle.
            tests = sum(level["own"] for level in page["levels"])
            self.assertEqual(len(page["levels"]), 4)
            if page["verdict"] == "separated" and command["block_tests"] > 0:
                self.assertEqual(tests, command["pair_tests"])
            else:
                self.assertGreaterEqual(tests, command["pair_tests"])

    def test_a_pose_of_the_command_line(self):
        run("view", *self.trees(), "--pose", "0.2,0,0,0,0,1,1", "-o", path("posed.html"))
        self.browser.open(path("posed.html"))
        self.browser.wait_for("window.viewer?.encounter?.answer")
        self.assertEqual(self.answer()["verdict"], "overlapping")
        self.assertEqual(self.js("viewer.scene.bodies[1].pose.translation"), [0.20000000298023224, 0, 0])


class ExactTrees(QueryTest):
    page = "exact.html"

    @classmethod
    def setUpClass(cls):
        bake("exact", bumpy(24, 12), "--exact")
        bake("inner", bumpy(24, 12, size=0.3), "--exact")
        run("view", path("exact.etree"), path("inner.etree"), "-o", path(cls.page))

    def note(self):
        return self.js("document.getElementById('verdict-note').textContent")

    def test_one_inside_the_other_and_triangles_that_meet(self):
        self.place((0.9, 0.1, 0.2, 0, 0, 0, 1))
        self.settle()
        self.assertEqual(self.js("viewer.encounter.answer.verdict"), "overlapping")
        self.assertRegex(self.note(), r"triangle .* of A meets triangle .* of B")
        self.place((0, 0, 0, 0, 0, 0, 0.7))
        self.settle()
        self.assertEqual(self.js("viewer.encounter.answer.verdict"), "overlapping")
        self.assertRegex(self.note(), "a part of one lies inside the other")


if __name__ == "__main__":
    main()
