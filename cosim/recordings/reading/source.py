"""Location of one scan, and access to its columns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from cosim.point_files import Columns


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
