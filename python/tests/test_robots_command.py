"""The command prolate-robot."""

from __future__ import annotations

import json

import numpy as np
import pytest
from robot_files import TETRAHEDRON

pytest.importorskip("lxml")
from prolate.robots._command import main

pytestmark = pytest.mark.usefixtures("own_folder")

ROBOT = """<robot name="r">
<link name="a"><collision><geometry><mesh filename="package://parts/part.obj" scale="1 1 2"/></geometry></collision>
<inertial><mass value="1.5"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<link name="b"><collision><geometry><sphere radius="0.5"/></geometry></collision></link>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>
<gazebo/></robot>"""


@pytest.fixture
def robot(tmp_path):
    (tmp_path / "robot.urdf").write_text(ROBOT)
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "part.obj").write_text(TETRAHEDRON)
    return tmp_path / "robot.urdf"


def test_info_says_what_is_there(robot, capsys):
    assert main(["info", str(robot), "--package", f"parts={robot.parent / 'here'}"]) == 0
    out, err = capsys.readouterr()
    assert "r: urdf, 2 links, 1 joints, 1 coordinates" in out and "a: root, 1.5 kg" in out
    assert "mesh part.obj 4 triangles, 1 x 2 x 6 m" in out and "b: j (continuous) of a" in out
    assert "sphere radius=0.5" in out and f"{robot}:6: <gazebo> in <robot> is not understood" in err


def test_info_names_what_is_missing_and_goes_on(robot, capsys):
    assert main(["info", str(robot), "--quiet"]) == 1
    out, err = capsys.readouterr()
    assert "2 links" in out and err.startswith(f"error: {robot}:2: link a: ") and "--package parts=FOLDER" in err
    assert err.count("\n") == 1
    assert main(["info", str(robot), "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert [link["name"] for link in said["links"]] == ["a", "b"] and said["coordinates"] == 1
    assert [(note["kind"], note["link"], note["line"]) for note in said["notes"]] == [
        ("info", "", 6),
        ("error", "a", 2),
    ]


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["info", "none.urdf"], 4, "none.urdf: No such file"),
        (["info", "bad.urdf"], 3, "bad.urdf:1: is not XML"),
        (["info"], 2, "required: robot"),
        (["inform", "r"], 2, "invalid choice"),
        (["info", "r", "--package", "parts"], 2, "must have the form NAME=..."),
        (["info", "r", "--dae-unit", "maybe"], 2, "invalid choice"),
    ],
)
def test_exit_codes(tmp_path, monkeypatch, capsys, words, code, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.urdf").write_text("no")
    try:
        assert main(words) == code
    except SystemExit as exit:
        assert exit.code == code
    assert said in capsys.readouterr().err


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """Of all tests, so that each cover is made once."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def bodies(tmp_path, monkeypatch, cache):
    """A robot of a primitive, which is its own cover, and a mesh that is convex."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.obj").write_text(TETRAHEDRON)
    (tmp_path / "robot.urdf").write_text(ROBOT.replace("package://parts/", ""))


def test_bake_covers_and_keeps_what_it_did(bodies, cache, capsys):
    pytest.importorskip("scipy")
    assert main(["bake", "robot.urdf", "--clearance", "5mm"]) == 0
    table = capsys.readouterr().out
    assert [line.split()[0] for line in table.splitlines()] == ["link", "a", "b"] and table.count("yes") == 2
    assert list((cache / "prolate" / "robots").iterdir())
    assert main(["bake", "robot.urdf", "--clearance", "0.005"]) == 0 and capsys.readouterr().out == table


def test_links_of_the_same_mesh_share_what_is_kept(bodies, tmp_path, capsys):
    pytest.importorskip("scipy")
    text = (tmp_path / "robot.urdf").read_text()
    mesh = '<mesh filename="part.obj" scale="1 1 2"/>'
    (tmp_path / "robot.urdf").write_text(text.replace('<sphere radius="0.5"/>', mesh))
    for goal in (["--clearance", "0.005"], ["--ellipsoids", "20", "--only", "hull"]):
        for _ in range(2):
            assert main(["bake", "robot.urdf", *goal]) == 0
            rows = [line.split() for line in capsys.readouterr().out.splitlines()[1:]]
            assert [row[0] for row in rows] == ["a", "b"] and rows[0][1:] == rows[1][1:]


@pytest.mark.parametrize(
    ("words", "begins"),
    [
        (["-o", "out.xml"], "<mujoco"),
        (["-o", "out.sdf"], "<sdf"),
        (["-o", "out.urdf"], "<robot"),
        (["-o", "out", "--to", "drake"], "<robot"),
        (["-o", "out.yaml", "--only", "spheres"], "collision_spheres"),
    ],
)
def test_convert_writes_each_format(bodies, tmp_path, capsys, words, begins):
    pytest.importorskip("scipy")
    assert main(["convert", "robot.urdf", *words]) == 0
    assert begins in (tmp_path / words[1]).read_text()
    assert "proved" in capsys.readouterr().out


def test_convert_writes_nothing_if_a_link_fails(bodies, tmp_path, capsys):
    pytest.importorskip("scipy")
    assert main(["convert", "robot.urdf", "-o", "out.foo"]) == 2
    assert "say which with --to" in capsys.readouterr().err
    (tmp_path / "part.obj").unlink()
    assert main(["convert", "robot.urdf", "-o", "out.xml"]) == 1
    said = capsys.readouterr().err
    assert "part.obj" in said and "out.xml: not written" in said
    assert not (tmp_path / "out.xml").exists()


def test_view_writes_a_page(bodies, tmp_path):
    pytest.importorskip("scipy")
    assert main(["view", "robot.urdf", "-o", "robot.html"]) == 0
    assert "<html" in (tmp_path / "robot.html").read_text()


def test_render_draws_a_picture(bodies, tmp_path, capsys):
    pytest.importorskip("scipy")
    image = pytest.importorskip("PIL.Image")
    words = ["render", "robot.urdf", "-o", "robot.png", "--size", "120,90", "--from=-30,10"]
    assert main([*words, "--q=-0.5"]) == 0
    picture = np.asarray(image.open(tmp_path / "robot.png"))
    assert picture.shape == (90, 120, 3) and len(np.unique(picture.reshape(-1, 3), axis=0)) > 20
    assert main([*words, "--q=1,2,3,4,5,6,7"]) == 2
    assert "q" in capsys.readouterr().err


def test_touch_writes_srdf(bodies, tmp_path, capsys):
    pytest.importorskip("scipy")
    assert main(["touch", "robot.urdf", "--samples", "100", "-o", "robot.srdf"]) == 0
    assert "0 pairs, beside 1 of neighbours, in 100 samples" in capsys.readouterr().out
    assert 'link1="a" link2="b" reason="Adjacent"' in (tmp_path / "robot.srdf").read_text()
    assert main(["info", "robot.urdf", "--srdf", "robot.srdf"]) == 0
    assert "1 pairs of links are never in contact" in capsys.readouterr().out


def test_options_that_exclude_each_other(bodies, capsys):
    with pytest.raises(SystemExit) as exit:
        main(["bake", "robot.urdf", "--ellipsoids", "20", "--exact"])
    assert exit.value.code == 2
    assert main(["bake", "robot.urdf", "--clearance", "5miles"]) == 2
    assert "--clearance: must be metres" in capsys.readouterr().err
