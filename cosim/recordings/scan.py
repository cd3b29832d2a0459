"""One scan of a recording, whatever file it came from, and the error of recordings."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from cosim.errors import CosimError
from cosim.point_files.scan import PointFileError, Scan

__all__ = ["RecordingError", "Scan", "recording_errors"]


class RecordingError(CosimError):
    """A recording cannot be used."""


@contextmanager
def recording_errors() -> Iterator[None]:
    """Raise what the reader of point files finds as an error of the recording."""
    try:
        yield
    except PointFileError as error:
        raise RecordingError(str(error)) from None
