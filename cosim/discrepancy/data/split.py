"""Split of a drive into frames for fitting and held-out frames for validation."""

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
    """Names of the frames of a split.

    Attributes:
        fit: frames for fitting.
        test: held-out frames; the same frames if there are too few for both.
    """

    fit: tuple[str, ...]
    test: tuple[str, ...]

    @property
    def is_held_out(self) -> bool:
        """Whether the test frames are not used for fitting."""
        return not set(self.fit) & set(self.test)

    def thinned(self, most: int) -> Split:
        """At most `most` evenly spaced frames of each part."""
        return Split(_select_evenly(self.fit, most), _select_evenly(self.test, most))


def split_drive(drive: Drive, beams: int, settings: Sampling = DEFAULT.sampling) -> Split:
    """Split a drive's frames; frames without ranges to the ground are split separately in the same proportion.

    If the twin is a map made from the scans, the held-out frames are scans that were not used for the map.

    Args:
        drive: drive with its twin.
        beams: number of beams per revolution.
        settings: settings of the split.
    """
    if has_surfels(drive.root) and {_FIT, _HELD_OUT} <= set(drive.splits):
        fit, held_out = (_group_by_map(drive, drive.split(name)) for name in (_FIT, _HELD_OUT))
        places = {frame.name: frame.twin.ego.pose[:3, 3] for frame in drive}
        return split_of_maps(fit, held_out, places, beams, settings)
    poor = [name for name in drive.frames if not _has_ground_ranges(drive[name])]
    return split_frames(drive.frames, poor, settings)


def split_of_maps(
    fit: Sequence[Sequence[str]],
    held_out: Sequence[Sequence[str]],
    positions: Mapping[str, np.ndarray],
    beams: int,
    settings: Sampling = DEFAULT.sampling,
) -> Split:
    """Select frames if the twin consists of maps made from the scans.

    One map: scans are evenly spaced over the whole drive. Several maps: as many maps as fit into memory are used,
    evenly spaced along the drive. From each, scans are taken from a stretch on which the sensor moves far, because
    scans of a sensor at rest contain no repeated observations from different distances.

    Args:
        fit: for each map, names of the scans it was made from, in order.
        held_out: for each map, names of the other scans in it.
        positions: (3,) position of the sensor by frame name, in the axes of its map [m].
        beams: number of beams per revolution.
        settings: settings of the split.
    """
    maps = [pair for pair in zip(fit, held_out, strict=True) if all(pair)]
    if not maps:
        return split_frames([name for names in fit for name in names], (), settings)
    if len(maps) == 1:
        return Split(
            _select_evenly(maps[0][0], settings.map_scans), _select_evenly(maps[0][1], settings.map_validation_scans)
        )
    most = max(settings.most_beams // (beams * (settings.scans_each + settings.validation_scans_each)), 1)
    maps = [maps[row] for row in _even_rows(len(maps), most)]
    each = max(settings.map_scans // len(maps), settings.scans_each)
    validation_each = max(settings.map_validation_scans // len(maps), settings.validation_scans_each)
    training, validation = list[str](), list[str]()
    for fit_names, held_out_names in maps:
        stretch = _select_stretch(fit_names, positions, each * settings.apart, settings.as_far)
        training += _select_evenly(stretch, each)
        validation += _select_evenly(
            _select_nearest(held_out_names, stretch, positions, 2 * validation_each), validation_each
        )
    return Split(tuple(training), tuple(validation))


def split_frames(names: Sequence[str], poor: Collection[str] = (), settings: Sampling = DEFAULT.sampling) -> Split:
    """Hold out every fourth segment of consecutive frames.

    Poor frames, whose ground contains no information on ranges, are divided separately in the same proportion.
    """
    size = max(1, min(settings.segment, len(names) // 8))
    ordered = [*(name for name in names if name not in poor), *(name for name in names if name in poor)]
    held_out = {name for index, name in enumerate(ordered) if index // size % 4 == 3}
    test = tuple(name for name in names if name in held_out)
    fit = tuple(name for name in names if name not in held_out)
    return Split(fit, test) if test and fit else Split(tuple(names), tuple(names))


def _group_by_map(drive: Drive, names: Sequence[str]) -> list[list[str]]:
    """Group names by the map that their scans are in; maps in the order of the drive."""
    by_map: dict[str | None, list[str]] = {name: [] for name in dict.fromkeys(f.twin.static for f in drive)}
    for name in names:
        by_map[drive[name].twin.static].append(name)
    return list(by_map.values())


def _select_stretch(
    names: Sequence[str], positions: Mapping[str, np.ndarray], most: int, as_far: float
) -> Sequence[str]:
    """Select `most` consecutive names with a long path of the sensor, as close to the middle as possible."""
    steps = np.linalg.norm(np.diff([positions[name] for name in names], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    count = min(most, len(names))
    moved = along[count - 1 :] - along[: len(names) - count + 1]
    far = np.flatnonzero(moved >= as_far * moved.max())
    first = int(far[np.abs(far - (len(moved) - 1) / 2).argmin()])
    return names[first : first + count]


def _select_nearest(
    names: Sequence[str], others: Sequence[str], positions: Mapping[str, np.ndarray], most: int
) -> Sequence[str]:
    """Select the `most` names closest to the middle one of `others`, in order."""
    middle = positions[others[len(others) // 2]]
    order = sorted(range(len(names)), key=lambda row: float(np.linalg.norm(positions[names[row]] - middle)))
    return [names[row] for row in sorted(order[:most])]


def _select_evenly(names: Sequence[str], most: int) -> tuple[str, ...]:
    """Select at most `most` evenly spaced names."""
    return tuple(names[row] for row in _even_rows(len(names), most))


def _even_rows(count: int, most: int) -> list[int]:
    """Select at most `most` evenly spaced rows."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int)).tolist()


def _has_ground_ranges(frame: Frame) -> bool:
    return not frame.has("twin/trust") or read_trust(frame.path("twin/trust")).ground_range
