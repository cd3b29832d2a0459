"""Findings of which the intervals include no change are dropped, one after the other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.analysis import context_of, trace_and_fit
from cosim.discrepancy.budget import budget_of
from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.dictionary.groups import Group, Tangent
from cosim.discrepancy.held_out import HeldOutCheck, check_held_out
from cosim.discrepancy.missing import Missing, ReportedTerm, drop_insignificant
from cosim.discrepancy.selection.evidence import gather_evidence
from cosim.discrepancy.selection.refit import FittedModel, Term
from cosim.discrepancy.unknown.curve import Curve
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.discrepancy.unknown.effect_class import effect_of
from sensors.effects.detection.random_dropout import RandomDropout
from sensors.effects.points.range_bias import RangeBias
from sensors.effects.points.range_noise import RangeNoise
from sensors.effects.points.range_walk import RangeWalk
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import make_yard

BIAS_M = 0.03


def test_of_two_findings_that_compensate_each_other_the_first_stays(tmp_path: Path) -> None:
    """A range walk that depends little on intensity is like a bias, so that both intervals include no change."""
    noise = RangeNoise(sigma_m=0.01, sigma_per_m=0.0)
    yard = make_yard(tmp_path, (noise, RangeBias(offset_m=BIAS_M)), known=(NOISE,), frames=4)
    context = context_of(opened(yard.drive), yard.sensor)
    both = (*context.initial_effects, RangeBias(offset_m=BIAS_M), RangeWalk(amplitude_m=0.01, decay=0.2))
    on = trace_and_fit(context, context.split.fit, both, (1, 2))
    found = [ReportedTerm(name, 0.001) for name in ("range_bias", "range_walk")]
    model, left, *_ = drop_insignificant(context, FittedModel(on.frames, on.fitter, on.fitted, (1, 2)), found)
    assert [one.name for one in left] == ["range_bias"]
    assert [effect.name for effect in model.fitted.effects] == ["range_noise", "range_bias"] and model.free == (1,)
    assert model.fitted.effects[1].model_dump()["offset_m"] == pytest.approx(BIAS_M, abs=0.003)


def test_a_plug_in_whose_interval_includes_no_change_is_listed_instead(tmp_path: Path) -> None:
    """Its formula does not describe the dependence that was selected."""
    yard = make_yard(tmp_path, (RangeNoise(sigma_m=0.01, sigma_per_m=0.0),), known=(NOISE,), frames=4)
    context = context_of(opened(yard.drive), yard.sensor)
    ring = tuple(str(number) for number in range(16))
    errors_m = np.random.default_rng(0).choice([-0.002, 0.002], 16)
    unknown = UnknownEffect.of(Curve("range", ("ring",), ("",), (ring,), errors_m, np.full(16, 0.001)))
    on = trace_and_fit(context, context.split.fit, (*context.initial_effects, effect_of(unknown)), (1,))
    term = Term(Group("range by ring", "range", ("ring",), 16), 0.001, 20.0, 20.0)
    model = FittedModel(on.frames, on.fitter, on.fitted, (1,), terms=(term,))
    found = [ReportedTerm(unknown.name, 0.001, unknown=unknown, term="range by ring")]
    model, left, listed, _ = drop_insignificant(context, model, found)
    assert not left and listed == (term,)
    assert [effect.name for effect in model.fitted.effects] == ["range_noise"]


def test_a_finding_that_raises_the_error_of_held_out_frames_is_listed_instead(tmp_path: Path) -> None:
    """The bias is there; losses, which a fit might prefer by chance, are not."""
    noise = RangeNoise(sigma_m=0.01, sigma_per_m=0.0)
    yard = make_yard(tmp_path, (noise, RangeBias(offset_m=BIAS_M)), known=(NOISE,), frames=8)
    context = context_of(opened(yard.drive), yard.sensor)
    own, bias = context.initial_effects, RangeBias(offset_m=BIAS_M)
    both = (*own, bias, RandomDropout(probability=0.2))
    on = trace_and_fit(context, context.split.fit, both, ())
    terms = tuple(
        Term(Group(name, "range", (), 1, tangent=Tangent(effect, "", 0.0)), 0.001, 20.0, 20.0)
        for name, effect in (("range_bias [offset_m]", bias), ("random_dropout [probability]", both[-1]))
    )
    model = FittedModel(on.frames, on.fitter, on.fitted, (1, 2), terms)
    evidence = gather_evidence(model, (), context.settings, 0)
    found = tuple(ReportedTerm(name, 0.001) for name in ("range_bias", "random_dropout"))
    missing = Missing(model, found, (), evidence, evidence, {})
    budget, frame_pairs = budget_of(context, missing.held_out(context), [own, (*own, bias), both])
    measured = HeldOutCheck(missing, budget, frame_pairs, frozenset())
    assert [one.name for one in measured.harmful(context)] == ["random_dropout"]
    assert not replace(measured, needed=frozenset({"random_dropout"})).harmful(context), "others need it"
    initial = FittedModel(on.frames, on.fitter, on.fitter.fit(own, ()), ())
    check = check_held_out(context, missing, initial)
    left = check.missing
    assert len(check.budget.aligned_steps) == 2 and check.budget.aligned_steps[1].error < budget.aligned_steps[2].error
    assert [one.name for one in left.findings] == ["range_bias"] and left.phases == terms[1:]
    assert [effect.name for effect in left.model.fitted.effects] == ["range_noise", "range_bias"]
    assert left.ci95["range_bias"]["offset_m"][0] < BIAS_M < left.ci95["range_bias"]["offset_m"][1]
