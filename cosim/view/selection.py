"""Select the frames of a drive to show."""

from __future__ import annotations

import numpy as np

from cosim.drives.kitti import Drive, box_areas
from cosim.errors import DriveError

_MAX_FRAMES = 200
_CANDIDATES = 12


def choose_frames(drive: Drive, wanted: str) -> tuple[str, ...]:
    """Select frames by comma-separated names, or a number of frames.

    For a number, the drive is divided into that many parts. From each part the frame whose labelled objects cover the
    largest area of the image is selected, from at most 12 candidates; the first one if several are equal.

    Args:
        drive: drive.
        wanted: `000000,000004` or `3`; a frame with exactly that name has precedence over a number.

    Raises:
        DriveError: a frame does not exist, or the number is out of bounds.
    """
    names = tuple(dict.fromkeys(name.strip() for name in wanted.split(",") if name.strip()))
    if len(names) == 1 and names[0] not in drive and names[0].isdecimal() and not names[0].startswith("0"):
        return _spread(drive, int(names[0]))
    if not names:
        raise DriveError(f"--frames is {wanted!r}; give names separated by commas, or a number")
    if len(names) > _MAX_FRAMES:
        raise DriveError(f"--frames names {len(names)} frames; a page holds at most {_MAX_FRAMES}")
    for name in names:
        drive[name]
    return names


def spread_evenly(names: tuple[str, ...], count: int) -> tuple[str, ...]:
    """At most `count` evenly spaced names, including the first and the last."""
    rows = np.unique(np.linspace(0, len(names) - 1, min(count, len(names))).round().astype(int))
    return tuple(names[row] for row in rows)


def richest_frames(drive: Drive, names: tuple[str, ...], count: int) -> tuple[str, ...]:
    """Divide the names into `count` parts and select from each the frame with the largest labelled area."""
    parts = np.array_split(np.array(names, object), max(1, min(count, len(names))))
    return tuple(_richest(drive, tuple(part)) for part in parts)


def _spread(drive: Drive, count: int) -> tuple[str, ...]:
    if count > _MAX_FRAMES:
        raise DriveError(f"--frames is {count}; a page holds at most {_MAX_FRAMES}")
    return richest_frames(drive, drive.frames, count)


def _richest(drive: Drive, names: tuple[str, ...]) -> str:
    candidates = spread_evenly(names, _CANDIDATES)
    return max(candidates, key=lambda name: _labelled_area(drive, name))


def _labelled_area(drive: Drive, name: str) -> float:
    """Area of the 2D boxes of a frame [px²]."""
    frame = drive[name]
    return float(box_areas(frame.labels.cared_for.bbox).sum()) if frame.has("label_2") else 0.0
