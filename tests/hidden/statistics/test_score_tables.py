"""Synthetic scores are what they say: mean zero without an effect, and the effect times the information with one."""

from __future__ import annotations

import numpy as np
import pytest

from tests.hidden.statistics.checks import excess, lower_share, uniformity, upper_share
from tests.hidden.statistics.score_tables import (
    CHANNELS,
    correlated_basis,
    draw_basis,
    draw_beams,
    draw_scores,
    quadratic_likelihood,
    track_effects,
)


@pytest.mark.parametrize("channel", CHANNELS)
def test_scores_have_mean_zero_and_grow_with_the_effect(channel: str) -> None:
    rng = np.random.default_rng(1)
    beams = draw_beams(rng, 200_000)
    null = draw_scores(rng, channel, beams)
    error = np.std(null.score) * np.sqrt(len(beams))
    assert abs(null.score.sum()) < 4 * error
    change = 0.02 if channel not in ("spurious", "early", "late") else 1.0
    there = draw_scores(rng, channel, beams, np.full(len(beams), change))
    assert there.score.sum() == pytest.approx(change * null.information.sum(), abs=4 * error, rel=0.1)


def test_tracks_are_of_very_different_sizes() -> None:
    size = np.sort(np.bincount(draw_beams(np.random.default_rng(0)).track))
    assert size[-1] > 20 * np.median(size)


def test_correlated_covariates_agree_for_the_share_requested() -> None:
    rng = np.random.default_rng(2)
    beams = draw_beams(rng)
    first = draw_basis(rng, beams, 8, "beam")
    second = correlated_basis(rng, first, 0.8)
    assert np.asarray(first.multiply(second).sum(1)).mean() == pytest.approx(0.8 + 0.2 / 8, abs=0.03)


def test_the_quadratic_likelihood_is_largest_at_the_step_of_newton() -> None:
    rng = np.random.default_rng(3)
    beams = draw_beams(rng, 300, tracks=20)
    scores = draw_scores(rng, "range", beams)
    x, z = draw_basis(rng, beams, 3, "beam").toarray()[:, :2], track_effects(beams).toarray()
    precision, zero = np.full(z.shape[1], 40.0), np.zeros(z.shape[1])

    def value(theta: np.ndarray) -> float:
        return quadratic_likelihood(scores, x, theta, z, precision, zero)

    curvature = z.T @ z + np.diag(precision)
    left = x - z @ np.linalg.solve(curvature, z.T @ x)
    best = np.linalg.solve(left.T @ x, left.T @ scores.score)
    for step in np.eye(2) * 0.1:
        assert value(best) > value(best + step) and value(best) > value(best - step)


def test_checks_tell_uniform_p_values_from_others() -> None:
    rng = np.random.default_rng(4)
    uniform = rng.random(400)
    assert uniformity(uniform) > 0.01 and excess(uniform, 0.05) > 0.01
    assert uniformity(uniform**2) < 1e-4 and excess(uniform**2, 0.05) < 1e-3
    share, low = upper_share(5, 100)
    assert low < 0.05 == share < lower_share(5, 100)[1]
