"""What pose errors say of effects that make such errors: those that follow a pattern over scans are no chance."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.discrepancy.pose_patterns import agreement, followed

SCANS = 16
CRITICAL = 4.0  # about what a family of sixty candidates takes
FLOOR = np.full(6, 1e-3)


def _acceleration() -> np.ndarray:
    return np.array([2.4, -0.5, -0.1, 1.0, -1.0, -0.7, -4.5, -4.5, -1.3, 0.0, -1.6, -0.4, 1.5, -0.6, 0.2, 0.1])


def _pitches(made: np.ndarray) -> np.ndarray:
    errors = np.zeros((SCANS, 6))
    errors[:, 4] = made
    return errors


def _agreement(errors: np.ndarray, seed: int = 0):
    return agreement(errors, _pitches(_acceleration()), FLOOR, np.random.default_rng(seed))


def test_pitches_that_follow_the_acceleration_show_and_tell_how_strongly():
    noise = 0.02 * np.random.default_rng(1).standard_normal((SCANS, 6))
    found = _agreement(_pitches(-0.3 * _acceleration()) + noise)
    assert found is not None and found.deviate < -CRITICAL and found.p_value < 0.01
    assert found.amplitude == pytest.approx(-0.3, abs=4 * found.error)
    assert found.error < 0.02


@pytest.mark.parametrize("drifting", [False, True])
def test_errors_of_their_own_hardly_ever_follow_it(drifting):
    alarms = 0
    for seed in range(100):
        errors = np.random.default_rng(seed).standard_normal((SCANS, 6))
        found = _agreement(errors.cumsum(0) if drifting else errors, seed)
        alarms += found is not None and abs(found.deviate) > CRITICAL and found.p_value < 0.05
    assert alarms <= 1


def test_a_turn_that_all_scans_share_is_steady_and_a_drift_is_not():
    rng, alike = np.random.default_rng(2), _pitches(np.ones(SCANS))
    noise = 0.01 * rng.standard_normal((SCANS, 6))
    drift = _pitches(1.0 + 0.2 * rng.standard_normal(SCANS).cumsum())
    steady, wandering = (agreement(made + noise, alike, FLOOR, rng) for made in (alike, drift))
    assert steady is not None and steady.is_steady and steady.deviate > CRITICAL and steady.p_value < 0.01
    assert wandering is not None and not wandering.is_steady


def test_a_single_scan_that_is_far_off_proves_nothing():
    made = np.zeros(SCANS)
    made[6] = 5.0
    found = _agreement(_pitches(made))
    assert found is not None and abs(found.deviate) < CRITICAL


def test_errors_too_small_to_matter_prove_nothing():
    noise = 1e-6 * np.random.default_rng(1).standard_normal((SCANS, 6))
    found = _agreement(_pitches(1e-4 * _acceleration()) + noise)
    assert found is not None and abs(found.deviate) < 1.0


def test_a_pattern_is_that_of_what_stands_still():
    rng = np.random.default_rng(0)
    basis = rng.standard_normal((2000, 6))
    true = np.array([10.0, 0.0, 0.0, 0.0, 0.1, 0.0])
    change = basis @ true
    change[:300] += 40 + 20 * rng.standard_normal(300)  # a car that comes along
    made, _ = followed(basis, change, np.ones(2000))
    assert made == pytest.approx(true, abs=0.05)
