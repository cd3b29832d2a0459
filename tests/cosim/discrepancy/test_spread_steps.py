"""Fits in which neighbouring beams scatter more than all beams do, as about surfaces of a map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.discrepancy.inference.fit import Fitter
from cosim.discrepancy.inference.parameters import acts_on_spreads, all_free
from cosim.discrepancy.inference.score import Column
from sensors.effects.detection.random_dropout import RandomDropout
from sensors.effects.points.range_noise import RangeNoise
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import fit_yard, make_yard

LOST, NOISE_M = 0.2, 0.01


def test_a_spread_that_cannot_rise_keeps_no_other_parameter_from_moving(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """Errors of neighbours are opposite, so that their differences show more noise than the likelihood of all beams."""
    drive = make_yard(tmp_path_factory.mktemp("yard"), known=(NOISE,), frames=4)
    sample, rng = fit_yard(drive).fitter.sample, np.random.default_rng(0)
    error_m, pair = rng.normal(0, NOISE_M, len(sample)), np.maximum(sample.partner, 0)
    is_later = (sample.partner >= 0) & (pair < np.arange(len(sample)))
    error_m[is_later] = -error_m[pair[is_later]]
    lost = rng.random(len(sample)) < LOST
    sample = replace(sample, along_m=np.where(lost, np.nan, sample.along_m + error_m))
    effects = (RangeNoise(sigma_m=NOISE_M, sigma_per_m=0.0), RandomDropout(probability=0.16))
    fitted = Fitter(sample).fit(effects, all_free(effects, (0, 1), 24))
    losses = sample.compared & sample.first
    assert fitted.effects[1].model_dump()["probability"] == pytest.approx(np.mean(lost[losses]), abs=0.01)


def test_parameters_of_spreads_are_those_that_change_nothing_else() -> None:
    ones = np.ones(3)
    columns = [
        Column({"range": ones}),
        Column({"range_variance": ones}),
        Column({"intensity_variance": ones}, ring=np.arange(3), rings=3),
        Column({"intensity": ones, "intensity_variance": ones}),
        Column({}),
    ]
    assert acts_on_spreads(columns).tolist() == [False, True, True, True, True, False, False]
