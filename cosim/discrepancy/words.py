"""Words of findings: parameters with units and intervals, channels, covariates, sources of the error."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.discrepancy.quantities import channel_words, covariate_words, dependence_words
from cosim.discrepancy.unexplained import Unexplained
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.report.phrases import listed, round_with_error
from sensors.effects.base import Effect, Parameter
from sensors.effects.registry import effect_classes

FEW = 3  # items of a list in a sentence
UNDETERMINED = "cannot be determined"
_WORTH_A_WORD = 0.02  # shares of the noise floor below which a source is left out
_COVERED = 0.9  # share of its allowed range that the interval of an undetermined parameter covers, at least


class Vocabulary:
    """Units and bounds of the parameters of effects.

    Args:
        extra: effects that are not in the catalogue.
    """

    def __init__(self, extra: Iterable[type[Effect]] = ()) -> None:
        self._kinds = {**effect_classes(), **{kind.name: kind for kind in extra}}

    def kind(self, effect: str) -> type[Effect] | None:
        """The class of an effect."""
        return self._kinds.get(effect)

    def parameter(self, effect: str, name: str) -> Parameter:
        """One parameter; without unit and bounds if the effect is unknown."""
        kind = self._kinds.get(effect)
        parameters = (row for row in kind.parameters() if row.name == name) if kind else iter(())
        return next(parameters, Parameter(name, "", None, None, "", False))

    def is_possible(self, effect: str, name: str, value: float) -> bool:
        """Whether a value lies within the bounds of the parameter."""
        parameter = self.parameter(effect, name)
        return (parameter.low is None or value >= parameter.low) and (parameter.high is None or value <= parameter.high)

    def is_determined(self, effect: str, name: str, interval: Any) -> bool:
        """Whether the interval of a number leaves out a part of its allowed range.

        Args:
            effect, name: the parameter.
            interval: 95 % interval (2,); None where it was not fitted, which counts as determined.
        """
        if interval is None:
            return True
        size = float(interval[1]) - float(interval[0])
        parameter = self.parameter(effect, name)
        width = np.inf if parameter.low is None or parameter.high is None else parameter.high - parameter.low
        return bool(np.isfinite(size) and size < _COVERED * width)

    def determined(self, effect: str, params: Mapping[str, Any], ci95: Mapping[str, Any]) -> dict[str, Any]:
        """Parameters for JSON files: None for numbers that cannot be determined."""
        return {name: self._determined(effect, name, value, ci95.get(name)) for name, value in params.items()}

    def _determined(self, effect: str, name: str, value: Any, interval: Any) -> Any:
        if interval is None:
            return value
        if np.ndim(value):
            pairs = zip(value, interval, strict=True)
            return [number if self.is_determined(effect, name, pair) else None for number, pair in pairs]
        return value if self.is_determined(effect, name, interval) else None

    def quantity(self, effect: str, name: str, value: Any, interval: Any = None) -> str:
        """A value with unit and half its interval; the extremes of lists."""
        unit = self.parameter(effect, name).unit
        if isinstance(value, str) or value is None:
            return str(value)
        size = np.atleast_1d(np.asarray(value, float))
        if np.ndim(value):
            return self._list(effect, name, size, interval)
        if not self.is_determined(effect, name, interval):
            return UNDETERMINED
        factor, unit = _shown_in(unit, float(np.abs(size).max()))
        if interval is None:
            return f"{factor * value:.3g}{_tail(unit)}"
        number, half = round_with_error(factor * value, factor * (interval[1] - interval[0]) / 2)
        return f"{number}{_tail(unit)} ± {half}"

    def _list(self, effect: str, name: str, values: np.ndarray, interval: Any) -> str:
        pairs = [None] * len(values) if interval is None else list(interval)
        known = np.array([self.is_determined(effect, name, pair) for pair in pairs])
        if not known.any():
            return UNDETERMINED
        factor, unit = _shown_in(self.parameter(effect, name).unit, float(np.abs(values[known]).max()))
        low, high = factor * values[known].min(), factor * values[known].max()
        missing = "" if known.all() else f"; {np.count_nonzero(~known)} {UNDETERMINED}"
        return f"{len(values)} values, {low:.3g} to {high:.3g}{_tail(unit)}{missing}"

    def parameters(self, effect: str, params: Mapping[str, Any], ci95: Mapping[str, Any]) -> str:
        """All fitted parameters in a line; all parameters if none was fitted."""
        names = [name for name in params if name in ci95] or list(params)
        quantities = (f"{_short(name)} {self.quantity(effect, name, params[name], ci95.get(name))}" for name in names)
        return ", ".join(quantities)


def source_words(parts: Mapping[str, float], floor: float, *, is_complete: bool) -> str:
    """Sources of an error in addition to noise, in noise floors: `poses 3.1, objects 0.2`.

    Args:
        parts: of a budget, in the unit of the error.
        floor: the error due to noise.
        is_complete: whether nothing is missing: missing effects are left out.
    """
    shares = {name: value / floor for name, value in parts.items() if name in SOURCES and value > _WORTH_A_WORD * floor}
    if is_complete:
        shares.pop("missing", None)
    names = {**SOURCES, "unexplained": "remainder"} if is_complete else SOURCES
    return ", ".join(f"{names[name]} {value:.{1 if value >= 0.1 else 2}f}" for name, value in shares.items())


SOURCES = {
    "poses": "poses", "objects": "objects", "map": "map", "missing": "missing effects", "unexplained": "unexplained",
}  # fmt: skip


@dataclass(frozen=True)
class Spread:
    """The standard deviation of a nuisance parameter in words.

    Attributes:
        what: is uncertain.
        factor, unit: for display.
        limit: in the unit of the JSON file, above which the estimate is implausible for a drive in good order.
        cause: the usual reason of an implausible estimate.
    """

    what: str
    factor: float
    unit: str
    limit: float
    cause: str

    def text(self, value: float) -> str:
        """A value with its unit."""
        return f"{self.factor * value:.2g} {self.unit}".replace(" °", "°")


SPREADS = {
    "pose_shift_m": Spread(
        "positions of scans", 100.0, "cm", 0.2,
        "poses and points have different time stamps or mounting positions, or the twin was built from other poses",
    ),
    "pose_turn_deg": Spread(
        "orientations of scans", 1.0, "°", 0.5,
        "the extrinsic calibration is wrong, or poses and points have different time stamps",
    ),
    "object_shift_m": Spread(
        "positions of objects", 100.0, "cm", 0.3,
        "labels are loose or interpolated, or have other time stamps than the points",
    ),
    "map_m": Spread(
        "surfaces of the map", 100.0, "cm", 0.2,
        "the map shows another place or state of the street, or its surfaces are coarser than the sensor resolves",
    ),
    "object_albedo": Spread(
        "reflectances of objects", 100.0, "%", 0.5,
        "reflectances of the twin are guessed, or intensities are compensated by the sensor in an unknown way",
    ),
    "map_albedo": Spread(
        "reflectances of the map", 100.0, "%", 0.5,
        "materials of the twin are guessed, or intensities are compensated by the sensor in an unknown way",
    ),
}  # fmt: skip


def spread_words(spreads: Mapping[str, float]) -> str:
    """The standard deviations of the nuisance parameters in a sentence; empty without any."""
    parts = [f"{row.what} {row.text(spreads[name])}" for name, row in SPREADS.items() if name in spreads]
    return f"Estimated standard deviations: {listed(parts)}." if parts else ""


def implausible_spreads(spreads: Mapping[str, float]) -> list[str]:
    """A sentence for each standard deviation above its plausible limit, with the usual cause."""
    return [
        f"The estimated standard deviation of the {row.what}, {row.text(spreads[name])}, exceeds the plausible limit "
        f"of {row.text(row.limit)}. Usual causes: {row.cause}; or a missing effect acts in the same way."
        for name, row in SPREADS.items()
        if spreads.get(name, 0.0) > row.limit
    ]


def times(ratio: float) -> str:
    """A ratio: `4.3 ×`, or `1.12 ×` near 1."""
    return f"{ratio:.1f} ×" if ratio >= 1.95 else f"{ratio:.2f} ×"


def unexplained_words(row: Unexplained) -> str:
    """A remaining dependence in short."""
    if row.resembles:
        return f"{channel_words(row.channel)}, similar to {row.resembles}"
    return dependence_words(row.channel, row.covariates)


def unknown_words(unknown: UnknownEffect) -> str:
    """The change that an unknown effect causes, in short."""
    curve = unknown.curve
    channel = channel_words(curve.channel)
    if curve.is_shared:
        return f"{channel}: {unknown.form}"
    if curve.covariates == ("constant",):
        return f"{channel} differs by {unknown.form}"
    on = " and ".join(covariate_words(name) for name in curve.covariates)
    rows = table_words(unknown)
    if rows:
        return f"{channel} depends on {on}: {rows}"
    if unknown.is_constant:
        return f"{channel} differs by {unknown.form}{f' {curve.unit}' if curve.unit else ''}, regardless of {on}"
    details = "; ".join(filter(None, (f"in {curve.unit}" if curve.unit else "", unknown.variables)))
    variables = f" ({details})" if details else ""
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


def _tail(unit: str) -> str:
    """A unit as it follows a number."""
    return f" {unit}" if unit not in ("", "°") else unit


def _shown_in(unit: str, size: float) -> tuple[float, str]:
    """Factor and unit for display."""
    if unit == "m" and size < 1:
        return (1000.0, "mm") if size < 0.002 else (100.0, "cm")
    if unit == "s" and size < 1:
        return 1000.0, "ms"
    return 1.0, unit
