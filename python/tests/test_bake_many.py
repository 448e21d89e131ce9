"""Many assets: executors, the cache, and workers that die."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import prolate
from conftest import HALF_A, box_mesh
from prolate import Asset


def write_obj(path, vertices, faces):
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture
def folder(tmp_path):
    """Three boxes as files, one of them twice, and a file that is no mesh."""
    for i, scale in enumerate((1, 2, 3)):
        write_obj(tmp_path / f"box{i}.obj", *box_mesh(HALF_A * scale))
    write_obj(tmp_path / "twin.obj", *box_mesh(HALF_A))
    (tmp_path / "broken.obj").write_text("v 1 2\n")
    return tmp_path


def assets(folder):
    names = ["box0", "box1", "broken", "box2", "twin", "absent"]
    return [Asset(folder / f"{name}.obj", {"levels": 1, "quality": "fast", "threads": 1}) for name in names]


def check(results, cached):
    assert [result.tree is not None for result in results] == [True, True, False, True, True, False]
    assert results[0].tree == results[4].tree
    assert "broken" in str(results[2].error) and "absent" in str(results[5].error)
    assert [result.cached for result in results if result.tree] == cached
    assert all(result.tree.info.proved for result in results if result.tree)


def test_here_and_in_a_cache(folder):
    seen = []
    results = prolate.bake_many(assets(folder), cache=folder / "cache", progress=lambda *p: seen.append(p))
    check(results, [False, False, False, True])
    assert seen[-1] == (6, 6) and len(list((folder / "cache").glob("*.etree"))) == 3
    again = prolate.bake_many(assets(folder), cache=folder / "cache")
    check(again, [True] * 4)
    assert [r.tree for r in again] == [r.tree for r in results]


@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_executors(folder, kind):
    make = ThreadPoolExecutor(2) if kind == "threads" else ProcessPoolExecutor(2, mp_context=get_context("spawn"))
    with make as executor:
        check(prolate.bake_many(assets(folder), executor=executor), [False, False, False, True])


def test_arrays_share_the_cache_with_files(folder):
    vertices, faces = box_mesh(HALF_A)
    options = {"levels": 1, "quality": "fast"}
    first = prolate.bake_many([Asset((vertices, faces), options)], cache=folder / "cache")
    file = prolate.bake_many([Asset(folder / "box0.obj", options)], cache=folder / "cache")
    assert not first[0].cached and file[0].cached and file[0].tree == first[0].tree
    other = prolate.bake_many(
        [Asset((vertices, faces), {"levels": 1, "quality": "fast", "seed": 5})], cache=folder / "cache"
    )
    assert not other[0].cached


def test_damaged_entries_are_baked_again(folder):
    prolate.bake_many(assets(folder)[:1], cache=folder / "cache")
    (entry,) = (folder / "cache").glob("*.etree")
    entry.write_bytes(entry.read_bytes()[:-5])
    assert not prolate.bake_many(assets(folder)[:1], cache=folder / "cache")[0].cached
    assert prolate.load(entry).info.proved


def test_the_command_shares_the_cache(folder):
    from prolate import _command

    if not os.path.exists(_command._EXECUTABLE):
        pytest.skip("built without the command")
    prolate.bake_many([Asset(folder / "box0.obj", {"exact": True})], cache=folder / "cache")
    done = subprocess.run(
        [
            _command._EXECUTABLE,
            "bake",
            folder / "box0.obj",
            "-o",
            folder / "out.etree",
            "--exact",
            "--cache",
            folder / "cache",
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "cache" in done.stderr


def test_nonsense_is_refused():
    with pytest.raises(TypeError, match="assets: int"):
        prolate.bake_many([3])
    (result,) = prolate.bake_many([Asset(box_mesh(), {"levles": 2})])
    assert result.tree is None and "levles" in str(result.error)


def slow_mesh(i):
    """Takes some seconds to bake."""
    rng = np.random.default_rng(i)
    parts = [box_mesh(rng.uniform(0.1, 0.5, 3), rng.uniform(-2, 2, 3)) for _ in range(8)]
    vertices = np.vstack([v for v, _ in parts])
    return vertices, np.vstack([f + 8 * k for k, (_, f) in enumerate(parts)])


def test_dask_loses_nothing_when_a_worker_dies(tmp_path):
    """Half-way, a worker is killed. All assets are done; what was finished before is not baked again."""
    distributed = pytest.importorskip("distributed")
    import dask

    cache, log = tmp_path / "cache", tmp_path / "log"
    todo = [Asset(slow_mesh(i), {"levels": 2, "quality": "fast", "threads": 1}) for i in range(6)]
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 5, "temporary-directory": str(log)}),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        before = {}

        def kill(done, count):
            if done == 2:
                before.update({entry: entry.stat().st_mtime_ns for entry in cache.glob("*.etree")})
                os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)

        results = prolate.bake_many(todo, executor=client.get_executor(), cache=cache, progress=kill)
    assert [result.error for result in results] == [None] * 6
    assert len(before) >= 2 and len(list(cache.glob("*.etree"))) == 6
    assert all(entry.stat().st_mtime_ns == written for entry, written in before.items())
    assert all(result.tree.verify(*asset.mesh) for result, asset in list(zip(results, todo))[:2])


def test_a_pool_that_breaks_keeps_what_is_done(tmp_path):
    todo = [Asset(slow_mesh(i), {"levels": 2, "quality": "fast", "threads": 1}) for i in range(3)]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:

        def kill(done, count):
            if done == 1:
                for pid in list(executor._processes):
                    os.kill(pid, signal.SIGKILL)

        results = prolate.bake_many(todo, executor=executor, cache=tmp_path, progress=kill)
    assert sum(result.tree is not None for result in results) >= 1
    assert all((result.tree is None) != (result.error is None) for result in results)
    again = prolate.bake_many(todo, cache=tmp_path)
    assert all(a.cached for a, r in zip(again, results) if r.tree) and all(a.tree for a in again)


def test_killed_while_it_saves_leaves_no_part(tmp_path):
    """A process that writes trees again and again is killed at arbitrary moments."""
    program = (
        "import sys, prolate\nsys.path.insert(0, sys.argv[2])\nfrom conftest import *\n"
        "t = [prolate.bake(*box_mesh(HALF_A), exact=True), prolate.bake(*box_mesh(HALF_B), levels=1, quality='fast')]\n"
        "print('go', flush=True)\nwhile True:\n    for tree in t: tree.save(sys.argv[1])\n"
    )
    path = tmp_path / "tree.etree"
    for wait in (0.001, 0.01, 0.05):
        process = subprocess.Popen(
            [sys.executable, "-c", program, str(path), os.path.dirname(__file__)], stdout=subprocess.PIPE
        )
        assert process.stdout.readline() == b"go\n"
        time.sleep(wait)
        process.kill()
        process.wait()
        assert not path.exists() or prolate.load(path).info.proved
