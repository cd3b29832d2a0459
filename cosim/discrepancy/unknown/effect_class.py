"""The effect of an unknown dependence as a class made in memory, for fits; no file is written, no text is run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from cosim.discrepancy.unknown.curve import Curve
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.discrepancy.unknown.families import MOST_POWER
from cosim.discrepancy.unknown.pairs import Grid
from cosim.discrepancy.unknown.terms import Term
from sensors.effects import channels, object_errors, shared_errors
from sensors.effects.base import Effect, number

BASES: dict[str, type[Effect]] = {
    "range": channels.RangeError,
    "azimuth_error": channels.AzimuthError,
    "elevation_error": channels.ElevationError,
    "intensity": channels.IntensityFactor,
    "intensity_offset": channels.IntensityOffset,
    "drop": channels.ReturnProbability,
    "range_variance": channels.RangeSpread,
    "intensity_variance": channels.IntensitySpread,
    "spurious": channels.UniformReturns,
    "early": channels.EarlyReturns,
    "late": channels.LateReturns,
    "shared_range": shared_errors.SharedRange,
    "shared_azimuth_error": shared_errors.SharedAzimuthError,
    "shared_elevation_error": shared_errors.SharedElevationError,
    "shared_intensity": shared_errors.SharedIntensity,
    "shared_drop": shared_errors.SharedDrop,
}
DESCRIPTIONS = {
    "amplitude": "size of the effect",
    "level": "the same everywhere",
    "cosine": "amplitude of the cosine",
    "sine": "amplitude of the sine",
    "start": "where it starts",
    "end": "where it ends",
    "edge": "where it starts or ends",
    "centre": "where it is strongest",
    "width": "width",
    "length": "length over which it falls to 1/e",
    "power": "exponent",
    "wave": "angular frequency",
    "shift": "phase",
}
SIZES = ("amplitude", "level", "cosine", "sine", "sigma")
POSITIVE = ("width", "length")
POSITIONS = ("start", "end", "edge", "centre")


def effect_class(unknown: UnknownEffect | Curve) -> type[Effect]:
    """Make the class of the effect of an unknown dependence.

    Its `example` has the measured size, its `neutral` parameters do nothing.
    """
    unknown = UnknownEffect.of(unknown) if isinstance(unknown, Curve) else unknown
    base, own = base_of(unknown), class_attributes(unknown)
    space: dict[str, Any] = {
        "__module__": __name__,
        "__qualname__": unknown.class_name,
        "__doc__": unknown.form,
        "__annotations__": dict.fromkeys(own, ClassVar),
        **own,
    }
    if unknown.is_function:
        units = unknown.parameter_units
        for name, value in unknown.parameters.items():
            space["__annotations__"][name] = float
            space[name] = number(DESCRIPTIONS[name], unit=units[name], **bounds(name, value))
        names = tuple(unknown.parameters)
        space["error"] = _error_of_grid(unknown.grid, names) if unknown.grid else _error_function(unknown.terms, names)
    make_class: Any = type(base)
    return make_class(unknown.class_name, (base,), space)


def effect_of(unknown: UnknownEffect | Curve) -> Effect:
    """Make the effect of an unknown dependence at its measured or fitted size."""
    kind = effect_class(unknown)
    return kind.model_validate(kind.example)


def base_of(unknown: UnknownEffect) -> type[Effect]:
    """Return the class from which its effect is derived."""
    if unknown.curve.is_of_objects:
        is_size = unknown.curve.covariates[1] == "object_size"
        return object_errors.ObjectSizeError if is_size else object_errors.ObjectPlaceError
    return BASES[unknown.curve.channel]


def class_attributes(unknown: UnknownEffect) -> dict[str, Any]:
    """Return the class attributes of its effect by name."""
    example = {name: _rounded(name, value) for name, value in unknown.parameters.items()}
    neutral = {name: 0.0 if name in SIZES else value for name, value in example.items()}
    shape = {name: value for name, value in example.items() if name not in SIZES}
    found: dict[str, Any] = {
        "name": unknown.name,
        "equation": equation(unknown),
        "reference": "found in measurements",
        "example": example,
        "neutral": neutral,
        "shapes": (shape,) if shape else (),
    }
    if unknown.curve.is_shared:
        return {**found, "shared_by": unknown.curve.covariates[0], "unit_size": unknown.unit_size}
    if unknown.objects is not None:
        return {**found, "changes_m": dict(unknown.objects.changes_m)}
    return {**found, "covariates": unknown.curve.covariates}


def equation(unknown: UnknownEffect) -> str:
    """Return its equation in one line, with units."""
    unit = f" [{unknown.curve.unit}]" if unknown.curve.unit and not unknown.curve.is_shared else ""
    variables = f"; {unknown.variables}" if unknown.variables else ""
    return f"{unknown.form}{unit}{variables}"


def _rounded(name: str, value: float) -> float:
    """Six digits; more of positions, which may be times since long ago."""
    return float(f"{value:.6g}") if name not in POSITIONS else round(value, 9)


def bounds(name: str, value: float) -> dict[str, float]:
    """Return the bounds of a parameter, `ge` and `le`, where it has any."""
    if name == "power":
        return {"ge": -MOST_POWER, "le": MOST_POWER}
    if name == "wave" and value > 0:  # a curve does not determine waves that are much longer or shorter
        return {"ge": float(f"{value / 2:.3g}"), "le": float(f"{value * 2:.3g}")}
    return {"ge": float(f"{min(1e-6, value / 100):.1g}")} if name in POSITIVE and value > 0 else {}


def _error_of_grid(grid: Grid, names: tuple[str, ...]) -> Any:
    """The method `error` of its class: the values of pairs of bins."""

    def error(self: Effect, x: Any, y: Any) -> Any:
        return grid.evaluate(x, y, {name: getattr(self, name) for name in names})

    return error


def _error_function(terms: tuple[Term, ...], names: tuple[str, ...]) -> Any:
    """The method `error` of its class: the product of the terms, the first with the effect's own parameters."""

    def error(self: Effect, *values: Any) -> Any:
        parameters: Mapping[str, float] = {name: getattr(self, name) for name in names}
        found = terms[0].evaluate(values[0], parameters)
        for term, value in zip(terms[1:], values[1:], strict=True):
            found = found * term.evaluate(value)
        return found

    return error
