"""Every candidate as directions in which a fitted model could change."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from cosim.discrepancy.candidates import unknowns, weak_forms, with_values
from cosim.discrepancy.evidence import Quantity, change
from cosim.discrepancy.fitting import Fitted, Fitter
from cosim.discrepancy.gate import Direction
from cosim.discrepancy.likelihood import judge
from cosim.discrepancy.system import Column
from sensors.effects.base import Effect

_LEVERAGE = 4.0


def directions(
    fitter: Fitter, fitted: Fitted, kinds: Sequence[type[Effect]], settled: Collection[int]
) -> list[Direction]:
    """Where to look for each kind of effect.

    Args:
        fitter: of the sample.
        fitted: the model as it stands.
        kinds: the candidates.
        settled: places of effects whose parameters have been fitted: nothing more is to be found of them.
    """
    found: list[Direction] = []
    for place, effect in enumerate(fitted.effects):
        if place not in settled and effect.neutral is not None:
            found += _retuned(fitter, fitted, place)
    there = {effect.name for effect in fitted.effects}
    for kind in kinds:
        if kind.name not in there and kind.neutral is not None:
            found += _new(fitter, fitted, kind)
    return found


def _retuned(fitter: Fitter, fitted: Fitted, place: int) -> Iterator[Direction]:
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


def _new(fitter: Fitter, fitted: Fitted, kind: type[Effect]) -> Iterator[Direction]:
    for weak, amplitude, step in weak_forms(kind):
        yield from _told(fitter, fitted, (*fitted.effects, weak), weak, amplitude, step, None)


def _told(
    fitter: Fitter,
    fitted: Fitted,
    effects: tuple[Effect, ...],
    weak: Effect,
    amplitude: str,
    step: float,
    place: int | None,
) -> Iterator[Direction]:
    """The direction of a weak form, if it changes anything."""
    sample = fitter.sample
    after = sample.predict(effects)
    label = ", ".join(
        f"{name} {value:g}"
        for name, value in weak.model_dump().items()
        if isinstance(value, float) and name != amplitude
    )
    if type(weak).density is not Effect.density or not amplitude:
        found = judge(sample, after, shift=fitter.shift(fitted.pose, after)).loglik
        gain = sample.share * (found - fitted.fit.loglik)
        if np.any(gain):
            strays = float(sample.weight @ (sample.returned & (fitted.fit.matched < 0.5)))
            kept = float(sample.weight @ (fitted.prediction.seen - after.seen))
            added = max(kept, 0.0) / step
            yield Direction(weak.name, label, amplitude, Column({}), weak, place, True, gain, added, strays)
        return
    whole: dict[Quantity, np.ndarray] = {
        name: values / step for name, values in change(fitted.prediction, after).items()
    }
    delta: dict[Quantity, np.ndarray] = {name: _bounded(values) for name, values in whole.items()}
    if delta:
        free = next(unknown for unknown in unknowns(type(weak)) if unknown.name == amplitude)
        column = Column(delta, sample.ring if free.rings > 1 else None, free.rings)
        at_bound = place is None and free.rings == 1 and (weak.neutral or {})[amplitude] <= free.low
        yield Direction(weak.name, label, amplitude, column, weak, place, at_bound, moved=whole.get("range"))


def _bounded(delta: np.ndarray) -> np.ndarray:
    """Changes with their longest tails cut: beams that graze a surface would outvote all others, and leave it first."""
    size = np.abs(delta)
    most = _LEVERAGE * float(np.median(size[size > 1e-3 * size.max()]))
    return np.clip(delta, -most, most)
