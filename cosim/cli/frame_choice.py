"""Selection of the frames that a command uses."""

from __future__ import annotations

import numpy as np

from cosim.drives.kitti import Drive
from cosim.errors import DriveError


def chosen_frames(drive: Drive, wanted: str) -> tuple[str, ...]:
    """Select frames by comma-separated names, or a number of evenly spaced frames; an equal frame name has precedence.

    Raises:
        DriveError: a frame does not exist, or no name is given.
    """
    names = tuple(dict.fromkeys(name.strip() for name in wanted.split(",") if name.strip()))
    if not names:
        raise DriveError(f"--frames is {wanted!r}; give names separated by commas, or a number")
    if len(names) == 1 and names[0] not in drive and names[0].isdecimal() and not names[0].startswith("0"):
        return evenly(drive.frames, int(names[0]))
    for name in names:
        drive[name]
    return names


def evenly(names: tuple[str, ...], count: int) -> tuple[str, ...]:
    """At most `count` evenly spaced names, including the first and the last."""
    rows = np.unique(np.linspace(0, len(names) - 1, min(count, len(names))).round().astype(int))
    return tuple(names[row] for row in rows)
