"""What estimated random effects have in common with a hypothesis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.discrepancy.inference.random_stratum import RandomStratum

SCANS, OBJECTS, DELAY_S = 16, 200, -0.02
FOLDS = 8


def _stratum(delay_s: float, seed: int, *, outliers: bool = False) -> RandomStratum:
    """Position errors of scans, in proportion to the speed, and of objects, which a delay does not move.

    Args:
        delay_s: of the poses.
        seed: of the noise.
        outliers: whether a few objects have large errors of their own that contradict the delay.
    """
    rng = np.random.default_rng(seed)
    speed, moving = rng.uniform(3, 12, SCANS), np.where(np.arange(OBJECTS) < 20, rng.uniform(-12, 12, OBJECTS), 0.0)
    poses = delay_s * speed + rng.normal(0, 0.01, SCANS)
    objects = delay_s * moving + rng.normal(0, 0.03, OBJECTS)
    if outliers:
        objects[:3] = -15 * delay_s * moving[:3]
    component = np.repeat([0, 1], (SCANS, OBJECTS))
    track = np.concatenate([OBJECTS + np.arange(SCANS), np.arange(OBJECTS)])
    part = np.concatenate([np.arange(SCANS), SCANS + np.arange(OBJECTS)])
    count = SCANS + OBJECTS
    x, u = np.concatenate([speed, moving]), np.concatenate([poses, objects])
    return RandomStratum(u, x[:, None], component, 2, (track, part), (count, count))


def _gain(stratum: RandomStratum) -> float:
    fold = np.random.default_rng(0).permutation(SCANS + OBJECTS) % FOLDS
    return float(stratum.gain(fold, FOLDS).sum())


@pytest.mark.parametrize("outliers", [False, True])
def test_a_delay_is_detected_in_the_pose_errors_that_absorbed_it(outliers: bool) -> None:
    stratum = _stratum(DELAY_S, 0, outliers=outliers)
    assert _gain(stratum) > 20
    scores, informations = stratum.tables()
    for score, information in zip(scores, informations, strict=True):
        assert score.sum() / information.sum() == pytest.approx(DELAY_S, rel=0.1)
        share = score[-SCANS:, 0] if score is scores[0] else score[:SCANS, 0]
        assert np.all(share < 0), "all scans agree"


def test_independent_errors_gain_nothing() -> None:
    gains = [_gain(_stratum(0.0, seed)) for seed in range(30)]
    assert np.mean(gains) < 0
    assert max(gains) < 6


def test_later_scans_are_predicted_by_earlier_ones() -> None:
    assert max(_stratum(DELAY_S, seed, outliers=True).p_of_predictions() for seed in range(10)) < 1e-4
    assert np.mean([_stratum(0.0, seed).p_of_predictions() < 0.05 for seed in range(100)]) <= 0.05


def test_two_quantities_that_drift_are_not_related() -> None:
    """Random walks of the errors and of the speed correlate, but neither predicts how the other goes on."""
    p_values = []
    for seed in range(200):
        rng, scans = np.random.default_rng(seed), np.arange(40)
        u, x = (rng.normal(size=len(scans)).cumsum() for _ in range(2))
        stratum = RandomStratum(u, x[:, None], np.zeros(len(scans), int), 1, (scans, scans), (len(scans),) * 2)
        p_values.append(stratum.p_of_predictions())
    assert np.mean(np.array(p_values) < 0.05) <= 0.05


def test_components_of_few_random_effects_predict_nothing() -> None:
    one = _stratum(DELAY_S, 0)
    few = np.concatenate([np.arange(2), np.arange(SCANS, SCANS + 2)])
    clusters = (np.arange(4), np.arange(4))
    stratum = RandomStratum(one.u[few], one.x[few], one.component[few], 2, clusters, (4, 4))
    assert not stratum.gain(np.arange(4), 4).any()


def test_an_amplitude_that_cannot_be_negative_gains_nothing_where_the_errors_have_the_other_sign() -> None:
    stratum = replace(_stratum(DELAY_S, 0), one_sided=True)
    assert abs(_gain(stratum)) < 0.5
    opposite = replace(stratum, x=-stratum.x)
    assert _gain(opposite) > 20
