"""`cosim detect DRIVE` with the included detector, on drives and on bare scans."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cosim.cli import main
from cosim.drives.kitti import read_calibration, read_labels, read_points, write_points
from cosim.recordings import open_recording
from training.checkpoints import load_detector, read_checkpoint
from training.recorded import RecordedFrames, height_above_ground
from training.weights import shipped


@pytest.fixture
def scans(tiny_drive: Path, tmp_path: Path) -> Path:
    """The tiny drive's scans as those of a bare LiDAR that sits 0.4 m higher."""
    folder = tmp_path / "my_scans"
    folder.mkdir()
    for file in (tiny_drive / "velodyne").iterdir():
        write_points(folder / file.name, read_points(file) - np.float32([0, 0, 0.4, 0]))
    return folder


def test_the_detector_that_comes_along_is_small_and_holds_nothing_but_itself():
    assert shipped().stat().st_size < 5e6
    assert set(read_checkpoint(shipped())) == {"format", "model", "classes", "weights"}
    detector, classes = load_detector(shipped())
    assert classes == ("Car",) and detector.settings.name == "pillars_small" and detector.settings.refine


def test_a_drive_is_looked_at_without_naming_a_detector(tiny_drive, tmp_path):
    out, report = tmp_path / "found", tmp_path / "told.json"
    assert main(["detect", str(tiny_drive), "--out", str(out), "--json", str(report), "--quiet"]) == 0
    assert sorted(file.stem for file in out.glob("*.txt")) == [f"{number:06d}" for number in range(4)]
    assert json.loads(report.read_text())["classes"] == ["Car"]


def test_the_height_of_a_bare_lidar_is_detected_and_its_scans_brought_to_the_height_that_was_learnt(scans):
    recording = open_recording(scans)
    height = height_above_ground(recording)
    assert height == pytest.approx(2.1, abs=0.02)
    lowest = [np.median(bare.points[bare.points[:, 2] < -1.5, 2]) for bare in RecordedFrames(recording, height)]
    assert lowest == pytest.approx([-1.73] * 4, abs=0.02)


def test_bare_scans_need_neither_calibration_nor_labels(scans, tmp_path, capsys):
    out = tmp_path / "found"
    assert main(["detect", str(scans), "--out", str(out)]) == 0
    assert "2.10 m above the ground" in capsys.readouterr().err
    found = [read_labels(file) for file in sorted(out.glob("*.txt"))]
    assert len(found) == 4 and read_calibration(out / "calib" / "000000.txt").P2.shape == (3, 4)
    for labels in found:  # cars are on the ground, 2.1 m below the LiDAR
        assert labels.location[labels.score > 0.5, 1] == pytest.approx(2.1, abs=0.4)


def test_what_is_neither_drive_nor_scans_is_refused_in_a_line(tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    assert main(["detect", str(tmp_path / "empty"), "--quiet"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
