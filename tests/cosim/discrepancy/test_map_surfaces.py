"""Maps made of a drive's own scans: which beams may be compared, and what stays free."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.data.map_surfaces import Maps
from cosim.drives.kitti import Drive
from cosim.drives.twin.surfels import has_surfels
from cosim.errors import FormatError
from sensors.hits import NOTHING, STATIC
from sensors.npz import npz_bytes


def wall(count: int = 40, **changed: np.ndarray) -> dict[str, np.ndarray]:
    """Surfaces of 40 cm side by side on the plane x = 5, seen from 4 to 9 metres."""
    position = np.arange(count) * 0.4
    arrays = {
        "centre": np.column_stack([np.full(count, 5.0), position, np.ones(count)]),
        "normal": np.tile([-1.0, 0, 0], (count, 1)),
        "reach_m": np.full((count, 8), 0.2),
        "sd_m": np.full(count, 0.02),
        "range_m": np.tile([4.0, 9.0], (count, 1)),
        "cos_incidence": np.tile([0.4, 0.9], (count, 1)),
        "trusted": np.ones(count, np.uint8),
        "cell_m": np.array([0.4]),
    }
    return arrays | changed


def drive_with(folder: Path, arrays: dict[str, np.ndarray]) -> Drive:
    (folder / "velodyne").mkdir(parents=True)
    (folder / "twin").mkdir()
    (folder / "calib").mkdir()
    np.ones((3, 4), "<f4").tofile(folder / "velodyne/000000.bin")
    (folder / "twin/surfels.npz").write_bytes(npz_bytes(arrays))
    return Drive(folder)


def test_hit_is_assigned_to_the_surface_it_lies_on(tmp_path: Path) -> None:
    drive = drive_with(tmp_path / "drive", wall())
    surfaces = Maps(drive).of(None)
    assert surfaces is not None and has_surfels(drive.root)
    position = np.array([[5.0, 0.83, 1.1], [5.01, 4.0, 0.9], [5.2, 4.0, 1.0], [5.0, 4.0, 1.0]])
    met = surfaces.met(position, np.array([STATIC, STATIC, STATIC, NOTHING]))
    np.testing.assert_array_equal(met, [2, 10, -1, -1])


def test_beams_are_compared_where_they_return_from_about_a_trusted_surface_or_not_at_all(tmp_path: Path) -> None:
    surfaces = Maps(drive_with(tmp_path / "drive", wall(trusted=np.array([1] * 39 + [0], np.uint8)))).of(None)
    assert surfaces is not None
    measured = np.array([[4.9, 0, 1], [4.5, 0, 1], [np.nan] * 3, [5.0, 15.6, 1], [5.0, 0, 1]])
    position = np.array([[5.0, 0, 1], [5.0, 0, 1], [5.0, 0, 1], [5.0, 15.6, 1], [5.0, 0, 1]])
    met, slope, still = np.array([0, 0, 0, 39, -1]), np.ones(5), np.zeros((5, 3))
    compared, stopped = surfaces.compared(met, position, slope, measured, still)
    np.testing.assert_array_equal(compared, [True, False, True, False, False])
    np.testing.assert_array_equal(stopped, [False, True, False, False, False])
    for moved, seen in ((0.4, True), (1.5, True), (-0.4, False)):
        compared, _ = surfaces.compared(met, position, slope, measured, np.tile([moved, 0, 0], (5, 1)))
        np.testing.assert_array_equal(compared, [True, seen, True, False, False], f"it had moved by {moved} m")


def test_beam_at_grazing_incidence_with_a_return_off_the_surface_is_not_compared(tmp_path: Path) -> None:
    surfaces = Maps(drive_with(tmp_path / "drive", wall())).of(None)
    assert surfaces is not None
    position, measured = np.tile([5.0, 0, 1], (2, 1)), np.tile([4.8, 0, 1], (2, 1))
    compared, _ = surfaces.compared(np.zeros(2, int), position, np.array([1.0, 0.05]), measured, np.zeros((2, 3)))
    np.testing.assert_array_equal(compared, [True, False])


def test_beam_outside_the_points_of_a_surface_is_not_compared(tmp_path: Path) -> None:
    surfaces = Maps(drive_with(tmp_path / "drive", wall())).of(None)
    assert surfaces is not None
    position = np.array([[5.0, 0.1, 1.1], [5.0, 0.19, 1.19]])  # in the cell's corner, beyond the octagon of the points
    lost = np.full((2, 3), np.nan)
    compared, _ = surfaces.compared(np.zeros(2, int), position, np.ones(2), lost, np.zeros((2, 3)))
    np.testing.assert_array_equal(compared, [True, False])


def test_roughness_is_what_noise_of_ranges_does_not_explain(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    slope = rng.uniform(0.05, 1, 4000)
    sd = np.hypot(0.006, 0.02 * slope)
    arrays = wall(4000, sd_m=sd, cos_incidence=np.stack([slope, slope], 1))
    surfaces = Maps(drive_with(tmp_path / "drive", arrays)).of(None)
    assert surfaces is not None
    assert np.median(surfaces.rough_m) == pytest.approx(0.006, rel=0.25)


def test_sampled_surfaces_have_the_requested_number_of_observations_half_of_them_horizontal(tmp_path: Path) -> None:
    normal = np.where(np.arange(400)[:, None] < 300, [[0.0, 0, 1]], [[1.0, 0, 0]])
    surfaces = Maps(drive_with(tmp_path / "drive", wall(400, normal=normal))).of(None)
    assert surfaces is not None
    looks = np.where(np.arange(400) % 10 == 0, 1, 10)
    drawn = surfaces.sample(looks, 1000, np.random.default_rng(0))
    assert len(np.unique(drawn)) == len(drawn) == 100 and (looks[drawn] > 1).all()
    assert np.count_nonzero(drawn < 300) == pytest.approx(50, abs=1)


def test_a_map_of_several_is_that_of_the_frame(tmp_path: Path) -> None:
    drive = drive_with(tmp_path / "drive", wall())
    (drive.root / "twin/surfels").mkdir()
    (drive.root / "twin/surfels.npz").rename(drive.root / "twin/surfels/segment_0003.npz")
    (drive.root / "twin/surfels/segment_0004.npz").write_bytes(npz_bytes(wall(7)))
    maps = Maps(drive)
    third, fourth = maps.of("worlds/segment_0003.glb"), maps.of("worlds/segment_0004.glb")
    assert third is not None and fourth is not None and (len(third), len(fourth)) == (40, 7)
    assert maps.of("worlds/segment_0003.glb") is third


def test_a_damaged_map_is_refused(tmp_path: Path) -> None:
    arrays = wall()
    del arrays["normal"]
    with pytest.raises(FormatError, match="missing normal"):
        Maps(drive_with(tmp_path / "lacks", arrays)).of(None)
    with pytest.raises(FormatError, match="one row per surface"):
        Maps(drive_with(tmp_path / "short", wall(sd_m=np.ones(3)))).of(None)
