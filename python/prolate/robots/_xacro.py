"""Expands xacro, where that is installed."""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import ModuleType

from .._errors import Error
from ._meshes import Packages
from ._xml import library

_EXPANDING = threading.Lock()  # xacro keeps what it works on in globals


def expand_xacro(path: Path, arguments: Mapping[str, str], packages: Packages) -> bytes:
    """The URDF that a xacro file makes. ``$(find ...)`` leads to the folders of ``packages``."""
    xacro = library("xacro", f"{path}")
    try:
        with _EXPANDING, _found_by(packages):
            return bytes(xacro.process_file(str(path), mappings=dict(arguments)).toprettyxml(encoding="utf-8"))
    except Exception as error:  # whatever macros and the Python in them raise
        raise Error(f"{path}: xacro: {error}", "bad_file") from None


@contextlib.contextmanager
def _found_by(packages: Packages) -> Iterator[None]:
    """xacro asks the module ament_index_python of ROS 2 where packages are, and imports it when it does."""
    index, inside = ModuleType("ament_index_python"), ModuleType("ament_index_python.packages")
    inside.__dict__["get_package_share_directory"] = lambda name: str(packages.folder(name, f"$(find {name})"))
    index.__dict__["packages"] = inside
    stand_ins = {one.__name__: one for one in (index, inside)}
    real = {name: sys.modules[name] for name in stand_ins if name in sys.modules}
    sys.modules.update(stand_ins)
    try:
        yield
    finally:
        for name in stand_ins:
            del sys.modules[name]
        sys.modules.update(real)
