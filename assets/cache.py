"""Results of slow functions that depend only on their arguments, stored on disk and mapped into memory from there.

Processes with the same result share its memory, and the system can take it back from them without writing it anywhere.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import mmap
import os
import shutil
import time
from collections.abc import Callable, Collection
from functools import cache, wraps
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, ParamSpec, TypeVar
from uuid import uuid4

import numpy as np

from assets.serialization import content_digest, dump, loads

FOLDER = "COSIM_CACHE"
"""Name of the environment variable with the folder of stored results; empty: nothing is stored."""

_DAY_S = 86400
_OTHERS_KEPT_DAYS = 30
_SUFFIX, _UNFINISHED = ".bin", ".partial"
_LEAST_MAPPED = 1 << 20  # bytes; each mapping needs one of the 1024 file descriptors of a process
_LIBRARIES = ("numpy", "scipy", "shapely", "mapbox-earcut", "embreex")

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")
_log = logging.getLogger(__name__)


def cached(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Keep a function's results in the user's cache folder.

    They are stored by the code of `assets` and of the function's own package and by the libraries' versions, so that
    results of other code are never read. Where the folder cannot be written, every result is computed. Arrays of a
    result may be changed: this does not change what is stored.

    Args:
        function: depends only on its arguments; they and its results are of types that `assets.serialization` allows.
    """
    return _cached(function, None, frozenset())


def cached_latest(
    most: int, *, ignore: Collection[str] = ()
) -> Callable[[Callable[_Arguments, _Result]], Callable[_Arguments, _Result]]:
    """`cached` for functions with large results: only those used last are kept.

    Args:
        most: number of results to keep.
        ignore: names of arguments that follow from the others; calls must give them by name.
    """
    return lambda function: _cached(function, most, frozenset(ignore))


def _cached(
    function: Callable[_Arguments, _Result], most: int | None, ignore: frozenset[str]
) -> Callable[_Arguments, _Result]:
    @wraps(function)
    def call(*arguments: _Arguments.args, **named: _Arguments.kwargs) -> _Result:
        folder = _folder(function.__module__.partition(".")[0], os.environ.get(FOLDER))
        if folder is None:
            return function(*arguments, **named)
        key = arguments, {name: value for name, value in named.items() if name not in ignore}
        path = folder / f"{function.__name__}-{content_digest(key)}{_SUFFIX}"
        try:
            result = loads(_content(path))
            if most is not None:
                os.utime(path)
            return result
        except FileNotFoundError:
            pass
        except (OSError, ValueError) as error:
            _log.info("%s: computed again, because it cannot be read (%s)", path, error)
        result = function(*arguments, **named)
        try:
            _write(path, result)
            result = loads(_content(path))
        except (OSError, ValueError) as error:
            _log.info("%s: not kept (%s)", path, error)
        if most is not None:
            _remove_all_but(folder, f"{function.__name__}-*{_SUFFIX}", most)
        return result

    return call


@cache
def _folder(package: str, where: str | None) -> Path | None:
    """Return the folder of cached results of a package's functions; None without a cache."""
    from platformdirs import user_cache_path

    if where == "":
        return None
    root = Path(where) if where else user_cache_path("cosim")
    folder = root / f"{package}-{_digest(package)}"
    try:
        if not folder.is_dir():
            _forget_others(root)
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        os.utime(folder)
        _remove_unfinished(folder)
    except OSError as error:
        _log.info("%s: cannot be written (%s); nothing is kept there", root, error.strerror)
        return None
    return folder


def _write(path: Path, result: Any) -> None:
    """Write atomically, because other processes may read and write the same file."""
    partial = _unique(path)
    try:
        with partial.open("wb") as file:
            dump(result, file)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _content(path: Path) -> memoryview:
    """The bytes of a file; those of a large one are read when they are used and copied when they are changed.

    A network file system frees a file that another computer removes, also while it is mapped here, and the next access
    would end the process. It keeps a file that has another name. That name is removed as soon as the file is mapped,
    which a client of a network file system delays until the mapping ends.
    """
    if path.stat().st_size < _LEAST_MAPPED:
        return np.fromfile(path, np.uint8).data
    name = _unique(path)
    try:
        name.hardlink_to(path)
    except OSError:  # the file system does not allow several names
        return np.fromfile(path, np.uint8).data
    try:
        with name.open("rb") as file:
            return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY))
    finally:
        name.unlink(missing_ok=True)


def _unique(path: Path) -> Path:
    """A name next to a file that no other process or computer uses."""
    return path.with_name(f"{path.name}.{uuid4().hex}{_UNFINISHED}")


def _remove_all_but(folder: Path, pattern: str, most: int) -> None:
    """Remove the files that were used least recently."""
    try:
        by_age = sorted(folder.glob(pattern), key=lambda path: path.stat().st_mtime, reverse=True)
        for path in by_age[most:]:
            path.unlink(missing_ok=True)
    except OSError as error:  # another process removes the same
        _log.info("%s: not cleared (%s)", folder, error)


def _digest(package: str) -> str:
    """Digest of everything that results depend on except the arguments."""
    here = Path(__file__).resolve().parent
    digest = hashlib.sha256()
    for name in sorted({here.name, package}):
        for path in sorted((here.parent / name).rglob("*.py")):
            digest.update(path.relative_to(here.parent).as_posix().encode() + path.read_bytes())
    for library in _LIBRARIES:
        try:
            digest.update(f"{library} {version(library)}".encode())
        except PackageNotFoundError:
            digest.update(library.encode())
    return digest.hexdigest()[:16]


def _forget_others(root: Path) -> None:
    """Remove what other versions of the code left and have not used for long."""
    if not root.is_dir():
        return
    oldest_s = time.time() - _OTHERS_KEPT_DAYS * _DAY_S
    for folder in root.iterdir():
        if folder.is_dir() and folder.stat().st_mtime < oldest_s:
            shutil.rmtree(folder, ignore_errors=True)


def _remove_unfinished(folder: Path) -> None:
    """Remove what processes left that were killed while they wrote."""
    oldest_s = time.time() - _DAY_S
    for path in folder.glob(f"*{_UNFINISHED}"):
        with contextlib.suppress(FileNotFoundError):  # another process removes the same
            if path.stat().st_mtime < oldest_s:
                path.unlink()
