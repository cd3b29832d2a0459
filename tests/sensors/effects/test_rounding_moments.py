"""Rounding: what it leaves of a mean and a spread."""

from __future__ import annotations

import numpy as np
import pytest

from sensors.effects.rounding import _moments


@pytest.mark.parametrize("sigma", [0.0, 0.01, 0.03, 0.06, 0.2])
def test_moments_are_those_of_rounded_normal_deviates(sigma):
    step, rng = 0.1, np.random.default_rng(3)
    mean = np.array([0.26, 0.31, 0.449])
    draws = np.rint((mean + sigma * rng.standard_normal((200_000, 3))) / step) * step
    found, variance = _moments(mean, np.full(3, sigma), step)
    assert np.allclose(found, draws.mean(0), atol=1.5e-3 if sigma else 1e-9)
    assert np.allclose(np.sqrt(variance), draws.std(0), atol=1.5e-3)


def test_no_step_leaves_everything():
    found, variance = _moments(np.array([1.0]), np.array([0.2]), 0.0)
    assert found[0] == 1.0 and variance[0] == pytest.approx(0.04)
