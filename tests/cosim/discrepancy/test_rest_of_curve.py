"""Curves about the final model: a fitted formula, plus what the data still differ by from it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.analysis import context_of, trace_and_fit
from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.dictionary.covariates import sample_covariates
from cosim.discrepancy.dictionary.groups import binned_group
from cosim.discrepancy.dictionary.linearisation import linearise
from cosim.discrepancy.selection.curves import rest_of_curve
from cosim.discrepancy.selection.refit import Term
from cosim.discrepancy.unknown.curve import Curve
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.discrepancy.unknown.effect_class import effect_of
from sensors.effects.points.range_noise import RangeNoise
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import make_yard

RANGE_M = np.linspace(3, 40, 30)
SIZE_M = 0.05


def hump(range_m: np.ndarray) -> np.ndarray:
    return SIZE_M * np.exp(-(((range_m - 14) / 5) ** 2))


def line(range_m: np.ndarray) -> np.ndarray:
    return 0.001 * range_m


def unknown_of(y_m: np.ndarray) -> UnknownEffect:
    return UnknownEffect.of(Curve("range", ("range",), ("m",), (RANGE_M,), y_m, np.full(30, 1e-4)))


@pytest.mark.parametrize(("believed", "is_right"), [(hump, True), (line, False)])
def test_the_curve_about_a_fit_is_that_of_the_data_whatever_the_formula(
    tmp_path: Path, believed: object, is_right: bool
) -> None:
    truth = RangeNoise(sigma_m=0.01, sigma_per_m=0.0), effect_of(unknown_of(hump(RANGE_M)))
    yard = make_yard(tmp_path, truth, known=(NOISE,), frames=5)
    context = context_of(opened(yard.drive), yard.sensor)
    unknown = unknown_of(believed(RANGE_M))  # type: ignore[operator]
    on = trace_and_fit(context, context.split.fit, (*context.initial_effects, effect_of(unknown)), (1,))
    linearisation = linearise(on.fitter, on.fitted, on.frames)
    covariates = {one.name: one for one in sample_covariates(on.fitter.sample, on.fitted.prediction, on.frames)}
    group = binned_group(linearisation, "range", covariates["range"], 10)
    assert group is not None
    rest = rest_of_curve(linearisation, Term(group, 0.01, 9.0, 9.0), covariates, unknown.name, 8)
    assert rest is not None
    params = on.fitted.effects[1].model_dump()
    found = unknown.refitted(params, {}, rest)
    x = np.asarray(found.curve.x[0], float)
    assert np.all(np.abs(found.curve.y - hump(x)) < 3 * np.maximum(found.curve.sigma, 5e-4))
    assert np.corrcoef(found.curve.y, hump(x))[0, 1] > 0.97
    assert (found.r2 > 0.9) == is_right
