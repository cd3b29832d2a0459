"""On which covariate, and in what shape, a residual depends that no candidate explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from cosim.discrepancy.groups.covariates import Covariate, covariates
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.score import Quantity
from cosim.discrepancy.unknown.formulas import Formula, best_formula, with_parameters
from cosim.discrepancy.unknown.refined import solve_shape

CHANNELS: tuple[Quantity, ...] = ("range", "intensity", "drop")
_FEWEST = 200  # beams in a bin
_MOST_NAMED = 6
_OF_SURFACES = {"albedo", "material"}
_KNOWN = (("range", "ring"), ("intensity", "ring"))  # the catalogue has one number a laser for these


@dataclass(frozen=True, eq=False)
class Shape:
    """A dependence on one covariate.

    Attributes:
        channel: what is off: range [m], intensity (relative), or drop (probability of a return).
        covariate: on what it depends.
        x, y, sigma: (b,) the shape and its standard errors.
        formula: the simplest that fits; None for categories, which are told one by one.
        delta_bic: how much the BIC falls with the shape as it is.
        names: (b,) of categories.
        acts: of intensities, whether the light itself is another, which whatever hangs on its strength notices (the
            chance of a return, its range), or only its reading.
        params, ci95: of the effect that it makes, as fitted together with everything else; empty before.
    """

    channel: Quantity
    covariate: str
    unit: str
    x: np.ndarray
    y: np.ndarray
    sigma: np.ndarray
    formula: Formula | None
    delta_bic: float
    names: tuple[str, ...]
    acts: Literal["light", "reading"] = "reading"
    params: Mapping[str, float] = field(default_factory=dict)
    ci95: Mapping[str, list[float]] = field(default_factory=dict)

    @property
    def r2(self) -> float:
        """Share of the shape that the formula explains; 1 for categories."""
        return self.formula.r2 if self.formula else 1.0

    @property
    def text(self) -> str:
        """The formula, or the categories that stand out."""
        if self.formula is not None:
            return self.formula.text
        order = np.argsort(-np.abs(self.y / np.maximum(self.sigma, 1e-12)))
        order = order[: int(np.clip(_standing_out(self)[0], 1, _MOST_NAMED))]
        return ", ".join(f"{self.names[i]}: {self.y[i]:+.3g}" for i in order)

    def is_like(self, other: Shape) -> bool:
        """Whether another has a formula of the same kind; tables of categories have no formula."""
        return bool(self.formula and other.formula and self.formula.family == other.formula.family)

    @property
    def has_apart(self) -> bool:
        """Whether its formula holds a constant error of ranges or a constant gain, which are effects of their own."""
        told = self.formula if self.channel in ("range", "intensity") else None
        return bool(told and told.has_own_zero and "level" in told.parameters)

    def without_level(self) -> Shape:
        """The same about zero."""
        assert self.formula is not None  # it has a level
        rest = {name: value for name, value in self.formula.parameters.items() if name != "level"}
        code = self.formula.code.removeprefix("level + ")
        return replace(self, formula=replace(self.formula, parameters=rest, code=code))

    def refitted(self, params: Mapping[str, float], ci95: Mapping[str, list[float]]) -> Shape:
        """With the parameters of a later fit and their intervals, which its formula takes over."""
        told = replace(self, params=dict(params), ci95=dict(ci95))
        if self.formula is None:
            return told
        return replace(told, formula=with_parameters(self.formula, params, self.x, self.y, self.sigma))

    def to_json(self) -> dict[str, Any]:
        """What `diagnose --json` writes under `unknown`."""
        return {
            "channel": self.channel,
            "covariates": [self.covariate],
            "form": self.text,
            "r2": self.r2,
            "unit": self.unit,
            "params": dict(self.params),
            "ci95": dict(self.ci95),
            "curve": {
                "x": list(self.names) if self.names else self.x.tolist(),
                "y": self.y.tolist(),
                "sigma": self.sigma.tolist(),
            },
        }


def find_shape(fitter: Fitter, fitted: Fitted) -> Shape | None:
    """The dependence that explains most of what a fitted model leaves, or None if none is worth its bins.

    Bins of what all beams of a scan share are little more than scans: the time explains as much as the speed does. So
    does the albedo for a material. Of these the one that is told in the simplest way is meant.
    """
    found: list[tuple[float, Quantity, Covariate, np.ndarray]] = []
    for covariate in covariates(fitter.sample, fitted):
        for channel in CHANNELS:
            kept = _kept(fitted, channel, covariate)
            if len(kept) < 2 or (channel, covariate.name) in _KNOWN:
                continue
            *_, gain = solve_shape(fitter, fitted, channel, _rows(fitted, channel, covariate, kept), len(kept), 1)
            delta = 2 * gain - len(kept) * np.log(len(fitter.sample))
            if delta > 0:
                found.append((float(delta), channel, covariate, kept))
    if not found:
        return None
    best = max(found, key=lambda one: one[0])
    alike = [one for one in found if one[1] == best[1] and _is_alike(one[2], best[2])]
    return max((_followed(fitter, fitted, *one) for one in alike), key=lambda one: _as_told(fitter, one))


def _is_alike(one: Covariate, other: Covariate) -> bool:
    """Whether two covariates sort beams alike."""
    return one.name == other.name or (one.of_scans and other.of_scans) or {one.name, other.name} <= _OF_SURFACES


def _as_told(fitter: Fitter, shape: Shape) -> float:
    """By how much the BIC falls with a shape's formula, or with as few of its categories as tell it."""
    if shape.formula is not None:
        told = shape.formula.bic
    else:
        _, told = _standing_out(shape)
    return shape.delta_bic + len(shape.x) * float(np.log(len(fitter.sample))) - told


def _standing_out(shape: Shape) -> tuple[int, float]:
    """How many categories it takes to tell a shape, and the BIC of these, each a number and a choice."""
    size = np.sort((shape.y / np.maximum(shape.sigma, 1e-12)) ** 2)[::-1]
    bic = np.append(size.sum(), size.sum() - np.cumsum(size)) + 2 * np.arange(len(size) + 1) * np.log(len(size))
    return int(np.argmin(bic)), float(bic.min())


def same_shape(fitter: Fitter, fitted: Fitted, shape: Shape) -> Shape | None:
    """A shape found before, found again beside another model; None where it cannot be."""
    covariate = next((one for one in covariates(fitter.sample, fitted) if one.name == shape.covariate), None)
    kept = _kept(fitted, shape.channel, covariate) if covariate is not None else np.zeros(0, int)
    if covariate is None or len(kept) < 2:
        return None
    return replace(_followed(fitter, fitted, shape.delta_bic, shape.channel, covariate, kept), acts=shape.acts)


def _followed(
    fitter: Fitter, fitted: Fitted, delta_bic: float, channel: Quantity, covariate: Covariate, kept: np.ndarray
) -> Shape:
    """The shape of a channel over the bins that are kept, and its formula."""
    y, covariance, _ = solve_shape(fitter, fitted, channel, _rows(fitted, channel, covariate, kept), len(kept))
    sigma, x = np.sqrt(np.maximum(np.diag(covariance), 0)), covariate.centres[kept]
    names = tuple(covariate.names[i] for i in kept) if covariate.names else ()
    formula = None if names else best_formula(x, y, sigma, covariate.period)
    return Shape(channel, covariate.name, covariate.unit, x, y, sigma, formula, delta_bic, names)


def _kept(fitted: Fitted, channel: Quantity, covariate: Covariate) -> np.ndarray:
    """Numbers of the bins with enough beams that tell of a channel."""
    count = np.bincount(covariate.bin[_used(fitted, channel, covariate)], minlength=len(covariate.centres))
    return np.flatnonzero(count >= _FEWEST)


def _used(fitted: Fitted, channel: Quantity, covariate: Covariate) -> np.ndarray:
    information = fitted.evidence.information.get(channel)
    return np.zeros(len(covariate.bin), bool) if information is None else (covariate.bin >= 0) & (information > 0)


def _rows(fitted: Fitted, channel: Quantity, covariate: Covariate, kept: np.ndarray) -> np.ndarray:
    """Place (n,) of every beam's bin among those kept; −1 for none."""
    place = np.full(len(covariate.centres) + 1, -1)
    place[kept] = np.arange(len(kept))
    return np.where(_used(fitted, channel, covariate), place[covariate.bin], -1)
