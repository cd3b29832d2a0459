"""Calibration from scans only."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.cli import main
from cosim.drives.twin.scene import scene_instances
from cosim.recordings import open_recording
from cosim.recordings.calibration.rounds import widened
from cosim.recordings.mapping.odometry import find_trajectory
from sensors.beams import Beams
from sensors.effects.beams.elevation_offset import ElevationOffset
from sensors.pattern import Pattern, load_pattern
from sensors.sensor_model import load_sensor
from sensors.tracing import Tracer
from tests.cosim.conftest import refused
from tests.cosim.recordings.simulated import yard
from tests.cosim.recordings.test_twin import STEP_M, carried, path
from tests.sharing import made_once

OFFSET_DEG = 0.6
SCANS = 24


def record(folder: Path, poses: np.ndarray, pattern: Pattern, dims_m: float | None = None) -> Path:
    """Scans of the yard by a moving sensor whose beams look higher than it believes, and whose echoes get weaker."""
    folder.mkdir(parents=True)
    rng, nominal, moving = np.random.default_rng(0), pattern.rays(), carried(pattern)
    raised = Beams.nominal(moving).raised(np.radians(OFFSET_DEG)).direction
    tracer = Tracer(replace(moving, direction=raised), pattern.range_m)
    for number, pose in enumerate(poses):
        reach = tracer.trace(yard(), pose, scene_instances(())).solid.range_m.astype(float)
        rows = np.flatnonzero(reach < pattern.range_m[1])
        away = reach[rows] + rng.normal(0, 0.01, len(rows))
        xyz = nominal.direction[rows].astype(float) * away[:, None]
        light = np.clip(0.3 * (1 + rng.normal(0, 0.1, len(rows))), 0, 1)
        light = light if dims_m is None else light / (1 + away / dims_m) ** 2
        np.column_stack([xyz, light]).astype("<f4").tofile(folder / f"{number:06d}.bin")
    return folder


def test_odometry_does_not_travel_with_the_cone_that_raised_beams_make_of_level_ground(tmp_path: Path) -> None:
    pytest.importorskip("kiss_icp")
    scans = record(tmp_path / "scans", path(8), load_pattern("vlp32c"))
    assert find_trajectory(open_recording(scans), 0.1).path_m == pytest.approx(7 * STEP_M, rel=0.1)


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibration on twenty-four scans: `scans/`, `out/` and `told.json` in one folder."""
    pytest.importorskip("kiss_icp")

    def make(folder: Path) -> None:
        record(folder / "scans", path(SCANS), load_pattern("vlp32c"))
        command = ["calibrate", str(folder / "scans"), "--out", str(folder / "out"), "--rounds", "2"]
        assert main([*command, "--json", str(folder / "told.json"), "--quiet"]) == 0

    return made_once(tmp_path_factory, "calibration", make)


@pytest.mark.slow
def test_points_corrected_for_what_was_detected_make_a_thinner_map(calibrated: Path) -> None:
    rounds = json.loads((calibrated / "told.json").read_text())["rounds"]
    found = {one["effect"]: one for each in rounds for one in each["findings"]}
    assert set(found) == {"sweep_motion", "elevation_offset"}
    for effect, amplitude, true in (("sweep_motion", "sweep_s", 0.1), ("elevation_offset", "offset_deg", OFFSET_DEG)):
        low, high = found[effect]["ci95"][amplitude]
        assert low < true < high
    for name in ("thickness_ground_m", "thickness_walls_m", "held_out_m"):
        assert rounds[1][name] < rounds[0][name]
    sensor = load_sensor(calibrated / "out" / rounds[1]["sensor_out"])
    assert set(found) <= {one.name for one in sensor.effects}


def test_an_interval_knows_what_the_map_takes_up_of_what_its_points_were_not_freed_of() -> None:
    report = {"params": {"offset_deg": 0.2}, "ci95": {"offset_deg": [0.19, 0.21]}}
    first = widened("elevation_offset", report, [])["offset_deg"]
    again = widened("elevation_offset", report, [ElevationOffset(offset_deg=0.18)])["offset_deg"]
    assert first[0] == again[0] == 0.19 and 0.21 < again[1] < 0.215 < 0.23 < first[1]
    noise = {"params": {"sigma_m": 0.02}, "ci95": {"sigma_m": [0.01, 0.03]}}
    assert widened("range_noise", noise, []) == noise["ci95"], "moves no point"
    undetermined = {"params": {"offsets_deg": [None, 0.1]}, "ci95": {"offsets_deg": [[-5.0, 5.0], [0.08, 0.12]]}}
    [whole, narrow] = widened("ring_elevation", undetermined, [])["offsets_deg"]
    assert whole == [-5.0, 5.0] and narrow[1] > 0.12


@pytest.mark.slow
def test_the_page_shows_every_round_and_the_history_of_every_sensor_file(calibrated: Path) -> None:
    page = (calibrated / "out/index.html").read_text()
    for words in ("Thickness of the map", "Error by round", "What was found", "Every sensor file tried"):
        assert words in page
    history = json.loads((calibrated / "out/history.json").read_text())
    rounds = json.loads((calibrated / "told.json").read_text())["rounds"]
    assert len(history) == len(rounds) and all(one["error"] > 0 for one in history)
    for file in ("map", "diagnosis"):
        assert (calibrated / f"out/from_found/round_1/{file}/index.html").is_file()


@pytest.mark.slow
def test_what_was_done_is_not_done_again_and_another_recording_is_refused(calibrated: Path, tmp_path: Path) -> None:
    out = shutil.copytree(calibrated / "out", tmp_path / "out")
    files = {file: file.stat().st_mtime_ns for file in out.rglob("round.json")}
    assert main(["calibrate", str(calibrated / "scans"), "--out", str(out), "--rounds", "2", "--quiet"]) == 0
    assert files == {file: file.stat().st_mtime_ns for file in out.rglob("round.json")}
    other = tmp_path / "other"
    other.mkdir()
    for file in sorted((calibrated / "scans").iterdir())[:6]:
        shutil.copy(file, other)
    assert "holds a calibration on" in refused("calibrate", other, "--out", out)


def test_bad_input_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scans").mkdir()
    np.ones((100, 4), "<f4").tofile(tmp_path / "scans/000000.bin")
    assert "a map needs five" in refused("calibrate", tmp_path / "scans", "--out", tmp_path / "out")
    assert "--rounds 0" in refused("calibrate", tmp_path / "scans", "--out", tmp_path / "out", "--rounds", "0")
    assert "recording itself" in refused("calibrate", tmp_path / "scans", "--out", tmp_path / "scans")


@pytest.mark.slow
def test_the_order_of_points_in_files_does_not_change_what_is_detected(tmp_path: Path) -> None:
    pytest.importorskip("kiss_icp")
    rings = record(tmp_path / "rings", path(SCANS), load_pattern("vlp16"))
    report = {}
    for order in ("rings", "firings", "shuffled"):
        folder = tmp_path / order
        folder.mkdir(exist_ok=True)
        for file in sorted(rings.iterdir()):
            points = np.fromfile(file, "<f4").reshape(-1, 4)
            rng = np.random.default_rng(int(file.stem))
            rows = {
                "rings": np.arange(len(points)),
                "firings": np.argsort(-np.arctan2(points[:, 1], points[:, 0]), kind="stable"),
                "shuffled": rng.permutation(len(points)),
            }[order]
            if order != "rings":
                points[rows].tofile(folder / file.name)
        out = ["--out", str(tmp_path / f"{order}_out"), "--json", str(tmp_path / f"{order}.json")]
        assert main(["calibrate", str(folder), *out, "--rounds", "1", "--quiet"]) == 0
        report[order] = json.loads((tmp_path / f"{order}.json").read_text())["rounds"][0]
    first = report["rings"]
    for other in (report["firings"], report["shuffled"]):
        assert other["thickness_ground_m"] == pytest.approx(first["thickness_ground_m"], rel=1e-3)
        own, theirs = first["findings"][0], other["findings"][0]
        assert theirs["effect"] == own["effect"]
        for name, (low, high) in own["ci95"].items():
            assert theirs["params"][name] == pytest.approx(own["params"][name], abs=0.5 * (high - low))


@pytest.mark.slow
def test_a_falloff_with_range_is_identified_though_reflectances_are_unknown(tmp_path: Path) -> None:
    pytest.importorskip("kiss_icp")
    record(tmp_path / "scans", path(SCANS), load_pattern("vlp16"), dims_m=25.0)
    command = ["calibrate", str(tmp_path / "scans"), "--out", str(tmp_path / "out"), "--rounds", "1", "--quiet"]
    assert main([*command, "--json", str(tmp_path / "told.json")]) == 0
    found = {one["effect"]: one for one in json.loads((tmp_path / "told.json").read_text())["rounds"][0]["findings"]}
    params = found["range_falloff"]["params"]
    assert (1 + 20 / params["reference_m"]) ** -params["exponent"] == pytest.approx((1 + 20 / 25) ** -2, rel=0.1)
