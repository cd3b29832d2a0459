"""The pattern that scans were taken with is found in their points, in whatever order they come."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from cosim.cli import main
from cosim.recordings import Scan
from cosim.recordings.pattern.lasers import find_lasers
from sensors.pattern import load_pattern, pattern_names
from tests.cosim.conftest import refused
from tests.cosim.recordings.simulated import scans

SPINNING = [name for name in pattern_names() if name not in ("at128_like", "depth_camera", "rosette_like_mid40")]
QUICK = ("vlp16", "hdl32e", "hdl64e_kitti", "os1_64", "pandar128")  # one of each way to space lasers
SAMPLES = Path(os.environ.get("COSIM_SCAN_SAMPLES", "samples"))


def written(folder: Path, result: list[Scan]) -> Path:
    folder.mkdir(parents=True)
    for scan in result:
        np.column_stack([scan.xyz, np.full(len(scan), 0.5)]).astype("<f4").tofile(folder / f"{scan.name}.bin")
    return folder


def estimate_pattern_of(folder: Path, out: Path) -> dict:
    file = out / "found.json"
    assert main(["pattern", str(folder), "--out", str(out / "found.yaml"), "--json", str(file), "--quiet"]) == 0
    return json.loads(file.read_text())


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in SPINNING]
)
def test_lasers_of_every_built_in_pattern_are_counted_and_placed(name: str, tmp_path: Path) -> None:
    pattern = load_pattern(name)
    result = estimate_pattern_of(written(tmp_path / "scans", scans(pattern, "shuffled")), tmp_path)
    assert result["lasers"] == pattern.rings and result["points_on_a_beam_share"] > 0.99
    np.testing.assert_allclose(result["elevation_deg"], pattern.elevation_deg, atol=0.02)
    assert result["firings"] == pattern.firings and result["order"] == "unordered"


@pytest.mark.parametrize("order", ["rings", "firings", "shuffled"])
@pytest.mark.parametrize(
    "name", ["vlp16", *(pytest.param(name, marks=pytest.mark.slow) for name in SPINNING if name != "vlp16")]
)
def test_two_decimals_and_stray_points_change_no_count(name: str, order: str) -> None:
    pattern, rng = load_pattern(name), np.random.default_rng(0)
    xyz, number = [], []
    for row, scan in enumerate(scans(pattern, order)):
        points, stray = scan.xyz.copy(), rng.random(len(scan)) < 0.005
        way = rng.normal(size=(stray.sum(), 3))
        points[stray] = way / np.linalg.norm(way, axis=1)[:, None] * rng.uniform(1, 60, (stray.sum(), 1))
        xyz.append(np.round(points, 2))
        number.append(np.full(len(points), row))
    every = np.concatenate(xyz)
    found = find_lasers(np.hypot(every[:, 0], every[:, 1]), every[:, 2], np.concatenate(number), 0.01)
    assert len(found) == pattern.rings
    off = np.abs(found.elevation_deg - np.array(pattern.elevation_deg))
    assert off.mean() < 0.02


@pytest.mark.parametrize("name", ["vlp16", pytest.param("hdl64e_kitti", marks=pytest.mark.slow)])
def test_two_decimals_do_not_blur_the_azimuth_step(name: str, tmp_path: Path) -> None:
    pattern = load_pattern(name)
    rounded = [Scan(scan.name, np.round(scan.xyz, 2)) for scan in scans(pattern, "shuffled")]
    result = estimate_pattern_of(written(tmp_path / "scans", rounded), tmp_path)
    assert result["lasers"] == pattern.rings
    assert result["firings"] == pattern.firings and result["firings_fixed"]


@pytest.mark.parametrize("order", ["rings", "firings", "shuffled"])
def test_the_order_of_points_changes_no_elevation_and_gives_the_azimuth_offsets(order: str, tmp_path: Path) -> None:
    pattern = load_pattern("hdl64e_kitti")
    result = estimate_pattern_of(written(tmp_path / "scans", scans(pattern, order)), tmp_path)
    np.testing.assert_allclose(result["elevation_deg"], pattern.elevation_deg, atol=0.001)
    off = np.array(result["azimuth_offset_deg"]) - np.array(pattern.azimuth_offset_deg)
    step = 360 / pattern.firings
    if order == "shuffled":
        off = (off + step / 2) % step - step / 2  # known but to whole steps
        assert any("azimuth offsets cannot be determined" in note for note in result["notes"])
    assert np.ptp(off) < 1.01 * step
    again = load_pattern(str(tmp_path / "found.yaml"))
    assert again.rings == 64 and again.firings == 2157


def test_two_optical_centres_are_two_blocks(tmp_path: Path) -> None:
    pattern = load_pattern("hdl64e")
    raised = []
    for scan in scans(pattern, "shuffled"):
        elevation = np.arctan2(scan.xyz[:, 2], scan.flat_range_m)
        lower = np.degrees(elevation) < -8.7
        xyz = scan.xyz + np.where(lower, 0.12, 0.20)[:, None] * [0, 0, 1]
        raised.append(Scan(scan.name, xyz))
    result = estimate_pattern_of(written(tmp_path / "scans", raised), tmp_path)
    np.testing.assert_allclose(result["block_centre_m"], [0.20, 0.12], atol=0.002)
    np.testing.assert_allclose(result["elevation_deg"], pattern.elevation_deg, atol=0.02)
    assert load_pattern(str(tmp_path / "found.yaml")).block == pattern.block
    assert any("dual_block, upper_m: 0.200" in note for note in result["notes"])


def test_the_page_shows_the_findings(tmp_path: Path) -> None:
    folder = written(tmp_path / "scans", scans(load_pattern("vlp16"), "firings", count=2))
    assert main(["pattern", str(folder), "--out", str(tmp_path / "v.yaml"), "--page", str(tmp_path / "page")]) == 0
    page = (tmp_path / "page/index.html").read_text()
    for words in ("16 lasers from +15.00° to -15.00°", "1808 firings/turn", "Misfit", "Fan", "Spacing"):
        assert words in page


def test_a_laser_that_meets_only_the_vehicle_is_detected() -> None:
    rng, pattern = np.random.default_rng(0), load_pattern("vlp32c")
    rays = pattern.rays()
    away = rng.uniform(3, 30, len(rays.ring))
    away[rays.ring == 31] = 0.7  # steeply down
    xyz = rays.direction.astype(float) * away[:, None]
    found = find_lasers(np.hypot(xyz[:, 0], xyz[:, 1]), xyz[:, 2], np.zeros(len(xyz), int))
    np.testing.assert_allclose(found.elevation_deg, pattern.elevation_deg, atol=0.02)


def test_noise_across_the_beams_becomes_misfit_and_not_lasers() -> None:
    pattern = load_pattern("vlp16")
    rng = np.random.default_rng(1)
    scan = scans(pattern, "shuffled", count=1)[0]
    turned = np.arctan2(scan.xyz[:, 2], scan.flat_range_m) + rng.normal(0, np.radians(0.01), len(scan))
    height = scan.flat_range_m * np.tan(turned)
    found = find_lasers(scan.flat_range_m, height, np.zeros(len(scan), int))
    assert len(found) == 16
    np.testing.assert_allclose(found.misfit_deg, 0.01, rtol=0.4)


def test_what_is_no_spinning_sensor_is_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    cloud = rng.uniform(-20, 20, (20000, 3))
    message = refused("pattern", written(tmp_path / "cloud", [Scan("0", cloud)]), "--out", tmp_path / "p.yaml")
    assert "cones about z" in message and "raster:" in message
    table = load_pattern("rosette_like_mid40")
    message = refused(
        "pattern", written(tmp_path / "rosette", scans(table, "firings", 1)), "--out", tmp_path / "p.yaml"
    )
    assert "cones about z" in message


def test_scans_of_several_sensors_are_refused(tmp_path: Path) -> None:
    one = scans(load_pattern("vlp16"), "firings", count=3)
    other = scans(load_pattern("os1_64"), "firings", count=1)[0]
    message = refused(
        "pattern", written(tmp_path / "both", [*one, Scan("000009", other.xyz)]), "--out", tmp_path / "p.yaml"
    )
    assert "as of several sensors" in message and "000009" in message


def test_too_few_points_are_refused(tmp_path: Path) -> None:
    folder = written(tmp_path / "few", [Scan("0", np.arange(150.0).reshape(50, 3) % 17 + 1)])
    assert "50 points" in refused("pattern", folder, "--out", tmp_path / "p.yaml")


@pytest.mark.skipif(not (SAMPLES / "nebula/velodyne_vlp16.pcd").is_file(), reason="COSIM_SCAN_SAMPLES has no samples")
def test_a_real_vlp16_agrees_with_its_own_columns(tmp_path: Path) -> None:
    file = SAMPLES / "nebula/velodyne_vlp16.pcd"
    result = estimate_pattern_of(file, tmp_path)
    data = pytest.importorskip("pypcd4").PointCloud.from_path(file).pc_data
    own = np.unique(np.degrees(np.arcsin(data["elevation"])).round(3))  # the driver stores the sine
    nearest = np.abs(np.array(result["elevation_deg"])[:, None] - own).min(1)
    assert nearest.max() < 0.02
