"""Which frames of a drive to show."""

from __future__ import annotations

import numpy as np

from cosim.drives.kitti import Drive, box_areas
from cosim.errors import DriveError

_MOST_FRAMES = 200
_CANDIDATES = 12


def choose_frames(drive: Drive, wanted: str) -> tuple[str, ...]:
    """Frames by names with commas between, or by how many.

    A number of frames is spread over the drive: it is cut into as many parts, and of each the frame whose
    labelled objects cover most of the image is taken (of at most 12 looked at), the earliest if equal.

    Args:
        drive: the drive.
        wanted: `000000,000004` or `3`. A frame of that very name wins over a number.

    Raises:
        DriveError: no such frame, or a number out of bounds.
    """
    names = tuple(dict.fromkeys(name.strip() for name in wanted.split(",") if name.strip()))
    if len(names) == 1 and names[0] not in drive and names[0].isdecimal() and not names[0].startswith("0"):
        return _spread(drive, int(names[0]))
    if not names:
        raise DriveError(f"--frames is {wanted!r}; give names with commas between, or a number")
    if len(names) > _MOST_FRAMES:
        raise DriveError(f"--frames names {len(names)} frames; a page holds at most {_MOST_FRAMES}")
    for name in names:
        drive[name]
    return names


def spread_evenly(names: tuple[str, ...], count: int) -> tuple[str, ...]:
    """At most `count` of the names, evenly spaced, the first and the last among them."""
    rows = np.unique(np.linspace(0, len(names) - 1, min(count, len(names))).round().astype(int))
    return tuple(names[row] for row in rows)


def richest_frames(drive: Drive, names: tuple[str, ...], count: int) -> tuple[str, ...]:
    """Of as many parts of the names, the frame of each whose labelled objects cover most of the image."""
    parts = np.array_split(np.array(names, object), max(1, min(count, len(names))))
    return tuple(_richest(drive, tuple(part)) for part in parts)


def _spread(drive: Drive, count: int) -> tuple[str, ...]:
    if count > _MOST_FRAMES:
        raise DriveError(f"--frames is {count}; a page holds at most {_MOST_FRAMES}")
    return richest_frames(drive, drive.frames, count)


def _richest(drive: Drive, names: tuple[str, ...]) -> str:
    candidates = spread_evenly(names, _CANDIDATES)
    return max(candidates, key=lambda name: _labelled_area(drive, name))


def _labelled_area(drive: Drive, name: str) -> float:
    """Area of the 2D boxes of a frame [px²]."""
    frame = drive[name]
    return float(box_areas(frame.labels.cared_for.bbox).sum()) if frame.has("label_2") else 0.0
