"""Scans whose only twin is the ground seen in themselves: what is wrong with the sensor shows in the road."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy import diagnose
from cosim.discrepancy.analysis import context_of, trace_and_fit
from cosim.drives.kitti import Calibration, Drive, Labels, write_calibration, write_labels, write_points
from cosim.labelled_twin import write_labelled_twin
from sensors.effects.beams.elevation_offset import ElevationOffset
from sensors.effects.points.range_noise import RangeNoise
from sensors.pattern import Pattern
from sensors.sensor_model import SensorModel
from tests.cosim.labelled_twin.scans import ELEVATION_RAD, FIRINGS, HEIGHT_M, scan

ERROR_DEG, NOISE = 0.2, RangeNoise(sigma_m=0.01)
PATTERN = Pattern(
    name="formula",
    sweep_s=0.1,
    firings=FIRINGS,
    range_m=(0.9, 80.0),
    elevation_deg=tuple(np.degrees(ELEVATION_RAD).tolist()),
    azimuth_offset_deg=(180.0 / FIRINGS,) * len(ELEVATION_RAD),
)
CALIBRATION = Calibration(
    P2=np.array([[700, 0, 600, 0], [0, 700, 180, 0], [0, 0, 1, 0]], float),
    R0_rect=np.eye(3),
    Tr_velo_to_cam=np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0]], float),
)


def _recorded(folder: Path, scans: int) -> Drive:
    """Roads that slope and bend a little, each by itself, seen by lasers that all look higher than they say."""
    root, rng = folder / "kitti" / "training", np.random.default_rng(4)
    for part in ("velodyne", "label_2", "calib"):
        (root / part).mkdir(parents=True)
    for number in range(scans):
        along, across, bend = rng.normal(0, [0.01, 0.01, 2e-5])

        def ground(x, y, along=along, across=across, bend=bend):
            return -HEIGHT_M + along * x + across * y + bend * x * x

        points, _ = scan(ground, seed=number, error_deg=ERROR_DEG, noise_m=NOISE.sigma_m)
        points[:, 3] = 0  # no intensities
        write_points(root / f"velodyne/{number:06d}.bin", points)
        write_calibration(root / f"calib/{number:06d}.txt", CALIBRATION)
        write_labels(root / f"label_2/{number:06d}.txt", Labels.empty())
    source = Drive(folder / "kitti")
    (folder / "pattern.yaml").write_text(PATTERN.to_yaml())
    write_labelled_twin(source, source.frames, folder / "drive", str(folder / "pattern.yaml"))
    return Drive(folder / "drive")


def test_such_scans_have_no_pose_errors_that_could_make_up_for_the_sensor(tmp_path: Path) -> None:
    drive, effects = _recorded(tmp_path, 4), (ElevationOffset(offset_deg=0.0), NOISE)
    context = context_of(drive, SensorModel(PATTERN, effects, "plain"))
    for free in ((), (0,)):
        found = trace_and_fit(context, drive.frames, effects, free)
        assert found.fitter.sample.own_axes
        assert not any(frame.shot.is_texture_known for frame in found.frames)
        assert not found.fitter.random.poses(found.fitted.estimate).any()
    offset = found.fitted.effects[0]
    assert isinstance(offset, ElevationOffset)
    assert offset.offset_deg == pytest.approx(ERROR_DEG, abs=0.05)


@pytest.mark.slow
def test_a_diagnosis_finds_first_that_all_lasers_look_too_low(tmp_path: Path) -> None:
    found = diagnose(_recorded(tmp_path, 12), SensorModel(PATTERN, (NOISE,), "plain"))
    assert found.effects[0].effect == "elevation_offset"
    (offset,) = (effect for effect in found.sensor.effects if isinstance(effect, ElevationOffset))
    assert offset.offset_deg == pytest.approx(ERROR_DEG, abs=0.05)
    assert found.error_after < 0.3 * found.error_before
