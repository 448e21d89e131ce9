"""Meshes as they come: arrays, files, and objects of other libraries."""

from __future__ import annotations

import contextlib
import math
import os
import re
from typing import TYPE_CHECKING, Any, NamedTuple, Union

from . import _core
from ._errors import path_of, truth

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

Placement = tuple[tuple[float, float, float], tuple[float, float, float]]

UNITS = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254, "ft": 0.3048}
_MOST_ROUNDING = 1e-5  # of the mesh's diagonal, as in the C++ readers


class Mesh(NamedTuple):
    """A triangle mesh as :func:`load_mesh` reads it.

    Attributes
    ----------
    vertices : float32 (V, 3)
        Metres, relative to ``origin``.
    faces : uint32 (F, 3)
        Counter-clockwise seen from outside.
    scale, origin : tuple of 3 floats
        ``vertices = scale * file - origin``, axis by axis.
    notes : list of str
        What the file states, and what was done about it.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    notes: list[str] = []


def metres(unit: Union[str, float, None]) -> float | None:
    """The unit's length in metres."""
    if unit is None:
        return None
    if isinstance(unit, str):
        if unit not in UNITS:
            raise ValueError(f"unit: must be one of {', '.join(UNITS)}, or a length in metres; not {unit!r}")
        return UNITS[unit]
    try:
        step = float(unit)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"unit: must be one of {', '.join(UNITS)}, or a length in metres; not {unit!r}") from None
    if not (step > 0 and math.isfinite(step)):
        raise ValueError("unit: must be above 0")
    return step


_LENGTH = re.compile(r"\s*([^a-z\s]+(?:e[^a-z\s]+)?)\s*([a-z]+)\s*")


def length(name: str, value: Union[str, float, None]) -> float | None:
    """Metres of a number of metres, or of a text such as ``"5mm"``."""
    if not isinstance(value, str):
        return value  # which _core looks at
    found = _LENGTH.fullmatch(value)
    with contextlib.suppress(KeyError, ValueError):
        if found is not None:
            return float(found[1]) * UNITS[found[2]]
    raise ValueError(f'{name}: must be metres, or a text such as "5mm" ({", ".join(UNITS)}); not {value!r}')


def factors(scale: ArrayLike | None) -> tuple[float, float, float]:
    """One factor for each axis."""
    import numpy as np

    if scale is None:
        return 1.0, 1.0, 1.0
    try:
        row = np.asarray(scale, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise TypeError("scale: must be a number, or three") from None
    if row.shape not in ((), (3,)) or not np.isfinite(row).all() or (row == 0).any():
        raise ValueError("scale: must be one number or three, finite, none of them 0")
    x, y, z = np.broadcast_to(row, 3).tolist()
    return x, y, z


def load_mesh(
    path: Union[str, os.PathLike[str]],
    *,
    unit: Union[str, float, None] = None,
    scale: ArrayLike | None = None,
    recentre: bool = False,
) -> Mesh:
    """Read OBJ, PLY, STL, OFF, glTF, GLB, 3MF, 3DS or DAE; polygons are cut into triangles exactly.

    Parameters
    ----------
    path : path-like
    unit : {"mm", "cm", "m", "in", "ft"} or float, optional
        The file's unit, or its length in metres. By default what the format defines (3MF, glTF), else metres.
    scale : float or (3,), optional
        Further factors along the axes; an odd number of negative ones mirrors.
    recentre : bool
        Move the mesh near (0, 0, 0), in double precision, as one at map coordinates needs.

    Returns
    -------
    Mesh

    Raises
    ------
    Error
        ``code`` is ``"io"``, ``"bad_file"``, ``"bad_mesh"`` or ``"out_of_memory"``; the message says what and where.
    ValueError, TypeError
        For an option.
    """
    vertices, faces, (by, origin), notes, _ = _core.load_mesh(
        os.fsencode(path_of("path", path)),
        metres(unit),
        None if scale is None else factors(scale),
        truth("recentre", recentre),
    )
    return Mesh(vertices, faces, by, origin, notes)


def arrays_of(mesh: Any) -> tuple[Any, Any]:
    """``(vertices, faces)`` of a mesh object of trimesh, Open3D or MeshLab."""
    if isinstance(mesh, Mesh):
        return mesh.vertices, mesh.faces
    if isinstance(mesh, tuple):
        if len(mesh) != 2:
            raise TypeError(f"mesh: a tuple must be (vertices, faces), not of length {len(mesh)}")
        return mesh[0], mesh[1]
    if hasattr(mesh, "geometry") and hasattr(mesh, "to_mesh"):
        raise TypeError("mesh: is a scene; make one mesh of it with to_mesh()")
    try:
        arrays = _foreign(mesh)
    except Exception as error:  # whatever other libraries raise, of a mesh without vertices, say
        raise ValueError(f"mesh: {type(mesh).__name__} does not give its vertices and faces: {error}") from None
    if arrays is None:
        raise TypeError(
            f"mesh: {type(mesh).__name__} has neither vertices and faces, nor what Open3D or MeshLab call them; "
            "give (vertices, faces)"
        )
    return arrays


def viewed(name: str, array: Any) -> Any:
    """What other libraries' arrays hold, as numpy's, without a copy where they allow it; all else as it is."""
    import numpy as np

    if isinstance(array, (np.ndarray, list, tuple)):
        return array
    try:
        if hasattr(array, "__array__"):
            return np.asarray(array)
        return np.from_dlpack(array) if hasattr(array, "__dlpack__") else array
    except Exception as error:  # of a GPU, say
        raise TypeError(f"{name}: cannot be read from here: {error}") from None


def _foreign(mesh: Any) -> tuple[Any, Any] | None:
    import numpy as np

    if hasattr(mesh, "current_mesh"):  # pymeshlab.MeshSet
        mesh = mesh.current_mesh()
    if hasattr(mesh, "vertex_matrix") and hasattr(mesh, "face_matrix"):  # pymeshlab.Mesh
        return mesh.vertex_matrix(), mesh.face_matrix()
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):  # trimesh.Trimesh
        return np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if hasattr(mesh, "vertices") and hasattr(mesh, "triangles"):  # open3d.geometry.TriangleMesh
        return np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):  # open3d.t.geometry.TriangleMesh
        return mesh.vertex.positions.numpy(), mesh.triangle.indices.numpy()
    return None


def placed(
    vertices: Any, faces: Any, scale: tuple[float, float, float], origin: Any
) -> tuple[Any, Any, Placement | None]:
    """Scales and moves a mesh in double precision. ``origin``: a point, or True for one near the mesh's middle.

    Returns vertices, faces and what was done; the arrays themselves if nothing was.
    """
    import numpy as np

    vertices, faces = viewed("vertices", vertices), viewed("faces", faces)
    is_array = isinstance(vertices, np.ndarray)
    if scale == (1.0, 1.0, 1.0) and origin is False and is_array and vertices.dtype == np.float32:
        return vertices, faces, None
    try:
        points = np.asarray(vertices, dtype=np.float64)
    except (TypeError, ValueError):
        raise TypeError("vertices: cannot be taken as an array of float64") from None
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        return vertices, faces, None  # which _core refuses by name
    points = points * scale if scale != (1.0, 1.0, 1.0) else points
    used = _used(points, faces)
    if used.size == 0:
        return vertices, faces, None
    low, high = used.min(axis=0), used.max(axis=0)
    diagonal = float(np.linalg.norm(high - low))
    if origin is True:
        step = 2.0 ** (math.floor(math.log2(diagonal)) - 1) if diagonal > 0 else 0.0
        origin = np.round((low + high) / 2 / step) * step if step > 0 else np.zeros(3)
    at = np.zeros(3) if origin is False else np.asarray(origin, dtype=np.float64)
    points = points - at if at.any() else points
    largest = float(np.abs(points).max())
    if largest < 3e38 and diagonal > 0 and float(np.spacing(np.float32(largest))) > _MOST_ROUNDING * diagonal:
        raise ValueError(
            "vertices: the mesh lies too far from (0, 0, 0) for single precision; "
            "give it a local origin with recentre=True"
        )
    if np.prod(scale) < 0:
        faces = np.asarray(faces)[:, ::-1]
    placement = (scale, (float(at[0]), float(at[1]), float(at[2])))
    return points, faces, placement if placement != ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)) else None


def _used(points: Any, faces: Any) -> Any:
    """The vertices that faces use; all of them if that cannot be told."""
    import numpy as np

    try:
        index = np.asarray(faces)
        return points[np.unique(index)] if index.dtype.kind in "iu" and index.size and index.min() >= 0 else points
    except (IndexError, TypeError, ValueError):
        return points
