"""p-values of fitted terms from the log-likelihood that clusters gain."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.discrepancy.selection.confirm import p_of_clusters, p_of_signs

CLUSTERS, HYPOTHESES = 60, 500


@pytest.mark.parametrize("dispersion", [1.0, 4.0])
def test_chance_is_rarely_significant_whatever_the_dispersion(dispersion: float) -> None:
    rng, p_values = np.random.default_rng(0), []
    for _ in range(400):
        information = rng.gamma(2.0, 10.0, CLUSTERS)
        score = np.sqrt(dispersion * information) * rng.normal(size=CLUSTERS)
        step = score.sum() / information.sum()
        gained = step * score - step**2 * information / 2
        p_values.append(p_of_clusters(gained, information, gained.sum(), 1, 1.0))
    share = np.mean(np.array(p_values) < 0.05)
    assert 0.005 < share < 0.06


def test_an_effect_is_significant_where_its_gain_is_several_times_its_error() -> None:
    rng, information = np.random.default_rng(1), np.full(CLUSTERS, 20.0)
    score = 0.2 * information + np.sqrt(information) * rng.normal(size=CLUSTERS)  # 7 standard errors
    step = score.sum() / information.sum()
    gained = step * score - step**2 * information / 2
    assert p_of_clusters(gained, information, gained.sum(), 1, 1.0) < 1e-6


def test_a_strong_effect_is_significant_although_the_clusters_do_not_gain_what_was_expected() -> None:
    rng = np.random.default_rng(2)
    gained, expected = 1e4 * rng.lognormal(0, 2, CLUSTERS), rng.lognormal(0, 2, CLUSTERS)
    assert p_of_clusters(gained, expected, gained.sum(), 2, 2.0) < 1e-12


def test_gains_of_both_signs_are_chance_however_large_their_sum() -> None:
    """What the best of several trial values gains where the likelihood jumps between them."""
    rng = np.random.default_rng(3)
    trials = rng.normal(0, 8, (12, CLUSTERS))
    gained = trials[trials.sum(1).argmax()]
    assert gained.sum() > 50
    assert HYPOTHESES * p_of_clusters(gained, np.abs(rng.normal(size=CLUSTERS)), gained.sum(), 2, 2.0) > 0.02


def test_one_cluster_is_no_evidence() -> None:
    gained = np.zeros(CLUSTERS)
    gained[0] = 500.0
    assert p_of_clusters(gained, gained, 500.0, 1, 1.0) == 1.0
    assert p_of_clusters(gained, np.ones(CLUSTERS), 500.0, 1, 1.0) > 0.05


def test_bound_of_random_signs_is_that_of_equal_gains() -> None:
    assert p_of_signs(np.ones(10)) == pytest.approx(2.0**-10, rel=1e-3)
    assert p_of_signs(np.array([1.0, -1.0])) == 1.0
    rng, gained = np.random.default_rng(4), np.random.default_rng(5).normal(0.4, 1, 40)
    drawn = (rng.choice((-1.0, 1.0), (100_000, 40)) @ gained >= gained.sum()).mean()
    assert drawn <= p_of_signs(gained) < 10 * drawn
