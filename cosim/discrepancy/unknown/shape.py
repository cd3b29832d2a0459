"""In what shape a channel depends on something that no candidate explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cosim.discrepancy.inference.score import Quantity
from cosim.discrepancy.settings import DEFAULT
from cosim.discrepancy.unknown.formulas import Formula, with_parameters


@dataclass(frozen=True, eq=False)
class Factor:
    """By what a dependence on a first covariate is multiplied: the shape over a second one, of size 1 at most.

    Attributes:
        covariate, unit: the second one.
        formula: the simplest that fits; its numbers stay as they are.
        x, y: (b,) the shape.
    """

    covariate: str
    unit: str
    formula: Formula
    x: np.ndarray
    y: np.ndarray


@dataclass(frozen=True, eq=False)
class Shape:
    """A dependence on one covariate, or on a product of two.

    Attributes:
        channel: what is off: range [m], intensity (relative), or drop (relative chance of a return).
        covariate: on what it depends.
        unit: of the covariate.
        x, y, sigma: (b,) the shape and its standard errors.
        formula: the simplest that fits; None for categories, which are told one by one.
        names: (b,) of categories.
        factor: by what it is multiplied.
        period: of a phase along the firings, in firings; 0 for others.
        aliases: further periods [s] of an oscillation that scans so far apart cannot tell from its own.
        p_value: its own, family-wise.
        params, ci95: of the effect that it makes, as fitted together with everything else; empty before.
    """

    channel: Quantity
    covariate: str
    unit: str
    x: np.ndarray
    y: np.ndarray
    sigma: np.ndarray
    formula: Formula | None
    names: tuple[str, ...] = ()
    factor: Factor | None = None
    period: float = 0.0
    aliases: tuple[float, ...] = ()
    p_value: float = 0.0
    params: Mapping[str, float] = field(default_factory=dict)
    ci95: Mapping[str, list[float]] = field(default_factory=dict)

    @property
    def is_of_scans(self) -> bool:
        """Whether it is a level for each scan."""
        return self.covariate == "scan"

    @property
    def covariates(self) -> tuple[str, ...]:
        """Names of what it depends on."""
        return (self.covariate, self.factor.covariate) if self.factor else (self.covariate,)

    @property
    def r2(self) -> float:
        """Share of the shape that the formula explains; 1 for tables."""
        found = self.formula.r2 if self.formula else 1.0
        return found * self.factor.formula.r2 if self.factor else found

    @property
    def text(self) -> str:
        """The formula, or the categories that stand out."""
        if self.formula is not None:
            said = self.formula.text
            if self.period:
                return f"{said}, x the phase in a period of {self.period:.4g} firings"
            if self.aliases:
                others = " or ".join(f"{one:.3g} s" for one in self.aliases)
                return f"{said}; between scans so far apart a period of {others} looks the same"
            return f"({said})·({self.factor.formula.text.replace('x', 'y')})" if self.factor else said
        if self.is_of_scans:
            return f"a level of its own for each scan, {self.y.std():.3g} about {self.y.mean():.3g}"
        return ", ".join(f"{self.names[row]}: {self.y[row]:+.3g}" for row in self.outstanding())

    def outstanding(self, most: int = 6, sigmas: float = 2.0) -> list[int]:
        """Rows of the surest values, the surest first: beyond so many standard errors, or one at least."""
        sure = np.abs(self.y) / np.maximum(self.sigma, 1e-12)
        order = np.argsort(-sure)[:most].tolist()
        return [row for row in order if sure[row] > sigmas] or order[:1]

    @property
    def name(self) -> str:
        """Of the effect that it makes, in sensor files."""
        return f"unknown_{self.channel}_by_{'_and_'.join(self.covariates)}"

    def with_aliases(self, regular: float = DEFAULT.shapes.regular) -> Shape:
        """With the periods that regular scans may take its oscillation in time for (Nyquist).

        Args:
            regular: share of the time between scans, by which it may vary in a regular drive.
        """
        wave = self.formula.parameters.get("wave", 0.0) if self.formula and self.formula.family == "sine" else 0.0
        apart = np.diff(np.sort(self.x))
        if wave <= 0 or len(apart) < 2 or np.ptp(apart) > regular * np.median(apart):
            return self
        each, own = 1 / float(np.median(apart)), wave / (2 * np.pi)
        return replace(self, aliases=tuple(1 / abs(one) for one in (each - own, each + own) if abs(one) > 0))

    def refitted(self, params: Mapping[str, float], ci95: Mapping[str, list[float]]) -> Shape:
        """With the parameters of a later fit and their intervals, which its formula takes over."""
        told = replace(self, params=dict(params), ci95=dict(ci95))
        if self.formula is None:
            return told
        return replace(told, formula=with_parameters(self.formula, params, self.x, self.y, self.sigma))

    def to_json(self) -> dict[str, Any]:
        """What `diagnose --json` writes under `unknowns`."""
        return {
            "channel": self.channel,
            "covariates": list(self.covariates),
            "form": self.text,
            "r2": self.r2,
            "p_value": self.p_value,
            "unit": self.unit,
            "params": dict(self.params),
            "ci95": dict(self.ci95),
            "curve": {
                "x": list(self.names) if self.names else self.x.tolist(),
                "y": self.y.tolist(),
                "sigma": self.sigma.tolist(),
            },
        }
