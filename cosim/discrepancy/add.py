"""Adds an effect to a sensor model and fits its parameters to a drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from cosim.discrepancy.analysis import Context, FittedFrames, context_of, fit_held_out, trace_and_fit
from cosim.discrepancy.budget import HeldOut, held_out
from cosim.discrepancy.candidates import with_values
from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.diagnose import fit_nuisances
from cosim.discrepancy.dictionary.effects import effect_groups
from cosim.discrepancy.dictionary.lattices import find_lattices
from cosim.discrepancy.dictionary.linearisation import linearise
from cosim.discrepancy.inference.intervals import intervals
from cosim.discrepancy.selection.refit import FittedModel, refit_with
from cosim.discrepancy.selection.table import score_groups
from cosim.discrepancy.words import Vocabulary
from cosim.drives.kitti import Drive
from cosim.errors import DriveError
from sensors.effects.base import Effect, LabelEffect, RoundingEffect
from sensors.effects.lasers import as_known, for_rings
from sensors.effects.registry import find_effect
from sensors.errors import SensorError
from sensors.pattern import first_problem
from sensors.sensor_model import SensorModel, load_sensor

_START_STEPS = 6


@dataclass(frozen=True, eq=False)
class Added:
    """A sensor model with an added effect.

    Attributes:
        effect: name of the effect.
        params: all parameters of the effect.
        ci95: 95 % intervals of its fitted parameters, by name.
        sensor: sensor model with the effect.
        error_before, error_after: held-out errors without and with the effect.
    """

    effect: str
    params: Mapping[str, Any]
    ci95: Mapping[str, Any]
    sensor: SensorModel
    error_before: HeldOut
    error_after: HeldOut

    def to_json(self) -> dict[str, Any]:
        """Values that `cosim add --json` writes."""
        return {
            "effect": self.effect,
            "params": dict(self.params),
            "ci95": dict(self.ci95),
            "error_before": self.error_before.error,
            "error_after": self.error_after.error,
        }

    def write_sensor(self, path: str | Path) -> Path:
        """Write the sensor to a file; returns its path.

        Raises:
            OutputError: the folder cannot be written.
        """
        from cosim.drives.sensor_files import write_sensor

        return write_sensor(self.sensor, Path(path))

    def __str__(self) -> str:
        words = Vocabulary([type(effect) for effect in self.sensor.effects])
        values = words.parameters(self.effect, self.params, self.ci95)
        before, after = self.error_before.error, self.error_after.error
        verdict = "" if after < before else ": no improvement, keep the sensor without this fit"
        return f"{self.effect} ({values}): held-out error {before:.3f} → {after:.3f}{verdict}"


def add(
    effect: type[Effect] | str,
    drive: Drive | str | Path,
    sensor: SensorModel | str | Path,
    *,
    fixed: Mapping[str, Any] | None = None,
    seed: int = 0,
) -> Added:
    """Fit an effect to a drive, jointly with the random effects of the drive.

    Args:
        effect: class of the effect, its name in the catalogue, or `path.py:ClassName`; an effect that the sensor
            already has is fitted again; of several with this name, that with the `fixed` parameters, or a further one.
        drive: measured drive with a twin, or its folder.
        sensor: sensor model or its file.
        fixed: parameters with known values, which are not fitted.
        seed: random seed of the sample.

    Raises:
        CosimError: the drive has no points or no twin, or the twin does not match it.
        SensorError: no such effect, the sensor file breaks the rules, or a fixed parameter does not fit the effect.
    """
    kind = find_effect(effect) if isinstance(effect, str) else effect
    drive = opened(drive)
    model = sensor if isinstance(sensor, SensorModel) else load_sensor(sensor)
    fixed, kind = fixed_parameters(kind, fixed or {}), for_rings(kind, model.pattern.rings)
    context = context_of(drive, model, seed=seed)
    effects = context.initial_effects
    index = _own_index(effects, kind, fixed)
    if index is not None and fixed:
        effects = tuple(with_values(effect, fixed) if i == index else effect for i, effect in enumerate(effects))
    on = fit_nuisances(context)
    known: dict[str, Any] = {}
    if index is None or issubclass(kind, RoundingEffect):
        effects, index, known = _start(context, on, kind, effects, fixed)
    names, before = context.split.fit, on
    on = trace_and_fit(context, names, effects, (index,), warm_start=on, fixed_params=tuple(fixed))
    effects = on.fitted.effects
    is_held_out = context.split.is_held_out
    without = fit_held_out(context, context.initial_effects) if is_held_out else before
    found = intervals(on.fitter, on.fitted)[kind.name] if on.fitted.free else known
    return Added(
        effect=kind.name,
        params=effects[index].model_dump(mode="json"),
        ci95=found,
        sensor=SensorModel(model.pattern, as_known(effects), model.origin),
        error_before=held_out(context, without, context.initial_effects),
        error_after=held_out(context, fit_held_out(context, effects) if is_held_out else on, effects),
    )


def _own_index(effects: Sequence[Effect], kind: type[Effect], fixed: Mapping[str, Any]) -> int | None:
    """Index of the sensor's own effect of a type; None without one.

    Raises:
        SensorError: the sensor has several with the fixed parameters.
    """
    rows = [row for row, effect in enumerate(effects) if effect.name == kind.name]
    if kind.repeatable:
        rows = [row for row in rows if all(getattr(effects[row], name) == value for name, value in fixed.items())]
    if len(rows) > 1:
        values = "; ".join(str(effects[row].model_dump()) for row in rows[:3])
        raise SensorError(f"the sensor has {len(rows)} effects {kind.name}: name one with --param ({values})")
    return rows[0] if rows else None


def fixed_parameters(kind: type[Effect], given: Mapping[str, Any]) -> dict[str, Any]:
    """Validate user-supplied parameters of an effect.

    Raises:
        SensorError: unknown parameter, value out of bounds, or an effect that does not change points.
    """
    unknown_names = sorted(set(given) - set(kind.model_fields))
    if unknown_names:
        known = ", ".join(kind.model_fields) or "none"
        raise SensorError(f"effect {kind.name} has no parameter {unknown_names[0]!r}; parameters: {known}")
    try:
        checked = kind.model_validate({**kind.example, **given})
    except ValidationError as error:
        raise SensorError(f"effect {kind.name}: {first_problem(error)}; see `cosim effects {kind.name}`") from error
    if issubclass(kind, LabelEffect):
        raise SensorError(
            f"effect {kind.name} changes labels, not points, and cannot be fitted; write it into the sensor file"
        )
    return {name: getattr(checked, name) for name in given}


def _start(
    context: Context,
    on: FittedFrames,
    kind: type[Effect],
    effects: Sequence[Effect],
    fixed: Mapping[str, Any],
) -> tuple[tuple[Effect, ...], int, dict[str, Any]]:
    """Return the effects with the new one at initial values, its index, and intervals that are already known."""
    others = tuple(effect for effect in effects if kind.repeatable or effect.name != kind.name)
    fitter, root = on.fitter, context.tracer.drive.root
    if issubclass(kind, RoundingEffect) and not fixed:
        at = fitter.at(others, on.fitted.estimate)
        found = find_lattices(fitter, at, [kind], np.random.default_rng([context.seed, 3]))
        if not found:
            raise DriveError(f"{root}: its values are not rounded as {kind.name} would do; pass the rounding step")
        return (*others, found[0].effect), len(others), found[0].interval
    if kind.neutral is None or all(name in fixed for name in kind.model_fields):
        return (*others, kind.model_validate({**kind.example, **fixed})), len(others), {}
    linearisation = linearise(fitter, on.fitted, on.frames)
    groups = [group for group in effect_groups(linearisation, [kind], (), ()) if group.effect_name == kind.name]
    by = replace(context.settings.selection, least_left=0.0)
    entries = score_groups(linearisation, groups, linearisation.projector(by.sectors), by)
    model = FittedModel(on.frames, fitter, on.fitted)
    fits = [
        refit_with(
            model, linearisation, entry.group, entry.start, fine=True, steps=_START_STEPS, absorbed=entry.absorbed
        )[0]
        for entry in entries
    ]
    if not fits:
        raise DriveError(f"{root}: {kind.name} has no effect in this drive; pass a drive in which it is observable")
    best = max(fits, key=lambda fit: fit.loglik).fitted.effects
    effect = next(one for one in best if one.name == kind.name)
    return (*others, with_values(effect, fixed) if fixed else effect), len(others), {}
