"""Which frames are fitted and which only judge."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.data.map_surfaces import is_own_map
from cosim.discrepancy.labelled_twin.trust import read_trust
from cosim.drives.kitti import Drive, Frame

_SEGMENT = 3
_MAP_SCANS, _MAP_JUDGES = 24, 8  # of a map that are fitted and that judge, evenly spread
_HELD_OUT = "held_out"


@dataclass(frozen=True)
class Split:
    """Names of frames that are fitted, and of those that took no part; the same where there are too few for both."""

    fit: tuple[str, ...]
    test: tuple[str, ...]

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
    """Every fourth segment of consecutive frames judges, the rest is fitted; poor frames by themselves."""
    size = max(1, min(_SEGMENT, len(names) // 8))
    rich = [name for name in names if name not in poor]
    ordered = [*rich, *(name for name in names if name in poor)]
    judges = {name for place, name in enumerate(ordered) if place // size % 4 == 3}
    test = tuple(name for name in names if name in judges)
    fit = tuple(name for name in names if name not in judges)
    return Split(fit, test) if test and fit else Split(tuple(names), tuple(names))


def _spread(names: Sequence[str], most: int) -> tuple[str, ...]:
    """So many names, evenly spread."""
    rows = np.unique(np.linspace(0, len(names) - 1, min(most, len(names))).round().astype(int))
    return tuple(names[int(row)] for row in rows)


def _tells_of_ranges(frame: Frame) -> bool:
    return not frame.has("twin/trust") or read_trust(frame.path("twin/trust")).ground_range
