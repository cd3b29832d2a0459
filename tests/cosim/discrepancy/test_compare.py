"""Comparing: a right model has no error, a wrong one shows what is wrong with it, and gaps are said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.cli.frame_choice import chosen_frames
from cosim.discrepancy import compare
from cosim.discrepancy.data.checks import opened
from cosim.drives.kitti import Drive
from cosim.errors import CosimError, DriveError
from sensors.effects.registry import find_effect
from sensors.errors import SensorError
from sensors.sensor_model import SensorModel
from tests.cosim.discrepancy.small_drive import PATTERN, make_yard


def effect(name: str, **values: float):
    return find_effect(name).model_validate(values)


def test_the_true_bare_sensor_has_no_error(tmp_path: Path) -> None:
    yard = make_yard(tmp_path)
    found = compare(yard.drive, yard.sensor)
    assert found.error < 1e-3
    assert found.totals.matched > 0.6 * found.totals.beams
    assert found.at_floor
    assert found.totals.parts()["drop"] == 0
    assert found.totals.spurious == 0


def test_constant_range_error_is_reported_as_bias_and_in_the_slices(tmp_path: Path) -> None:
    yard = make_yard(tmp_path, (effect("range_bias", offset_m=0.03),))
    found = compare(yard.drive, yard.sensor)
    ranges = found.to_json()["channels"]["range"]
    assert ranges["bias_m"] == pytest.approx(0.03, abs=2e-4)
    assert ranges["mae_m"] == pytest.approx(0.03, abs=2e-4)
    assert ranges["rmse_m"] == pytest.approx(0.03, abs=2e-4)
    assert found.totals.parts()["range"] == pytest.approx(0.03, abs=2e-4)
    assert not found.at_floor
    worst = found.slices[0]
    assert worst.channel == "range"
    assert worst.bias == pytest.approx(0.03, abs=1e-3)
    known = SensorModel(PATTERN, (effect("range_bias", offset_m=0.03),), "known")
    assert compare(yard.drive, known).error < 1e-3


def test_true_noise_scores_better_than_none_too_little_or_too_much(tmp_path: Path) -> None:
    noise = "range_noise"
    yard = make_yard(tmp_path, (effect(noise, sigma_m=0.02),))

    def error(sigma_m: float) -> float:
        effects = (effect(noise, sigma_m=sigma_m),) if sigma_m else ()
        return compare(yard.drive, SensorModel(PATTERN, effects, "stated"), budget=False).totals.parts()["range"]

    right = error(0.02)
    assert right < min(error(0.0), error(0.005), error(0.06))
    # The Gaussian's own CRPS: σ/√π. Without noise in the model it is the mean absolute error, σ·√(2/π).
    assert right == pytest.approx(0.02 / np.sqrt(np.pi), rel=0.05)
    assert error(0.0) == pytest.approx(0.02 * np.sqrt(2 / np.pi), rel=0.05)


def test_the_noise_floor_is_the_error_of_the_true_model(tmp_path: Path) -> None:
    noise = (effect("range_noise", sigma_m=0.02), effect("intensity_noise", sigma_rel=0.1))
    yard = make_yard(tmp_path, noise)
    right = compare(yard.drive, SensorModel(PATTERN, noise, "true"), budget=False)
    assert right.floor is not None
    assert right.error == pytest.approx(right.floor.error, rel=0.05)
    wrong = compare(
        yard.drive, SensorModel(PATTERN, (*noise, effect("range_bias", offset_m=0.05)), "wrong"), budget=False
    )
    assert wrong.floor is not None
    assert wrong.floor.error == pytest.approx(right.floor.error, rel=0.1)
    assert wrong.error > 1.5 * wrong.floor.error


def test_lost_returns_are_drops_and_their_chance_is_scored(tmp_path: Path) -> None:
    lossy = effect("random_dropout", probability=0.2)
    yard = make_yard(tmp_path, (lossy,))
    surprised = compare(yard.drive, yard.sensor, budget=False).totals
    assert surprised.dropped / (surprised.dropped + surprised.matched) == pytest.approx(0.2, abs=0.02)
    foreseen = compare(yard.drive, SensorModel(PATTERN, (lossy,), "lossy"), budget=False).totals
    share = (surprised.dropped + surprised.matched) / surprised.beams
    # Brier: p where all returns were promised, p(1 − p) where the chance was known.
    assert surprised.parts()["drop"] == pytest.approx(0.2 * share, rel=0.1)
    assert foreseen.parts()["drop"] == pytest.approx(0.16 * share, rel=0.1)


def test_what_no_surface_gave_is_spurious(tmp_path: Path) -> None:
    def nearer(points: np.ndarray) -> np.ndarray:
        points = points.copy()
        far = np.flatnonzero(np.linalg.norm(points[:, :3], axis=1) > 15)[:200:4]
        points[far, :3] *= 0.4
        return points

    yard = make_yard(tmp_path, change=nearer)
    found = compare(yard.drive, yard.sensor, budget=False)
    assert 35 <= found.to_json()["channels"]["spurious"]["per_frame"] <= 50
    assert abs(found.totals.signed) / found.totals.matched < 1e-3


def test_points_that_are_no_numbers_are_left_out_and_counted(tmp_path: Path) -> None:
    def spoilt(points: np.ndarray) -> np.ndarray:
        points = points.copy()
        points[10:17, 0] = np.nan
        return points

    yard = make_yard(tmp_path, frames=2, change=spoilt)
    found = compare(yard.drive, yard.sensor, budget=False)
    assert found.totals.bad == 14
    assert any("14 points with NaN" in note for note in found.notes)
    assert np.isfinite(found.error)


def test_a_drive_without_intensities_leaves_that_channel_out_and_says_so(tmp_path: Path) -> None:
    yard = make_yard(tmp_path, (effect("range_bias", offset_m=0.02),), columns=3)
    found = compare(yard.drive, yard.sensor, budget=False)
    assert "intensity" not in found.to_json()["channels"]
    assert any("no intensities" in note for note in found.notes)
    parts = found.totals.parts()
    assert set(parts) == {"range", "drop", "spurious"}
    assert found.error == pytest.approx((parts["range"] / 0.01 + parts["drop"] / 0.02 + parts["spurious"]) / 3)


def test_a_twin_that_is_metres_off_is_refused_with_its_misfit(tmp_path: Path) -> None:
    yard = make_yard(tmp_path, shifted_m=6.0)
    with pytest.raises(DriveError, match=r"the twin does not fit frame 000000: only \d+% .* the median is \d+\.\d\d m"):
        compare(yard.drive, yard.sensor)


def test_one_frame_is_enough_and_is_said(tmp_path: Path) -> None:
    yard = make_yard(tmp_path, frames=1)
    found = compare(yard.drive, yard.sensor)
    assert found.totals.frames == 1
    assert any("only one frame" in note for note in found.notes)


def test_the_same_seed_gives_the_same_error(tmp_path: Path) -> None:
    noise = (effect("range_noise", sigma_m=0.02),)
    yard = make_yard(tmp_path, noise)
    sensor = SensorModel(PATTERN, noise, "noisy")
    first, again, other = (compare(yard.drive, sensor, seed=seed).error for seed in (1, 1, 2))
    assert first == again
    assert first == pytest.approx(other, rel=0.05)


def test_frames_by_name_or_number(tmp_path: Path) -> None:
    drive = opened(make_yard(tmp_path, frames=3).drive)
    assert chosen_frames(drive, "2") == ("000000", "000002")
    assert chosen_frames(drive, "000001,000000") == ("000001", "000000")
    for wrong in ("000009", "", "some"):
        with pytest.raises(CosimError):
            chosen_frames(drive, wrong)


def test_a_sensor_file_with_an_unknown_effect_is_refused(tmp_path: Path) -> None:
    yard = make_yard(tmp_path, known=({"effect": "range_wlak", "amplitude_m": 0.1},), frames=1)
    with pytest.raises(SensorError, match="did you mean range_walk"):
        compare(yard.drive, yard.sensor)


def test_the_floor_of_drops_knows_that_chances_differ(tmp_path: Path) -> None:
    """Where dim returns are lost more often than bright ones, neighbours of unlike chance differ for a known reason."""
    soft = (effect("detection_threshold", threshold=0.2, softness=0.05), effect("incidence_falloff", exponent=0.6))
    yard = make_yard(tmp_path, soft, frames=4)
    found = compare(yard.drive, SensorModel(PATTERN, soft, "true"), budget=False)
    assert found.floor is not None
    assert found.totals.parts()["drop"] > 0.02
    assert found.floor.parts["drop"] == pytest.approx(found.totals.parts()["drop"], rel=0.12)


def test_a_drive_in_bytes_has_the_figures_of_the_same_drive_in_shares(tmp_path: Path) -> None:
    noise = (effect("range_noise", sigma_m=0.02), effect("intensity_noise", sigma_rel=0.1))
    byte = np.array([1, 1, 1, 255], np.float32)
    shares = make_yard(tmp_path / "shares", noise)
    in_bytes = make_yard(tmp_path / "bytes", noise, change=lambda points: points * byte)
    one, other = (compare(yard.drive, SensorModel(PATTERN, noise, "true"), budget=False) for yard in (shares, in_bytes))
    assert other.error == pytest.approx(one.error, rel=1e-5)
    for name, values in one.to_json()["channels"].items():
        assert other.to_json()["channels"][name] == pytest.approx(values, rel=1e-5, abs=1e-7)
    assert any("parts of 255" in note for note in Drive(in_bytes.drive).notes())
    assert not any("255" in note for note in Drive(shares.drive).notes())
