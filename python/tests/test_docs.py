"""The programs of docs/python.md, docs/robots.md and README.md."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from prolate import _command

ROOT = Path(__file__).parents[2]
MODELS = Path("/usr/share/glmark2/models")

needs_models = pytest.mark.skipif(not MODELS.exists(), reason="Debian's package glmark2-data is not installed")


def programs(document):
    return re.findall(r"^```python\n(.*?)^```", (ROOT / document).read_text(), re.MULTILINE | re.DOTALL)


def run(document):
    """All blocks, one after the other, in one namespace."""
    known = {"__name__": "__main__"}
    for block in programs(document):
        exec(compile(block, document, "exec"), known)


@needs_models
def test_python_md(tmp_path, monkeypatch, capsys):
    pytest.importorskip("PIL")
    pytest.importorskip("tqdm")
    if not os.path.exists(_command._EXECUTABLE):
        pytest.skip("built without the command")
    monkeypatch.chdir(tmp_path)
    run("docs/python.md")
    for picture in re.findall(r"^!\[.*\]\((.*\.png)\)", (ROOT / "docs/python.md").read_text(), re.MULTILINE):
        assert (tmp_path / picture).exists() and (ROOT / "docs" / picture).exists()
    if folder := os.environ.get("PROLATE_PICTURES"):
        for picture in tmp_path.glob("*.png"):
            picture.rename(Path(folder) / picture.name)
    print(capsys.readouterr().out)


def test_robots_md(tmp_path, monkeypatch):
    pytest.importorskip("lxml")
    pytest.importorskip("scipy")
    monkeypatch.chdir(tmp_path)
    run("docs/robots.md")


@needs_models
def test_readme(tmp_path, monkeypatch):
    assert len(programs("README.md")) == 1
    monkeypatch.chdir(tmp_path)
    run("README.md")
