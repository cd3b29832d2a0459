"""What values that a sensor cuts off still say of their mean."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.discrepancy.inference.likelihood import MEAN_INFORMATION, NU, SCALE, censored, student_score

SIGMA, DRAWS = 0.1, 200_000


def _values(mean: float) -> np.ndarray:
    drawn = mean + SIGMA * SCALE * np.random.default_rng(3).standard_t(NU, DRAWS)
    return np.clip(drawn, 0, 1)


def _held(values: np.ndarray, mean: float):
    every = np.ones(len(values))
    return censored(values, mean * every, SIGMA * every, (0.0, 1.0))


@pytest.mark.parametrize("mean", [0.0, 0.3, 0.85, 1.0, 1.1])
def test_at_the_true_mean_slopes_average_out_and_scatter_as_the_information_says(mean):
    found = _held(_values(mean), mean)
    assert abs(found.score.mean()) < 0.01
    assert (found.score**2).mean() == pytest.approx(found.information[0], rel=0.02)


def test_maximum_likelihood_mean_of_mostly_censored_values_is_unbiased():
    values = _values(1.05)
    means = np.linspace(0.9, 1.2, 61)
    assert means[np.argmax([_held(values, mean).loglik.sum() for mean in means])] == pytest.approx(1.05, abs=0.01)


def test_far_from_limits_nothing_is_cut_off():
    found = _held(np.array([0.45, 0.5, 0.62]), 0.5)
    np.testing.assert_allclose(found.score, student_score(np.array([-0.5, 0.0, 1.2])))
    np.testing.assert_allclose(found.information, MEAN_INFORMATION, rtol=1e-3)


@pytest.mark.parametrize("mean", [0.0, 0.3, 0.97])
def test_the_score_of_the_spread_is_the_derivative_of_the_likelihood(mean):
    values, every, step = _values(mean)[:1000], np.ones(1000), 1e-4
    less, more = (
        censored(values, mean * every, SIGMA * np.exp(sign * step) * every, (0.0, 1.0)).loglik for sign in (-1, 1)
    )
    np.testing.assert_allclose(_held(values, mean).spread_score, (more - less) / (2 * step), atol=1e-5)
