"""Losses at the ends of a map's surfaces are no losses of the sensor; losses that occur everywhere are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.discrepancy.dictionary.covariates import sample_covariates
from cosim.discrepancy.inference.likelihood import residuals_of
from cosim.discrepancy.inference.score import Evidence
from cosim.discrepancy.sampling.sample import Prediction, Sample
from sensors.effects.points.range_noise import RangeNoise
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import fit_yard, make_yard

NOISE_OF_RANGES = RangeNoise(sigma_m=0.01, sigma_per_m=0.0)
CELLS = 400  # surfaces of the map, of about ten beams each
LOST = 0.2


@pytest.fixture(scope="module")
def predicted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Sample, Prediction]:
    """A sample whose beams all return, on surfaces of which every third is at the end of the map."""
    drive = make_yard(tmp_path_factory.mktemp("yard"), (NOISE_OF_RANGES,), known=(NOISE,), frames=4)
    on = fit_yard(drive)
    whole = on.fitter.sample
    sample = replace(whole, surface=np.where(whole.compared, np.arange(len(whole)) % CELLS, -1))
    sample = replace(
        sample, at_end=sample.compared & (sample.surface % 3 == 0), compared=whole.compared & whole.returned
    )
    return sample, on.fitted.prediction


def _losing(sample: Sample, lost: np.ndarray) -> Sample:
    return replace(sample, along_m=np.where(lost, np.nan, sample.along_m))


def _with_losses(predicted: Prediction, share: float) -> Prediction:
    return replace(predicted, seen=predicted.seen * (1 - share), silent=predicted.silent + predicted.seen * share)


def _significance(sample: Sample, expected: Prediction) -> float:
    """Score of losses, in standard deviations."""
    evidence = Evidence.of(sample, residuals_of(sample, expected))
    return float(evidence.score["drop"].sum() / np.sqrt(evidence.information["drop"].sum()))


def test_losses_at_some_ends_are_put_down_to_the_map(predicted: tuple[Sample, Prediction]) -> None:
    sample, expected = predicted
    is_short = sample.at_end & (sample.surface % 60 == 0)
    lost = is_short & (np.random.default_rng(1).random(len(sample)) < 0.5)
    here = _losing(sample, lost)
    met = residuals_of(here, expected).not_missed
    assert met[is_short].mean() < 0.1 and met[sample.at_end & ~is_short].mean() > 0.97
    assert np.all(met[~sample.at_end] == 1)
    elsewhere = replace(here, at_end=np.zeros(len(here), bool))
    of_all, of_sensor = (_significance(one, expected) for one in (elsewhere, here))
    assert of_all < -30 and of_sensor > -3


def test_losses_everywhere_are_losses_of_the_sensor(predicted: tuple[Sample, Prediction]) -> None:
    sample, expected = predicted
    here = _losing(sample, sample.compared & (np.random.default_rng(2).random(len(sample)) < LOST))
    logliks = {share: residuals_of(here, _with_losses(expected, share)).loglik.sum() for share in (0.0, 0.1, LOST, 0.3)}
    assert max(logliks, key=logliks.__getitem__) == LOST
    assert residuals_of(here, _with_losses(expected, LOST)).not_missed.mean() > 0.97


def test_the_score_is_the_derivative_of_the_likelihood(predicted: tuple[Sample, Prediction]) -> None:
    sample, expected = predicted
    rng, step = np.random.default_rng(3), 1e-4
    here = _losing(sample, sample.at_end & (rng.random(len(sample)) < 0.3 * rng.random(CELLS)[sample.surface]))
    expected = _with_losses(expected, 0.1)
    up, down = (_with_losses(expected, sign * step) for sign in (-1, 1))
    slope = (residuals_of(here, up).loglik - residuals_of(here, down).loglik) @ here.share
    change = (up.seen - down.seen) * here.compared
    score = Evidence.of(here, residuals_of(here, expected)).score["drop"] @ change
    assert slope == pytest.approx(score, rel=0.02)


def test_as_many_losses_as_returns_are_left_out_where_something_unmapped_stops_beams(
    predicted: tuple[Sample, Prediction],
) -> None:
    """Half of the beams meet something that is not in the map: their returns are not compared, their losses are."""
    sample, expected = predicted
    rng = np.random.default_rng(4)
    stopped, lost = rng.random(len(sample)) < 0.5, rng.random(len(sample)) < LOST
    here = _losing(sample, lost)
    here = replace(here, compared=sample.compared & (lost | ~stopped), at_end=np.zeros(len(sample), bool))
    shares = (0.1, LOST, 0.3, 0.4)

    def most_likely(sample: Sample) -> float:
        return max(shares, key=lambda share: residuals_of(sample, _with_losses(expected, share)).outcome.sum())

    assert most_likely(here) > LOST
    assert most_likely(replace(here, unmapped=np.full(len(here), 0.5))) == LOST


def test_intensities_of_neighbours_share_the_errors_of_a_map(predicted: tuple[Sample, Prediction]) -> None:
    sample, expected = predicted
    twin = replace(sample, twin_sigma_m=sample.twin_sigma_m * 0, twin_sigma_intensity=sample.twin_sigma_intensity * 0)
    for of_own_map in (False, True):
        covariates = sample_covariates(replace(twin, of_own_map=of_own_map), expected, ())
        names = {covariate.name for covariate in covariates}
        assert ("previous_intensity" in names) is not of_own_map
        assert "previous_range" in names
