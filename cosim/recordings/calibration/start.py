"""The sensor model that a calibration starts from: the pattern, its optical centres, and noise as points show it."""

from __future__ import annotations

import numpy as np

from cosim.recordings.mapping.prepare import Prepared
from cosim.recordings.pattern.find import beams_of
from cosim.recordings.recording import Recording
from cosim.recordings.scan import Scan
from sensors.effects.base import Effect
from sensors.effects.beams.dual_block import DualBlock
from sensors.effects.points.intensity_noise import IntensityNoise
from sensors.effects.points.range_noise import RangeNoise
from sensors.sensor_model import SensorModel

GUESSED = (RangeNoise.name, IntensityNoise.name)  # from neighbouring points; fitted along with whatever is found
_SCANS = 6
_SECOND = np.sqrt(6.0)  # standard deviation of a second difference of independent values of one unit each
_SMOOTH_M = 0.3
_LEAST_M, _LEAST_REL = 0.001, 0.01
_NORMAL = 1.4826  # standard deviation of a normal distribution relative to its median absolute deviation
_CENTRED_M = 0.005


def first_sensor(prepared: Prepared) -> SensorModel:
    """Pattern, `dual_block` where the points show two centres or one that is not the origin, and noise."""
    effects: list[Effect] = []
    centres = prepared.found.block_centre_m
    if np.abs(centres).max() > _CENTRED_M:
        upper, lower = centres[0], centres[-1]
        effects.append(DualBlock(upper_m=round(float(upper), 4), lower_m=round(float(lower), 4)))
    range_m, share = point_noise(prepared.recording, prepared.found.lasers.lines)
    effects.append(RangeNoise(sigma_m=round(range_m, 4), sigma_per_m=0.0))
    if share is not None:
        effects.append(IntensityNoise(sigma_rel=round(share, 3)))
    return SensorModel(prepared.pattern, tuple(effects))


def point_noise(recording: Recording, lines: np.ndarray) -> tuple[float, float | None]:
    """Standard deviation of ranges [m], and of intensities as a share of them; None where there are none.

    From second differences of neighbouring points of a laser, which smooth surfaces make small.

    Args:
        recording: scans in order.
        lines: (k, 2) cones of the lasers, see `Lasers.lines`.
    """
    ranges, lights = [], []
    for number in np.unique(np.linspace(0, len(recording) - 1, _SCANS).round().astype(int)):
        away, light = _differences(recording[int(number)], lines)
        ranges.append(away)
        lights.append(light)
    away, light = np.concatenate(ranges), np.concatenate(lights)
    sigma = _NORMAL * float(np.median(np.abs(away))) / _SECOND if len(away) else _LEAST_M
    share = _NORMAL * float(np.median(np.abs(light))) / _SECOND if len(light) else None
    return max(sigma, _LEAST_M), None if share is None else float(np.clip(share, _LEAST_REL, 1.0))


def _differences(scan: Scan, lines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Second differences of ranges where they are small, and of intensities there, as shares of their mean."""
    which, nothing = beams_of(scan, lines), np.zeros(0)
    order = np.lexsort((scan.azimuth_rad, which))
    order = order[which[order] >= 0]
    if len(order) < 3:
        return nothing, nothing
    laser, reach = which[order], np.linalg.norm(scan.xyz[order], axis=1)
    bend = reach[2:] - 2 * reach[1:-1] + reach[:-2]
    smooth = (laser[2:] == laser[:-2]) & (np.abs(bend) < _SMOOTH_M)
    if scan.intensity is None:
        return bend[smooth], nothing
    light = scan.intensity[order].astype(np.float64)
    mean = (light[2:] + light[1:-1] + light[:-2]) / 3
    usable = smooth & (mean > 0.05) & (mean < 0.9)
    return bend[smooth], (light[2:] - 2 * light[1:-1] + light[:-2])[usable] / mean[usable]
