"""Baking, trees, and what they hold."""

from __future__ import annotations

import copy
import gc
import itertools
import mmap
import os
import pickle
import signal
import threading
import weakref

import numpy as np
import pytest

import prolate
from conftest import HALF_A, box_mesh


def sphere_mesh(rings=24):
    theta, phi = np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)
    points = (
        [[0, 0, 1.0]]
        + [[np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)] for t in theta[1:-1] for p in phi]
        + [[0, 0, -1.0]]
    )
    n, at = len(phi), lambda r, k: 1 + r * len(phi) + k % len(phi)
    faces = [[0, at(0, k), at(0, k + 1)] for k in range(n)]
    for r in range(rings - 2):
        faces += [
            f
            for k in range(n)
            for f in ([at(r, k), at(r + 1, k), at(r + 1, k + 1)], [at(r, k), at(r + 1, k + 1), at(r, k + 1)])
        ]
    faces += [[len(points) - 1, at(rings - 2, k + 1), at(rings - 2, k)] for k in range(n)]
    return np.array(points), np.array(faces)


def test_arrays_of_all_types_give_the_same_tree():
    vertices, faces = box_mesh(HALF_A)
    trees = [
        prolate.bake(v, f, exact=True)
        for v in (
            vertices,
            vertices.astype(np.float32),
            np.asfortranarray(vertices),
            vertices.tolist(),
            vertices.astype(">f8"),
        )
        for f in (faces, faces.astype(np.int32), faces.astype(np.uint8), faces.tolist(), np.asfortranarray(faces))
    ]
    assert set(trees) == {trees[0]}


def test_contiguous_arrays_are_not_changed_and_not_held():
    vertices, faces = box_mesh(HALF_A)
    vertices, faces = vertices.astype(np.float32), faces.astype(np.int32)
    before = vertices.copy()
    dead = weakref.ref(vertices)
    tree = prolate.bake(vertices, faces, exact=True)
    assert (vertices == before).all()
    del vertices
    gc.collect()
    assert dead() is None
    assert tree.info.exact


def test_dlpack_comes_in():
    class OnlyDlpack:
        def __init__(self, array):
            self.array = array

        def __dlpack__(self, **options):
            return self.array.__dlpack__()

        def __dlpack_device__(self):
            return self.array.__dlpack_device__()

    vertices, faces = box_mesh(HALF_A)
    given = prolate.bake(vertices, faces, exact=True)
    for real, whole in ((np.float32, np.int32), (np.float64, np.int64)):
        assert prolate.bake(OnlyDlpack(vertices.astype(real)), OnlyDlpack(faces.astype(whole)), exact=True) == given
    with pytest.raises(TypeError, match="vertices"):
        prolate.bake(OnlyDlpack(None), faces, exact=True)
    pose = OnlyDlpack(np.array([0, 0, 0, 0, 0, 0, 1.0]))
    assert prolate.collide(given, pose, given, pose) == prolate.Verdict.OVERLAPPING


def test_cut_covers_random_points_of_the_solid(cover):
    rng = np.random.default_rng(1)
    points = rng.uniform(-1, 1, (5000, 3)) * HALF_A
    for level in range(cover.level_count):
        cut = cover.cut(level)
        local = np.einsum("nij,npi->npj", cut.rotation, points[None] - cut.center[:, None]) / cut.radii[:, None]
        assert ((local**2).sum(-1) <= 1).any(axis=0).all()
        inverse = np.linalg.inv(cut.factor)
        exact = np.einsum("nij,npj->npi", inverse, points[None] - cut.center[:, None])
        assert ((exact**2).sum(-1) <= 1 + 1e-9).any(axis=0).all()


def test_ellipsoids_are_consistent(cover):
    cut = cover.cut()
    shape = np.einsum("nij,nkj->nik", cut.factor, cut.factor)
    again = np.einsum("nij,nj,nkj->nik", cut.rotation, cut.radii**2, cut.rotation)
    assert np.allclose(shape, again, rtol=0, atol=1e-11)
    assert (np.linalg.det(cut.rotation) > 0.999).all()
    x, y, z, w = cut.quaternion.T
    assert np.allclose(cut.rotation[:, 0, 1], 2 * (x * y - z * w), atol=1e-12)
    assert np.allclose(cut.rotation[:, 2, 0], 2 * (x * z - y * w), atol=1e-12)
    assert set(cut.parent) <= set(cover.cut(cover.level_count - 2).node)
    assert not any(array.flags.writeable for array in cut)
    with pytest.raises(ValueError, match="level"):
        cover.cut(9)
    assert (cover.cut(0).parent == -1).all()


def test_prefix_is_a_coarser_tree(cover):
    coarse = cover.prefix(1)
    assert coarse.level_count == 2 and coarse.info.is_prefix
    assert (coarse.cut().center == cover.cut(1).center).all()


def test_info(cover, box_a):
    info = cover.info
    assert info.proved and not info.exact and info.diagnosis is not None and info.diagnosis.closed
    assert abs(info.volume - 8 * HALF_A.prod()) <= info.volume_error + 1e-9
    x, y, z = HALF_A**2
    assert abs(info.mass.volume - 8 * HALF_A.prod()) <= 1e-12 + info.mass.volume_error
    expected = 8 * HALF_A.prod() / 3 * np.diag([y + z, x + z, x + y])
    assert np.allclose(info.mass.inertia, expected, atol=1e-12) and np.allclose(info.mass.center, 0, atol=1e-12)
    assert info.levels[-1].outside_ratio < info.levels[0].outside_ratio
    assert box_a.info.exact and box_a.info.triangle_count == 12
    assert "12 triangles" in repr(box_a) and "ellipsoids" in repr(cover)
    assert box_a.mesh.faces.shape == (12, 3) and cover.mesh is None


def test_bytes_pickle_copy_equality(tmp_path, cover, box_a):
    data = bytes(cover)
    assert prolate.Tree.from_bytes(data) == cover != box_a
    assert cover != 1
    for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
        again = pickle.loads(pickle.dumps(cover, protocol))
        assert again == cover and hash(again) == hash(cover) and again.info == cover.info
    assert copy.copy(cover) is cover and copy.deepcopy(cover) is cover
    cover.save(tmp_path / "cover.etree")
    assert prolate.load(tmp_path / "cover.etree") == cover
    assert {cover: 1}[prolate.Tree.from_bytes(bytearray(data))] == 1


def test_read_only_buffers_are_not_copied_and_kept_alive(tmp_path, cover):
    data = bytes(cover)
    tree = prolate.Tree.from_bytes(memoryview(data))
    assert np.shares_memory(tree.buffer, np.frombuffer(data, np.uint8))
    del data
    gc.collect()
    assert tree == cover
    cover.save(tmp_path / "cover.etree")
    with open(tmp_path / "cover.etree", "rb") as file:
        mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    tree = prolate.Tree.from_bytes(mapped)
    with pytest.raises(BufferError):
        mapped.close()
    assert tree == cover
    del tree
    gc.collect()
    mapped.close()
    with pytest.raises(ValueError):
        prolate.Tree.from_bytes(mapped)


def test_writable_buffers_are_copied(cover):
    data = bytearray(bytes(cover))
    tree = prolate.Tree.from_bytes(data)
    data[200:] = bytes(len(data) - 200)
    assert tree == cover


def test_every_damage_is_found(cover):
    data = bytes(cover)
    for cut in (0, 1, 7, 100, len(data) // 2, len(data) - 1):
        with pytest.raises(prolate.Error) as caught:
            prolate.Tree.from_bytes(data[:cut])
        assert caught.value.code == "bad_file" and caught.value.where <= len(data)
    for at in range(0, len(data), 37):
        with pytest.raises(prolate.Error):
            prolate.Tree.from_bytes(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])


def test_verify_proves_and_finds_what_is_missing(cover):
    vertices, faces = box_mesh(HALF_A)
    assert cover.verify(vertices, faces)
    larger = cover.verify(vertices * 1.5, faces)
    assert not larger and larger.levels[-1].counterexample is not None


def frame_mesh():
    """A square frame, 2 x 2 x 0.5, with a hole of 1 x 1."""
    corner = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
    vertices = [(x, y, z) for z in (-0.25, 0.25) for size in (1, 0.5) for x, y in size * corner]
    faces = []
    for k in range(4):
        n = (k + 1) % 4
        for a, b, c, d in ((k, n, 8 + n, 8 + k), (4 + n, 4 + k, 12 + k, 12 + n), (8 + k, 8 + n, 12 + n, 12 + k),
                           (n, k, 4 + k, 4 + n)):  # fmt: skip
            faces += [(a, b, c), (a, c, d)]
    return np.array(vertices), np.array(faces)


def test_clearance_is_a_length_and_holes_stay_free():
    mesh = frame_mesh()
    near = prolate.bake(*box_mesh(), clearance="60cm", ellipsoids=1, quality="fast").info
    assert near.goal_reached == (near.levels[-1].hausdorff_max <= 0.6) and near.hole_radius is None
    assert near.asked.ellipsoids == 1 and near.asked.distance == pytest.approx(60 / near.diagonal)
    few = prolate.bake(*mesh, keep_holes=0.2, ellipsoids=8, quality="fast")
    proof = few.verify(*mesh)
    assert not few.info.goal_reached and few.info.hole_radius < 0.2
    assert not proof and not proof.holes_kept and np.abs(proof.blocked).max() < 2
    open_ = prolate.bake(*mesh, keep_holes=0.3, quality="fast")
    assert open_.info.hole_radius >= 0.3 and open_.info.asked.keep_holes == pytest.approx(0.3)
    proof = open_.verify(*mesh)
    assert proof and proof.holes_kept and proof.blocked is None
    ball = prolate.Sphere((0, 0, 0), 0.3)
    path = np.array([[0, 0, z, 0, 0, 0, 1] for z in np.linspace(-1, 1, 9)])
    assert (prolate.overlap(open_, path, ball) == prolate.Verdict.SEPARATED).all()
    least, most = prolate.ball_range(2)
    for wrong in ({"keep_holes": 1.01 * most}, {"fill": 0.99 * least}, {"keep_holes": 0.45}, {"clearance": 1e-9}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            prolate.bake(*mesh, quality="fast", **wrong)
    assert prolate.least_clearance(2, "fast") == pytest.approx(10 * prolate.least_clearance(2))


def test_what_a_ball_cannot_reach_is_filled():
    vertices, faces = box_mesh(HALF_A)
    shell = prolate.bake(vertices, faces[:-1], fill="60cm", ellipsoids=1, quality="fast")
    assert shell.info.asked.fill == pytest.approx(0.6) and not shell.info.surface_mode
    assert shell.info.volume == pytest.approx(8 * HALF_A.prod(), rel=0.2)


def test_units_scales_and_origins_are_remembered():
    vertices, faces = box_mesh(HALF_A * 1000, (4e6, -3e6, 2e6))
    with pytest.raises(ValueError, match="recentre"):
        prolate.bake(vertices + [1e9, 0, 0], faces, exact=True)
    tree = prolate.bake(vertices, faces, unit="mm", scale=(1, 1, -1), recentre=True, levels=1, quality="fast")
    assert tree.info.scale == (0.001, 0.001, -0.001)
    middle = np.array([4e6, -3e6, 2e6]) * tree.info.scale - tree.info.origin
    assert np.abs(middle).max() < 2
    assert tree.verify(vertices, faces)
    assert tree.info.diagnosis.turned_shells == 0 and tree.info.diagnosis.closed


def test_files(tmp_path):
    vertices, faces = box_mesh(HALF_A)
    path = tmp_path / "box.obj"
    path.write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in vertices)
        + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces)
    )
    mesh = prolate.load_mesh(path, unit="cm")
    assert mesh.vertices.dtype == np.float32 and mesh.faces.shape == (12, 3)
    assert np.allclose(mesh.vertices * 100, vertices)
    tree = prolate.bake_mesh(mesh, exact=True)
    assert tree.info.scale == (0.01, 0.01, 0.01) and tree.verify(mesh)
    for bad in ("absent.obj", "box.xyz"):
        with pytest.raises(prolate.Error) as caught:
            prolate.load_mesh(tmp_path / bad)
        assert bad in str(caught.value)
    odd = os.path.join(os.fsencode(tmp_path), b"\xff\xfe.etree")  # no UTF-8
    tree.save(odd)
    assert prolate.load(odd) == tree
    os.rename(path, odd[:-5] + b"obj")
    assert (prolate.load_mesh(odd[:-5] + b"obj", unit="cm").vertices == mesh.vertices).all()
    with pytest.raises(prolate.Error, match="absent"):
        prolate.load_mesh(odd[:-5] + b"absent.obj")
    with pytest.raises(ValueError, match="path"):
        prolate.load("a\0b")
    with pytest.raises(prolate.Error) as caught:
        tree.save(tmp_path / "no" / "folder.etree")
    assert caught.value.code == "io"


def test_mesh_objects_by_duck_typing():
    vertices, faces = box_mesh(HALF_A)
    wanted = prolate.bake(vertices, faces, exact=True)

    class Trimesh:
        pass

    class Open3d:
        pass

    class Meshlab:
        def vertex_matrix(self):
            return vertices

        def face_matrix(self):
            return faces.astype(np.int32)

    class MeshSet:
        def current_mesh(self):
            return Meshlab()

    Trimesh.vertices, Trimesh.faces = vertices, faces
    Open3d.vertices, Open3d.triangles = vertices, faces
    for mesh in (Trimesh(), Open3d(), Meshlab(), MeshSet(), (vertices, faces)):
        assert prolate.bake_mesh(mesh, exact=True) == wanted
    with pytest.raises(TypeError, match="mesh"):
        prolate.bake_mesh(7)


def test_progress_and_cancel():
    mesh = sphere_mesh()
    seen = []
    prolate.bake(*mesh, levels=1, quality="fast", progress=lambda *p: seen.append(p))
    assert seen[-1][0] == "done" and seen[-1][1] == 1 and all(a[1] <= b[1] for a, b in itertools.pairwise(seen))
    with pytest.raises(prolate.Error) as caught:
        prolate.bake(*mesh, levels=4, quality="best", progress=lambda *p: False)
    assert caught.value.code == "cancelled"

    def fail(*_):
        raise LookupError("mine")

    with pytest.raises(LookupError, match="mine"):
        prolate.bake(*mesh, levels=4, quality="best", progress=fail)


def test_ctrl_c_ends_a_bake(request):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        prolate.bake(*sphere_mesh(60), levels=5, quality="best")
    timer.join()


def test_other_threads_run_during_a_bake():
    ticks, done = [0], threading.Event()

    def tick():
        while not done.wait(0.005):
            ticks[0] += 1

    thread = threading.Thread(target=tick)
    thread.start()
    prolate.bake(*sphere_mesh(), levels=2, quality="fast")
    done.set()
    thread.join()
    assert ticks[0] > 3


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"levels": 0}, ValueError, "levels"),
        ({"levels": 2, "exact": True}, ValueError, "."),
        ({"ellipsoids": 70000}, ValueError, "ellipsoids"),
        ({"tolerance": -1}, ValueError, "tolerance"),
        ({"distance": float("nan")}, ValueError, "distance"),
        ({"degree": 1}, ValueError, "degree"),
        ({"quality": "worst"}, ValueError, "quality"),
        ({"primitive": None}, ValueError, "primitive"),
        ({"threads": -1}, ValueError, "threads"),
        ({"seed": 1.5}, TypeError, "seed"),
        ({"unit": "parsec"}, ValueError, "unit"),
        ({"scale": (1, 0, 1)}, ValueError, "scale"),
        ({"alpha": "a"}, TypeError, "alpha"),
        ({"clearance": 0}, ValueError, "clearance"),
        ({"clearance": "5 parsec"}, ValueError, "clearance"),
        ({"keep_holes": "1m", "fill": "1m"}, ValueError, "keep_holes"),
        ({"progress": 3}, TypeError, "progress"),
        ({"recentre": np.zeros(2)}, TypeError, "recentre"),
    ],
)
def test_bad_options(change, error, match):
    with pytest.raises(error, match=match):
        prolate.bake(*box_mesh(), **change)


def test_bad_meshes():
    vertices, faces = box_mesh()
    nan = vertices.copy()
    nan[5, 1] = np.nan
    far = faces.copy()
    far[3, 2] = 8
    for args, error, match in [
        ((nan, faces), ValueError, r"vertices\[5\]"),
        ((vertices, far), ValueError, r"faces\[3\].*8 vertices"),
        ((vertices, -far), ValueError, r"faces\["),
        ((vertices, faces.astype(float)), TypeError, "faces"),
        ((vertices[:, :2], faces), ValueError, r"vertices.*\(8, 2\)"),
        ((vertices, faces.reshape(-1)), ValueError, "faces"),
        (("abc", faces), TypeError, "vertices"),
        ((vertices, faces + 0.5), TypeError, "faces"),
        ((vertices, (faces + 0.5).tolist()), TypeError, "faces"),
        ((vertices * 1e39, faces), ValueError, "vertices"),
        ((vertices, faces[:0]), prolate.Error, "."),
        ((vertices * 0, faces), prolate.Error, "."),
    ]:
        with pytest.raises(error, match=match):
            prolate.bake(*args, exact=True)
