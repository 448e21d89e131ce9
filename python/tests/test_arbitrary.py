"""Arbitrary arguments at every function: an answer or one of three errors, and never a crash."""

from __future__ import annotations

import warnings
from functools import partial

import hypothesis.extra.numpy as hn
import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import prolate

SETTINGS = settings(max_examples=150, deadline=None, database=None, suppress_health_check=list(HealthCheck))

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
junk = st.one_of(
    numbers, st.text(max_size=3), st.binary(max_size=40), st.lists(numbers, max_size=8), arrays, st.just(object())
)
# Mostly right, so that not every example ends at the first argument.
poses = st.one_of(
    junk,
    hn.arrays(st.sampled_from([np.float32, np.float64]), st.sampled_from([(7,), (2, 7), (3, 7), (4, 4), (2, 4, 4)])),
    st.just(np.array([0, 0, 0, 0, 0, 0, 1.0])),
    st.just(np.eye(4)),
    st.floats(width=32).map(lambda x: [x, 0, 0, 0, 0, 0, 1]),
    st.floats().map(lambda x: [x, -x, 0, x, 0, 0, 1]),
)
points = st.one_of(junk, hn.arrays(np.float64, st.sampled_from([(3,), (2, 3), (0, 3)])))
faces = st.one_of(
    junk, hn.arrays(st.sampled_from([np.int32, np.int64, np.uint8]), st.just((4, 3)), elements=st.integers(0, 4))
)


def survive(call):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            call()
        except (ValueError, TypeError, prolate.Error) as error:
            assert str(error)


def trees(cover, box_a):
    return st.sampled_from([cover, box_a, box_a, None, 3])


def test_queries(cover, box_a):
    tree = trees(cover, box_a)

    @SETTINGS
    @given(st.data())
    def run(data):
        draw = data.draw
        a, b = draw(tree), draw(tree)
        pa, pb = draw(poses), draw(poses)
        limits = {"margin": draw(st.one_of(st.just(0), numbers)), "budget": draw(st.one_of(st.just(1000), junk))}
        survive(lambda: prolate.collide(a, pa, b, pb, out=draw(st.one_of(st.none(), junk)), **limits))
        survive(lambda: prolate.distance(a, pa, b, pb, budget=1000, tolerance=draw(numbers)))
        survive(lambda: prolate.contacts(a, pa, b, pb, **limits))
        survive(lambda: prolate.sweep(a, pa, draw(poses), b, pb, draw(poses), **limits))
        survive(lambda: prolate.raycast(a, pa, draw(points), draw(points), draw(numbers), budget=1000))
        survive(lambda: prolate.signed_distance(a, draw(points), pa, budget=1000, max_distance=draw(numbers)))
        survive(lambda: prolate.contains(a, draw(points), pa))
        survive(lambda: prolate.bounds(a, pa, margin=draw(numbers)))
        survive(lambda: prolate.collide(a, pa, b, pb, threads=draw(numbers), order=draw(st.text(max_size=4))))

    run()


def test_shapes(box_a):
    shapes = st.one_of(
        st.builds(prolate.Sphere, points, numbers),
        st.builds(prolate.Capsule, points, points, numbers),
        st.builds(prolate.Box, poses, points),
        st.builds(prolate.HalfSpace, points, numbers),
        junk,
    )

    @SETTINGS
    @given(poses, shapes, numbers)
    def run(pose, shape, margin):
        survive(lambda: prolate.overlap(box_a, pose, shape, margin=margin, budget=1000))

    run()


@SETTINGS
@given(points, poses, junk, numbers)
def test_pairs(radii, at, pairs, number):
    survive(lambda: prolate.pairs.collide(radii, at, pairs, margin=number))
    survive(lambda: prolate.pairs.distance([1, 2, 3], at, [[0, 0]], tolerance=number))


@SETTINGS
@given(points, numbers, numbers, faces)
def test_primitives(row, radius, height, triangles):
    survive(lambda: prolate.box_tree(row))
    survive(lambda: prolate.ellipsoid_tree(row))
    survive(lambda: prolate.cylinder_tree(radius, height))
    survive(lambda: prolate.sphere_tree(radius))
    survive(lambda: prolate.convex_tree(row, triangles))
    survive(lambda: prolate.convex_tree(np.random.default_rng(0).normal(size=(5, 3)), triangles))


def test_world(box_a):
    @SETTINGS
    @given(poses, junk, numbers)
    def run(pose, ids, number):
        world = prolate.World()
        survive(lambda: world.insert(box_a, pose))
        survive(lambda: world.insert(box_a, np.eye(4), margin=number, layers=number))
        survive(lambda: world.move(ids, pose))
        survive(lambda: world.remove(number))
        survive(lambda: world.collide(margin=number))
        survive(lambda: prolate.World(slack=number))

    run()


@SETTINGS
@given(
    points,
    faces,
    st.dictionaries(st.sampled_from(["levels", "weld", "unit", "scale", "quality", "tolerance"]), junk, max_size=1),
)
def test_bake(vertices, triangles, options):
    survive(lambda: prolate.bake(vertices, triangles, exact=True, threads=1, **options))
    survive(lambda: prolate.bake(np.random.default_rng(0).normal(size=(5, 3)), triangles, exact=True, threads=1))


def test_bytes(cover):
    data = bytes(cover)

    @SETTINGS
    @given(junk, st.integers(0, len(data) - 1), st.binary(max_size=20), st.integers(0, len(data)))
    def run(anything, at, patch, end):
        survive(lambda: prolate.Tree.from_bytes(anything))
        damaged = (data[:at] + patch + data[at + len(patch) :])[:end]

        def ask():
            tree = prolate.Tree.from_bytes(damaged, check_hash=False)
            prolate.collide(tree, np.eye(4), tree, np.eye(4))
            tree.cut(-1)
            assert repr(tree) and tree.info

        survive(ask)

    run()
    for level in (None, "a", 1.5, 2**70, -9):
        survive(partial(cover.cut, level))
        survive(partial(cover.prefix, level))


@SETTINGS
@given(st.lists(st.one_of(junk, st.tuples(points, faces)), max_size=3))
def test_bake_many(assets):
    survive(lambda: prolate.bake_many([prolate.Asset(asset, {"exact": True}) for asset in assets]))
    survive(lambda: prolate.bake_many(assets))
