"""What all findings are told in: parameters with their units and intervals, channels, where an error comes from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from cosim.discrepancy.unexplained import Unexplained
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.report.phrases import as_sure, listed
from sensors.effects.base import Effect, Parameter
from sensors.effects.registry import effect_classes

FEW = 3  # that a sentence lists
_WORTH_A_WORD = 0.02  # floors from which it does


class Vocabulary:
    """Knows the units of parameters.

    Args:
        extra: effects that are not in the catalogue.
    """

    def __init__(self, extra: Iterable[type[Effect]] = ()) -> None:
        self._kinds = {**effect_classes(), **{kind.name: kind for kind in extra}}

    def kind(self, effect: str) -> type[Effect] | None:
        """The class of an effect's name."""
        return self._kinds.get(effect)

    def parameter(self, effect: str, name: str) -> Parameter:
        """One parameter."""
        kind = self._kinds.get(effect)
        found = (one for one in kind.parameters() if one.name == name) if kind else iter(())
        return next(found, Parameter(name, "", None, None, "", False))

    def is_possible(self, effect: str, name: str, value: float) -> bool:
        """Whether a value lies within the parameter's bounds."""
        one = self.parameter(effect, name)
        return (one.low is None or value >= one.low) and (one.high is None or value <= one.high)

    def quantity(self, effect: str, name: str, value: Any, interval: Any = None) -> str:
        """A value with its interval and unit; lists in short."""
        unit = self.parameter(effect, name).unit
        if isinstance(value, str) or value is None:
            return str(value)
        size = np.atleast_1d(np.asarray(value, float))
        factor, unit = _shown_in(unit, float(np.abs(size).max()))
        tail = f" {unit}" if unit not in ("", "°") else unit
        if np.ndim(value):
            return f"{len(size)} values, {factor * size.min():.3g} to {factor * size.max():.3g}{tail}"
        if interval is None:
            return f"{factor * value:.3g}{tail}"
        said, half = as_sure(factor * value, factor * (interval[1] - interval[0]) / 2)
        return f"{said}{tail} ± {half}"

    def parameters(self, effect: str, params: Mapping[str, Any], ci95: Mapping[str, Any]) -> str:
        """All parameters that were fitted, in a line; all there are if none was."""
        names = [name for name in params if name in ci95] or list(params)
        said = (f"{_short(name)} {self.quantity(effect, name, params[name], ci95.get(name))}" for name in names)
        return ", ".join(said)


def source_words(parts: Mapping[str, float], floor: float, *, is_complete: bool) -> str:
    """What an error is made of beside noise, in floors: `3.1 of it poses, 0.2 objects, nothing missing`.

    Args:
        parts: of a budget, in the unit of the error.
        floor: the error that noise alone makes.
        is_complete: whether nothing is missing, which is said then.
    """
    shares = {name: value / floor for name, value in parts.items() if name in SOURCES and value > _WORTH_A_WORD * floor}
    if is_complete:
        shares.pop("missing", None)
    names = {**SOURCES, "unexplained": "left over"} if is_complete else SOURCES
    said = [
        f"{value:.1f} {names[name]}" if value >= 0.1 else f"{value:.2f} {names[name]}" for name, value in shares.items()
    ]
    if said:
        said[0] = said[0].replace(" ", " of it ", 1)
    return ", ".join([*said, *(["nothing missing"] if is_complete else [])])


def spread_words(spreads: Mapping[str, float]) -> str:
    """How far what is merely not known scatters, in a sentence; empty where nothing does."""
    told = {
        name: f"{factor * spreads[name]:.2g} {unit}".replace(" °", "°")
        for name, (factor, unit) in _SPREADS.items()
        if name in spreads
    }
    poses = [told[name] for name in ("pose_shift_m", "pose_turn_deg") if name in told]
    said = [f"poses of scans by {listed(poses)}"] if poses else []
    said += [f"{what} by {told[name]}" for name, what in _OTHER_SPREADS.items() if name in told]
    return f"Standard deviations of what is merely not known: {listed(said)}." if said else ""


SOURCES = {
    "poses": "poses", "objects": "objects", "map": "the map", "missing": "missing effects",
    "unexplained": "unexplained",
}  # fmt: skip
_SPREADS = {
    "pose_shift_m": (100.0, "cm"), "pose_turn_deg": (1.0, "°"), "object_shift_m": (100.0, "cm"), "map_m": (100.0, "cm"),
    "object_albedo": (100.0, "%"), "map_albedo": (100.0, "%"),
}  # fmt: skip
_OTHER_SPREADS = {
    "object_shift_m": "places of objects",
    "map_m": "surfaces of the map",
    "object_albedo": "brightness of objects",
    "map_albedo": "brightness of the map",
}


def times(ratio: float) -> str:
    """A ratio: `4.3 ×`, or `1.12 ×` near 1."""
    return f"{ratio:.1f} ×" if ratio >= 1.95 else f"{ratio:.2f} ×"


def unexplained_words(one: Unexplained) -> str:
    """What is left, in short."""
    channel = channel_words(one.channel)
    if one.resembles:
        return f"{channel}, similar to {one.resembles}"
    return f"{channel} by {' and '.join(one.covariates).replace('_', ' ')}"


def channel_words(channel: str) -> str:
    """A channel of `diagnose --json` in words."""
    return _CHANNELS.get(channel, channel.replace("_", " "))


_CHANNELS = {
    "drop": "returns",
    "spurious": "spurious returns",
    "early": "early returns",
    "late": "late returns",
    "range_variance": "spread of ranges",
    "intensity_variance": "spread of intensities",
}  # fmt: skip


def unknown_words(unknown: UnknownEffect) -> str:
    """What an unknown effect does, in short."""
    curve = unknown.curve
    channel = channel_words(curve.channel)
    if curve.is_shared:
        return f"{channel}: {unknown.form}"
    if curve.covariates == ("constant",):
        return f"{channel} differs by {unknown.form}"
    on = " and ".join(curve.covariates).replace("_", " ")
    rows = table_words(unknown)
    if rows:
        return f"{channel} depends on {on}: {rows}"
    variables = f" ({unknown.variables})" if unknown.variables else ""
    return f"{channel} depends on {on} as {unknown.form}{variables}"


def table_words(unknown: UnknownEffect) -> str:
    """The significant categories with units: `paving +4.81 cm`; empty for formulas."""
    factor, unit = {"m": (100.0, "cm"), "rad": (float(np.degrees(1.0)), "°")}.get(unknown.curve.unit, (100.0, "%"))
    tail = unit if unit == "°" else f" {unit}"
    words = (
        f"{name.replace('_', ' ')} {factor * value:+.3g}{tail}".replace("-", "−")
        for name, value, _ in unknown.table_rows()
    )
    return ", ".join(words)


def _short(name: str) -> str:
    """A parameter's name without its unit."""
    for ending in ("_deg_per_mps2", "_per_m", "_mrad", "_ppm", "_deg", "_m", "_s", "_ns"):
        if name.endswith(ending) and len(name) > len(ending):
            return name.removesuffix(ending).replace("_", " ")
    return name.replace("_", " ")


def _shown_in(unit: str, size: float) -> tuple[float, str]:
    """Factor and unit in which a value reads well."""
    if unit == "m" and size < 1:
        return (1000.0, "mm") if size < 0.002 else (100.0, "cm")
    if unit == "s" and size < 1:
        return 1000.0, "ms"
    return 1.0, unit
