"""Many assets, on this machine or on many."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NamedTuple, Union

from . import _core
from ._bake import bake_mesh, core_options, prepared
from ._errors import Error, check_callable, path_of
from ._mesh import Mesh, arrays_of, factors, load_mesh, metres
from ._tree import Tree, load

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future


class Asset(NamedTuple):
    """One asset of :func:`bake_many`.

    Attributes
    ----------
    mesh : path-like, or what :func:`bake_mesh` takes
        A path is read by the worker, so it must name the same file there.
    options : dict
        Those of :func:`bake`; with a path, ``unit``, ``scale`` and ``recentre`` are those of :func:`load_mesh`.
    """

    mesh: Any
    options: dict[str, Any] = {}


class BakeResult(NamedTuple):
    """What became of one asset.

    Attributes
    ----------
    tree : Tree or None
    error : Exception or None
        What stood in the way; exactly one of the two is there.
    cached : bool
        The tree was taken from the cache, or from another asset of the same content.
    """

    tree: Tree | None
    error: BaseException | None
    cached: bool


AnyAsset = Union[Asset, str, "os.PathLike[str]", Any]


def bake_many(
    assets: Iterable[AnyAsset],
    *,
    executor: Executor | None = None,
    cache: Union[str, os.PathLike[str], None] = None,
    progress: Callable[[int, int], object] | None = None,
) -> list[BakeResult]:
    """Bake many assets, and only those whose contents the cache does not have.

    Parameters
    ----------
    assets : iterable of Asset, path or mesh
    executor : concurrent.futures.Executor, optional
        Where the work is done: a ``ProcessPoolExecutor``, Dask's ``Client.get_executor()``, ``mpi4py.futures``.
        Without, assets are baked one after the other in this process. Each bake uses all cores that the worker sees,
        unless its options say ``threads``.
    cache : path-like, optional
        A folder, the same for all workers, that keeps every tree by the content of its mesh, the options and the
        version of the builder; that of ``prolate bake --cache``. What a worker has finished survives its death. Entries
        may be deleted at any time.
    progress : callable, optional
        Called as ``progress(done, count)`` after each asset.

    Returns
    -------
    list of BakeResult
        In the order of the assets. An asset that fails has its error, and does not stop the others.

    Raises
    ------
    TypeError
        For what is no asset.

    Notes
    -----
    Assets of the same content and options are baked once.
    """
    check_callable("progress", progress)
    if executor is not None and not hasattr(executor, "submit"):
        raise TypeError(f"executor: must be a concurrent.futures.Executor, not {type(executor).__name__}")
    try:
        jobs = [_asset(asset) for asset in assets]
    except TypeError as error:
        raise TypeError(f"assets: {error}") from None
    folder = None if cache is None else os.path.abspath(path_of("cache", cache))
    first = _first_of_its_kind(jobs)
    results: list[BakeResult | None] = [None] * len(jobs)
    done = 0
    for index, result in _results(jobs, sorted(set(first)), executor, folder):
        for twin in (i for i, one in enumerate(first) if one == index):
            results[twin] = result if twin == index else result._replace(cached=result.tree is not None)
            done += 1
            if progress is not None:
                progress(done, len(jobs))
    return [result for result in results if result is not None]


def _asset(asset: AnyAsset) -> Asset:
    if isinstance(asset, Asset):
        if not isinstance(asset.options, dict):
            raise TypeError(f"options of an Asset must be a dict, not {type(asset.options).__name__}")
        return asset
    if isinstance(asset, (str, os.PathLike, Mesh)) or hasattr(asset, "vertices") or isinstance(asset, tuple):
        return Asset(asset)
    raise TypeError(f"{type(asset).__name__} is neither an Asset, a path nor a mesh")


def _first_of_its_kind(jobs: list[Asset]) -> list[int]:
    """For each asset, the index of the first of the same content and options."""
    seen: dict[object, int] = {}
    return [seen.setdefault((_content(job), repr(sorted(job.options.items()))), i) for i, job in enumerate(jobs)]


def _content(job: Asset) -> object:
    import hashlib

    import numpy as np

    mesh = job.mesh
    if isinstance(mesh, (str, os.PathLike)):
        return _core.mesh_file_hash(os.fsencode(mesh), None, None, False) or os.fsdecode(mesh)
    try:
        arrays = [np.asarray(array) for array in arrays_of(mesh)]
    except (TypeError, ValueError):
        return id(mesh)  # which its bake refuses
    frame = (mesh.scale, mesh.origin) if isinstance(mesh, Mesh) else None
    return (
        frame,
        *((a.dtype.str, a.shape, hashlib.blake2b(np.ascontiguousarray(a).tobytes()).digest()) for a in arrays),
    )


def _results(
    jobs: list[Asset], wanted: list[int], executor: Executor | None, folder: str | None
) -> Iterable[tuple[int, BakeResult]]:
    """(index, result), as they are finished."""
    from concurrent.futures import as_completed

    if executor is None:
        for index in wanted:
            yield index, bake_asset(jobs[index], folder)
        return
    futures: dict[Future[BakeResult], int] = {executor.submit(bake_asset, jobs[i], folder): i for i in wanted}
    try:
        for future in as_completed(futures):
            error = future.exception()
            yield futures[future], BakeResult(None, error, False) if error is not None else future.result()
    finally:
        for future in futures:
            future.cancel()


def bake_asset(asset: Asset, folder: str | None) -> BakeResult:
    """What a worker does. Never raises but for an interruption."""
    try:
        tree, cached = _cached_or_baked(asset, folder)
        return BakeResult(tree, None, cached)
    except Exception as error:  # one error an asset
        return BakeResult(None, error, False)


def _cached_or_baked(asset: Asset, folder: str | None) -> tuple[Tree, bool]:
    mesh, options = asset.mesh, dict(asset.options)
    if not isinstance(mesh, (str, os.PathLike)):
        return _found_or_baked(mesh, options, folder, None)
    frame = {name: options.pop(name) for name in ("unit", "scale", "recentre") if name in options}
    file_key = None
    if folder is not None:
        by = factors(frame["scale"]) if frame.get("scale") is not None else None
        file_key = _core.mesh_file_hash(os.fsencode(mesh), metres(frame.get("unit")), by, bool(frame.get("recentre")))
        tree = _find(folder, _known_source(folder, file_key), _core.options_hash(core_options(options)))
        if tree is not None:
            return tree, True
    return _found_or_baked(load_mesh(mesh, **frame), options, folder, file_key)


def _found_or_baked(mesh: Any, options: dict[str, Any], folder: str | None, file_key: int | None) -> tuple[Tree, bool]:
    if folder is None:
        return bake_mesh(mesh, **options), False
    source, key = _core.bake_key(*prepared(mesh, options))
    if file_key is not None:
        write_atomically(os.path.join(folder, f"{file_key:016x}.mesh"), f"{file_key:016x} {source:016x}\n".encode())
    tree = _find(folder, source, key)
    if tree is not None:
        return tree, True
    tree = bake_mesh(mesh, **options)
    os.makedirs(folder, exist_ok=True)
    tree.save(_tree_path(folder, source, key))
    return tree, False


def _tree_path(folder: str, source: int, options: int) -> str:
    return os.path.join(folder, f"{source:016x}-{options:016x}.etree")


def _known_source(folder: str, file_key: int | None) -> int | None:
    """The hash of the mesh in files of these bytes."""
    if file_key is None:
        return None
    with contextlib.suppress(OSError, ValueError):
        with open(os.path.join(folder, f"{file_key:016x}.mesh"), encoding="ascii") as file:
            text = file.read(64)
        if len(text) == 34 and text.startswith(f"{file_key:016x} "):
            return int(text[17:33], 16)
    return None


def _find(folder: str, source: int | None, options: int) -> Tree | None:
    """The tree, if there is a sound one: nothing is believed for its name."""
    if source is None:
        return None
    try:
        tree = load(_tree_path(folder, source, options))
    except Error:
        return None
    known = tree.info_dict()
    sound = (
        known["source_hash"] == source
        and known["options_hash"] == options
        and known["proved"]
        and not known["is_prefix"]
    )
    return tree if sound else None


def write_atomically(path: str, content: bytes) -> None:
    """Atomically: workers on other machines read it meanwhile."""
    import secrets

    os.makedirs(os.path.dirname(path), exist_ok=True)
    temporary = f"{path}.{secrets.token_hex(8)}"  # open() gives it the rights that the user's umask leaves
    try:
        with open(temporary, "xb") as file:
            file.write(content)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.remove(temporary)
        raise
