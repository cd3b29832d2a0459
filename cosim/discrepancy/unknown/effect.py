"""An unknown effect: a measured curve, the terms that describe it, and what is reported of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cosim.discrepancy.unknown.curve import Axis, Curve
from cosim.discrepancy.unknown.families import FAMILIES
from cosim.discrepancy.unknown.formula import Formula, explained_share, weights
from cosim.discrepancy.unknown.pairs import Grid, factor_errors, product_at, singular_pair, terms_over
from cosim.discrepancy.unknown.terms import ObjectTable, Term, TermTable, object_table, term_over, wave_of
from sensors.effects.covariates import COVARIATES
from sensors.effects.shared_errors import PACKET_FIRINGS, SECTORS

_VARIABLES = ("x", "y")
_REGULAR = 0.1  # share of the time between scans, by which it may vary in a regular drive


@dataclass(frozen=True, eq=False)
class Factor:
    """One factor of an unknown effect, for charts.

    Attributes:
        covariate, unit: on which it depends.
        x: (b,) centres of bins, or names of categories.
        y, sigma: (b,) as measured, in the channel's unit; of the second factor of a pair, of size 1 at most.
        term: that describes it.
    """

    covariate: str
    unit: str
    x: Axis
    y: np.ndarray
    sigma: np.ndarray
    term: Term


@dataclass(frozen=True, eq=False)
class UnknownEffect:
    """A dependence that no effect of the catalogue explains.

    Attributes:
        curve: as measured.
        terms: one for each covariate, whose product it is; none of shared errors, errors of objects and grids.
        objects: the changes of objects, of errors of size or place.
        grid: values by pairs of bins of two covariates, where no product of terms describes the curve.
        params, ci95: of its effect, as fitted together with everything else; empty before.
    """

    curve: Curve
    terms: tuple[Term, ...]
    params: Mapping[str, float] = field(default_factory=dict)
    ci95: Mapping[str, list[float]] = field(default_factory=dict)
    objects: ObjectTable | None = None
    grid: Grid | None = None

    @classmethod
    def of(cls, curve: Curve) -> UnknownEffect:
        """Describe a curve by the simplest terms that fit it."""
        if curve.is_shared:
            return cls(curve, ())
        if curve.is_of_objects:
            types, axes = (tuple(map(str, axis)) for axis in curve.x)
            return cls(curve, (), objects=object_table(types, axes, np.where(curve.is_known, curve.y, np.nan)))
        if curve.frequency_hz:
            return cls(curve, (wave_of(curve.frequency_hz, curve.start_s, curve.y),))
        if len(curve.covariates) == 1:
            return cls(curve, (term_over(curve.covariates[0], curve.x[0], curve.y, curve.sigma, curve.periods[0]),))
        found = terms_over(curve)
        return cls(curve, (), grid=found) if isinstance(found, Grid) else cls(curve, found)

    @property
    def name(self) -> str:
        """Name of its effect in sensor files."""
        return self.curve.name

    @property
    def class_name(self) -> str:
        """Name of the class of its effect."""
        return "".join(word.capitalize() for word in self.name.split("_"))

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of its effect, at their fitted values."""
        if self.curve.is_shared:
            return {"sigma": self.params.get("sigma", self.standard_deviation)}
        if self.objects is not None:
            return dict(self.objects.parameters)
        first = self.terms[0] if self.grid is None else self.grid
        return {**first.parameters, **self.params}

    @property
    def is_function(self) -> bool:
        """Whether it is a function of covariates, unlike shared errors and errors of objects."""
        return bool(self.terms) or self.grid is not None

    @property
    def standard_deviation(self) -> float:
        """Standard deviation of a shared error, from the curve."""
        known = self.curve.is_known
        weight = 1 / np.maximum(self.curve.sigma[known], 1e-12) ** 2
        return max(float(f"{np.average(self.curve.y[known], weights=weight):.5g}"), 0.0)

    @property
    def unit_size(self) -> int:
        """Firings of a packet, or sectors of a turn, of a shared error."""
        usual = {"packet": PACKET_FIRINGS, "sector": SECTORS}.get(self.curve.covariates[0], 1)
        return self.curve.unit_size if self.curve.unit_size > 1 else usual

    @property
    def r2(self) -> float:
        """Share of the curve that the terms explain."""
        if len(self.terms) < 2:
            return self.terms[0].r2 if self.terms else 1.0
        flat = self.curve.y.ravel(), self.curve.sigma.ravel()
        return explained_share(flat[0], product_at(self.terms, self.curve.x).ravel(), weights(*flat))

    @property
    def form(self) -> str:
        """The effect's size as people write it, x the first covariate and y the second."""
        curve = self.curve
        if curve.is_shared:
            unit = f" {curve.unit}" if curve.unit else ""
            return f"standard deviation {self.parameters['sigma']:.3g}{unit}, common to each {self.shared_by}"
        if self.objects is not None:
            return self.objects.text("x")
        if self.grid is not None:
            return self.grid.text(*_VARIABLES)
        parts = [term.text(name) for term, name in zip(self.terms, _VARIABLES, strict=False)]
        if len(parts) == 2:
            return "·".join(f"({part})" for part in parts)
        others = " or ".join(f"{period:.3g} s" for period in self.aliases)
        return f"{parts[0]}; a period of {others} fits equally well at this frame rate" if others else parts[0]

    @property
    def is_constant(self) -> bool:
        """Whether no value of the covariate differs significantly from the others."""
        return all(isinstance(term, Formula) and term.family == "constant" for term in self.terms) and bool(self.terms)

    @property
    def shared_by(self) -> str:
        """The unit of a shared error in words."""
        unit = self.curve.covariates[0]
        sizes = {"packet": f"packet of {self.unit_size} firings", "sector": f"sector of 1/{self.unit_size} turn"}
        return sizes.get(unit, "ring in a scan" if unit == "ring" else unit)

    @property
    def variables(self) -> str:
        """The meaning of x and y, with units."""
        if not self.is_function:
            return ""
        descriptions = [
            f"{variable}: {COVARIATES[name].words}{f' [{unit}]' if unit else ''}"
            for variable, name, unit in zip(_VARIABLES, self.curve.covariates, self.curve.units, strict=False)
            if name != "constant"
        ]
        return "; ".join(descriptions)

    @property
    def aliases(self) -> tuple[float, ...]:
        """Further periods [s] of an oscillation between scans that regular scans cannot distinguish (Nyquist)."""
        term = self.terms[0] if self.terms else None
        if self.curve.covariates != ("frame_time",) or not isinstance(term, Formula) or term.family != "sine":
            return ()
        apart, wave = np.diff(np.sort(np.asarray(self.curve.x[0], float))), term.values["wave"]
        if len(apart) < 2 or np.ptp(apart) > _REGULAR * np.median(apart) or wave <= 0:
            return ()
        rate_hz, own_hz = 1 / float(np.median(apart)), wave / (2 * np.pi)
        return tuple(1 / abs(alias_hz) for alias_hz in (rate_hz - own_hz, rate_hz + own_hz) if alias_hz != 0)

    @property
    def factors(self) -> tuple[Factor, ...]:
        """One factor for each of `terms`."""
        curve = self.curve
        parts: tuple[np.ndarray, ...] = (curve.y,)
        errors: tuple[np.ndarray, ...] = (curve.sigma,)
        if len(self.terms) == 2:
            parts = singular_pair(curve.y, curve.sigma)
            errors = factor_errors(np.where(curve.is_known, curve.sigma, np.inf), *parts)
        columns = zip(curve.covariates, curve.units, curve.x, parts, errors, self.terms, strict=False)
        return tuple(Factor(*column) for column in columns)

    @property
    def parameter_units(self) -> dict[str, str]:
        """Unit of each parameter of its effect."""
        curve = self.curve
        if curve.is_shared:
            return {"sigma": curve.unit}
        if self.objects is not None or self.grid is not None:
            return {"amplitude": ""}
        term, of_x = self.terms[0], curve.units[0]
        found = dict.fromkeys(term.parameters, of_x)
        found |= dict.fromkeys(("level", "cosine", "sine"), curve.unit) | {"power": "", "shift": "rad"}
        found["wave"] = f"rad/{of_x}" if of_x else ""
        is_slope = isinstance(term, Formula) and FAMILIES[term.family].is_slope
        if not isinstance(term, Formula):
            found["amplitude"] = ""
        else:
            found["amplitude"] = f"{curve.unit or '1'}/{of_x}" if is_slope and of_x else curve.unit
        return {name: found[name] for name in term.parameters}

    def table_rows(self) -> list[tuple[str, float, float]]:
        """Name, value and standard error of the significant categories; empty where the effect is no table."""
        if len(self.terms) != 1 or not isinstance(self.terms[0], TermTable):
            return []
        term = self.terms[0]
        size = term.parameters["amplitude"]
        return [(name, size * term.values[name], abs(size) * term.sigma[name]) for name in term.outstanding()]

    @property
    def has_formula(self) -> bool:
        """Whether a formula of numbers describes the curve or a factor of it."""
        return any(isinstance(term, Formula) for term in self.terms) and not self.curve.frequency_hz

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return the size of an effect of one numeric covariate at x."""
        return self.terms[0].evaluate(np.asarray(x, float))

    def refitted(
        self, params: Mapping[str, float], ci95: Mapping[str, list[float]], rest: Curve | None = None
    ) -> UnknownEffect:
        """Return the same with the parameters and intervals of a later fit, which its first term takes over.

        Args:
            params: of its effect.
            ci95: their intervals.
            rest: what the data still differ by from the formula next to everything else that was fitted; the curve
                becomes the sum of both. Default: the curve stays as measured.
        """
        if rest is not None:
            terms = self.refitted(params, ci95).terms
            size = product_at(terms, rest.x) if len(terms) == 2 else terms[0].evaluate(np.asarray(rest.x[0], float))
            return replace(self, curve=replace(rest, y=rest.y + size)).refitted(params, ci95)
        curve = self.curve
        fitted = replace(self, params=dict(params), ci95=dict(ci95))
        if curve.is_shared:
            return fitted
        if self.objects is not None:
            return replace(fitted, objects=replace(self.objects, parameters=dict(params)))
        if self.grid is not None:
            return replace(fitted, grid=replace(self.grid, parameters=self._scale(self.grid.parameters, params)))
        first = self.terms[0]
        if isinstance(first, Formula):
            of_first = curve.y if len(self.terms) == 1 else singular_pair(curve.y, curve.sigma)[0]
            known = curve.is_known if len(self.terms) == 1 else np.isfinite(of_first)
            sigma = curve.sigma if len(self.terms) == 1 else np.ones(len(of_first))
            axis = np.asarray(curve.x[0], float)
            first = first.with_values(params, axis[known], of_first[known], sigma[known])
        else:
            first = replace(first, parameters=self._scale(first.parameters, params))
        return replace(fitted, terms=(first, *self.terms[1:]))

    def _scale(self, old: Mapping[str, float], params: Mapping[str, float]) -> dict[str, float]:
        """Parameters of a table from a later fit; no probability falls by more than all of it."""
        found = {name: float(params.get(name, value)) for name, value in old.items()}
        if self.curve.channel == "drop" and "amplitude" in found:
            largest_fall = max(-float(np.nanmin(self.curve.y)), 1e-9)
            found["amplitude"] = min(found["amplitude"], 1 / largest_fall)
        return found

    def to_json(self) -> dict[str, Any]:
        """Return what `diagnose --json` writes under `unknowns`."""
        curve = self.curve
        axes = [list(axis) if isinstance(axis, tuple) else axis.tolist() for axis in curve.x]
        return {
            "channel": curve.channel,
            "covariates": list(curve.covariates),
            "form": self.form,
            "r2": self.r2,
            "p_value": curve.p_value,
            "unit": curve.units[0],
            "units": list(curve.units),
            "channel_unit": curve.unit,
            "params": dict(self.params),
            "ci95": dict(self.ci95),
            "curve": {
                "x": axes[0] if len(axes) == 1 else axes,
                "y": _listed(curve.y),
                "sigma": _listed(curve.sigma),
            },
        }


def _listed(values: np.ndarray) -> list[Any]:
    """Nested lists; None for what is not finite."""
    if values.ndim == 1:
        return [float(value) if np.isfinite(value) else None for value in values]
    return [_listed(row) for row in values]
