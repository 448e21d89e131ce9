"""Which links touch, and covers that are mended at the joints."""

from __future__ import annotations

import re

import pytest
from robot_files import texts

import prolate
from conftest import box_mesh

pytest.importorskip("lxml")
pytest.importorskip("scipy")
from prolate import robots

# A pole, and around it a C on a joint of its own: hooks that no convex body can hold without the pole.
HOOK = """<robot name="hook">
<link name="pole"><collision><geometry><cylinder radius="0.05" length="1"/></geometry></collision></link>
<link name="turn"/><link name="hook"><collision><geometry><mesh filename="hook.obj"/></geometry></collision></link>
<link name="arm"><collision><origin xyz="0.3 0 0.12"/><geometry><box size="0.6 0.1 0.1"/></geometry></collision></link>
<link name="far"><collision><origin xyz="0 0 3"/><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
<joint name="a" type="continuous"><parent link="pole"/><child link="turn"/><axis xyz="0 0 1"/></joint>
<joint name="b" type="continuous"><parent link="turn"/><child link="hook"/><axis xyz="0 0 1"/></joint>
<joint name="c" type="revolute"><parent link="turn"/><child link="arm"/><axis xyz="0 1 0"/>
<origin xyz="0.2 0 0"/><limit lower="-1" upper="1"/></joint>
<joint name="d" type="fixed"><parent link="pole"/><child link="far"/></joint>
</robot>"""


@pytest.fixture(scope="module")
def hook(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hook")
    (folder / "hook.urdf").write_text(HOOK)
    lines, first = [], 1
    for half, center in [
        ((0.25, 0.02, 0.1), (0, 0.23, 0)),
        ((0.25, 0.02, 0.1), (0, -0.23, 0)),
        ((0.02, 0.25, 0.1), (0.23, 0, 0)),
    ]:
        vertices, faces = box_mesh(half, center)
        lines += [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces + first]
        first += len(vertices)
    (folder / "hook.obj").write_text("\n".join(lines))
    robot = robots.Robot.load(folder / "hook.urdf")
    return robot, robot.bake(exact=True), robot.bake(clearance=0.3)


def test_rates_are_those_of_single_questions(hook):
    _, exact, covers = hook
    found = robots.touches(exact, covers, samples=500, seed=3)
    kinematics = robots.Kinematics(exact.description)
    q, names = kinematics.random(500, 3), list(kinematics.links)
    frames = kinematics.fk(q)
    assert {pair.links for pair in found.pairs} == {
        ("arm", "far"),
        ("arm", "hook"),
        ("arm", "pole"),
        ("far", "hook"),
        ("hook", "pole"),
    }
    for pair in found.pairs:
        for rate, baked in ((pair.exact, exact), (pair.covers, covers)):
            trees = [baked.covers[name].tree for name in pair.links]
            poses = [frames[names.index(name)] for name in pair.links]
            verdicts = prolate.collide(trees[0], poses[0], trees[1], poses[1])
            assert rate == pytest.approx((verdicts != prolate.Verdict.SEPARATED).mean(), abs=0.004)
    assert found.adjacent == (("far", "pole"),)


def test_what_only_covers_bring_into_contact_is_no_reason_to_exclude(hook):
    _, exact, covers = hook
    found = robots.touches(exact, covers, samples=500)
    rates = {pair.links: pair for pair in found.pairs}
    around = rates["hook", "pole"]
    assert around.exact == 0 and around.covers == 1 and around.added == 1
    assert around.covers_home and not around.home
    assert 0 < rates["arm", "hook"].exact < 1 and rates["arm", "hook"].home
    assert found.disabled() == {("far", "pole"): "adjacent", ("arm", "far"): "never", ("far", "hook"): "never"} | (
        {("arm", "pole"): "never"} if rates["arm", "pole"].covers == 0 else {}
    )
    table = found.table()
    assert "of 5 pairs, beside 1 of neighbours, in 500 samples" in table
    assert re.search(r"1 touch by their meshes at home\n +2 touch by their covers at home", table)
    assert re.search(r"arm hook +\d+\.\d\d% +\d+\.\d\d%  at home", table)
    assert re.search(r"hook pole +0\.00% +100\.00%  new, covers at home", table)


def test_covers_are_mended_where_meshes_do_not_touch(hook):
    _, exact, covers = hook
    mended, found = robots.mend(exact, covers, rounds=1, samples=200)
    around = next(pair for pair in found.pairs if pair.links == ("hook", "pole"))
    assert around.covers == 0 and mended.proved
    assert mended.covers["hook"].clearance < covers.covers["hook"].clearance
    assert mended.covers["arm"].kind == covers.covers["arm"].kind


def test_pairs_are_written_and_read_as_srdf(hook, tmp_path):
    _, exact, covers = hook
    found = robots.touches(exact, covers, samples=100)
    found.save(tmp_path / "hook.srdf")
    again = robots.load(exact.description.source, srdf=tmp_path / "hook.srdf")
    words = {"adjacent": "Adjacent", "never": "Never", "always": "Default"}
    assert again.disabled == {pair: words[why] for pair, why in found.disabled().items()} and not texts(
        again, "warning"
    )
    with pytest.raises(prolate.Error) as error:
        found.save(tmp_path / "hook.srdf" / "hook.srdf")
    assert error.value.code == "io"
    with pytest.raises(ValueError, match="samples"):
        robots.touches(exact, covers, samples=0)
