"""Backing into a place between two parked cars."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.traffic.motion import Script, overlaps
from cosim.traffic.motion.chassis import Chassis
from cosim.traffic.motion.park_path import plan_backing_in

ASIDE_M, PLACE_M, STEP_S = -2.65, 4.0, 0.1


def neighbours(length_m: float, ahead_m: float, behind_m: float) -> np.ndarray:
    """Boxes of those parked before and behind the place."""
    at = PLACE_M + ahead_m + 2, PLACE_M - length_m - behind_m - 2
    return np.array([[x, ASIDE_M, 0.0, 4.0, 1.7] for x in at])


def back_in(length_m: float, ahead_m: float, behind_m: float, askew_rad: float = 0.0) -> Script | None:
    """A script in axes at its start."""
    boxes, size = neighbours(length_m, ahead_m, behind_m), np.array([length_m, 1.7, 1.5])
    position = np.array([PLACE_M, ASIDE_M])
    return plan_backing_in(np.zeros(2), 0.0, "car", size, position, askew_rad, boxes, 0.15, STEP_S)


LENGTHS, GAPS, ASKEW = st.floats(3.0, 5.0), st.floats(2.5, 4.0), st.floats(-0.06, 0.06)


@given(LENGTHS, GAPS, st.floats(0.4, 2.0), ASKEW)
@settings(max_examples=40, deadline=None)
def test_a_car_is_in_its_position_along_the_kerb(length, ahead, behind, askew):
    script = back_in(length, ahead, behind, askew)
    assert script is not None
    assert script.front[-1] == pytest.approx([PLACE_M, ASIDE_M], abs=0.05)
    assert script.heading_rad[-1] == pytest.approx(0.0, abs=1e-6)


@given(LENGTHS, GAPS, st.floats(0.4, 2.0), ASKEW)
@settings(max_examples=20, deadline=None)
def test_it_touches_neither_neighbour(length, ahead, behind, askew):
    script, others = back_in(length, ahead, behind, askew), neighbours(length, ahead, behind)
    assert script is not None
    for front, heading in zip(script.front, script.heading_rad, strict=True):
        middle = front - length / 2 * np.array([np.cos(heading), np.sin(heading)])
        size = np.vstack([[length, 1.7], others[:, 3:]])
        assert not len(overlaps(np.vstack([middle, others[:, :2]]), np.append(heading, [0.0, 0.0]), size).first)


@given(LENGTHS, GAPS, ASKEW)
@settings(max_examples=20, deadline=None)
def test_its_rear_wheels_roll_and_do_not_slip(length, ahead, askew):
    script = back_in(length, ahead, 1.0, askew)
    assert script is not None
    rear_m = float(Chassis.of(("car",), np.array([length])).rear_m[0])
    forward = np.column_stack([np.cos(script.heading_rad), np.sin(script.heading_rad)])
    moved = np.diff(script.front - rear_m * forward, axis=0)
    middle = script.heading_rad[:-1] + np.diff(script.heading_rad) / 2
    across = moved[:, 1] * np.cos(middle) - moved[:, 0] * np.sin(middle)
    assert np.abs(across).max() < 0.003
    assert np.hypot(*moved.T).max() < 2.0 * STEP_S


def test_a_gap_as_long_as_the_car_is_too_short():
    assert back_in(4.5, 0.3, 0.3) is None
