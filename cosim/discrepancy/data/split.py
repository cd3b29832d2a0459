"""Which frames are fitted, which only judge, and which are not touched until the end."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.data.map_surfaces import is_own_map
from cosim.discrepancy.labelled_twin.trust import read_trust
from cosim.drives.kitti import Drive, Frame

_SEGMENT = 3
_FEWEST = 16  # frames of which a segment can be spared for the end
_MAP_SCANS, _MAP_JUDGES = 24, 8  # of a map that are fitted and that judge, evenly spread
_HELD_OUT = "held_out"


@dataclass(frozen=True)
class Split:
    """Names of frames.

    Attributes:
        fit: those that are fitted.
        test: those that judge, step by step; the same where there are too few for both.
        confirm: those that are looked at once, at the end; none where there are too few.
    """

    fit: tuple[str, ...]
    test: tuple[str, ...]
    confirm: tuple[str, ...] = ()

    @property
    def is_held_out(self) -> bool:
        """Whether the test frames took no part in the fit."""
        return not set(self.fit) & set(self.test)


def split_drive(drive: Drive) -> Split:
    """The split of a drive's frames; of those whose ground tells nothing of ranges as many judge as of the others.

    Of a map made of the scans, those judge that took no part in it.
    """
    if is_own_map(drive) and _HELD_OUT in drive.splits:
        held = drive.split(_HELD_OUT)
        fit = [name for name in drive.frames if name not in set(held)]
        if held and fit:
            return Split(_spread(fit, _MAP_SCANS), _spread(held, _MAP_JUDGES))
    return split_frames(drive.frames, [name for name in drive.frames if not _tells_of_ranges(drive[name])])


def split_frames(names: Sequence[str], poor: Collection[str] = ()) -> Split:
    """Every fourth segment of consecutive frames judges, the last one is left untouched, the rest is fitted.

    Poor frames are shared out among those that fit and judge by themselves.
    """
    size = max(1, min(_SEGMENT, len(names) // 8))
    rich = [name for name in names if name not in poor]
    confirm = tuple(rich[-size:]) if len(rich) >= _FEWEST else ()
    ordered = [*rich[: len(rich) - len(confirm)], *(name for name in names if name in poor)]
    judges = {name for place, name in enumerate(ordered) if place // size % 4 == 3}
    left = [name for name in names if name not in confirm]
    test = tuple(name for name in left if name in judges)
    fit = tuple(name for name in left if name not in judges)
    return Split(fit, test, confirm) if test and fit else Split(tuple(names), tuple(names))


def _spread(names: Sequence[str], most: int) -> tuple[str, ...]:
    """So many names, evenly spread."""
    rows = np.unique(np.linspace(0, len(names) - 1, min(most, len(names))).round().astype(int))
    return tuple(names[int(row)] for row in rows)


def _tells_of_ranges(frame: Frame) -> bool:
    return not frame.has("twin/trust") or read_trust(frame.path("twin/trust")).ground_range
