"""Which frames are fitted, and which are held out."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.settings import DEFAULT, Sampling
from cosim.drives.kitti import Drive, Frame
from cosim.drives.twin import read_trust
from cosim.drives.twin.surfels import has_surfels

_FIT, _HELD_OUT = "fit", "held_out"


@dataclass(frozen=True)
class Split:
    """Names of frames.

    Attributes:
        fit: those that are fitted.
        test: held-out frames; the same where there are too few for both.
    """

    fit: tuple[str, ...]
    test: tuple[str, ...]

    @property
    def is_held_out(self) -> bool:
        """Whether the test frames took no part in the fit."""
        return not set(self.fit) & set(self.test)


def split_drive(drive: Drive, beams: int, settings: Sampling = DEFAULT.sampling) -> Split:
    """The split of a drive's frames; of those whose ground tells nothing of ranges as many judge as of the others.

    Of maps made of the scans, those judge that took no part in them.

    Args:
        drive: with its twin.
        beams: of a turn.
        settings: numbers that decide.
    """
    if has_surfels(drive.root) and {_FIT, _HELD_OUT} <= set(drive.splits):
        fit, held_out = (_by_map(drive, drive.split(name)) for name in (_FIT, _HELD_OUT))
        places = {frame.name: frame.twin.ego.pose[:3, 3] for frame in drive}
        return split_of_maps(fit, held_out, places, beams, settings)
    poor = [name for name in drive.frames if not _tells_of_ranges(drive[name])]
    return split_frames(drive.frames, poor, settings)


def split_of_maps(
    fit: Sequence[Sequence[str]],
    held_out: Sequence[Sequence[str]],
    places: Mapping[str, np.ndarray],
    beams: int,
    settings: Sampling = DEFAULT.sampling,
) -> Split:
    """The split of scans that maps were made of, and of those that took no part.

    One map gives scans from end to end. Of several, as many as memory bears and evenly spread along the drive, each
    gives some of a stretch on which the sensor moves far: scans of a sensor that waits show every surface alike.

    Args:
        fit: names of the scans that made a map, in order, a sequence for each.
        held_out: names of those that took no part in it.
        places: (3,) of the sensor by name, in the axes of each map [m].
        beams: of a turn.
        settings: numbers that decide.
    """
    told = [pair for pair in zip(fit, held_out, strict=True) if all(pair)]
    if not told:
        return split_frames([name for names in fit for name in names], (), settings)
    if len(told) == 1:
        return Split(_spread(told[0][0], settings.map_scans), _spread(told[0][1], settings.map_judges))
    most = max(settings.most_beams // (beams * (settings.scans_each + settings.judges_each)), 1)
    told = [told[row] for row in _rows(len(told), most)]
    each = max(settings.map_scans // len(told), settings.scans_each)
    judges = max(settings.map_judges // len(told), settings.judges_each)
    fitted, judging = list[str](), list[str]()
    for mine, theirs in told:
        stretch = _moving(mine, places, each * settings.apart, settings.as_far)
        fitted += _spread(stretch, each)
        judging += _spread(_nearest(theirs, stretch, places, 2 * judges), judges)
    return Split(tuple(fitted), tuple(judging))


def split_frames(names: Sequence[str], poor: Collection[str] = (), settings: Sampling = DEFAULT.sampling) -> Split:
    """Hold out every fourth segment of consecutive frames.

    Poor frames, whose ground contains no information on ranges, are divided separately in the same proportion.
    """
    size = max(1, min(settings.segment, len(names) // 8))
    ordered = [*(name for name in names if name not in poor), *(name for name in names if name in poor)]
    held_out = {name for place, name in enumerate(ordered) if place // size % 4 == 3}
    test = tuple(name for name in names if name in held_out)
    fit = tuple(name for name in names if name not in held_out)
    return Split(fit, test) if test and fit else Split(tuple(names), tuple(names))


def _by_map(drive: Drive, names: Sequence[str]) -> list[list[str]]:
    """Names by the map that their scans lie in; the maps in the order of the drive."""
    found: dict[str | None, list[str]] = {name: [] for name in dict.fromkeys(f.twin.static for f in drive)}
    for name in names:
        found[drive[name].twin.static].append(name)
    return list(found.values())


def _moving(names: Sequence[str], places: Mapping[str, np.ndarray], most: int, as_far: float) -> Sequence[str]:
    """So many names that follow each other and along which the sensor moves far; of such, those next to the middle."""
    steps = np.linalg.norm(np.diff([places[name] for name in names], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    count = min(most, len(names))
    moved = along[count - 1 :] - along[: len(names) - count + 1]
    far = np.flatnonzero(moved >= as_far * moved.max())
    first = int(far[np.abs(far - (len(moved) - 1) / 2).argmin()])
    return names[first : first + count]


def _nearest(names: Sequence[str], others: Sequence[str], places: Mapping[str, np.ndarray], most: int) -> Sequence[str]:
    """So many names, in order, of places next to where others are in the middle."""
    middle = places[others[len(others) // 2]]
    order = sorted(range(len(names)), key=lambda row: float(np.linalg.norm(places[names[row]] - middle)))
    return [names[row] for row in sorted(order[:most])]


def _spread(names: Sequence[str], most: int) -> tuple[str, ...]:
    """So many names, evenly spread."""
    return tuple(names[row] for row in _rows(len(names), most))


def _rows(count: int, most: int) -> list[int]:
    """So many of some rows, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int)).tolist()


def _tells_of_ranges(frame: Frame) -> bool:
    return not frame.has("twin/trust") or read_trust(frame.path("twin/trust")).ground_range
