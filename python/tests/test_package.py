"""The command, pictures, exports, and where the package refuses to run."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import prolate
from conftest import HALF_A, box_mesh
from prolate import _command

needs_command = pytest.mark.skipif(not os.path.exists(_command._EXECUTABLE), reason="built without the command")


@needs_command
def test_exports(tmp_path, cover):
    for kind in ("csv", "json", "ply", "obj", "glb", "pov"):
        cover.export(tmp_path / f"cover.{kind}", level=-2)
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


@pytest.mark.skipif(sys.version_info < (3, 12), reason="isolated interpreters came with 3.12")
def test_subinterpreters_are_refused():
    program = (
        "try:\n    import _interpreters as x\nexcept ImportError:\n    import _xxsubinterpreters as x\n"
        "i = x.create()\nprint(x.run_string(i, 'import prolate'))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert "does not support loading in subinterpreters" in done.stdout + done.stderr
