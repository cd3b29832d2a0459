"""Location of one scan, and access to its columns."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from cosim.point_files import Columns
from cosim.recordings.scan import RecordingError


@dataclass(frozen=True)
class Source:
    """A scan that has not been read yet.

    Attributes:
        name: of the scan.
        read: gives its columns; raises RecordingError where the file is damaged.
        stamp_s: when it was taken, if the container says so [s].
    """

    name: str
    read: Callable[[], Columns]
    stamp_s: float | None = None


def capture_sources(
    path: Path, open_scans: Callable[[Path], Iterator[tuple[float, Any]]], columns_of: Callable[[Any], Columns]
) -> tuple[Source, ...]:
    """Scans of a capture of packets, which its decoder can read only from the beginning.

    Args:
        path: of the capture.
        open_scans: decodes a capture: time stamps [s] and scans of the decoder, in order. Can be pickled.
        columns_of: columns of such a scan. Can be pickled.

    Raises:
        RecordingError: as `open_scans` does, and if there is no scan.
    """
    stamps = [stamp for stamp, _ in open_scans(path)]
    if not stamps:
        raise RecordingError(f"{path}: no whole scan in it; record longer than a revolution")
    capture = _Capture(path, open_scans, columns_of)
    return tuple(
        Source(f"{number:06d}", partial(capture.columns, number), stamp) for number, stamp in enumerate(stamps)
    )


@dataclass(eq=False)
class _Capture:
    """Reads scans by number, going forward; starts again where an earlier one is requested."""

    path: Path
    open_scans: Callable[[Path], Iterator[tuple[float, Any]]]
    columns_of: Callable[[Any], Columns]

    def __post_init__(self) -> None:
        self._scans: Iterator[tuple[float, Any]] | None = None
        self._next = 0

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_scans": None, "_next": 0}

    def columns(self, number: int) -> Columns:
        """The columns of one scan."""
        if self._scans is None or number < self._next:
            self._scans, self._next = self.open_scans(self.path), 0
        for _, scan in self._scans:
            self._next += 1
            if self._next > number:
                return self.columns_of(scan)
        raise RecordingError(f"{self.path}: ends before scan {number}")
