"""Anything at all in the place of any argument of any public function: an answer, or one of three errors that names the
argument, and never a crash."""

from __future__ import annotations

import concurrent.futures
import inspect
import re
import warnings

import hypothesis.extra.numpy as hn
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import prolate
from conftest import HALF_A, box_mesh

# ---- anything ----

dtypes = st.one_of(
    hn.floating_dtypes(),
    hn.integer_dtypes(),
    hn.unsigned_integer_dtypes(),
    hn.boolean_dtypes(),
    hn.complex_number_dtypes(),
    hn.unicode_string_dtypes(max_len=3),
    hn.datetime64_dtypes(),
)
sides = st.sampled_from([0, 1, 2, 3, 4, 7, 8])
arrays = dtypes.flatmap(lambda d: hn.arrays(d, st.lists(sides, min_size=0, max_size=3).map(tuple)))
numbers = st.one_of(st.floats(), st.integers(-(2**70), 2**70), st.none(), st.booleans())
# No slash: what is written stays in the test's folder.
texts = st.text(st.characters(exclude_characters="/"), max_size=3)
data = st.binary(max_size=40).map(lambda b: b.replace(b"/", b"0"))
junk = st.one_of(numbers, texts, data, st.lists(numbers, max_size=8), arrays, st.just(object()))

# ---- what is right, or nearly, by the name of the parameter: so that examples get beyond the first check ----

poses = st.one_of(
    hn.arrays(st.sampled_from([np.float32, np.float64]), st.sampled_from([(7,), (2, 7), (3, 7), (4, 4), (2, 4, 4)])),
    st.just(np.array([0, 0, 0, 0, 0, 0, 1.0])),
    st.just(np.eye(4)),
    st.floats(width=32).map(lambda x: [x, 0, 0, 0, 0, 0, 1]),
    st.floats().map(lambda x: [x, -x, 0, x, 0, 0, 1]),
)
right = st.floats(-2, 2).map(lambda x: [x, 0, 0, 0.1, 0, 0, 1])
pose = st.one_of(right, right, right, poses)
points = st.one_of(
    hn.arrays(np.float64, st.sampled_from([(3,), (2, 3), (0, 3)])),
    *[st.just([0.3, 0.2, 0.1]), st.just([[0, 0, 2]])] * 2,
)
faces = st.one_of(
    hn.arrays(st.sampled_from([np.int32, np.int64, np.uint8]), st.just((4, 3)), elements=st.integers(0, 4)),
    *[st.just(box_mesh()[1])] * 2,
)
vertices = st.sampled_from([box_mesh(HALF_A)[0], np.random.default_rng(0).normal(size=(5, 3))])
shapes = st.one_of(
    st.builds(prolate.Sphere, st.one_of(points, junk), numbers),
    st.builds(prolate.Capsule, points, st.one_of(points, junk), numbers),
    st.builds(prolate.Box, st.one_of(poses, junk), points),
    st.builds(prolate.HalfSpace, st.one_of(points, junk), numbers),
)
lengths = st.floats(0, 3)
few = st.integers(0, 3)
USUAL = {
    **dict.fromkeys(
        ("poses", "poses_a", "poses_b", "pose", "start_a", "end_a", "start_b", "end_b", "start", "end"), pose
    ),
    **dict.fromkeys(("points", "origins", "directions"), points),
    **dict.fromkeys(("radius", "half_height", "diagonal", "longest_side", "margin", "tolerance", "slack"), lengths),
    **dict.fromkeys(("radii", "half"), st.just([1.0, 0.5, 0.25])),
    **dict.fromkeys(("levels", "max_level", "layers", "mask", "id", "level", "threads"), few),
    "vertices": vertices,
    "faces": faces,
    "mesh": st.just(box_mesh(HALF_A)),
    "assets": st.lists(st.builds(prolate.Asset, st.tuples(vertices, faces), st.just({"exact": True})), max_size=2),
    "shape": shapes,
    "what": st.one_of(shapes, st.lists(shapes, max_size=2), st.just(prolate.sphere_tree(0.5))),
    "i": few,
    "pairs": st.just([[0, 0]]),
    "ids": st.just([1 << 32]),
    "budget": st.just(1000),
    "order": st.sampled_from(["xyzw", "wxyz"]),
    "quality": st.just("fast"),
    "exact": st.just(True),
    "samples": st.just(16),
    "size": st.just((64, 48)),
    "path": st.sampled_from(["a.etree", "a.csv", "a.obj", "a.glb"]),
    "cache": st.just("cache"),
    "tree": st.just(prolate.box_tree(HALF_A)),
    "a": st.just(prolate.box_tree(HALF_A)),
    "b": st.sampled_from([prolate.box_tree([0.3, 0.3, 0.8]), prolate.HalfSpace((0, 0, 1), 0)]),
    "options": st.just({"exact": True}),
}
# Else mostly slow: bakes that nobody asked for.
ALWAYS = {
    "bake": {"quality", "exact"},
    "render": {"samples", "size"},
    "sweep": {"budget"},
}

# ---- the functions ----


def methods(thing):
    return {
        f"{type(thing).__name__}.{name}": getattr(thing, name)
        for name in dir(type(thing))
        if not name.startswith("_") and callable(getattr(thing, name)) and name in vars(type(thing))
    }


def functions(tree, world):
    """All that is public and takes arguments, by name."""
    return {
        **{name: getattr(prolate, name) for name in prolate.__all__ if inspect.isfunction(getattr(prolate, name))},
        **{f"pairs.{name}": getattr(prolate.pairs, name) for name in ("collide", "distance")},
        **methods(tree),
        **methods(world),
        "World": prolate.World,
        "Asset": lambda mesh, options: prolate.bake_many([prolate.Asset(mesh, options)]),
        "bake_mesh": lambda mesh, progress: prolate.bake_mesh(mesh, exact=True, progress=progress),
    }


SLOW = {"Tree.render": 20, "Tree.view": 6, "Tree.export": 20, "Tree.verify": 60, "bake": 80, "bake_many": 40}


def usual(name, parameter, default):
    if (name, parameter) == ("World.insert", "shape"):
        return USUAL["b"]
    return USUAL.get(parameter, st.just(None if default is inspect.Parameter.empty else default))


@st.composite
def arguments(draw, name, parameters):
    """By keyword: at most two that are anything, the others right, and those that have defaults seldom."""
    wrong = draw(st.sets(st.sampled_from(sorted(parameters)), max_size=2))
    always = ALWAYS.get(name.rpartition(".")[2], set())
    out = {}
    for parameter, default in parameters.items():
        if parameter in wrong:
            out[parameter] = draw(st.one_of(junk, usual(name, parameter, default)))
        elif default is inspect.Parameter.empty or parameter in always or draw(few) == 0:
            out[parameter] = draw(usual(name, parameter, default))
    return out


def survive(function, parameters, given_):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            function(**given_)
        except (ValueError, TypeError) as error:
            names = [*parameters, *(("vertices", "faces") if "mesh" in parameters else ())]
            assert re.search(r"\b(" + "|".join(names) + r")\b", str(error)), f"{error!r} names no argument"
        except prolate.Error as error:
            assert str(error)


NAMES = sorted(functions(prolate.box_tree(HALF_A), prolate.World()))


@pytest.mark.parametrize("name", NAMES)
def test_anything(name, cover, box_a, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cover.save("a.etree")
    world = prolate.World()
    world.insert(box_a, np.eye(4))
    function = functions(cover, world)[name]
    parameters = {p.name: p.default for p in inspect.signature(function).parameters.values()}
    if not parameters:
        function()
        return

    @settings(max_examples=SLOW.get(name, 100), deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(arguments(name, parameters))
    def run(given_):
        survive(function, parameters, given_)

    run()


def test_nothing_public_is_left_out():
    known = {name.rpartition(".")[2] for name in NAMES}
    for name in prolate.__all__:
        thing = getattr(prolate, name)
        assert not callable(thing) or inspect.isclass(thing) or name in known
    assert {"collide", "distance"} <= set(prolate.pairs.__all__) <= {"collide", "distance", "PairDistances"}
    assert {"Tree.verify", "Tree.from_bytes", "Tree.cut", "Tree.prefix", "Tree.export", "World.move"} <= set(NAMES)


@settings(max_examples=150, deadline=None, database=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_damaged_trees(cover, data):
    content = bytes(cover)
    at, end = data.draw(st.integers(0, len(content) - 1)), data.draw(st.integers(0, len(content)))
    patch = data.draw(st.binary(max_size=20))
    try:
        tree = prolate.Tree.from_bytes((content[:at] + patch + content[at + len(patch) :])[:end], check_hash=False)
    except prolate.Error as error:
        assert error.code in ("bad_file", "newer_version")
        return
    prolate.collide(tree, np.eye(4), tree, np.eye(4))
    tree.cut(-1)
    assert repr(tree) and tree.info


def test_an_asset_that_fails_stops_no_other():
    good, bad = (prolate.Asset((box_mesh()[0], f), {"exact": True}) for f in (box_mesh()[1], [[0, 1, 99]]))
    with concurrent.futures.ThreadPoolExecutor(2) as executor:
        found = prolate.bake_many([good, bad, good], executor=executor)
    assert [result.error is None for result in found] == [True, False, True]
