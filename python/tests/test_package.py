"""The command, pictures, exports, and where the package refuses to run."""

from __future__ import annotations

import inspect
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import prolate
from conftest import HALF_A, box_mesh
from prolate import _command

REQUIREMENTS = Path(__file__).parents[1] / "requirements.cmake"
needs_command = pytest.mark.skipif(not os.path.exists(_command._EXECUTABLE), reason="built without the command")


@needs_command
def test_pictures_of_what_deforms(tmp_path):
    vertices, faces = box_mesh(HALF_A)
    lean = np.zeros((1, *np.shape(vertices)))
    lean[0, :, 0] = np.asarray(vertices)[:, 2]
    tree = prolate.bake(vertices, faces, ellipsoids=4, quality="fast", threads=1)
    moving = tree.with_modes(vertices, faces, modes=lean, ranges=[0.5])
    np.savez(tmp_path / "modes.npz", modes=lean, ranges=[0.5])
    small = {"size": (300, 100), "levels": [1], "samples": 16, "style": "overlay"}
    one = moving.render((vertices, faces), at=[0.5], modes=tmp_path / "modes.npz", **small)
    both = moving.render((vertices, faces), at=[[0.5], [-0.5]], modes=tmp_path / "modes.npz", **small)
    assert one.shape == both.shape == (100, 300, 3) and (one != both).any()
    with pytest.raises(prolate.Error, match="range"):
        moving.render(at=[0.6], **small)
    with pytest.raises(ValueError, match="at:"):
        moving.render(at=[[[0.5]]], **small)


@needs_command
def test_exports(tmp_path, cover):
    for kind in ("csv", "json", "ply", "obj", "glb", "pov"):
        cover.export(tmp_path / f"cover.{kind}", level=-2, view=(-30, 20) if kind == "pov" else None)
    cut = cover.cut(1)
    rows = np.loadtxt(tmp_path / "cover.csv", delimiter=",", skiprows=1)
    assert np.array_equal(rows[:, 1:4], cut.center) and np.array_equal(rows[:, 4:7], cut.radii)
    assert np.array_equal(rows[:, 7:].reshape(-1, 3, 3), cut.rotation)
    nodes = json.loads((tmp_path / "cover.json").read_text())["nodes"]
    assert [node["node"] for node in nodes] == cut.node.tolist()
    (tmp_path / "mine.csv").write_text("mine")
    for bad in (tmp_path / "mine.csv", tmp_path / "cover.xyz", tmp_path / "no" / "cover.csv"):
        with pytest.raises(prolate.Error):
            cover.export(bad)
    assert (tmp_path / "mine.csv").read_text() == "mine"
    cover.export(tmp_path / "mine.csv", force=True)
    assert (tmp_path / "mine.csv").read_text().startswith("level,")


@needs_command
def test_render_and_view(cover):
    pytest.importorskip("PIL")
    mesh = box_mesh(HALF_A)
    picture = cover.render(mesh, size=(400, 300), samples=16, heat=True, view=(30, 20))
    assert picture.shape == (300, 400, 3) and picture.dtype == np.uint8 and len(np.unique(picture)) > 50
    assert (cover.render(size=(200, 150), levels=[0], samples=16) != 255).any()
    with pytest.raises(prolate.Error, match="heat"):
        cover.render(heat=True)
    page = cover.view(mesh)
    assert page.startswith("<!") and "</html>" in page
    assert "iframe" in cover._repr_html_()


@needs_command
def test_the_command_runs():
    done = subprocess.run([_command._EXECUTABLE, "--version"], capture_output=True, text=True, check=True)
    assert prolate.__version__ in done.stdout


def test_versions_agree():
    major, minor, patch = (int(part) for part in prolate.__version__.split("."))
    assert prolate._core.LIBRARY_VERSION == 10000 * major + 100 * minor + patch


def test_importing_is_light():
    """No numpy, and nothing else that takes long, before it is needed."""
    program = "import sys, prolate; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    assert not {"numpy", "subprocess", "concurrent.futures", "pickle", "json", "dataclasses", "PIL"} & set(loaded)


def test_every_public_name_is_documented():
    for name in prolate.__all__:
        thing = getattr(prolate, name)
        assert name.startswith("__") or (thing.__doc__ and len(thing.__doc__) > 30), name


def test_subinterpreters_are_refused():
    code = f"import sys; sys.path[:] = {sys.path}; import prolate"
    program = (
        "try:\n    import _interpreters as x\nexcept ImportError:\n    import _xxsubinterpreters as x\n"
        f"i = x.create()\nprint(x.run_string(i, {code!r}))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=60)
    assert "does not support loading in subinterpreters" in done.stdout + done.stderr


@pytest.mark.skipif(not (shutil.which("cmake") and REQUIREMENTS.exists()), reason="no CMake, or no sources")
@pytest.mark.parametrize("free", [0, 1])
def test_free_threaded_python_is_refused_when_built(tmp_path, free):
    (tmp_path / "sitecustomize.py").write_text(
        f"import sysconfig; sysconfig.get_config_vars()['Py_GIL_DISABLED'] = {free}"
    )
    python = tmp_path / "python"
    python.write_text(f'#!/bin/sh\nPYTHONPATH={tmp_path} exec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    done = subprocess.run(
        ["cmake", f"-DPython_EXECUTABLE={python}", "-P", REQUIREMENTS], capture_output=True, text=True, check=False
    )
    assert ("free-threaded" in done.stderr and done.returncode != 0) == bool(free)


@needs_command
def test_the_command_and_bake_have_the_same_options():
    help_ = subprocess.run([_command._EXECUTABLE, "bake", "--help"], capture_output=True, text=True, check=True).stdout
    known = {name.replace("-", "_") for name in re.findall(r"^ +(?:-\w,)?--([a-z-]+)", help_, re.MULTILINE)}
    # Files, the console, and what bake_many(), Tree.with_modes() and Tree.with_skin() have.
    known -= {"help", "quiet", "output", "report", "json", "force", "manifest", "cache", "rebake"}
    known -= {"modes", "range", "skin"}
    assert set(inspect.signature(prolate.bake).parameters) == known | {"vertices", "faces", "progress"}


@needs_command
def test_pictures_and_exports_have_the_options_of_the_command():
    for word, method, other in (
        ("export", prolate.Tree.export, {"output", "format"}),
        ("render", prolate.Tree.render, {"output", "mesh", "unit", "scale", "recentre", "weld", "no_shadow", "force"}),
    ):
        done = subprocess.run([_command._EXECUTABLE, word, "--help"], capture_output=True, text=True, check=True)
        known = {name.replace("-", "_") for name in re.findall(r"^ +(?:-\w,)?--([a-z-]+)", done.stdout, re.MULTILINE)}
        assert known - other - {"help", "quiet"} <= set(inspect.signature(method).parameters)
