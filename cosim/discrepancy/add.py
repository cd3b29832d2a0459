"""Adds an effect to a sensor: its parameters, and those of what is there, fitted to a drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from cosim.discrepancy.candidates import with_values
from cosim.discrepancy.data.checks import check_fit, opened
from cosim.discrepancy.data.frames import FrameTracer, TracedFrame, bending, in_order
from cosim.discrepancy.data.sample import draw_sample
from cosim.discrepancy.data.split import split_drive
from cosim.discrepancy.groups.effects import directions
from cosim.discrepancy.groups.quantization import find_lattices
from cosim.discrepancy.inference.fit import Fitter, all_free
from cosim.discrepancy.inference.intervals import intervals
from cosim.discrepancy.kinds import as_known, for_rings, with_rings
from cosim.discrepancy.ranking import fit_candidate
from cosim.discrepancy.settling import ROWS, settle
from cosim.discrepancy.validation import HeldOut, held_out_errors
from cosim.drives.kitti import Drive
from cosim.errors import DriveError
from sensors.effects.base import Effect, LabelEffect, RoundingEffect
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
        from cosim.discrepancy.sensor_out import write_sensor

        return write_sensor(self.sensor, Path(path))

    def __str__(self) -> str:
        from cosim.discrepancy.report.sentences import Vocabulary

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
    split = split_drive(drive)
    tracer = FrameTracer(drive, model)
    effects = with_rings(in_order(model.effects), model.pattern.rings)
    before = held_out_errors(tracer, split.test, effects, model.origin)
    place = next((i for i, effect in enumerate(effects) if effect.name == kind.name), None)
    if place is not None and fixed:
        effects = tuple(with_values(one, fixed) if i == place else one for i, one in enumerate(effects))
    frames = tracer.trace_all(split.fit, bending(effects))
    check_fit(frames[0], drive)
    known: dict[str, Any] = {}
    if place is None or issubclass(kind, RoundingEffect):
        fitter = Fitter(draw_sample(frames, ROWS, np.random.default_rng([seed, ROWS])))
        effects, place, known = _begun(fitter, kind, effects, fixed, drive)
    free = [one for one in all_free(effects, [place], model.pattern.rings) if one.unknown.name not in fixed]

    def trace(bent: tuple[Effect, ...], leaning: np.ndarray) -> list[TracedFrame]:
        return tracer.trace_all(split.fit, bent, leaning)

    settled = settle(frames, trace, effects, free, seed)
    result = settled.fitted
    effects = result.effects
    sensor_after = SensorModel(model.pattern, as_known(effects), model.origin)
    return Added(
        effect=kind.name,
        params=effects[place].model_dump(mode="json"),
        ci95=intervals(settled.fitter, result)[kind.name] if result.free else known,
        sensor=sensor_after,
        error_before=before,
        error_after=held_out_errors(tracer, split.test, effects, model.origin),
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
    fitter: Fitter, kind: type[Effect], effects: Sequence[Effect], fixed: Mapping[str, Any], drive: Drive
) -> tuple[tuple[Effect, ...], int, dict[str, Any]]:
    """The effects with the new one, roughly as strong as it is, its place, and intervals that are known already."""
    effects = tuple(one for one in effects if one.name != kind.name)
    if issubclass(kind, RoundingEffect) and not fixed:
        found = find_lattices(fitter, fitter.fit(effects, ()), [kind], np.random.default_rng(0))
        if not found:
            raise DriveError(f"{drive.root}: its values stand on no lattice that {kind.name} would make; give its step")
        return (*effects, found[0].effect), len(effects), found[0].interval
    if kind.neutral is None or all(name in fixed for name in kind.model_fields):
        return (*effects, kind.model_validate({**kind.example, **fixed})), len(effects), {}
    null = fitter.fit(effects, ())
    found = [one for one in directions(fitter, null, [kind], range(len(effects))) if one.effect == kind.name]
    if not found:
        raise DriveError(f"{drive.root}: nothing in it depends on {kind.name}; give a drive that shows it")
    best = fit_candidate(fitter, null, found)
    effect = with_values(best.fitted.effects[best.place], fixed) if fixed else best.fitted.effects[best.place]
    return (*effects, effect), len(effects), {}
