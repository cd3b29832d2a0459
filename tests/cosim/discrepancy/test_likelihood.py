"""Densities integrate to one, and scores are the slopes of the likelihood that is fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, sparse, stats

from cosim.discrepancy.analysis import FittedFrames
from cosim.discrepancy.inference.dependence import Dependence, updated_spurious_shares
from cosim.discrepancy.inference.likelihood import NU, SCALE, censored, range_spread_m, residuals_of, student
from cosim.discrepancy.inference.score import Evidence
from cosim.discrepancy.sampling.sample import Prediction, Sample
from sensors.effects.points.range_noise import RangeNoise
from tests.cosim.discrepancy.small_drive import fit_yard, make_yard

STEP = {"range": 1e-6, "intensity": 1e-6, "drop": 1e-6}


@pytest.fixture(scope="module")
def view(tmp_path_factory: pytest.TempPathFactory) -> FittedFrames:
    """A yard whose model knows everything but a tenth of its range noise."""
    noise = {"effect": "range_noise", "sigma_m": 0.01}
    dim = {"effect": "intensity_noise", "sigma_rel": 0.1}
    effects = (RangeNoise(sigma_m=0.011, sigma_per_m=0.0),)
    return fit_yard(make_yard(tmp_path_factory.mktemp("yard"), effects, known=(noise, dim), frames=4))


def test_ranges_have_a_density_of_unit_variance() -> None:
    whole, _ = integrate.quad(lambda z: np.exp(student(np.array([z])))[0], -np.inf, np.inf)
    spread, _ = integrate.quad(lambda z: z * z * np.exp(student(np.array([z])))[0], -np.inf, np.inf)
    assert (whole, spread) == (pytest.approx(1, abs=1e-7), pytest.approx(1, abs=1e-4))


@pytest.mark.parametrize(("mean", "sigma"), [(0.02, 0.05), (0.5, 0.1), (0.97, 0.2)])
def test_intensities_and_what_is_cut_off_make_one(mean: float, sigma: float) -> None:
    def density(value: float) -> float:
        return float(np.exp(censored(np.array([value]), np.array([mean]), np.array([sigma]), (0.0, 1.0)).loglik[0]))

    inside, _ = integrate.quad(density, 1e-12, 1 - 1e-12, points=[mean])
    assert inside + density(0.0) + density(1.0) == pytest.approx(1, abs=1e-6)


def test_the_density_is_that_of_a_student() -> None:
    z = np.linspace(-6, 6, 41)
    np.testing.assert_allclose(student(z), stats.t.logpdf(z / SCALE, NU) - np.log(SCALE))


def test_a_beam_returns_from_somewhere_or_not_at_all(view: FittedFrames) -> None:
    expected = _inside_bounds(view)
    sample = replace(view.fitter.sample, intensity=np.zeros(len(expected.seen)), above_m=expected.rise_m)
    sigma, grid = range_spread_m(expected, sample.settings.likelihood), np.linspace(-8, 8, 81)  # of arsinh of deviates
    at_once = float(np.exp(student(np.zeros(1)))[0])  # of every rise here, which equals its expectation

    def chance(along_m: np.ndarray) -> np.ndarray:
        return np.exp(residuals_of(replace(sample, along_m=along_m), expected).loglik)

    returns = np.stack([chance(expected.range_m + np.sinh(one) * sigma) * np.cosh(one) for one in grid]) / at_once
    whole = integrate.trapezoid(returns, grid, axis=0) * sigma + chance(np.full(len(sigma), np.nan))
    met = sample.compared & np.isfinite(expected.range_m) & ~sample.edge
    assert met.sum() > 1000
    np.testing.assert_allclose(whole[met], 1, atol=1e-4)


def test_an_effect_and_a_dependence_with_the_same_spurious_returns_are_equally_likely(view: FittedFrames) -> None:
    """Also near edges: nothing depends on whether fog is an effect or a share by bins."""
    expected, sample, share = _inside_bounds(view), view.fitter.sample, 0.2
    rows = len(expected.seen)
    density = np.where(sample.returned, 0.05, 0.0)
    expected = replace(expected, spurious_per_m=np.zeros(rows))
    binned = replace(expected, spurious_share=np.full(rows, share), spurious=share * density)
    kept = 1 - share
    as_effect = replace(
        expected, seen=kept * expected.seen, silent=kept * expected.silent, spurious_per_m=share * density
    )
    of_bins, of_effect = residuals_of(sample, binned), residuals_of(sample, as_effect)
    used = sample.compared & sample.first & np.isfinite(expected.range_m) & (sample.chance == 1)
    assert (used & sample.edge).sum() > 50
    assert (used & ~sample.edge).sum() > 1000
    np.testing.assert_allclose(of_bins.outcome[used], of_effect.outcome[used], atol=0.01)


def test_shares_of_spurious_returns_are_fitted_with_the_slope_of_the_likelihood(view: FittedFrames) -> None:
    """Also near edges, where a beam may meet neither side; no share grows beyond the largest one."""
    expected, step = _inside_bounds(view), 1e-7
    sample = view.fitter.sample
    assert (sample.edge & sample.returned & sample.compared).sum() > 50
    alone = sample.compared & sample.first & sample.returned & (sample.chance == 1)
    now = residuals_of(sample, expected)
    more = residuals_of(sample, replace(expected, spurious=expected.spurious + step))
    slope = now.either / np.exp(now.outcome)
    assert (alone & (now.either < 1)).any() and (alone & (now.either == 1)).any()
    numeric = np.expm1(more.outcome - now.outcome) / step
    np.testing.assert_allclose(numeric[alone], slope[alone], rtol=0.05)
    everywhere = Dependence("early", "early", sparse.csr_matrix(np.ones((len(slope), 1))), np.array([0.5]))
    (after,) = updated_spurious_shares(sample, expected, np.full(len(slope), 1e6), [everywhere])
    assert after.coefficients[0] == 0.95


def _moved(expected: Prediction, channel: str, by: float) -> Prediction:
    if channel == "range":
        return replace(expected, range_m=expected.range_m + by)
    if channel == "intensity":
        return replace(expected, intensity=expected.intensity + by)
    return replace(expected, seen=expected.seen - by, silent=expected.silent + by)


@pytest.mark.parametrize("channel", ["range", "intensity", "drop"])
def test_scores_are_slopes_of_the_likelihood(view: FittedFrames, channel: str) -> None:
    sample, expected = view.fitter.sample, _inside_bounds(view)
    score = Evidence.of(sample, residuals_of(sample, expected)).score[channel]  # type: ignore[index]
    up, down = (residuals_of(sample, _moved(expected, channel, by)).loglik for by in (STEP[channel], -STEP[channel]))
    slope = sample.share * (up - down) / (2 * STEP[channel])
    sign = -1 if channel == "drop" else 1
    clean = _clean(sample, view)
    assert np.count_nonzero(clean) > 1000
    np.testing.assert_allclose(sign * slope[clean], score[clean], rtol=2e-3, atol=2e-3 * np.abs(score[clean]).max())


def test_returns_of_other_surfaces_say_nothing_about_losses(view: FittedFrames) -> None:
    """The score of the probability of a return is 0 on average, also where other parts of the footprint may return."""
    inside, share = _inside_bounds(view), 0.1
    expected = replace(inside, seen=inside.seen * (1 - share))
    sample = view.fitter.sample
    returned = replace(sample, along_m=expected.range_m)
    lost = replace(sample, along_m=np.full(len(sample), np.nan))
    other = replace(sample, along_m=expected.range_m - 5.0)
    returned, lost, other = (
        Evidence.of(one, residuals_of(one, expected)).score["drop"] for one in (returned, lost, other)
    )
    alone = sample.compared & ~sample.edge & np.isfinite(expected.range_m)
    mean = expected.seen * returned + expected.silent * lost + share * other
    assert alone.sum() > 1000
    assert np.abs(lost[alone]).min() > 1
    np.testing.assert_allclose(mean[alone], 0, atol=2e-3)


def _inside_bounds(view: FittedFrames) -> Prediction:
    """What is expected, every beam with some chance of not returning."""
    expected = view.fitted.prediction
    seen = np.minimum(expected.seen, 0.9)
    return replace(expected, seen=seen, silent=expected.silent + expected.seen - seen)


def _clean(sample: Sample, view: FittedFrames) -> np.ndarray:
    """Beams that certainly met their surface, or met nothing: between two surfaces responsibilities move, too."""
    matched = view.fitted.residuals.matched
    return sample.compared & np.isfinite(view.fitted.prediction.range_m) & ((matched > 0.9999) | ~sample.returned)
