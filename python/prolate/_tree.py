"""Ellipsoid trees."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Optional, Union

from . import _core
from ._errors import Error, check_callable, path_of, truth
from ._info import Asked, Diagnosis, Ellipsoids, LevelInfo, LevelProof, Mass, Proof, TreeInfo
from ._mesh import Mesh, arrays_of, placed

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

Progress = Optional[Callable[[str, float, int], object]]


class Tree(_core.Tree):
    """An ellipsoid tree: a hierarchy of ellipsoids, each level of which covers a solid.

    :func:`bake`, :func:`load` and :meth:`from_bytes` make trees. A tree is immutable, may be shared by threads, pickled
    and copied, and equals a tree of the same bytes.
    """

    __slots__ = ("_hash", "_report")
    _report: dict[str, Any] | None
    _hash: int | None

    def __init__(self, buffer: object, check_hash: bool = True) -> None:
        super().__init__(_bytes_of(buffer), truth("check_hash", check_hash))
        self._report = None
        self._hash = None

    @classmethod
    def from_bytes(cls, buffer: object, *, check_hash: bool = True) -> Tree:
        """A tree over the bytes of an ``.etree`` file.

        Parameters
        ----------
        buffer : bytes-like
            Read where it lies, and kept alive, if it is read-only: ``bytes``, a read-only ``memoryview``, or
            ``mmap.mmap(..., access=mmap.ACCESS_READ)``, under which the file must not be cut short. What can be written
            to is copied first. A prefix of a file that ends where a level ends is a coarser tree.
        check_hash : bool
            Compare the content's hash, which finds every accidental change. Without, queries are still safe.

        Raises
        ------
        Error
            ``code`` is ``"bad_file"`` or ``"newer_version"``, ``where`` the byte of the first offence.
        TypeError, ValueError
            For what holds no bytes.
        """
        return cls(buffer, check_hash)

    # ---- bytes ----

    def __bytes__(self) -> bytes:
        return self.buffer.tobytes()

    def save(self, path: Union[str, os.PathLike[str]]) -> None:
        """Write the ``.etree`` file. An interruption leaves the old file or the new one, never a part.

        Raises
        ------
        Error
            ``code`` is ``"io"``, ``where`` the ``errno``.
        """
        _core.save(os.fsencode(path_of("path", path)), self)

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        import pickle

        data = pickle.PickleBuffer(self.buffer.data) if protocol >= 5 else bytes(self)
        return _restored, (data, self._report)

    def __copy__(self) -> Tree:
        return self

    def __deepcopy__(self, memo: object) -> Tree:
        return self

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Tree):
            return NotImplemented
        return self is other or self.buffer.data == other.buffer.data

    def __hash__(self) -> int:
        if self._hash is None:
            known = self.info_dict()
            self._hash = hash((known["bytes"], known["source_hash"], known["options_hash"]))
        return self._hash

    # ---- contents ----

    @property
    def info(self) -> TreeInfo:
        """What the tree says of itself: levels, closeness, volume, proof, how it was baked."""
        known = self.info_dict()
        levels = tuple(LevelInfo(**level) for level in known.pop("levels"))
        report = dict(self._report or {})
        hole_radius = report.pop("hole_radius", None)
        return TreeInfo(
            levels=levels,
            mass=Mass(**known.pop("mass")),
            asked=Asked(**known.pop("asked")),
            diagnosis=Diagnosis(**report) if report else None,
            hole_radius=hole_radius,
            **known,
        )

    def cut(self, level: int = -1) -> Ellipsoids:
        """The ellipsoids of a level, and of the leaves above it.

        Parameters
        ----------
        level : int
            0 is the root; negative ones count from the last, -1.

        Raises
        ------
        ValueError
            There is no such level.
        """
        return Ellipsoids(*self.cut_arrays(level))

    def prefix(self, level: int) -> Tree:
        """The coarser tree that ends with ``level``, over the same bytes. Of an exact tree it has no triangles."""
        return Tree(self.buffer[: self.level_end(level)])

    @property
    def inner(self) -> Tree | None:
        """The inner cover: a tree of ellipsoids inside the solid, proved. None if it was not asked for (``inner=``).

        It reads the same bytes. ``info.is_inner`` is true of it, and of each level the ``union_volume`` is known.
        """
        found = self.inner_range()
        return None if found is None else Tree(self.buffer[found[0] : found[1]], check_hash=False)

    @property
    def mesh(self) -> Mesh | None:
        """The triangles of an exact tree; None of others."""
        if not self.has_triangles:
            return None
        known = self.info_dict()
        return Mesh(*self.mesh_arrays(), scale=known["scale"], origin=known["origin"])

    def verify(self, mesh: Any, faces: Any = None, *, threads: int = 0, progress: Progress = None) -> Proof:
        """Prove that each level covers a mesh, from the tree's bytes and the mesh alone.

        Parameters
        ----------
        mesh : array (V, 3), or a mesh object
            The vertices, as they were given to :func:`bake`: they are scaled and moved as the tree remembers. Or what
            :func:`load_mesh` or :func:`bake_mesh` know; what ``load_mesh`` has read is taken as it is.
        faces : integer array (F, 3), optional
            With vertices.
        threads : int
            0 = all cores.
        progress : callable, optional
            As in :func:`bake`.

        Returns
        -------
        Proof

        Raises
        ------
        Error, ValueError, TypeError
            For a mesh that cannot be a solid or surface.
        """
        check_callable("progress", progress)
        as_read = isinstance(mesh, Mesh)
        vertices, triangles = (mesh, faces) if faces is not None else arrays_of(mesh)
        if not as_read:
            known = self.info_dict()
            origin = known["origin"] if any(known["origin"]) else False
            vertices, triangles, _ = placed(vertices, triangles, known["scale"], origin)
        report = _core.verify(self, vertices, triangles, None, threads, progress)
        report["levels"] = tuple(LevelProof(**level) for level in report["levels"])
        return Proof(**report)

    def with_modes(self, mesh: Any, faces: Any = None, *, modes: ArrayLike, ranges: ArrayLike) -> Tree:
        """The same tree with bounds of how its nodes move by modes, proved. :func:`collide_deformed` asks about it.

        At coordinates ``q`` vertex ``v`` is at ``vertices[v] + sum(q[m] * modes[m, v])``, and the nodes hold the mesh
        for all ``q`` with ``abs(q) <= ranges``. Other queries answer for the mesh at rest.

        Parameters
        ----------
        mesh, faces
            What the tree was baked from, as for :meth:`verify`.
        modes : array (M, V, 3)
            Displacements of the vertices by a unit of each of at most 64 modes, in the unit of the vertices. Rounded to
            float32. Vertices in one place must move alike.
        ranges : array (M,)
            Largest absolute values of the coordinates, above 0.

        Raises
        ------
        Error, ValueError, TypeError
            For modes of another number of vertices, or not finite; for another mesh; for ranges in which a node would
            grow a thousandfold; for a tree that has modes already, and one of a filled mesh.
        """
        import numpy as np

        try:
            displacements = np.asarray(modes, dtype=float)
        except (ValueError, TypeError) as error:
            raise type(error)(f"modes: {error}; give an array (M, V, 3)") from None
        vertices, triangles, placement = self._baked_from(mesh, faces)
        if not isinstance(mesh, Mesh) and displacements.ndim == 3 and displacements.shape[2] == 3:
            displacements = displacements * np.asarray(self.info_dict()["scale"])
        return Tree(_core.add_modes(self, vertices, triangles, placement, displacements, ranges))

    def with_skin(
        self, mesh: Any, faces: Any = None, *, joints: ArrayLike, weights: ArrayLike, bones: int | None = None
    ) -> Tree:
        """The same tree with bounds of how bones move its nodes, proved. :func:`collide_deformed` asks about it.

        With a matrix ``T[b]`` for each bone, vertex ``v`` is at ``sum(weights[v, i] * T[joints[v, i]] @ vertices[v])``
        over the sum of its weights (linear blend skinning), and the nodes hold the mesh for all matrices. Other queries
        answer for the mesh at rest. Modes (:meth:`with_modes`) move the vertices before bones do.

        Parameters
        ----------
        mesh, faces
            What the tree was baked from, as for :meth:`verify`.
        joints, weights : arrays (V, W)
            Which bones move each vertex, at most 8, and how much: at least 0, the sum 1 within 0.01. Weights are
            rounded to float32. A bone of weight 0 means nothing. Vertices in one place must move alike.
        bones : int, optional
            How many there are, at most 1024; by default, as many as ``joints`` names.

        Raises
        ------
        Error, ValueError, TypeError
            For weights of another number of vertices, below 0, not finite, or of another sum; for another mesh; for a
            tree that has a skin already, and one of a filled mesh.
        """
        import numpy as np

        try:
            which, much = np.asarray(joints), np.asarray(weights, dtype=float)
        except (ValueError, TypeError) as error:
            raise type(error)(f"weights: {error}; give an array (V, W)") from None
        if which.shape != much.shape or which.ndim != 2:
            raise ValueError(f"joints and weights: must both have shape (V, W), not {which.shape} and {much.shape}")
        which = np.where(much == 0, 0, which)
        if not np.issubdtype(which.dtype, np.integer) or which.size == 0 or not 0 <= which.min() <= which.max() < 1024:
            raise ValueError("joints: must be integers from 0 to 1023")
        count = int(which.max()) + 1 if bones is None else bones
        vertices, triangles, placement = self._baked_from(mesh, faces)
        return Tree(_core.add_skin(self, vertices, triangles, placement, which.astype(float), much, count))

    def _baked_from(self, mesh: Any, faces: Any) -> tuple[Any, Any, Any]:
        """Vertices, faces and placement of the mesh that the tree was baked from."""
        if isinstance(mesh, Mesh):
            return mesh.vertices, mesh.faces, (mesh.scale, mesh.origin)
        vertices, triangles = (mesh, faces) if faces is not None else arrays_of(mesh)
        known = self.info_dict()
        origin = known["origin"] if any(known["origin"]) else False
        return placed(vertices, triangles, known["scale"], origin)

    @property
    def bone_count(self) -> int:
        """How many bones move it; 0 without a skin."""
        return self.count_bones()

    @property
    def mode_ranges(self) -> NDArray[np.float32]:
        """How large the coordinates of :func:`collide_deformed` may be, one for each mode; empty without modes."""
        return self.mode_range_array()

    # ---- pictures and exports, by the command that comes with the package ----

    def export(
        self,
        path: Union[str, os.PathLike[str]],
        *,
        level: int | None = None,
        segments: int = 32,
        outer: bool | None = None,
        view: tuple[float, float] | None = None,
        up: str | None = None,
        force: bool = False,
    ) -> None:
        """Write the ellipsoids for other programs.

        Parameters
        ----------
        path : path-like
            Ends in ``.csv``, ``.json`` (full precision), ``.ply``, ``.obj`` (meshes), ``.glb`` (glTF) or ``.pov``.
        level : int, optional
            The cut at this level; negative ones count from the last. By default as ``prolate export --help`` says.
        segments : int
            Of meshes: 4 ... 256 along each section.
        outer : bool, optional
            Of meshes: triangles outside the ellipsoids, which then cover (``.ply`` and ``.obj`` by default), or corners
            on them.
        view, up
            Of ``.pov``: as in :meth:`render`.
        force : bool
            Replace files that prolate did not write, too.

        Raises
        ------
        Error
        """
        from . import _command

        if level is not None:
            self.level_end(level)  # is there one?
            level += self.level_count if level < 0 else 0
        options = _command.flags(
            output=os.path.abspath(path_of("path", path)), level=level, segments=segments, outer=outer is True,
            no_outer=outer is False, view=view, up=up, force=truth("force", force),
        )  # fmt: skip
        _command.run_on(self, "export", [], options)

    def render(
        self,
        mesh: Any = None,
        *,
        levels: list[int] | None = None,
        size: tuple[int, int] = (1600, 1200),
        view: tuple[float, float] | None = None,
        up: str | None = None,
        heat: bool = False,
        heat_top: float | None = None,
        section: str | None = None,
        at: ArrayLike | None = None,
        modes: str | os.PathLike[str] | None = None,
        style: str = "beside",
        samples: int | None = None,
        shadow: bool = True,
        threads: int = 0,
    ) -> NDArray[np.uint8]:
        """A picture of the tree, level by level; needs Pillow.

        Parameters
        ----------
        mesh : path, or what :func:`bake_mesh` takes, optional
            The mesh that the tree covers, to be shown as well.
        levels : list of int, optional
            By default 1, 2 and 3.
        size : (int, int)
            Width and height, pixels.
        view : (float, float), optional
            Azimuth and elevation of the viewer, degrees.
        up : {"x", "y", "z"}, optional
            The axis that points up.
        heat : bool
            Colour by how far the tree sticks out of the mesh.
        heat_top : float, optional
            The same, with a legend that ends at this many % of the diagonal.
        section : str, optional
            ``"z"`` or ``"z,0.4"``: cut open across an axis.
        at : array (M,) or (N, M), optional
            Coordinates of a tree with modes, within their ranges: it is shown there, too, beside rest.
        modes : path, optional
            The ``.npz`` that ``prolate bake --modes`` takes: the mesh then moves with the tree. Exact trees know it.
        style : {"beside", "overlay", "none"}
            Where the mesh is.
        samples : int, optional
            Light samples a pixel, 16 ... 1024.
        shadow : bool
            On the floor.
        threads : int
            0 = all cores.

        Returns
        -------
        uint8 array (height, width, 3)

        Raises
        ------
        Error
        """
        from . import _command

        options = _command.flags(
            mesh=style if mesh is not None else "none",
            size="x".join(map(str, size)) if isinstance(size, (list, tuple)) else size,
            levels=levels, view=view, up=up, heat=truth("heat", heat), heat_top=heat_top, section=section,
            samples=samples, no_shadow=not truth("shadow", shadow), threads=threads,
            modes=None if modes is None else os.path.abspath(path_of("modes", modes)),
        )  # fmt: skip
        for q in _rows("at", at):
            options += _command.flags(at=q)
        return _command.picture(self, mesh, options)

    def view(self, mesh: Any = None) -> str:
        """A page of HTML that shows the tree, and the mesh, in a browser, offline. ``mesh`` is as in :meth:`render`."""
        from . import _command

        return _command.page(self, mesh)

    def _repr_html_(self) -> str:
        try:
            page = self.view()
        except Error as error:
            return f"<pre>{self!r}\n{error}</pre>"
        escaped = page.replace("&", "&amp;").replace('"', "&quot;")
        style = "width:100%;height:480px;border:0"
        return f'<iframe srcdoc="{escaped}" style="{style}" sandbox="allow-scripts"></iframe>'

    def __repr__(self) -> str:
        known = self.info_dict()
        last = known["levels"][-1]
        kind = (
            "exact, " + f"{known['triangle_count']} triangles"
            if self.has_triangles
            else f"{last['ellipsoids']} {known['primitive']}s"
        )
        ratio = last["outside_ratio"]
        close = "" if self.has_triangles or ratio != ratio else f", outside ratio {ratio:.3g}"
        proved = "proved" if known["proved"] else "not proved"
        return f"<prolate.Tree: {kind}, {self.level_count} levels{close}, {proved}, {known['bytes']} bytes>"


def load(path: Union[str, os.PathLike[str]], *, check_hash: bool = True) -> Tree:
    """Read an ``.etree`` file into memory and check it.

    Parameters
    ----------
    path : path-like
    check_hash : bool
        As for :meth:`Tree.from_bytes`, which also takes a mapped file.

    Raises
    ------
    Error
        ``code`` is ``"io"``, ``"bad_file"`` or ``"newer_version"``.
    """
    name = path_of("path", path)
    try:
        with open(name, "rb") as file:
            data = file.read()
    except OSError as error:
        raise Error(f"{error.strerror}: {name}", "io", error.errno or 0) from None
    try:
        return Tree.from_bytes(data, check_hash=check_hash)
    except Error as error:
        raise Error(f"{error}: {name}", error.code, error.where) from None


def baked_tree(data: object, report: dict[str, Any] | None) -> Tree:
    """The tree of bytes that were just made."""
    tree = Tree(data, check_hash=False)
    tree._report = report
    return tree


def _restored(data: object, report: dict[str, Any] | None) -> Tree:
    tree = Tree(data)
    tree._report = report
    return tree


def _rows(name: str, coordinates: ArrayLike | None) -> list[list[float]]:
    """One row, or several, of numbers."""
    if coordinates is None:
        return []
    import numpy as np

    try:
        rows = np.atleast_2d(np.asarray(coordinates, dtype=float))
    except (ValueError, TypeError) as error:
        raise type(error)(f"{name}: {error}; give an array (M,) or (N, M)") from None
    if rows.ndim != 2:
        raise ValueError(f"{name}: must have shape (M,) or (N, M), not {rows.shape}")
    return rows.tolist()  # type: ignore[no-any-return]


def _bytes_of(buffer: object) -> NDArray[np.uint8]:
    """The bytes as an array that nobody can write to."""
    import numpy as np

    try:
        view = memoryview(buffer)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"buffer: must be bytes-like, not {type(buffer).__name__}") from None
    if not view.contiguous:
        raise ValueError("buffer: must be contiguous")
    data = np.frombuffer(view, dtype=np.uint8) if view.nbytes > 0 else np.empty(0, np.uint8)
    return data if view.readonly else data.copy()
