"""Every candidate of the catalogue as directions in which a fitted model could change."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from cosim.discrepancy.candidates import unknowns, weak_forms, with_values
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.score import Column, Quantity, SparseMatrix, change
from cosim.discrepancy.inference.score_test import Group, Strays
from cosim.discrepancy.sampling.sample import Prediction, Sample
from sensors.effects.base import Effect


def effect_groups(
    fitter: Fitter, fitted: Fitted, kinds: Sequence[type[Effect]], settled: Collection[int]
) -> list[Group]:
    """Where to look for each kind of effect.

    Args:
        fitter: of the sample.
        fitted: the model as it stands.
        candidates: effects that are asked for.
        settled: places of effects whose parameters have been fitted: nothing more is to be found of them.
    """
    found: list[Group] = []
    for place, effect in enumerate(fitted.effects):
        if place not in settled and effect.neutral is not None:
            found += _retuned(fitter, fitted, place)
    there = {effect.name for effect in fitted.effects}
    for kind in kinds:
        if kind.name not in there and kind.neutral is not None:
            for weak, amplitude, step in weak_forms(kind):
                found += _told(fitter, fitted, (*fitted.effects, weak), weak, amplitude, step, None)
    return found


def _retuned(fitter: Fitter, fitted: Fitted, place: int) -> Iterator[Group]:
    """Other values of an effect that the sensor has."""
    effect = fitted.effects[place]
    for unknown in unknowns(type(effect)):
        value = np.asarray(getattr(effect, unknown.name), float)
        if value.ndim and value.size != unknown.rings:
            continue
        step = unknown.step if np.all(value + unknown.step <= unknown.high) else -unknown.step
        moved = with_values(effect, {unknown.name: value + step})
        effects = (*fitted.effects[:place], moved, *fitted.effects[place + 1 :])
        yield from _told(fitter, fitted, effects, moved, unknown.name, step, place)


def _told(
    fitter: Fitter,
    fitted: Fitted,
    effects: tuple[Effect, ...],
    weak: Effect,
    amplitude: str,
    step: float,
    place: int | None,
) -> Iterator[Group]:
    """The group of a weak form, if it changes anything."""
    sample = fitter.sample
    after = sample.predict(effects)
    label = ", ".join(
        f"{name} {value:g}"
        for name, value in weak.model_dump().items()
        if isinstance(value, float) and name != amplitude
    )
    if type(weak).density is not Effect.density or not amplitude:
        is_new = amplitude and place is None
        few = (
            min(fitter.settings.screen.most_strays / max(_taken(sample, fitted, after).sum(), 1e-300), 1.0)
            if is_new
            else 1.0
        )
        if few < 1:
            sparse = with_values(weak, {amplitude: getattr(weak, amplitude) - (1 - few) * step})
            after, step = sample.predict((*fitted.effects, sparse)), few * step
        found = fitter.residuals(after, fitted.estimate).loglik
        gain = sample.share * (found - fitted.residuals.loglik)
        if np.any(gain):
            strays = _strays(sample, fitted, after, step) if amplitude else None  # a whole setting is no unit
            yield Group(
                weak.name, weak.channel, {}, 1, one_sided=True, start=weak, amplitude=amplitude, label=label,
                place=place, gain=gain, strays=strays,
            )  # fmt: skip
        return
    moved, passed_on = (
        change(fitted.prediction, after, sample.settings.law),
        fitter.random.passed_on(fitted.prediction, fitted.estimate),
    )
    delta: dict[Quantity, np.ndarray] = {
        name: values / step * passed_on.get(name, 1.0)
        for name, values in moved.items()
        if name in fitted.evidence.score
    }
    if delta:
        free = next(unknown for unknown in unknowns(type(weak)) if unknown.name == amplitude)
        column = Column(delta, sample.ring if free.rings > 1 else None, free.rings)
        at_bound = place is None and free.rings == 1 and (weak.neutral or {})[amplitude] <= free.low
        columns: dict[Quantity, SparseMatrix] = {name: column.matrix(name, len(sample)) for name in delta}
        yield Group(
            weak.name, weak.channel, columns, free.rings, one_sided=at_bound, start=weak, amplitude=amplitude,
            label=label, place=place,
        )  # fmt: skip


def _strays(sample: Sample, fitted: Fitted, after: Prediction, step: float) -> Strays | None:
    """What a weak form adds."""
    taken = _taken(sample, fitted, after)
    if not np.any(taken):
        return None
    gain = float(taken @ np.log1p(_given_way(fitted, after) / sample.settings.law.stray_share) / taken.sum())
    return Strays(taken * np.count_nonzero(sample.first), step, 1 / sample.mean_weight, gain)


def _taken(sample: Sample, fitted: Fitted, after: Prediction) -> np.ndarray:
    """(n,) Share of all beams whose own returns give way to strays."""
    return sample.share * sample.clear * _given_way(fitted, after) / np.count_nonzero(sample.first)


def _given_way(fitted: Fitted, after: Prediction) -> np.ndarray:
    """(n,) How much less likely each beam's own return is."""
    return np.maximum(fitted.prediction.seen - after.seen, 0.0)
