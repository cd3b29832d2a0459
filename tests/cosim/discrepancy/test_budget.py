"""Errors of two models on the same held-out frames."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.discrepancy.budget import Budget, HeldOut
from cosim.discrepancy.settings import DEFAULT

_BEFORE = np.array([0.40, 0.44, 0.38, 0.41, 0.42, 0.39])


def held_out(by_frame: np.ndarray) -> HeldOut:
    return HeldOut(float(by_frame.mean()), by_frame, np.full(len(by_frame), 60_000), None)


def rises(after: np.ndarray) -> bool:
    return held_out(_BEFORE).rises_to(held_out(after), DEFAULT.at_floor, DEFAULT.level)


def test_a_model_that_is_worse_on_every_frame_raises_the_error() -> None:
    assert rises(_BEFORE + np.array([0.05, 0.04, 0.06, 0.05, 0.04, 0.05]))


@pytest.mark.parametrize(
    "after",
    [
        _BEFORE,
        _BEFORE - 0.1,
        _BEFORE + 0.001,  # alignment is not more exact
        _BEFORE + np.array([0.5, -0.1, -0.1, -0.05, -0.05, 0.0]),  # one frame only
        np.full(6, np.nan),
    ],
)
def test_equal_better_or_uncertain_models_do_not(after: np.ndarray) -> None:
    assert not rises(after)


def test_one_frame_shows_no_significant_rise() -> None:
    assert not held_out(_BEFORE[:1]).rises_to(held_out(_BEFORE[:1] + 1), DEFAULT.at_floor, DEFAULT.level)


def test_parts_are_scaled_to_what_exceeds_the_noise() -> None:
    parts = {"noise": 0.4, "poses": 0.3, "missing": 0.3}
    budget = Budget(1.0, 0.5, 0.6, 0.4, parts, (), ())
    assert budget.scaled_to(1.6) == pytest.approx({"noise": 0.4, "poses": 0.6, "missing": 0.6})
    assert budget.scaled_to(0.3) == pytest.approx({"noise": 0.3, "poses": 0.0, "missing": 0.0})
