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
_FEWEST_SCANS, _FEWEST_JUDGES = 4, 4  # of each map where there are several: fewer hardly meet one surface twice
_MOST_MAPS = 16  # that are looked at, evenly spread along the drive
_FIT, _HELD_OUT = "fit", "held_out"


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
    if is_own_map(drive) and {_FIT, _HELD_OUT} <= set(drive.splits):
        return split_of_map(*(_by_map(drive, drive.split(name)) for name in (_FIT, _HELD_OUT)))
    return split_frames(drive.frames, [name for name in drive.frames if not _tells_of_ranges(drive[name])])


def split_of_map(fit: Sequence[Sequence[str]], held_out: Sequence[Sequence[str]]) -> Split:
    """The split of scans that maps were made of, and of those that took no part: some of each map.

    Args:
        fit: names of the scans that made a map, a sequence for each.
        held_out: names of those that took no part in it.
    """
    told = [pair for pair in zip(fit, held_out, strict=True) if all(pair)]
    if not told:
        return split_frames([name for names in fit for name in names])
    told = [told[row] for row in _rows(len(told), _MOST_MAPS)]
    scans = max(_MAP_SCANS // len(told), _FEWEST_SCANS)
    judges = max(_MAP_JUDGES // len(told), _FEWEST_JUDGES)
    return Split(
        tuple(names[row] for names, _ in told for row in _rows(len(names), scans)),
        tuple(names[row] for _, names in told for row in _rows(len(names), judges)),
    )


def split_frames(names: Sequence[str], poor: Collection[str] = ()) -> Split:
    """Every fourth segment of consecutive frames judges, the rest is fitted; poor frames by themselves."""
    size = max(1, min(_SEGMENT, len(names) // 8))
    rich = [name for name in names if name not in poor]
    ordered = [*rich, *(name for name in names if name in poor)]
    judges = {name for place, name in enumerate(ordered) if place // size % 4 == 3}
    test = tuple(name for name in names if name in judges)
    fit = tuple(name for name in names if name not in judges)
    return Split(fit, test) if test and fit else Split(tuple(names), tuple(names))


def _by_map(drive: Drive, names: Sequence[str]) -> list[list[str]]:
    """Names by the map that their scans lie in; the maps in the order of the drive."""
    found: dict[str | None, list[str]] = {name: [] for name in dict.fromkeys(f.twin.static for f in drive)}
    for name in names:
        found[drive[name].twin.static].append(name)
    return list(found.values())


def _rows(count: int, most: int) -> list[int]:
    """So many of some rows, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int)).tolist()


def _tells_of_ranges(frame: Frame) -> bool:
    return not frame.has("twin/trust") or read_trust(frame.path("twin/trust")).ground_range
