"""Notes on properties of scans that affect the reliability of figures computed from them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cosim.drives.kitti.frame import Frame
from cosim.errors import DriveError, FormatError


def scan_notes(frames: Sequence[Frame]) -> tuple[str, ...]:
    """Sentences on broken points, empty scans, intensities and rings; frames are read one after another.

    Raises:
        DriveError: no frame holds a point.
        FormatError: a scan cannot be read.
    """
    if not frames:
        raise DriveError("no frames: name at least one")
    left_out: Counter[str] = Counter()
    points = empty = dark = unordered = 0
    highest = 0.0
    for kept in frames:
        frame = replace(kept)  # forgets its points
        left_out.update(frame.left_out)
        points += len(frame.points)
        if not len(frame.points):
            empty += 1
            continue
        dark += not frame.has_intensity
        highest = max(highest, float(np.abs(frame.points[:, 3]).max()))
        unordered += not _has_rings(frame)
    if not points:
        raise DriveError(
            f"{frames[0].root}: none of the {len(frames)} scans holds a finite point; "
            "velodyne/NAME.bin is float32 x y z intensity a point"
        )
    many = len(frames)
    notes = {
        f"{left_out['not finite']} points hold NaN or infinity: left out": left_out.pop("not finite", 0),
        f"{left_out.total()} points are no returns ({', '.join(left_out)}): left out": left_out.total(),
        f"{empty} of {many} scans hold no point": empty,
        f"intensities are absent or all zero in {dark} of {many} scans: nothing is said of intensity there": dark,
        f"intensities reach {highest:g}: 0 to 1 is expected, those above count as 1": highest > 1,
        f"rings of {unordered} of {many} scans cannot be recovered, their points are in another order: "
        "give rays/NAME.npz": unordered,
    }
    return tuple(note for note, count in notes.items() if count)


def _has_rings(frame: Frame) -> bool:
    try:
        return len(frame.rays) == len(frame.points)
    except FormatError:
        return False
