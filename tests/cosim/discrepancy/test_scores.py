"""The scores are fair: the expected score of a small ensemble is that of its distribution."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from cosim.discrepancy.scores import Adjustment, Ensemble, _crps, model_chance, scored
from sensors.effects.detection.random_dropout import RandomDropout
from sensors.effects.points.intensity_quantization import IntensityQuantization
from sensors.effects.points.range_quantization import RangeQuantization
from tests.cosim.discrepancy.small_drive import fit_yard, make_yard

MEMBERS, ROWS = 4, 200_000


def gaussian_crps(value: np.ndarray, sigma: float) -> np.ndarray:
    """Closed form of N(0, σ²) (Gneiting and Raftery, JASA 2007, eq. 21)."""
    z = value / sigma
    return sigma * (z * (2 * stats.norm.cdf(z) - 1) + 2 * stats.norm.pdf(z) - 1 / np.sqrt(np.pi))


@pytest.mark.parametrize("value", [0.0, 0.3, -1.2])
def test_small_ensemble_scores_like_the_gaussian_it_is_drawn_from(value: float) -> None:
    members = np.random.default_rng(1).normal(0, 0.5, (MEMBERS, ROWS))
    scores = _crps(members, np.full(ROWS, value), np.inf)
    assert scores.mean() == pytest.approx(float(gaussian_crps(np.array(value), 0.5)), abs=2e-3)


def test_one_member_scores_its_distance() -> None:
    measured = np.array([1.0, 2.5, -1.0])
    assert _crps(np.zeros((1, 3)), measured, np.inf) == pytest.approx(np.abs(measured))


def test_no_other_spread_scores_better_than_the_true_one() -> None:
    rng = np.random.default_rng(2)
    measured = rng.normal(0, 1, ROWS)
    scores = {s: _crps(rng.normal(0, s, (MEMBERS, ROWS)), measured, np.inf).mean() for s in (0.5, 0.8, 1.0, 1.25, 2.0)}
    assert min(scores, key=lambda sigma: scores[sigma]) == 1.0


def test_members_that_do_not_return_are_left_out() -> None:
    members = np.array([[0.0, 1.0], [np.nan, 3.0], [np.nan, np.nan]])
    # One member left: its distance. Two left, at 1 and 3 about 2: mean distance 1, less half their own, 1.
    assert _crps(members, np.array([0.5, 2.0]), np.inf) == pytest.approx([0.5, 0.0])


def test_far_off_costs_no_more_than_the_clip() -> None:
    assert _crps(np.zeros((1, 1)), np.array([50.0]), 1.0) == pytest.approx([1.0])


def test_a_model_does_not_draw_the_noise_that_a_simulated_drive_was_measured_with() -> None:
    measured = np.random.default_rng([3, 7]).standard_normal(4)
    assert not np.isin(model_chance(3, 7).standard_normal(4), measured).any()


def test_values_are_rounded_where_surfaces_really_are() -> None:
    """Rounding acts last: who knows a surface to be 4 cm farther must round what is measured there."""
    rounding = RangeQuantization(step_m=0.1), IntensityQuantization(step=0.05)
    report = Ensemble(np.array([[1.02, 2.08, np.nan]]), np.array([[0.5, 0.93, np.nan]]), rounding)
    ranges, intensities = report.moved(np.array([0.04, -0.04, 0.0]), np.array([0.9, 1.2, 1.0]))
    np.testing.assert_allclose(ranges, [[1.1, 2.0, np.nan]])
    np.testing.assert_allclose(intensities, [[0.45, 1.0, np.nan]])


def test_known_random_effects_change_the_probability_of_a_loss(tmp_path: Path) -> None:
    """A surface that is darker than the twin says is lost more often: the forecast that knows it scores better."""
    frame = fit_yard(make_yard(tmp_path, (RandomDropout(probability=0.1),), frames=1)).frames[0]
    beams = len(frame.shot.rays)
    certain = Ensemble(np.repeat(frame.observed.range_from(frame.shot.rays.origin)[None], 2, 0), np.ones((2, beams)))
    lost = np.isnan(certain.range_m[0])
    returned = Ensemble(np.where(lost, frame.shot.hits.solid.range_m, certain.range_m), certain.intensity)
    plain, adjusted = (scored(frame, returned, Adjustment(silent=change)) for change in (0.0, lost.astype(float)))
    used = ~np.isnan(plain.brier) & lost & frame.shot.hits.solid.exists
    assert used.any()
    np.testing.assert_allclose(plain.brier[used], 1.0)
    np.testing.assert_allclose(adjusted.brier[used], 0.0)
