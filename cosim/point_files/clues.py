"""Properties that the points of a scan show: ground, sense of rotation, lasers, firing times.

Every statistic is robust: it uses quantiles or shares, so that a few wrong rows do not decide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_FEWEST = 200  # points that a statistic needs
_BLOCKS = 180  # of consecutive points, for the turn of the head
_TOGETHER = 0.95  # resultant length of azimuths in a block that the head was at in one moment
_SAME_SENSE = 0.9  # share of steps between blocks in one sense
_TURN = (0.45, 1.6)  # revolutions that one scan may hold
_LAYER_M, _HEIGHTS_M = 0.2, (0.3, 6.0)  # thickness of a ground layer, heights of sensors above the ground
_LAYER_SHARE, _OTHER_SHARE, _BEYOND_SHARE = 0.12, 0.3, 0.02
_REACH_M = 40.0  # of points that show the ground
_STEPS_M, _ON_STEP, _MOST_ON_STEP = (0.001, 0.002, 0.004, 0.005), 0.15, 0.8  # resolutions; within share of a step
_ELEVATION_CELLS = 1800  # of 0.1°
_RING_SPREAD = 0.3  # spread of elevations within a laser over that of all points
_GROWTH = 0.97  # correlation of time with place in the file
_ANGLE_UNITS_RAD = (1.0, np.pi / 180, np.pi / 18_000)  # of columns that repeat an angle
_REPEATS, _SAME_RATIO, _SAME_RAD = 0.95, 0.01, 0.01  # share of the points, relative and absolute difference
_CORE, _GAP = (0.02, 0.98), 0.25  # quantiles of times without outliers; longest pause relative to their span


@dataclass(frozen=True)
class GroundClue:
    """The layer of points that the ground makes.

    Attributes:
        z: its height in the sensor's axes [unit of the file].
        share: of the near points in it.
    """

    z: float
    share: float


def find_ground(xyz: np.ndarray, unit_m: float = 1.0) -> GroundClue | None:
    """The ground as a dense layer below or above the sensor; None where no layer is one clearly.

    Args:
        xyz: (n, 3) points.
        unit_m: length of one unit of the coordinates.
    """
    near = xyz[np.hypot(xyz[:, 0], xyz[:, 1]) * unit_m < _REACH_M]
    if len(near) < _FEWEST:
        return None
    below, above = (_layer(sign * near[:, 2] * unit_m) for sign in (-1, 1))
    best, other, sign = (below, above, -1) if below[1] >= above[1] else (above, below, 1)
    beyond = float(np.mean(sign * near[:, 2] * unit_m > best[0] + 2 * _LAYER_M))
    if best[1] < _LAYER_SHARE or other[1] > _OTHER_SHARE * best[1] or beyond > _BEYOND_SHARE:
        return None
    return GroundClue(sign * best[0] / unit_m, best[1])


def range_resolution_unit(ranges: np.ndarray, units_m: tuple[float, ...]) -> float | None:
    """The unit [m] in which ranges are multiples of a sensor's resolution; None unless exactly one is.

    Sensors measure ranges in steps of 1 to 5 mm. Stored as float32 coordinates, the steps are still visible up to some
    tens of metres, unless a calibration of each laser has been applied.

    Args:
        ranges: (n,) distances from the sensor [unit of the file].
        units_m: possible lengths of one unit.
    """
    near = ranges[(ranges > 0) & (ranges * min(units_m) < _REACH_M)]
    if len(near) < _FEWEST:
        return None
    stepped = []
    for unit in units_m:
        steps = [near * unit / step for step in _STEPS_M]
        if any(np.mean(np.abs(each - np.rint(each)) < _ON_STEP) > _MOST_ON_STEP for each in steps):
            stepped.append(unit)
    return stepped[0] if len(stepped) == 1 else None


def _layer(heights: np.ndarray) -> tuple[float, float]:
    """Height and share of the densest layer at the heights at which sensors are mounted."""
    edges = np.arange(_HEIGHTS_M[0], _HEIGHTS_M[1] + _LAYER_M, _LAYER_M)
    counts, _ = np.histogram(heights, edges)
    densest = int(counts.argmax())
    return float(edges[densest] + _LAYER_M / 2), float(counts[densest] / len(heights))


def sense_of_rotation(xyz: np.ndarray, time: np.ndarray | None) -> int | None:
    """+1 where azimuths grow with time (counter-clockwise about z), −1 where they fall; None where that is not to see.

    Points come in the order of firing where blocks of consecutive points share an azimuth and the blocks make about one
    revolution. With times the points are put in that order first.

    Args:
        xyz: (n, 3) points in the order of the file.
        time: (n,) firing times of any unit; None where there are none.
    """
    if time is not None:
        xyz = xyz[np.argsort(time, kind="stable")]
    if len(xyz) < 4 * _BLOCKS:
        return None
    direction = np.exp(1j * np.arctan2(xyz[:, 1], xyz[:, 0]))
    edges = np.linspace(0, len(xyz), _BLOCKS + 1).astype(int)
    mean = np.add.reduceat(direction, edges[:-1]) / np.diff(edges)
    if float(np.median(np.abs(mean))) < _TOGETHER:
        return None
    step = np.angle(mean[1:] / mean[:-1])
    turns = abs(float(step.sum())) / (2 * np.pi)
    sense = 1 if step.sum() > 0 else -1
    if not _TURN[0] < turns < _TURN[1] or float(np.mean(sense * step > 0)) < _SAME_SENSE:
        return None
    return sense


def elevation_entropy(xyz: np.ndarray) -> float:
    """Entropy of the elevations of points (n, 3) about z [nats]: low where they gather on cones, as those of lasers."""
    elevation = np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1]))
    counts = np.histogram(elevation, _ELEVATION_CELLS, (-np.pi / 2, np.pi / 2))[0]
    share = counts[counts > 0] / max(len(xyz), 1)
    return float(-np.sum(share * np.log(share)))


def separates_elevations(xyz: np.ndarray, values: np.ndarray) -> bool:
    """Whether points of equal value lie at equal elevations, as those of one laser do.

    Args:
        xyz: (n, 3) points.
        values: (n,) whole numbers.
    """
    known, group, count = np.unique(values, return_inverse=True, return_counts=True)
    if len(xyz) < _FEWEST or len(known) < 2 or len(known) > len(xyz) / 8:
        return False
    elevation = np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1]))
    order = np.lexsort((elevation, group))
    median = elevation[order][np.cumsum(count) - (count + 1) // 2]
    within = float(np.median(np.abs(elevation - median[group])))
    return within < _RING_SPREAD * float(np.median(np.abs(elevation - np.median(elevation))))


def repeated_geometry(xyz: np.ndarray, values: np.ndarray) -> str | None:
    """Name the coordinate of the points that a column repeats in another form; None if it repeats none.

    Args:
        xyz: (n, 3) points.
        values: (n,) column.
    """
    ground_m, reach_m = np.hypot(xyz[:, 0], xyz[:, 1]), np.linalg.norm(xyz, axis=1)
    usual = np.isfinite(values) & np.isfinite(reach_m) & (reach_m > 0)
    if usual.sum() < _FEWEST:
        return None
    values, ground_m, reach_m, xyz = values[usual], ground_m[usual], reach_m[usual], xyz[usual]
    for name, length in (("range", reach_m), ("horizontal range", ground_m), ("squared range", reach_m**2)):
        if _is_proportional(values, length):
            return name
    azimuth, elevation = np.arctan2(xyz[:, 1], xyz[:, 0]), np.arctan2(xyz[:, 2], ground_m)
    for unit in _ANGLE_UNITS_RAD:
        span = float(np.ptp(np.quantile(values, [0.01, 0.99]))) * unit
        if 0.5 * np.pi < span < 2.02 * np.pi and any(_is_turned(sense * values * unit, azimuth) for sense in (1, -1)):
            return "azimuth"
        if np.mean(np.abs(values * unit - elevation) < _SAME_RAD) > _REPEATS:
            return "elevation"
    return None


def _is_proportional(values: np.ndarray, length: np.ndarray) -> bool:
    """Whether values are a constant times lengths that differ."""
    spread = np.quantile(length, [0.1, 0.9])
    usual = length > 0
    if spread[1] < 1.5 * spread[0] or usual.mean() < _REPEATS:
        return False
    ratio = values[usual] / length[usual]
    factor = float(np.median(ratio))
    return factor > 0 and float(np.mean(np.abs(ratio / factor - 1) < _SAME_RATIO)) > _REPEATS


def _is_turned(angle_rad: np.ndarray, azimuth_rad: np.ndarray) -> bool:
    """Whether angles are azimuths from any zero."""
    away = np.exp(1j * (angle_rad - azimuth_rad))
    middle = np.angle(np.mean(away))
    return float(np.mean(np.abs(np.angle(away * np.exp(-1j * middle))) < _SAME_RAD)) > _REPEATS


def are_laser_numbers(values: np.ndarray, most: int = 512) -> bool:
    """Whether all values but a few are small whole numbers."""
    finite = values[np.isfinite(values)]
    whole = (finite == np.round(finite)) & (finite >= 0) & (finite < most)
    return len(finite) > 0 and float(np.mean(whole)) > 0.99


def grows_along_firing(xyz: np.ndarray, time: np.ndarray) -> bool:
    """Whether values grow along the order of firing: with the place in the file, or with the turn of the head.

    Args:
        xyz: (n, 3) points in the order of the file.
        time: (n,) finite values.
    """
    usual = core_times(time)
    xyz, time = xyz[usual], time[usual]
    if len(time) < 20 or time.max() <= time.min():
        return False
    position = np.arange(len(time), dtype=np.float64)
    if np.corrcoef(position, time)[0, 1] > _GROWTH:
        return True
    return sense_of_rotation(xyz, time) is not None


def core_times(time: np.ndarray) -> np.ndarray:
    """(n,) bool: times that belong to the sweep; outliers are separated by a pause that no sweep has.

    Args:
        time: (n,) times in any unit; non-finite values are outliers.
    """
    finite = np.isfinite(time.astype(np.float64))
    if finite.sum() < 20:
        return finite
    ordered = np.sort(time[finite])
    low, high = (round(q * (len(ordered) - 1)) for q in _CORE)
    longest = _GAP * float(ordered[high] - ordered[low])
    steps = np.diff(ordered).astype(np.float64)
    first = low - int(np.argmax((steps[:low] > longest)[::-1])) if (steps[:low] > longest).any() else 0
    last = high + int(np.argmax(steps[high:] > longest)) if (steps[high:] > longest).any() else len(ordered) - 1
    with np.errstate(invalid="ignore"):
        return finite & (time >= ordered[first]) & (time <= ordered[last])
