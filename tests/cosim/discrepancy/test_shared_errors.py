"""Errors that the beams of a firing share: how they are sampled, what they gain, and that they are found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy import diagnose
from cosim.discrepancy.analysis import context_of
from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.dictionary.groups import Group
from cosim.discrepancy.dictionary.shared_errors import SharedError
from cosim.discrepancy.sampling.drawing import draw_sample
from cosim.discrepancy.unknown.curve import Curve
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.discrepancy.unknown.effect_class import effect_of
from sensors.effects.points.range_noise import RangeNoise
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import Yard, make_yard

OWN_M, SHARED_M = 0.01, 0.02


def test_some_firings_are_sampled_as_a_whole_and_weights_count_all_beams(biased_yard: Yard) -> None:
    context = context_of(opened(biased_yard.drive), biased_yard.sensor)
    frames = context.tracer.trace_all(context.split.fit, ())
    clear = [frame.observed.trusted & ~frame.edge for frame in frames]
    whole, counted = 0, []
    for seed in range(10):
        sample = draw_sample(frames, 2000, np.random.default_rng(seed))
        for number, (frame, mask) in enumerate(zip(frames, clear, strict=True)):
            rows = sample.frame == number
            is_sampled = np.zeros(len(mask), bool)
            is_sampled[sample.beam[rows]] = True
            grid = (frame.shot.pattern.rings, frame.shot.pattern.firings)
            missing = (mask & ~is_sampled).reshape(grid).sum(0)
            whole += np.count_nonzero((missing == 0) & (mask.reshape(grid).sum(0) >= 5))
        is_clear = np.array([clear[number][beam] for number, beam in zip(sample.frame, sample.beam, strict=True)])
        counted.append(sample.weight[is_clear].sum())
    assert whole > 30
    assert np.mean(counted) == pytest.approx(sum(mask.sum() for mask in clear), rel=0.05)


def test_the_gain_of_a_shared_error_is_that_of_the_likelihood() -> None:
    """Against the exact one of normal errors: ½ Σ [v S²/(1 + v I) − ln(1 + v I)] with I of all beams of a unit."""
    rng, units, each = np.random.default_rng(3), 400, 12
    unit, information = np.repeat(np.arange(units), each), np.full(units * each, OWN_M**-2)
    error_m = rng.normal(0, OWN_M, units * each) + rng.normal(0, SHARED_M, units)[unit]
    score, variance = error_m * information, np.full(units * each, SHARED_M**2)
    others = np.bincount(unit, score)[unit] - score
    one = SharedError(Group("", "", (), 1), unit, information**2 * (each - 1), SHARED_M**2, 0.0)
    gain = one.gain(0.5 * one.weight * score * others, variance).sum()
    total, whole = np.bincount(unit, score), np.bincount(unit, information)
    exact = 0.5 * (SHARED_M**2 * total**2 / (1 + SHARED_M**2 * whole) - np.log1p(SHARED_M**2 * whole)).sum()
    assert gain == pytest.approx(exact, rel=0.1)
    assert one.gain(np.zeros(len(unit)), variance).sum() < 0, "no correlation is evidence against the error"


def test_beams_that_share_their_unit_with_no_other_gain_nothing() -> None:
    unit = np.arange(5)
    one = SharedError(Group("", "", (), 1), unit, np.zeros(5), 1e-4, 0.0)
    np.testing.assert_array_equal(one.gain(np.zeros(5), np.full(5, 1e-4)), 0)


def test_diagnosis_reports_an_error_shared_by_firings_instead_of_more_noise(tmp_path: Path) -> None:
    curve = Curve("shared_range", ("firing",), ("",), (("firing",),), np.array([SHARED_M]), np.array([1e-3]))
    truth = RangeNoise(sigma_m=OWN_M, sigma_per_m=0.0), effect_of(UnknownEffect.of(curve))
    yard = make_yard(tmp_path, truth, known=(NOISE,), frames=8)
    found = diagnose(yard.drive, yard.sensor)
    assert not found.effects
    assert [(one.curve.channel, one.curve.covariates) for one in found.unknowns] == [("shared_range", ("firing",))]
    assert found.unknowns[0].parameters["sigma"] == pytest.approx(SHARED_M, rel=0.15)
    assert diagnose(yard.drive, found.sensor).verdict == "none"
