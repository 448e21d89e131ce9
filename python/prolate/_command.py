"""The command ``prolate`` that comes with the package, and what is done by it."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NoReturn

from ._errors import Error, ErrorCode, path_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ._tree import Tree

_EXECUTABLE = os.path.join(os.path.dirname(__file__), "bin", "prolate")
_CODES: dict[int, ErrorCode] = {2: "bad_options", 3: "bad_mesh", 4: "io", 5: "internal"}


def main() -> NoReturn:
    """The command, as the console sees it."""
    if not os.path.exists(_EXECUTABLE):
        sys.exit("prolate: this installation was built without the command (PROLATE_BUILD_CLI)")
    os.execv(_EXECUTABLE, ["prolate", *sys.argv[1:]])


def _run(arguments: list[str]) -> bytes:
    """What the command prints; its error as an Error."""
    if not os.path.exists(_EXECUTABLE):
        raise Error("this installation was built without the command (PROLATE_BUILD_CLI)", "unsupported")
    done = subprocess.run(
        [_EXECUTABLE, *arguments, "--quiet"], stdin=subprocess.DEVNULL, capture_output=True, check=False
    )
    if done.returncode == 0:
        return done.stdout
    text = done.stderr.decode(errors="replace").strip()
    with contextlib.suppress(json.JSONDecodeError, KeyError):
        said = json.loads(text)["error"]
        text = f"{said['subject']}: {said['what']}"
    raise Error(text.removeprefix("prolate: ").removeprefix("error: "), _CODES.get(done.returncode, "internal"))


@contextlib.contextmanager
def _files(tree: Tree, mesh: Any) -> Iterator[list[str]]:
    """The tree, and the mesh if there is one, as files."""
    with tempfile.TemporaryDirectory(prefix="prolate-") as folder:
        tree_path = os.path.join(folder, "tree.etree")
        tree.save(tree_path)
        if mesh is None:
            yield [tree_path]
        elif isinstance(mesh, (str, os.PathLike)):
            yield [tree_path, os.path.abspath(path_of("mesh", mesh))]  # "-" would be standard input
        else:
            mesh_path = os.path.join(folder, "mesh.ply")
            _write_ply(mesh_path, mesh)
            yield [tree_path, mesh_path]


def _write_ply(path: str, mesh: Any) -> None:
    """Binary PLY, with doubles, in the frame of the mesh's file."""
    import numpy as np

    from ._mesh import Mesh, arrays_of

    vertices, faces = arrays_of(mesh)
    points = np.asarray(vertices, dtype=np.float64)
    if isinstance(mesh, Mesh):
        points = (points + mesh.origin) / mesh.scale
    triangles = np.empty(len(faces), dtype=[("count", "u1"), ("index", "<u4", 3)])
    triangles["count"] = 3
    triangles["index"] = faces
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\nproperty double x\nproperty double y\n"
        f"property double z\nelement face {len(triangles)}\nproperty list uchar uint vertex_indices\nend_header\n"
    )
    with open(path, "wb") as file:
        file.write(header.encode())
        file.write(np.ascontiguousarray(points, dtype="<f8").tobytes())
        file.write(triangles.tobytes())


def flags(**given: object) -> list[str]:
    """Options as the command reads them; None and False are left out, and so it has its own defaults."""
    out = []
    for name, value in given.items():
        many = ",".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
        if value is not None and value is not False:
            out.append("--" + name.replace("_", "-") + ("" if value is True else "=" + many))
    return out


def run_on(tree: Tree, word: str, more: list[str], options: list[str]) -> bytes:
    """``prolate WORD TREE MORE... OPTIONS``."""
    with _files(tree, None) as files:
        return _run([word, *files, *more, *options])


def picture(tree: Tree, mesh: Any, options: list[str]) -> NDArray[np.uint8]:
    import io

    import numpy as np

    try:
        from PIL import Image
    except ImportError:
        raise Error("Tree.render() needs Pillow: pip install pillow", "unsupported") from None
    with _files(tree, mesh) as files:
        png = _run(["render", *files, "-o", "-", *options])
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


def page(tree: Tree, mesh: Any) -> str:
    with _files(tree, mesh) as files:
        return _run(["view", *files, "-o", "-"]).decode()
