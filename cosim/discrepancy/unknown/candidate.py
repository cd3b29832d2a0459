"""A shape as a candidate among others: as the plug-in that will be written, fitted like any effect."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.discrepancy.gate import Direction, Verdict, run_gate
from cosim.discrepancy.groups.covariates import covariates
from cosim.discrepancy.inference.clusters import compressed
from cosim.discrepancy.inference.columns import Column
from cosim.discrepancy.inference.fit import Fitted, Fitter, all_free
from cosim.discrepancy.ranking import ALIKE_BIC, Ranked
from cosim.discrepancy.unknown.refined import shape_column
from cosim.discrepancy.unknown.shape import CHANNELS, Shape
from cosim.discrepancy.unknown.write import class_name, effect_source
from sensors.effects.base import Effect
from sensors.effects.registry import find_effect

_STEPS = 8


def shape_effect(shape: Shape) -> Effect:
    """The effect of a shape, at the size found."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "unknown_effect.py"
        file.write_text(effect_source(shape), encoding="utf-8")
        kind = find_effect(f"{file.name}:{class_name(shape)}", Path(folder))
    return kind.model_validate(kind.example)


def rank_shape(fitter: Fitter, fitted: Fitted, shape: Shape, along: Sequence[int] = ()) -> tuple[Shape, Ranked]:
    """A shape fitted on top of a model, to be held against candidates; of intensities, in the better of two places.

    Args:
        fitter: of the sample.
        fitted: the model as it stands.
        shape: what was found.
        along: places of effects that have been fitted, which may have made up for light that was another.
    """
    if shape.channel != "intensity":
        return shape, _ranked(fitter, fitted, shape)
    reading, light = replace(shape, acts="reading"), replace(shape, acts="light")
    free = all_free(fitted.effects, along, fitter.rings)
    before = fitter.fit(fitted.effects, free, pose=fitted.pose, pose_sigma=fitted.pose_sigma, steps=_STEPS)
    of_reading, of_light = (_ranked(fitter, before, one, along) for one in (reading, light))
    is_read = of_reading.delta_bic > of_light.delta_bic + ALIKE_BIC
    return (reading, of_reading) if is_read else (light, of_light)


def spread_of_gain(fitter: Fitter, before: Fitted, after: Fitted) -> float:
    """By how many deviates a fit gains from place to place: its gain over the root sum of squares of places' own.

    Large gains count as their logarithms, so that the few places that show most do not outvote all others; but not
    where every spot of the map has an error of its own to be gained by.

    A law of the sensor shows wherever its covariate does. A wrong label or a wrong spot of the map makes a shape, too,
    of whatever is peculiar to it, but gains there alone.

    Args:
        fitter: of the sample, whose tracks (instances, cells of the map) are the places.
        before, after: fits to compare.
    """
    gain = fitter.sample.share * (after.fit.loglik - before.fit.loglik)
    _, place = np.unique(fitter.sample.track, return_inverse=True)
    own = np.bincount(place.ravel(), gain)
    own = own if fitter.sample.map_is_off else compressed(own)
    return float(own.sum() / max(np.sqrt(np.sum(own**2)), 1e-12))


def _ranked(fitter: Fitter, fitted: Fitted, shape: Shape, along: Sequence[int] = ()) -> Ranked:
    effects = (*fitted.effects, shape_effect(shape))
    place = len(fitted.effects)
    free = all_free(effects, [place, *along], fitter.rings)
    result = fitter.fit(effects, free, pose=fitted.pose, pose_sigma=fitted.pose_sigma, steps=_STEPS)
    mine = sum(one.unknown.rings for one in result.free_of(place))
    count = mine if shape.formula is not None else len(shape.y)
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
    poses = fitter.slopes(fitted.pose, fitted.prediction)
    return run_gate(found, [evidence], [], sample.clusters, present, poses, rng)
