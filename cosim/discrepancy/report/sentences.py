"""Findings in words: parameters with their units and intervals, and the one line that a command says."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from cosim.discrepancy.diagnosis import Diagnosis, Finding
from cosim.discrepancy.report.phrases import as_sure, p_words
from cosim.discrepancy.unknown import Shape
from sensors.effects.base import Effect, Parameter
from sensors.effects.registry import effect_classes

_SMALL_M = 1.0
_AT_FLOOR = 0.05  # by how much above it is still at it
_PLAIN = ("range_bias", "elevation_offset", "range_walk", "incidence_falloff", "random_dropout")


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


def headline(found: Diagnosis, words: Vocabulary) -> str:
    """The line that `cosim diagnose` says."""
    parts = [_found(one, words) for one in found.effects]
    if parts:
        ambiguous = any(one.also_possible for one in found.effects)
        parts[0] = f"{'ambiguous' if ambiguous else 'missing'}: {parts[0]}"
    if found.unknown is not None:
        parts.append(f"unknown: {unknown_words(found.unknown)}")
    biased = found.labels is not None and found.labels.verdict == "missing"
    if biased:
        parts.append(str(found.labels))
    off = f"; {map_words(found)}" if found.map_off_m > 0 else ""
    if not parts:
        smallest = smallest_words(found, words, most=3)
        seen, above = f"; would have seen {smallest}" if smallest else "", unexplained_words(found)
        return f"nothing missing that would show{seen}{above and f'; {above}'}{off}"
    if biased and len(parts) == 1:
        return parts[0]
    fall = f"{error_words(found)} {found.error_before:.3f} → {found.error_after:.3f}"
    floor = "" if found.noise_floor is None else f", noise floor {found.noise_floor:.3f}"
    return f"{'; '.join(parts)}; {fall}{floor}{off}"


def floor_words(found: Diagnosis) -> str:
    """Where the error ends beside its noise floor; empty where that is not known."""
    above = found.above_floor
    if above is None:
        return ""
    size = f"{above:.0%} above" if above < 1 else f"{1 + above:.1f} times"
    return f"{'at' if above <= _AT_FLOOR else size} the noise floor ({found.noise_floor:.3f})"


def unexplained_words(found: Diagnosis) -> str:
    """That the error stands above its floor though nothing was found; empty where it does not."""
    if found.above_floor is None or found.above_floor <= _AT_FLOOR:
        return ""
    return f"yet the {error_words(found)}, {found.error_after:.3f}, is {floor_words(found)}"


def error_words(found: Diagnosis) -> str:
    """Which error it is that a diagnosis tells."""
    return "held-out error" if found.split.is_held_out else "error on the fitted frames themselves"


def map_words(found: Diagnosis) -> str:
    """How far the twin's map is off."""
    return f"the twin's map itself is off by about {100 * found.map_off_m:.1f} cm"


def unknown_words(unknown: Shape) -> str:
    """What an unknown effect does, in short."""
    channel = unknown.channel.replace("_", " ").replace("variance", "spread")
    of = "" if unknown.names or not unknown.unit else f", x in {unknown.unit}"
    return f"{channel} depends on {unknown.covariate.replace('_', ' ')} as {unknown.text}{of}"


def smallest_words(found: Diagnosis, words: Vocabulary, most: int) -> str:
    """Smallest amplitudes that would have been seen, of the first few effects, plain ones before others."""
    rows = [row for row in smallest_rows(found) if words.is_possible(*row)]
    rows.sort(key=lambda row: _PLAIN.index(row[0]) if row[0] in _PLAIN else len(_PLAIN))
    said = [f"{effect} from {words.quantity(effect, name, value)}" for effect, name, value in rows[:most]]
    return ", ".join(said)


def smallest_rows(found: Diagnosis) -> list[tuple[str, str, float]]:
    """Effect, amplitude and smallest detectable value, where it is above 0."""
    return [
        (effect, name, value)
        for effect, values in sorted(found.smallest_detectable.items())
        for name, value in values.items()
        if np.isfinite(value) and value > 0
    ]


def _found(one: Finding, words: Vocabulary) -> str:
    values = words.parameters(one.effect, one.params, one.ci95)
    alike = f"; not separable from {', '.join(one.also_possible)}" if one.also_possible else ""
    return f"{one.effect} ({values}), {p_words(one.p_value)}{alike}"


def _short(name: str) -> str:
    """A parameter's name without its unit."""
    for ending in ("_deg_per_mps2", "_per_m", "_mrad", "_ppm", "_deg", "_m", "_s", "_ns"):
        if name.endswith(ending) and len(name) > len(ending):
            return name.removesuffix(ending).replace("_", " ")
    return name.replace("_", " ")


def _shown_in(unit: str, size: float) -> tuple[float, str]:
    """Factor and unit in which a value reads well."""
    if unit == "m" and size < _SMALL_M:
        return (1000.0, "mm") if size < 0.002 else (100.0, "cm")
    if unit == "s" and size < _SMALL_M:
        return 1000.0, "ms"
    return 1.0, unit
