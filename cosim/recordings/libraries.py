"""Libraries that only recordings need, imported when they are."""

from __future__ import annotations

from types import ModuleType

from cosim.point_files import libraries
from cosim.recordings.scan import recording_errors


def needed(module: str, reads: str) -> ModuleType:
    """Import a library.

    Args:
        module: its full name.
        reads: what it is needed for, for the message.

    Raises:
        RecordingError: it is not installed.
    """
    with recording_errors():
        return libraries.needed(module, reads)
