"""Libraries that only recordings need, imported when they are."""

from __future__ import annotations

import importlib
from types import ModuleType

from cosim.recordings.scan import RecordingError

_HOW = {
    "ouster": "pip install --no-deps ouster-sdk (it pins older versions of what cosim uses)",
}


def needed(module: str, reads: str) -> ModuleType:
    """Import a library.

    Args:
        module: its full name.
        reads: what it is needed for, for the message.

    Raises:
        RecordingError: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        how = _HOW.get(package, "pip install 'cosim[recordings]'")
        raise RecordingError(f"{reads} needs the package {package}; install it: {how}") from error
