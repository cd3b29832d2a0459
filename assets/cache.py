"""Results of slow functions that depend only on their arguments, stored on disk for the next process."""

from __future__ import annotations

import hashlib
import logging
import os
import shutil
import time
from collections.abc import Callable, Collection
from functools import cache, wraps
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import ParamSpec, TypeVar

from assets.serialization import content_digest, dumps, loads

FOLDER = "COSIM_CACHE"
"""Name of the environment variable with the folder of stored results; empty: nothing is stored."""

_OTHERS_KEPT_DAYS = 30
_LIBRARIES = ("numpy", "scipy", "shapely", "mapbox-earcut", "embreex")

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")
_log = logging.getLogger(__name__)


def cached(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Keep a function's results in the user's cache folder.

    They are stored by the code of `assets` and of the function's own package and by the libraries' versions, so that
    results of other code are never read. Where the folder cannot be written, every result is computed.

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
        path = folder / f"{function.__name__}-{content_digest(key)}.npz"
        try:
            result = loads(path.read_bytes())
            if most is not None:
                os.utime(path)
            return result
        except FileNotFoundError:
            pass
        except (OSError, ValueError) as error:
            _log.info("%s: computed again, because it cannot be read (%s)", path, error)
        result = function(*arguments, **named)
        _write(path, dumps(result))
        if most is not None:
            _remove_all_but(folder, f"{function.__name__}-*.npz", most)
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
    except OSError as error:
        _log.info("%s: cannot be written (%s); nothing is kept there", root, error.strerror)
        return None
    return folder


def _write(path: Path, content: bytes) -> None:
    """Write atomically, because other processes may read and write the same file."""
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")
    try:
        partial.write_bytes(content)
        partial.replace(path)
    except OSError as error:
        _log.info("%s: cannot be written (%s)", path, error.strerror)
        partial.unlink(missing_ok=True)


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
    oldest_s = time.time() - _OTHERS_KEPT_DAYS * 86400
    for folder in root.iterdir():
        if folder.is_dir() and folder.stat().st_mtime < oldest_s:
            shutil.rmtree(folder, ignore_errors=True)
