"""Which frames are fitted and which only judge."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from cosim.discrepancy.labelled_twin.trust import read_trust
from cosim.drives.kitti import Drive, Frame

_SEGMENT = 3


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
    """The split of a drive's frames; of those whose ground tells nothing of ranges as many judge as of the others."""
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


def _tells_of_ranges(frame: Frame) -> bool:
    return not frame.has("twin/trust") or read_trust(frame.path("twin/trust")).ground_range
