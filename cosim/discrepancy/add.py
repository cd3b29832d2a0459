"""Adds an effect to a sensor: its parameters, and those of what is there, fitted to a drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from cosim.discrepancy.budget import HeldOut, held_out
from cosim.discrepancy.candidates import with_values
from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.diagnose import begun, case_of
from cosim.discrepancy.groups.effects import effect_groups
from cosim.discrepancy.groups.quantization import find_lattices
from cosim.discrepancy.inference.intervals import intervals
from cosim.discrepancy.select import best_fit
from cosim.discrepancy.state import Case, Model, State, fitted_anew, given, judged
from cosim.discrepancy.words import Vocabulary
from cosim.drives.kitti import Drive
from cosim.errors import DriveError
from sensors.effects.base import Effect, LabelEffect, RoundingEffect
from sensors.effects.lasers import as_known, for_rings
from sensors.effects.registry import find_effect
from sensors.errors import SensorError
from sensors.pattern import first_problem
from sensors.sensor_model import SensorModel, load_sensor


@dataclass(frozen=True, eq=False)
class Added:
    """A sensor with an effect more.

    Attributes:
        effect: its name.
        params: all its parameters.
        ci95: intervals of those that were fitted, by name.
        sensor: the sensor with it.
        error_before, error_after: on frames that took no part in the fit.
    """

    effect: str
    params: Mapping[str, Any]
    ci95: Mapping[str, Any]
    sensor: SensorModel
    error_before: HeldOut
    error_after: HeldOut

    def to_json(self) -> dict[str, Any]:
        """What `cosim add --json` writes."""
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
        return f"{self.effect} ({values}): held-out error {self.error_before.error:.3f} → {self.error_after.error:.3f}"


def add(
    effect: type[Effect] | str,
    drive: Drive | str | Path,
    sensor: SensorModel | str | Path,
    *,
    fixed: Mapping[str, Any] | None = None,
    seed: int = 0,
) -> Added:
    """Fit an effect to a drive together with the noise and the like that the sensor has already.

    Args:
        effect: its class, its name in the catalogue, or `path.py:ClassName`; one that the sensor has is fitted anew.
        drive: measured, with a twin, or its folder.
        sensor: the model, or its file.
        fixed: parameters that are known and stay.
        seed: of the sample.

    Raises:
        CosimError: the drive lacks points or a twin, or the twin does not fit it.
        SensorError: no such effect, the sensor file breaks the rules, or a fixed parameter does not fit the effect.
    """
    kind = find_effect(effect) if isinstance(effect, str) else effect
    drive = opened(drive)
    model = sensor if isinstance(sensor, SensorModel) else load_sensor(sensor)
    fixed, kind = known_parameters(kind, fixed or {}), for_rings(kind, model.pattern.rings)
    case = case_of(drive, model, seed=seed, extra=())
    effects = given(case)
    place = next((i for i, one in enumerate(effects) if one.name == kind.name), None)
    if place is not None and fixed:
        effects = tuple(with_values(one, fixed) if i == place else one for i, one in enumerate(effects))
    state = begun(case)
    known: dict[str, Any] = {}
    if place is None or issubclass(kind, RoundingEffect):
        effects, place, known = _begun(case, state, kind, effects, fixed)
    view = fitted_anew(case, Model(effects, (place,)), state.view, tuple(fixed))
    effects = view.fitted.effects
    judges = judged(case, state.judges, Model(effects))
    found = intervals(view.fitter, view.fitted)[kind.name] if view.fitted.free else known
    return Added(
        effect=kind.name,
        params=effects[place].model_dump(mode="json"),
        ci95=found,
        sensor=SensorModel(model.pattern, as_known(effects), model.origin),
        error_before=held_out(case, state.judges, given(case)),
        error_after=held_out(case, judges, effects),
    )


def known_parameters(kind: type[Effect], given: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of an effect that are known, as the effect takes them.

    Raises:
        SensorError: no such parameter, a value out of bounds, or an effect of which points tell nothing.
    """
    strange = sorted(set(given) - set(kind.model_fields))
    if strange:
        known = ", ".join(kind.model_fields) or "none"
        raise SensorError(f"effect {kind.name} has no parameter {strange[0]!r}; parameters: {known}")
    try:
        checked = kind.model_validate({**kind.example, **given})
    except ValidationError as error:
        raise SensorError(f"effect {kind.name}: {first_problem(error)}; see `cosim effects {kind.name}`") from error
    if issubclass(kind, LabelEffect):
        raise SensorError(f"effect {kind.name} changes labels, which points cannot tell; write it into the sensor file")
    return {name: getattr(checked, name) for name in given}


def _begun(
    case: Case, state: State, kind: type[Effect], effects: Sequence[Effect], fixed: Mapping[str, Any]
) -> tuple[tuple[Effect, ...], int, dict[str, Any]]:
    """The effects with the new one, roughly as strong as it is, its place, and intervals that are known already."""
    effects = tuple(one for one in effects if one.name != kind.name)
    fitter, root = state.view.fitter, case.tracer.drive.root
    if issubclass(kind, RoundingEffect) and not fixed:
        found = find_lattices(fitter, fitter.at(effects, state.view.fitted.estimate), [kind], np.random.default_rng(0))
        if not found:
            raise DriveError(f"{root}: its values stand on no lattice that {kind.name} would make; give its step")
        return (*effects, found[0].effect), len(effects), found[0].interval
    if kind.neutral is None or all(name in fixed for name in kind.model_fields):
        return (*effects, kind.model_validate({**kind.example, **fixed})), len(effects), {}
    groups = effect_groups(fitter, state.view.fitted, [kind], range(len(effects)))
    best = best_fit(state, [one for one in groups if one.name == kind.name])
    if best is None:
        raise DriveError(f"{root}: nothing in it depends on {kind.name}; give a drive that shows it")
    effect = with_values(best, fixed) if fixed else best
    return (*effects, effect), len(effects), {}
