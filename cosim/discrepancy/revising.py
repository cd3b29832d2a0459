"""Second thoughts on what was found first, once the rest is there: simpler causes, shapes drawn anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cosim.discrepancy.candidates import amplitudes, unknowns
from cosim.discrepancy.groups.effects import directions
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.intervals import covariances, stray_weight
from cosim.discrepancy.inference.search import is_searched
from cosim.discrepancy.kinds import confusable
from cosim.discrepancy.ranking import Ranked, fit_candidate
from cosim.discrepancy.unknown import Shape, same_shape
from sensors.effects.base import BeamEffect, Effect, ScanEffect

_STARTS = 2
_WITHIN_INTERVAL = 2.1  # standard errors, of about twenty scans


def simpler_rival(fitter: Fitter, fitted: Fitted, place: int, kinds: Sequence[type[Effect]]) -> Effect | None:
    """An effect of fewer numbers that does as well in the place of another, by the BIC; None if there is none.

    What is found first has to make up for all that is missing then: a delay by intensity for a constant one whose
    sum with another error it fits by chance.

    Args:
        fitter: of the sample.
        fitted: the model with everything found.
        place: of the effect in question.
        kinds: the candidates; asked are those declared to be confusable with it.
    """
    effect, there = fitted.effects[place], {one.name for one in fitted.effects}
    count = sum(one.unknown.rings for one in fitted.free_of(place))
    rivals = [kind for kind in kinds if confusable(kind, type(effect)) and kind.name not in there]
    rivals = [kind for kind in rivals if sum(one.rings for one in unknowns(kind)) < count]
    rest = (*fitted.effects[:place], *fitted.effects[place + 1 :])
    without = fitter.fit(rest, (), pose=fitted.pose, pose_sigma=fitted.pose_sigma) if rivals else fitted
    best: Ranked | None = None
    for kind in rivals:
        starts = directions(fitter, without, [kind], range(len(rest)))
        if not starts or issubclass(kind, BeamEffect) != isinstance(effect, BeamEffect):
            continue  # frames are traced as the effect in question bends their beams
        one = fit_candidate(fitter, without, starts[:_STARTS])
        gained = 2 * (one.fitted.loglik - fitted.loglik) + (count - one.parameters) * np.log(len(fitter.sample))
        if gained > 0 and (best is None or one.delta_bic > best.delta_bic):
            best = one
    return None if best is None else best.fitted.effects[best.place]


def is_idle(fitter: Fitter, fitted: Fitted, place: int, clearly: float, said: Effect | None = None) -> bool:
    """Whether an effect could as well do nothing, or what it was said to do: by its interval, or as the fit is as good.

    Args:
        fitter: of the sample.
        fitted: the model with everything found.
        place: of the effect in question.
        clearly: standard errors beyond which an amplitude is there.
        said: the effect as the sensor had it; None if it did not.
    """
    count = sum(one.unknown.rings for one in fitted.free_of(place))
    if said is None:
        fitted = _with_shape_held(fitted, place)
    at, rows, apart, is_sloping = 0, [], [], True
    neutral = said.model_dump() if said is not None else type(fitted.effects[place]).neutral or {}
    for one, column in zip(fitted.free, fitted.columns, strict=True):
        if one.effect == place:
            rows += range(at, at + one.unknown.rings)
            away = np.subtract(getattr(fitted.effects[place], one.unknown.name), neutral[one.unknown.name])
            apart += np.atleast_1d(away).tolist()
            is_sloping &= not is_searched(fitted.effects[place], one.unknown, column)
        at += one.unknown.rings
    deviate = _joint_deviate(covariances(fitter, fitted), rows, np.array(apart)) if rows else np.inf
    if deviate > clearly:
        return False
    if is_sloping and deviate < _WITHIN_INTERVAL:
        return True
    there = () if said is None else (said,)
    rest = (*fitted.effects[:place], *there, *fitted.effects[place + 1 :])
    without = fitter.fit(rest, (), pose=fitted.pose, pose_sigma=fitted.pose_sigma)
    cost = count * np.log(len(fitter.sample))
    if isinstance(fitted.effects[place], ScanEffect):
        cost *= stray_weight(fitter, fitted)  # each is one fact
    return 2 * (fitted.loglik - without.loglik) < cost


def _with_shape_held(fitted: Fitted, place: int) -> Fitted:
    """A fit without those parameters of an effect that mean nothing where its amplitudes are none (Davies 1977)."""
    if not fitted.free_of(place):
        return fitted  # a rounding, which is never none
    switching = amplitudes(type(fitted.effects[place]))
    kept = [row for row, one in enumerate(fitted.free) if one.effect != place or one.unknown.name in switching]
    return replace(
        fitted, free=tuple(fitted.free[row] for row in kept), columns=tuple(fitted.columns[row] for row in kept)
    )


def _joint_deviate(covariances: Sequence[np.ndarray], rows: Sequence[int], apart: np.ndarray) -> float:
    """Size of numbers (k,) in their standard errors, as they go together: one may make up for another (Wald)."""
    squares = []
    for one in covariances:
        mine = one[np.ix_(rows, rows)]
        mine += np.diag(1e-6 * np.diag(mine) + 1e-24)
        squares.append(float(apart @ np.linalg.solve(mine, apart)) / len(apart))
    return float(np.sqrt(min(squares)))


def redrawn(fitter: Fitter, fitted: Fitted, place: int, shape: Shape) -> Shape | None:
    """An unknown shape drawn anew: when it was found, it stood beside values that had made up for part of it.

    Args:
        fitter: of the sample.
        fitted: the model with everything found.
        place: of the shape's effect.
        shape: as it was found.
    """
    found = _beside_the_rest(fitter, fitted, place, shape)
    if found is None or found.is_like(shape):
        # Its numbers have been fitted along with all others.
        return None if found is None else replace(found, formula=shape.formula)
    return found.without_level() if found.has_apart else found


def with_its_curve(fitter: Fitter, fitted: Fitted, place: int, shape: Shape) -> Shape:
    """An unknown shape with the curve that it has beside the model as it stands; categories as they were drawn.

    What stood beside it when it was drawn may be gone, and with it a constant that its formula has taken over.
    """
    found = _beside_the_rest(fitter, fitted, place, shape) if shape.formula is not None else None
    return shape if found is None else replace(shape, x=found.x, y=found.y, sigma=found.sigma)


def _beside_the_rest(fitter: Fitter, fitted: Fitted, place: int, shape: Shape) -> Shape | None:
    """The same shape drawn beside all effects but its own; None where it cannot be."""
    rest = (*fitted.effects[:place], *fitted.effects[place + 1 :])
    without = fitter.fit(rest, (), pose=fitted.pose, pose_sigma=fitted.pose_sigma)
    return same_shape(fitter, without, shape)
