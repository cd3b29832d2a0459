"""Libraries that only point files of some formats need, imported when they are."""

from __future__ import annotations

import importlib
from types import ModuleType

from cosim.point_files.scan import PointFileError

_HOW = {
    "ouster": "pip install --no-deps ouster-sdk (it pins older versions of what cosim uses)",
    "laspy": "pip install 'cosim[export]'",
}


def needed(module: str, reads: str) -> ModuleType:
    """Import a library.

    Args:
        module: its full name.
        reads: what it is needed for, for the message.

    Raises:
        PointFileError: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        how = _HOW.get(package, "pip install 'cosim[recordings]'")
        raise PointFileError(f"{reads} needs the package {package}; install it: {how}") from error
