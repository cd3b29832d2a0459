"""How the head turns is found whatever a ring does not meet."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.recordings import Scan
from cosim.recordings.pattern.turning import find_turning
from sensors.pattern import Pattern, load_pattern

FAN = load_pattern("vlp16").model_copy(update={"azimuth_offset_deg": tuple(np.tile([-3.0, 3.0], 8).tolist())})
_32 = load_pattern("vlp32c")
UNORDERED = _32.model_copy(update={"elevation_deg": tuple(np.roll(_32.elevation_deg, 7).tolist())})


def under_the_sky(pattern: Pattern, rng: np.random.Generator, count: int = 6) -> tuple[list[Scan], list[np.ndarray]]:
    """Scans ring by ring whose upper lasers have returns only in some sectors, and their lasers."""
    rays, scans, rings = pattern.rays(), [], []
    slot = np.arange(len(rays.ring)) % pattern.firings / pattern.firings
    for number in range(count):
        seen = np.ones(len(rays.ring), bool)
        for ring in range(pattern.rings // 4):
            begin = rng.uniform(0.1, 0.7)
            seen &= (rays.ring != ring) | ((slot > begin) & (slot < begin + 0.25))
        rows = np.flatnonzero(seen & (rng.random(len(seen)) < 0.9))
        scans.append(Scan(f"{number:06d}", rays.direction[rows].astype(float) * rng.uniform(5, 60, (len(rows), 1))))
        rings.append(rays.ring[rows].astype(int))
    return scans, rings


@pytest.mark.parametrize("pattern", [load_pattern("vlp16"), FAN, UNORDERED, load_pattern("hdl64e_kitti")])
def test_lasers_that_look_into_the_sky_turn_no_fan_about(pattern: Pattern) -> None:
    scans, rings = under_the_sky(pattern, np.random.default_rng(0))
    turning = find_turning(scans, rings, pattern.rings, pattern.sweep_s)
    step = 360 / pattern.firings
    assert turning.firings == pattern.firings
    seen = np.arange(pattern.rings) >= pattern.rings // 4
    off = turning.fan_deg - np.array(pattern.azimuth_offset_deg)
    assert np.abs(off[seen]).max() < 1.01 * step
    assert np.abs(turning.fan_deg).max() < 1.1 * max(np.abs(pattern.azimuth_offset_deg).max(), step)
