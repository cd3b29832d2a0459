"""Rings recovered from the order of points, in KITTI's order and ours."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.drives.kitti.drive import Drive
from cosim.drives.kitti.rings import recover_rays
from cosim.errors import FormatError

_ELEVATIONS = np.radians(np.linspace(2, -24.8, 64))
_FIRINGS = 600


def _scan(seed: int, kitti_order: bool, keep: float = 0.8) -> tuple[np.ndarray, np.ndarray]:
    """Points of a random world and their true rings."""
    rng = np.random.default_rng(seed)
    step = (np.arange(_FIRINGS) + 0.5) / _FIRINGS * 2 * np.pi
    azimuth = np.tile(step if kitti_order else np.pi - step, 64)
    ring = np.repeat(np.arange(64), _FIRINGS)
    distance = rng.uniform(3, 60, len(ring))
    height = distance * np.tan(_ELEVATIONS[ring]) + np.where(ring < 32, 0.2, 0.12)
    points = np.stack([distance * np.cos(azimuth), distance * np.sin(azimuth), height, 0 * height], -1)
    kept = rng.random(len(ring)) < keep
    return points[kept].astype(np.float32), ring[kept]


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.floats(0.2, 1))
def test_rings_of_a_full_scan_come_back(seed: int, kitti_order: bool, keep: float) -> None:
    points, ring = _scan(seed, kitti_order, keep)
    rays = recover_rays(points, 0.1)
    assert rays.recovered
    assert np.array_equal(rays.ring, ring)
    assert np.allclose(rays.time_s, -rays.azimuth / (2 * np.pi) * 0.1)
    assert not rays.return_no.any()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.sets(st.integers(0, 63), max_size=12))
def test_the_pattern_shows_which_rings_have_no_return(seed: int, kitti_order: bool, gone: set[int]) -> None:
    points, ring = _scan(seed, kitti_order)
    seen = ~np.isin(ring, list(gone))
    assert np.array_equal(recover_rays(points[seen], 0.1, _ELEVATIONS).ring, ring[seen])


@pytest.mark.parametrize(
    "azimuth",
    [
        [0.001, 6.2828, 0.002, 1, 3, 6.2, 0.01, 2, 6.28, 0.0003, 6.2829, 0.001, 4],
        [6.283, 0.002, 1, 3, 6.2, 0.01, 2, 6.28, 6.283, 0.0003, 4],
        [1, 3, 6.2, 0.01, 0.008, 2, 6.28, 0.3],
    ],
)
def test_jitter_across_the_seam_makes_no_ring(azimuth: list[float]) -> None:
    points = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(len(azimuth))], -1)
    ring = recover_rays(points, 0.1).ring
    assert ring.max() == 2
    assert (np.diff(ring.astype(int)) >= 0).all()


def test_scans_of_no_and_one_point() -> None:
    assert len(recover_rays(np.zeros((0, 4), np.float32), 0.1, _ELEVATIONS)) == 0
    assert recover_rays(np.ones((1, 4), np.float32), 0.1).ring.tolist() == [0]


def test_a_shuffled_scan_is_refused() -> None:
    points, _ = _scan(0, True)
    np.random.default_rng(0).shuffle(points)
    with pytest.raises(FormatError, match=r"rings, more than the 256.*give rays/ or sort it"):
        recover_rays(points, 0.1, source="scan.bin")


def test_real_scans_have_sixty_four_rings_and_their_usual_number_of_points(kitti_root) -> None:
    for frame in Drive(kitti_root):
        rays = frame.rays
        assert rays.recovered
        assert np.array_equal(np.unique(rays.ring), np.arange(64))
        assert 75_000 < len(frame.points) == len(rays) < 130_000
        elevation = [np.median(frame.points[rays.ring == ring, 2]) for ring in (0, 20, 40)]
        assert elevation == sorted(elevation, reverse=True)
        assert np.abs(rays.time_s).max() <= 0.05 + 1e-6
