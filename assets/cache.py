"""Results that are slow to make and follow from their arguments alone, kept on disk from one process to the next."""

from __future__ import annotations

import hashlib
import logging
import os
import shutil
import time
from collections.abc import Callable
from functools import cache, wraps
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, ParamSpec, TypeVar, cast

if TYPE_CHECKING:
    from joblib import Memory

FOLDER = "COSIM_CACHE"
"""Name of the environment variable that says where results are kept; empty: nowhere."""

_OTHERS_KEPT_DAYS = 30
_LIBRARIES = ("numpy", "scipy", "shapely", "mapbox-earcut", "embreex")

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")
_log = logging.getLogger(__name__)


def cached(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Keep a function's results in the user's cache folder.

    They are kept apart by the code of `assets` and of the function's own package and by the libraries' versions, so
    that nothing made by other code is ever read. Where the folder cannot be written, everything is made anew.

    Args:
        function: depends on its arguments alone; they and its results can be pickled.
    """

    @cache
    def kept() -> Callable[_Arguments, _Result]:
        memory = _memory(function.__module__.partition(".")[0], os.environ.get(FOLDER))
        return function if memory is None else cast("Callable[_Arguments, _Result]", memory.cache(function))

    @wraps(function)
    def call(*arguments: _Arguments.args, **named: _Arguments.kwargs) -> _Result:
        return kept()(*arguments, **named)

    return call


@cache
def _memory(package: str, where: str | None) -> Memory | None:
    from joblib import Memory
    from platformdirs import user_cache_path

    if where == "":
        return None
    root = Path(where) if where else user_cache_path("cosim")
    folder = root / f"{package}-{_digest(package)}"
    try:
        if not folder.is_dir():
            _forget_others(root)
            folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        return Memory(folder, verbose=0)
    except OSError as error:
        _log.info("%s: cannot be written (%s); nothing is kept there", root, error.strerror)
        return None


def _digest(package: str) -> str:
    """Of everything that results depend on but the arguments."""
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
