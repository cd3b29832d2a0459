"""The two-sample test finds what differs, and nothing between equal sets."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cosim.cli import main
from cosim.drives.kitti import write_calibration, write_points
from cosim.stats.two_sample.figures import FIGURES, measure_figures
from cosim.stats.two_sample.patches import Patches
from cosim.stats.two_sample.separation import TwoSampleSettings, pairwise_auc, separate_sets
from tests.cosim.stats.sets import CALIBRATION

pytest.importorskip("sklearn", reason="the two-sample test needs scikit-learn")

KEYS = [figure.key for figure in FIGURES]
QUICK = TwoSampleSettings(folds=3, draws=99, trees=20, leaves=7)


def patches(rng: np.random.Generator, units: int = 12, shift: dict[str, float] | None = None) -> Patches:
    """Eight patches a unit whose figures are normal, with a mean of each unit's own."""
    unit = np.repeat(np.arange(units), 8)
    figures = rng.normal(size=(len(unit), len(FIGURES))) + 0.3 * rng.normal(size=(units, len(FIGURES)))[unit]
    for key, amount in (shift or {}).items():
        figures[:, KEYS.index(key)] += amount
    return Patches(
        unit,
        unit.astype(str),
        np.zeros((len(unit), 2), int),
        figures.astype(np.float32),
        np.ones((len(unit), 4), bool),
        np.zeros((len(unit), 2, 4, 4), np.float16),
    )


def test_equal_sets_are_not_distinguished() -> None:
    rng = np.random.default_rng(1)
    result = separate_sets(patches(rng), patches(rng), rng, QUICK)
    for item in result.channels:
        assert 0.3 < item.sets.auc < 0.7
        assert item.sets.p_value is not None
        assert item.sets.p_value > 0.05


def test_the_channel_that_differs_is_named() -> None:
    rng = np.random.default_rng(2)
    result = separate_sets(patches(rng, shift={"zeros": 2.0}), patches(rng), rng, QUICK)
    found = {item.channel: item.sets for item in result.channels}
    assert found["intensity"].auc > 0.8
    assert found["intensity"].low <= found["intensity"].auc <= found["intensity"].high
    assert found["intensity"].p_value is not None
    assert found["intensity"].p_value < 0.1  # twice the mean over folds of four units against four
    assert found["geometry"].auc < 0.7
    assert result.figures[0].key == "zeros"
    assert result.figures[0].is_larger


def test_auc_counts_ties_half() -> None:
    assert pairwise_auc(np.array([1.0, 2.0]), np.array([1.0, 0.0])) == pytest.approx(3.5 / 4)


def test_figures_of_a_plane_with_given_gaps() -> None:
    range_m = np.full((1, 16, 40), 10.0, np.float32)
    range_m[0, 3, [5, 9]] = np.nan  # two single gaps
    range_m[0, 7] = np.nan  # a row without return
    intensity = np.where(np.isnan(range_m), np.nan, np.arange(40) >= 20).astype(np.float32)
    found = dict(zip(KEYS, measure_figures(range_m, intensity)[0], strict=True))
    assert found["range_p50"] == 10
    assert found["row_step_p90"] == 0
    assert found["single_gaps"] == pytest.approx(2 / 640)
    assert found["empty_rows"] == pytest.approx(1 / 16)
    assert found["returned"] == pytest.approx(1 - 42 / 640)
    assert found["gap_length"] == pytest.approx(42 / 3)
    assert found["zeros"] == pytest.approx((15 * 20 - 2) / (640 - 42))
    assert found["zero_runs"] == pytest.approx(1 - 15 / (15 * 20 - 2 - 2), abs=0.01)
    assert found["intensity_column_correlation"] == pytest.approx(1)


def scan_set(root: Path, rings: int, frames: int, *, noise_m: float, seed: int) -> Path:
    """Scans of a wall round the sensor, 12 m away, as a LiDAR with some rings sees it."""
    rng = np.random.default_rng(seed)
    for part in ("velodyne", "calib"):
        (root / part).mkdir(parents=True)
    elevation, azimuth = np.meshgrid(
        np.radians(np.linspace(10, -10, rings)), np.arange(0, 2 * np.pi, 0.01), indexing="ij"
    )
    for frame in range(frames):
        distance = 12 + noise_m * rng.normal(size=azimuth.shape)
        across = distance * np.cos(elevation)
        columns = [across * np.cos(azimuth), across * np.sin(azimuth), distance * np.sin(elevation)]
        points = np.stack([*columns, rng.uniform(0.2, 0.4, azimuth.shape)], -1).reshape(-1, 4)
        write_points(root / f"velodyne/{frame:06d}.bin", points[rng.uniform(size=len(points)) > 0.02])
        write_calibration(root / f"calib/{frame:06d}.txt", CALIBRATION)
    return root


@pytest.mark.parametrize("rings", [16, 24])
def test_the_command_needs_neither_twin_nor_labels_nor_one_lidar(tmp_path: Path, rings: int) -> None:
    a = scan_set(tmp_path / "a", 16, 5, noise_m=0.05, seed=1)
    b = scan_set(tmp_path / "b", rings, 8, noise_m=0.005, seed=2)
    command = ["stats", str(a), "--against", str(b), "--out", str(tmp_path / "page"), "--quiet", "--units", "1"]
    assert main([*command, "--json", str(tmp_path / "r.json")]) == 0
    found = json.loads((tmp_path / "r.json").read_text())["two_sample"]
    assert found["grid"]["rows_are_lasers"] == (rings == 16)
    assert found["channels"]["geometry"]["auc"] > 0.95
    assert found["channels"]["geometry"]["baseline"]["auc"] < 0.75
    assert found["figures"][0]["channel"] == "geometry"
    page = (tmp_path / "page/index.html").read_text(encoding="utf-8")
    assert page.count('alt="range, 2 to 80 m') == 24


@pytest.mark.parametrize(("option", "value"), [("--units", "town"), ("--units", "0"), ("--sector-deg", "5")])
def test_bad_options_are_refused(
    drive: Path, tmp_path: Path, option: str, value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["stats", str(drive), "--against", str(drive), "--out", str(tmp_path / "page"), "--quiet", option, value]
    assert main(command) == 2
    assert value in capsys.readouterr().err
    assert not (tmp_path / "page").exists()
