"""Which frames of a drive a command takes."""

from __future__ import annotations

import numpy as np

from cosim.drives.kitti import Drive
from cosim.errors import DriveError


def chosen_frames(drive: Drive, wanted: str) -> tuple[str, ...]:
    """Frames by names with commas between, or by how many, evenly spread; a frame of that very name wins.

    Raises:
        DriveError: no such frame, or none.
    """
    names = tuple(dict.fromkeys(name.strip() for name in wanted.split(",") if name.strip()))
    if not names:
        raise DriveError(f"--frames is {wanted!r}; give names with commas between, or a number")
    if len(names) == 1 and names[0] not in drive and names[0].isdecimal() and not names[0].startswith("0"):
        return evenly(drive.frames, int(names[0]))
    for name in names:
        drive[name]
    return names


def evenly(names: tuple[str, ...], count: int) -> tuple[str, ...]:
    """At most `count` of the names, evenly spaced, the first and the last among them."""
    rows = np.unique(np.linspace(0, len(names) - 1, min(count, len(names))).round().astype(int))
    return tuple(names[row] for row in rows)
