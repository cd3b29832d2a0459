"""A shape as a candidate among others: as the plug-in that will be written, fitted like any effect."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from cosim.discrepancy.fitting import Fitted, Fitter, all_free
from cosim.discrepancy.gate import Direction, Verdict, run_gate
from cosim.discrepancy.ranking import Ranked
from cosim.discrepancy.system import Column
from cosim.discrepancy.unknown.covariates import covariates
from cosim.discrepancy.unknown.search import CHANNELS, Shape, shape_column
from cosim.discrepancy.unknown.write import class_name, effect_source
from sensors.effects.base import Effect
from sensors.effects.registry import find_effect

_STEPS = 8
_FEWEST_PARTS = 120


def shape_effect(shape: Shape) -> Effect:
    """The effect of a shape, at the size found."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "unknown_effect.py"
        file.write_text(effect_source(shape), encoding="utf-8")
        kind = find_effect(f"{file.name}:{class_name(shape)}", Path(folder))
    return kind.model_validate(kind.example)


def rank_shape(fitter: Fitter, fitted: Fitted, shape: Shape) -> Ranked:
    """A shape fitted on top of a model, to be held against candidates."""
    effects = (*fitted.effects, shape_effect(shape))
    place = len(fitted.effects)
    free = all_free(effects, [place], fitter.rings)
    result = fitter.fit(effects, free, pose=fitted.pose, pose_sigma=fitted.pose_sigma, steps=_STEPS)
    count = len(free) if shape.formula is not None else len(shape.y)
    delta = 2 * (result.loglik - fitted.loglik) - count * np.log(len(fitter.sample))
    return Ranked(effects[place].name, result, place, float(delta), count)


def shape_gate(fitter: Fitter, fitted: Fitted, present: tuple[Column, ...], rng: np.random.Generator) -> Verdict:
    """Whether any residual depends on any covariate, in whatever shape: the gate over all of them."""
    found = []
    sample = fitter.sample
    evidence = fitter.evidence(fitted.prediction, fitted.pose)
    for covariate in covariates(sample, fitted):
        bins = len(covariate.centres)
        for channel in CHANNELS:
            column = shape_column(fitted, channel, covariate.bin, bins)
            found.append(Direction(f"{channel} by {covariate.name}", "", "", column))
    poses = fitter.pose_errors.slopes(fitted.pose)
    return run_gate(found, [evidence], [], sample.track, sample.frame, sample.parts(_FEWEST_PARTS), present, poses, rng)
