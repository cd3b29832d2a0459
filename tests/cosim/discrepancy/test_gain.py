"""One comparison for everything: a gain by cluster, whatever the number of beams."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.diagnose import case_of, given
from cosim.discrepancy.inference.comparison import Gain, gain, stability
from cosim.discrepancy.inference.fit import Fitter
from cosim.discrepancy.sampling.drawing import draw_sample
from cosim.discrepancy.state import Model, viewed
from sensors.effects.points.range_bias import RangeBias
from tests.cosim.discrepancy.small_drive import Yard


def test_gain_per_beam_does_not_depend_on_how_many_beams_were_drawn(biased_yard: Yard) -> None:
    case = case_of(opened(biased_yard.drive), biased_yard.sensor)
    frames = case.tracer.trace_all(case.split.fit, ())
    each, sure = [], []
    for rows in (6_000, 24_000):
        fitter = Fitter(draw_sample(frames, rows, np.random.default_rng(1)))
        without = fitter.fit(given(case), ())
        biased = fitter.at((*given(case), RangeBias(offset_m=0.04)), without.estimate)
        found = gain(fitter, without, biased)
        each.append(found.value / len(fitter.sample))
        sure.append(found.value / found.error)
    assert each[0] == pytest.approx(each[1], rel=0.1)
    assert sure[0] == pytest.approx(sure[1], rel=0.35), "clusters make it sure, not beams"


def test_nothing_is_gained_by_nothing(biased_yard: Yard) -> None:
    case = case_of(opened(biased_yard.drive), biased_yard.sensor)
    view = viewed(case, case.split.fit, Model(given(case)), 6_000)
    found = gain(view.fitter, view.fitted, view.fitted)
    assert found.value == 0
    assert found.p_value == 1


def test_few_large_clusters_have_few_degrees_of_freedom() -> None:
    rng = np.random.default_rng(0)
    large, small = 100 + 30 * rng.standard_normal(4), rng.standard_normal(400)
    both = Gain.of([large, small])
    assert both.value == pytest.approx(large.sum() + small.sum())
    assert 3 <= both.freedom < 20
    assert Gain.of([small]).freedom == pytest.approx(399)


@pytest.mark.parametrize("clusters", [12, 200])
def test_its_test_holds_its_level(clusters: int) -> None:
    rng = np.random.default_rng(7)
    drawn = [Gain.of([rng.standard_t(5, clusters)]).p_value for _ in range(2000)]
    assert np.mean(np.array(drawn) < 0.05) == pytest.approx(0.05, abs=0.015)


@pytest.mark.parametrize("clusters", [5, 12, 200])
def test_a_second_look_without_an_outlier_hardly_makes_it_likelier(clusters: int) -> None:
    rng = np.random.default_rng(7)
    drawn = [Gain.of([rng.standard_t(5, clusters)]) for _ in range(2000)]
    p_values = [min(one.p_value, one.without_outlier().p_value) for one in drawn]
    assert np.mean(np.array(p_values) < 0.05) < 0.065


def test_one_place_that_gains_the_most_does_not_hide_what_others_gain_and_is_not_enough_alone() -> None:
    rng = np.random.default_rng(0)
    gained, none = np.append(rng.normal(20, 25, 30), 3000), np.append(np.linspace(-50, 50, 30), 3000)
    assert Gain.of([gained]).p_value > 0.05 > Gain.of([gained]).without_outlier().p_value
    assert Gain.of([none]).p_value > 0.05 and Gain.of([none]).without_outlier().p_value > 0.05
    alike = Gain.of([rng.normal(20, 25, 30)])
    assert alike.without_outlier() is alike


def test_frames_that_took_no_part_deny_what_only_fits(biased_yard: Yard) -> None:
    case = case_of(opened(biased_yard.drive), biased_yard.sensor)
    judges = viewed(case, case.split.test, Model(given(case)), 6_000)
    right, wrong = (
        judges.fitter.fit((*given(case), RangeBias(offset_m=off)), (), judges.fitted.estimate) for off in (0.04, -0.04)
    )
    assert gain(judges.fitter, judges.fitted, right).p_value < 0.05
    assert gain(judges.fitter, judges.fitted, wrong).p_value > 0.95
    assert replace(right, effects=()).loglik > judges.fitted.loglik


HALVES = 999


def _shares(*clusters: np.ndarray, prices: tuple[float, ...] | None = None) -> np.ndarray:
    gains = [Gain.of([one]) for one in clusters]
    return stability(gains, prices or (1.0,) * len(gains), HALVES, np.random.default_rng(3))


def test_what_gains_more_in_nearly_every_cluster_wins_every_half() -> None:
    rng = np.random.default_rng(1)
    better, worse = 2 + rng.standard_normal(100), 1 + rng.standard_normal(100)
    assert _shares(better, worse) == pytest.approx([1, 0], abs=0.01)


def test_two_that_gain_alike_share_the_halves() -> None:
    rng = np.random.default_rng(2)
    apart = rng.standard_normal(100)
    apart -= apart.mean()
    shares = _shares(2 + apart, 2 - apart, 1 + rng.standard_normal(100))
    assert shares[:2] == pytest.approx([0.5, 0.5], abs=0.05)
    assert shares[2] < 0.01


def test_what_lives_off_a_single_cluster_is_not_stable() -> None:
    single = np.where(np.arange(100) == 7, 1000.0, 0.0)
    assert _shares(single) == pytest.approx([0.5], abs=0.05), "nothing wins where that cluster is not"
    assert _shares(single, np.full(100, 1.0)) == pytest.approx([0.5, 0.5], abs=0.05)


def test_numbers_must_earn_their_price() -> None:
    alike = np.ones(100)
    assert _shares(alike, alike + 0.1, prices=(1.0, 30.0)) == pytest.approx([1, 0])
    assert _shares(alike, prices=(60.0,)) == pytest.approx([0])


def test_the_clustering_that_is_less_sure_of_a_winner_counts() -> None:
    even, single = np.ones(100), np.where(np.arange(100) == 7, 100.0, 0.0)
    both = [
        replace(Gain.of([even]), sums=(even, single)),
        replace(Gain.of([0.5 * even]), sums=(0.5 * even, 0.5 * even)),
    ]
    assert stability(both, (1.0, 1.0), HALVES, np.random.default_rng(3)) == pytest.approx([0.5, 0.5], abs=0.05)


def test_what_the_law_of_noise_gains_by_a_skew_is_no_bias(biased_yard: Yard) -> None:
    case = case_of(opened(biased_yard.drive), biased_yard.sensor)
    view = viewed(case, case.split.fit, Model((*given(case), RangeBias(offset_m=0.04))), 6_000)
    fitter, rng = view.fitter, np.random.default_rng(1)
    expected = fitter.random.adjusted(view.fitted.prediction, view.fitted.estimate).range_m
    skewed = 0.01 * (rng.exponential(size=len(expected)) - 1)  # of mean zero
    sample = replace(fitter.sample, along_m=np.where(fitter.sample.returned, expected + skewed, np.nan))
    skew = Fitter(sample)
    right = skew.at(view.fitted.effects, view.fitted.estimate)
    likelier = skew.at((*given(case), RangeBias(offset_m=0.038)), view.fitted.estimate)
    assert likelier.loglik > right.loglik, "where its law has most returns"
    found = gain(skew, right, likelier)
    assert found.of_shape > 0 and found.value < 0
