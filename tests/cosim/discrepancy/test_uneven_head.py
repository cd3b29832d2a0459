"""Points of a head that turns unevenly: beams look where points lie, and slots that it skips are no losses."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cosim.discrepancy.data.observation import Observed, observe
from cosim.drives.kitti import Drive
from cosim.drives.kitti.rays import PointRays, encode_rays
from sensors.pattern import load_pattern

PATTERN = load_pattern("vlp16")
STEP_RAD = 2 * np.pi / PATTERN.firings
REACH_M = 10.0


def observed(folder: Path, slots: np.ndarray) -> Observed:
    """One laser's returns at ten metres, at places (n,) in steps from the first slot."""
    azimuth = np.pi - (slots + 0.5) * STEP_RAD
    count, ring = len(slots), 8
    elevation = np.radians(PATTERN.elevation_deg[ring])
    flat = np.cos(elevation)
    direction = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.full(count, np.sin(elevation))], 1)
    for name in ("velodyne", "rays", "calib"):
        (folder / name).mkdir(parents=True)
    points = np.column_stack([REACH_M * direction, np.full(count, 0.5)])
    points.astype("<f4").tofile(folder / "velodyne/000000.bin")
    nothing = np.zeros(count)
    rays = PointRays(np.full(count, ring, np.uint8), azimuth, nothing, nothing.astype(np.uint8))
    (folder / "rays/000000.npz").write_bytes(encode_rays(rays))
    return observe(Drive(folder)["000000"], PATTERN, PATTERN.rays())


def of_ring(values: np.ndarray) -> np.ndarray:
    return values.reshape(PATTERN.rings, PATTERN.firings)[8]


def test_beams_look_where_their_points_lie(tmp_path: Path) -> None:
    found = observed(tmp_path, np.arange(20) + 0.4)
    assert np.abs(of_ring(found.along_m)[:20] - REACH_M).max() < 1e-4
    assert np.abs(of_ring(found.above_m)[:20]).max() < 1e-4


def test_a_slot_that_the_head_skips_is_no_loss_and_a_gap_is(tmp_path: Path) -> None:
    found = observed(tmp_path, np.array([0.4, 1.4, 2.7, 3.7, 5.4, 6.4, 9.4]))  # no firing in 2 and 4, losses in 7 and 8
    trusted, returned = of_ring(found.trusted), of_ring(found.returned)
    np.testing.assert_array_equal(np.flatnonzero(returned), [0, 1, 3, 4, 5, 6, 9])
    np.testing.assert_array_equal(np.flatnonzero(~trusted), [2])
    assert trusted[7] and trusted[8]


def test_points_in_the_middle_of_their_slots_show_every_dropped_return(tmp_path: Path) -> None:
    found = observed(tmp_path, np.array([0.0, 1.0, 3.0]))
    assert of_ring(found.trusted).all() and not of_ring(found.returned)[2]
