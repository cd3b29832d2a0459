"""Tangents of the catalogue's effects: derivatives of a fitted model with respect to each effect's amplitude."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from cosim.discrepancy.candidates import unknowns, weak_forms, with_values
from cosim.discrepancy.dictionary.groups import Group, Tangent
from cosim.discrepancy.dictionary.linearisation import Linearisation
from cosim.discrepancy.inference.dependence import apply_changes, changes_of
from cosim.discrepancy.inference.derivatives import difference_quotients
from cosim.discrepancy.inference.score import Column, Quantity, SparseMatrix
from cosim.discrepancy.sampling.sample import Prediction
from sensors.effects.base import Effect


def effect_groups(
    linearisation: Linearisation, types: Sequence[type[Effect]], fixed: Sequence[int], fitted: Sequence[int]
) -> list[Group]:
    """Build the groups of all candidates that the sensor does not have, and of its own effects that were not fitted.

    Args:
        linearisation: linearised model.
        types: candidate effects.
        fixed: indices of effects with fixed parameters.
        fitted: indices of effects whose parameters were fitted.
    """
    effects, groups = linearisation.fitted.effects, list[Group]()
    for index, effect in enumerate(effects):
        if index not in fixed and index not in fitted and effect.neutral is not None:
            groups += _other_values(linearisation, index)
    present = {effect.name for effect in effects}
    for kind in types:
        if kind.name not in present and kind.neutral is not None:
            for weak, amplitude, step in weak_forms(kind):
                groups += _tangents(linearisation, (*effects, weak), Tangent(weak, amplitude, step))
    return groups


def mixture_score(
    linearisation: Linearisation, changed: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Score and information (n,) of an effect that adds spurious returns, at its reference amplitude.

    With L₀ and L₁ the likelihoods without and with it, the score is w(L₁ − L₀)/L₁; under the null its information is
    the expected number of returns that it adds.

    Args:
        linearisation: linearised model.
        changed: (n,) changes of the probability of the surface's return, of the probability of no return, and of the
            density of spurious returns [1/m].
    """
    sample, before = linearisation.sample, linearisation.adjusted
    seen, silent, spurious_per_m = changed
    after = replace(
        before,
        seen=np.clip(before.seen + seen, 0, 1),
        silent=np.clip(before.silent + silent, 0, 1),
        spurious_per_m=np.maximum(before.spurious_per_m + spurious_per_m, 0),
    )
    fitter = linearisation.fitter
    old = fitter.residuals_at(before).outcome
    new = fitter.residuals_at(after).outcome
    used = sample.share * sample.clear * sample.first
    added = np.maximum(-seen, 0) + np.maximum(-silent, 0)
    return used * (1 - np.exp(np.minimum(old - new, 50.0))), used * added


def _other_values(linearisation: Linearisation, index: int) -> Iterator[Group]:
    """Yield groups for changed parameters of an effect that the sensor already has."""
    effects = linearisation.fitted.effects
    effect = effects[index]
    for unknown in unknowns(type(effect)):
        value = np.asarray(getattr(effect, unknown.name), float)
        if value.ndim and value.size != unknown.rings:
            continue
        step = unknown.step if np.all(value + unknown.step <= unknown.high) else -unknown.step
        moved = with_values(effect, {unknown.name: value + step})
        changed = (*effects[:index], moved, *effects[index + 1 :])
        yield from _tangents(linearisation, changed, Tangent(moved, unknown.name, step, index))


def _tangents(linearisation: Linearisation, effects: tuple[Effect, ...], tangent: Tangent) -> Iterator[Group]:
    """Yield the group of a weak form if it changes any measured quantity."""
    sample, fitted, weak = linearisation.sample, linearisation.fitted, tangent.effect
    if type(weak).density is not Effect.density or not tangent.amplitude:
        yield from _direct(linearisation, sample.predict(effects), tangent)
        return
    jacobian = linearisation.fitter.random.prediction_jacobian(fitted.prediction, fitted.estimate)
    free = next(unknown for unknown in unknowns(type(weak)) if unknown.name == tangent.amplitude)
    index = len(effects) - 1 if tangent.index is None else tangent.index
    neutral = with_values(weak, {tangent.amplitude: np.asarray(getattr(weak, tangent.amplitude), float) - tangent.step})
    without = (*effects[:index], neutral, *effects[index + 1 :])
    delta: dict[Quantity, np.ndarray] = {
        name: values * jacobian.get(name, 1.0)
        for name, values in difference_quotients(sample, without, index, free, tangent.step, fitted.bare).items()
        if name in linearisation.evidence.score
    }
    if weak.channel == "drop" and "drop" in delta:
        delta["drop"] = np.where(linearisation.channels["drop"].slope > 0, delta["drop"], 0.0)
    if not delta:
        return
    column = Column(delta, sample.ring if free.rings > 1 else None, free.rings)
    at_bound = tangent.index is None and free.rings == 1 and (weak.neutral or {})[tangent.amplitude] <= free.low
    columns: dict[Quantity, SparseMatrix] = {name: column.matrix(name, len(sample)) for name in delta}
    name = _name(tangent)
    yield Group(name, weak.channel, (), free.rings, columns, one_sided=at_bound, tangent=tangent)


def _direct(linearisation: Linearisation, after: Prediction, tangent: Tangent) -> Iterator[Group]:
    """Yield the group of an effect that adds spurious returns, or of an effect without amplitude."""
    sample, fitted = linearisation.sample, linearisation.fitted
    before, weak = fitted.bare, tangent.effect
    changed = after.seen - before.seen, after.silent - before.silent, after.spurious_per_m - before.spurious_per_m
    share = float(sample.share @ (np.maximum(-changed[0], 0) * sample.clear)) / max(float(sample.share.sum()), 1e-9)
    is_new = bool(tangent.amplitude) and tangent.index is None
    if is_new and share > 0:  # scale the amplitude to the reference share of returns
        scale = sample.settings.likelihood.reference_share / share
        changed = changed[0] * scale, changed[1] * scale, changed[2] * scale
        weaker = {tangent.amplitude: np.multiply(getattr(weak, tangent.amplitude), scale)}
        tangent = Tangent(with_values(weak, weaker), tangent.amplitude, tangent.step * scale, None)
    if is_new:
        score, information = mixture_score(linearisation, changed)
    else:
        after = apply_changes(sample, after, changes_of(fitted.dependences))
        gain = linearisation.fitter.residuals(after, fitted.estimate).loglik - fitted.residuals.loglik
        score, information = sample.share * gain, np.zeros(len(sample))
    if np.any(score):
        yield Group(
            _name(tangent), weak.channel, (), 1, one_sided=True, is_count=is_new, direct=(score, information),
            tangent=tangent,
        )  # fmt: skip


def _name(tangent: Tangent) -> str:
    """Name of the group: the effect with the values of its other parameters."""
    settings = ", ".join(
        f"{name} {value:g}"
        for name, value in tangent.effect.model_dump().items()
        if isinstance(value, float) and name != tangent.amplitude
    )
    amplitude = f"{tangent.amplitude}; " if tangent.amplitude and settings else tangent.amplitude
    return f"{tangent.effect.name} [{amplitude}{settings}]"
