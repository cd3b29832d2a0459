"""What errors of poses have taken up of an effect is handed over to it, where they follow it more than chance does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.diagnose import begun, case_of
from cosim.discrepancy.inference.handover import explained
from cosim.discrepancy.select import screened
from sensors.effects.registry import find_effect
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import make_yard

_LEAST, _KNOWN = np.full(6, 1e-12), np.ones(6)
_PITCH = 4


def _taken(by_scan: np.ndarray) -> np.ndarray:
    """(scans, 6, 1) of an effect that pitches each scan by so much an amplitude."""
    taken = np.zeros((len(by_scan), 6, 1))
    taken[:, _PITCH, 0] = by_scan
    return taken


def test_pose_errors_that_follow_an_effect_gain_the_logarithm_of_how_much_narrower_they_are_beside_it() -> None:
    rng = np.random.default_rng(1)
    by_scan, apart = rng.normal(size=16), 1e-3 * rng.normal(size=(16, 6))
    u = apart + 0.2 * _taken(by_scan)[..., 0]
    amplitude, gain = explained(u[None], _taken(by_scan), _LEAST, _KNOWN)
    assert amplitude[0, 0] == pytest.approx(0.2, rel=0.01)
    narrower = np.sqrt((u[:, _PITCH] ** 2).mean() / (apart[:, _PITCH] ** 2).mean())
    assert gain[0] == pytest.approx(16 * np.log(narrower), rel=0.05)


def test_pose_errors_that_follow_nothing_gain_half_of_a_squared_deviate() -> None:
    rng = np.random.default_rng(2)
    _, gain = explained(rng.normal(size=(2000, 16, 6)), _taken(rng.normal(size=16)), _LEAST, _KNOWN)
    assert gain.min() > -1e-9
    assert gain.mean() == pytest.approx(0.5, rel=0.2)


def test_a_turned_mount_is_found_in_the_poses_of_the_scans(tmp_path: Path) -> None:
    turned = find_effect("mount_rotation").model_validate({"roll_deg": 0.0, "pitch_deg": 0.4, "yaw_deg": 0.0})
    noise = find_effect("range_noise").model_validate({"sigma_m": 0.01})
    yard = make_yard(tmp_path, (turned, noise), known=(NOISE,), frames=12)
    case = case_of(opened(yard.drive), yard.sensor)
    state = begun(case)
    random, fitted = state.view.fitter.random, state.view.fitted
    assert np.degrees(random.poses(fitted.estimate)[:, _PITCH]) == pytest.approx(0.4, abs=0.02), "taken up"
    first = next(one for one in screened(case, state) if one.group.begun is not None)
    assert first.group.name == "mount_rotation" and first.p_value < case.settings.level
    start, left = first.group.start, first.group.begun
    assert start is not None and left is not None
    assert start.model_dump()["pitch_deg"] == pytest.approx(0.4, abs=0.02)
    assert np.abs(np.degrees(random.poses(left)[:, _PITCH])).max() < 0.02
