"""The spread of points about surfaces that scans were mapped to is estimated, apart from the noise of the sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.discrepancy.dictionary.linearisation import linearise
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.parameters import all_free
from cosim.discrepancy.inference.random_effects import RandomEffects
from cosim.discrepancy.sampling.sample import Sample
from sensors.effects.points.intensity_noise import IntensityNoise
from sensors.effects.points.range_noise import RangeNoise
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import fit_yard, make_yard

NOISE_M, ROUGH_M = 0.01, 0.02


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Sample:
    noise = RangeNoise(sigma_m=NOISE_M, sigma_per_m=0.0)
    return fit_yard(make_yard(tmp_path_factory.mktemp("yard"), (noise,), known=(NOISE,), frames=6)).fitter.sample


def _roughened(sample: Sample, *, by_beam: float, shared: float) -> Sample:
    """Surfaces that are rough: each beam has an error of its own, and one in common with its neighbours."""
    rng = np.random.default_rng(0)
    slope = 1 / np.maximum(sample.cos_incidence, 0.1)
    keys = np.stack([sample.frame, sample.ring, sample.firing // 48, sample.track])
    patch = np.unique(keys, axis=1, return_inverse=True)[1].ravel()
    error = by_beam * rng.normal(0, ROUGH_M, len(sample)) + shared * rng.normal(0, ROUGH_M, len(sample))[patch]
    return replace(sample, along_m=sample.along_m + error * slope, twin_sigma_m=ROUGH_M * slope)


def _fit(sample: Sample, *, free: bool = False) -> Fitted:
    effects = (RangeNoise(sigma_m=NOISE_M, sigma_per_m=0.0),)
    return Fitter(sample).fit(effects, all_free(effects, (0,) if free else (), 24))


def _factors(sample: Sample, fitted: Fitted) -> np.ndarray:
    """(2,) mean factors over the returns."""
    return fitted.estimate.surface_spread[:, sample.material[sample.compared & sample.returned]].mean(1)


def test_roughness_that_is_not_there_is_not_assumed(sample: Sample) -> None:
    smooth = _roughened(sample, by_beam=0.0, shared=0.0)
    assert _factors(smooth, _fit(smooth)).max() < 0.3


def test_roughness_is_divided_into_what_neighbours_share_and_the_rest(sample: Sample) -> None:
    for by_beam, shared in ((1.0, 0.0), (0.0, 1.0), (0.7, 0.7)):
        rough = _roughened(sample, by_beam=by_beam, shared=shared)
        whole, unshared = _factors(rough, _fit(rough))
        assert whole == pytest.approx(np.hypot(by_beam, shared), abs=0.2)
        assert unshared == pytest.approx(by_beam, abs=0.3)


def test_noise_of_the_sensor_is_not_taken_for_roughness(sample: Sample) -> None:
    rough = _roughened(sample, by_beam=0.3, shared=0.5)
    noise = _fit(rough, free=True).effects[0]
    assert isinstance(noise, RangeNoise)
    at_10_m = np.hypot(noise.sigma_m, 10 * noise.sigma_per_m)
    assert at_10_m == pytest.approx(NOISE_M, rel=0.25)


def test_surveyed_twins_have_no_roughness(sample: Sample) -> None:
    assert np.all(_fit(sample).estimate.surface_spread == 1)


def test_leverage_of_map_surfaces_sums_to_their_number(sample: Sample) -> None:
    random = RandomEffects(sample)
    start = random.start()
    free = replace(start, variance=np.full(len(start.variance), 1e6))
    leverage = random.map_leverage(np.ones(len(sample)), free)
    assert leverage.sum() == pytest.approx(len(np.unique(sample.surface[sample.surface_derivative != 0])), rel=0.01)


def test_scatter_of_intensities_that_the_twin_causes_is_no_evidence_about_noise_of_the_sensor(sample: Sample) -> None:
    effects = (IntensityNoise(sigma_rel=0.01),)
    certain, uncertain = (replace(sample, twin_sigma_intensity=np.full(len(sample), sigma)) for sigma in (0.0, 0.2))
    informations = []
    for one in (certain, uncertain):
        fitter = Fitter(one)
        _, information = linearise(fitter, fitter.fit(effects, ()), ()).weights("intensity_variance")
        informations.append(information.sum())
    assert informations[0] > 1000
    assert informations[1] < 1e-3 * informations[0]
