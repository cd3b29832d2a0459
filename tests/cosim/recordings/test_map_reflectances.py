"""Reflectances of the surfaces of a map that was made from the scans."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.analysis import context_of
from cosim.discrepancy.budget import AS_GIVEN, Aligned
from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.diagnose import fit_nuisances
from cosim.discrepancy.inference.fit import Fitter
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.sampling.sample import Sample
from cosim.discrepancy.settings import DEFAULT
from cosim.drives.kitti import Drive
from sensors.effects.light.range_falloff import RangeFalloff
from sensors.effects.light.ring_gain import RingGain
from sensors.effects.points.intensity_noise import IntensityNoise
from sensors.effects.points.range_noise import RangeNoise
from sensors.pattern import load_pattern
from sensors.sensor_model import SensorModel

NOISE = (RangeNoise(sigma_m=0.02), IntensityNoise(sigma_rel=0.1))


def test_a_surface_of_which_all_returns_saturate_has_a_finite_reflectance(twin: Path) -> None:
    drive = Drive(twin / "twin")
    sensor = SensorModel(load_pattern(str(drive.pattern)), NOISE)
    context = context_of(opened(drive), sensor, settings=replace(DEFAULT, rows=4_000))
    sample = fit_nuisances(context).fitter.sample
    seen = np.bincount(sample.surface[sample.surface >= 0])
    saturated = np.flatnonzero(seen > 1)[:5]
    bright = replace(sample, intensity=np.where(np.isin(sample.surface, saturated), 1.0, sample.intensity))
    fitted = Fitter(bright).fit(NOISE, ())
    assert np.abs(fitted.estimate.u[Fitter(bright).random.rows("albedo_of_map")]).max() < 30


def test_a_map_keeps_the_mean_intensities_of_its_scans_under_other_effects(twin: Path) -> None:
    """Intensity effects of a model would otherwise darken a map whose reflectances are mean measured intensities."""
    drive = Drive(twin / "twin")
    sensor = SensorModel(load_pattern(str(drive.pattern)), (RangeNoise(sigma_m=0.02),))
    falloff = RangeFalloff(reference_m=5.0, exponent=1.5)
    context = context_of(opened(drive), sensor, settings=replace(DEFAULT, rows=8_000))
    on = fit_nuisances(context)
    before, after = Aligned(context, on, sensor.effects), Aligned(context, on, (*sensor.effects, falloff))
    sums = np.zeros((2, 2))
    for number in range(len(before)):
        one, other = before.frame(number, AS_GIVEN), after.frame(number, AS_GIVEN)
        used = (one.frame.surface >= 0) & one.frame.observed.returned & one.frame.observed.trusted
        for row, kind in enumerate(("asphalt", "concrete")):
            material = one.frame.shot.hits.table.names.index(kind)
            rows = used & (one.frame.shot.hits.solid.material == material)
            sums[:, row] += [part.expected.intensity[rows].sum() for part in (one, other)]
    assert (sums > 0).all()
    np.testing.assert_allclose(sums[1], sums[0], rtol=0.01)
    found = after.frame(0, AS_GIVEN)
    near = found.frame.shot.hits.solid.range_m < 5
    assert found.expected.intensity[near].mean() > 1.2 * before.frame(0, AS_GIVEN).expected.intensity[near].mean()


@pytest.fixture(scope="module")
def sample(twin: Path) -> Sample:
    """Beams of the twin, with intensities of 0.3 and noise of a tenth."""
    drive = Drive(twin / "twin")
    sensor = SensorModel(load_pattern(str(drive.pattern)), NOISE)
    context = context_of(opened(drive), sensor, settings=replace(DEFAULT, rows=4_000))
    whole = fit_nuisances(context).fitter.sample
    return replace(whole, intensity=0.3 * (1 + 0.1 * np.random.default_rng(4).standard_normal(len(whole))))


def test_a_factor_on_all_intensities_makes_a_map_neither_more_nor_less_likely(sample: Sample) -> None:
    fitter = Fitter(sample)
    dark = RingGain(gains=(0.4,) * fitter.rings)
    as_made, darker = fitter.fit(NOISE, ()), fitter.fit((dark, *NOISE), ())
    brightness = [1 + one.estimate.u[fitter.random.rows("albedo_of_map")].mean() for one in (as_made, darker)]
    assert brightness[1] == pytest.approx(brightness[0] / 0.4, rel=0.01)
    surfaces = len(np.unique(sample.surface[sample.surface >= 0]))
    assert surfaces > 100 and abs(as_made.loglik - darker.loglik) < 0.02 * surfaces


def test_the_score_of_a_reflectance_is_the_derivative_of_the_likelihood(sample: Sample) -> None:
    """Also where the noise is larger than the sensor's, which changes in proportion to the reflectance."""
    noisy = replace(sample, intensity=np.clip(2 * sample.intensity - 0.3, 0, 1))
    fitter, rng = Fitter(noisy), np.random.default_rng(5)
    random, rows = fitter.random, fitter.random.rows("albedo_of_map")
    fitted = fitter.at(NOISE, random.start())
    direction = np.where((np.arange(random.size) >= rows.start) & (np.arange(random.size) < rows.stop), 1e-4, 0.0)
    direction *= rng.uniform(0.5, 1.5, random.size)
    used = LinearModel.of(random, (), fitted.evidence, fitted.prediction, fitted.estimate).used
    loglik = [
        noisy.share @ fitter.residuals(fitted.prediction, replace(fitted.estimate, u=sign * direction)).loglik
        for sign in (-1, 1)
    ]
    evidence, design = fitted.evidence, random.designs(fitted.prediction, fitted.estimate)["intensity"]
    score = design.T @ evidence.score["intensity"]
    assert (loglik[1] - loglik[0]) / 2 == pytest.approx(score @ direction[used], rel=0.01)
