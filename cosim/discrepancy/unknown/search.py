"""On which covariate, and in what shape, a residual depends that no candidate explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cosim.discrepancy.evidence import Quantity
from cosim.discrepancy.fitting import Fitted, Fitter
from cosim.discrepancy.system import Column, Normal
from cosim.discrepancy.unknown.covariates import Covariate, covariates
from cosim.discrepancy.unknown.formulas import Formula, best_formula

CHANNELS: tuple[Quantity, ...] = ("range", "intensity", "drop")
_FEWEST = 200  # beams in a bin


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

    @property
    def r2(self) -> float:
        """Share of the shape that the formula explains; 1 for categories."""
        return self.formula.r2 if self.formula else 1.0

    @property
    def text(self) -> str:
        """The formula, or the categories that stand out."""
        if self.formula is not None:
            return self.formula.text
        order = np.argsort(-np.abs(self.y / np.maximum(self.sigma, 1e-12)))[:6]
        return ", ".join(f"{self.names[i]}: {self.y[i]:+.3g}" for i in order)

    def refitted(self, parameters: Mapping[str, float]) -> Shape:
        """With the parameters of a later fit, as far as its formula has them."""
        if self.formula is None:
            return self
        values = {name: float(parameters.get(name, value)) for name, value in self.formula.parameters.items()}
        return replace(self, formula=replace(self.formula, parameters=values))

    def to_json(self) -> dict[str, Any]:
        """What `diagnose --json` writes under `unknown`."""
        return {
            "channel": self.channel,
            "covariates": [self.covariate],
            "form": self.text,
            "r2": self.r2,
            "unit": self.unit,
            "curve": {
                "x": list(self.names) if self.names else self.x.tolist(),
                "y": self.y.tolist(),
                "sigma": self.sigma.tolist(),
            },
        }


def find_shape(fitter: Fitter, fitted: Fitted) -> Shape | None:
    """The dependence that explains most of what a fitted model leaves, or None if none is worth its bins.

    The shape is that of the channel's residual with pose errors of every scan as likely as their spread says, so
    that a tilted scan is not taken for a dependence on azimuth.
    """
    best: Shape | None = None
    for covariate in covariates(fitter.sample, fitted):
        for channel in CHANNELS:
            found = _shape(fitter, fitted, channel, covariate)
            if found is not None and found.delta_bic > (best.delta_bic if best else 0.0):
                best = found
    if best is None or best.names:
        return best
    period = 2 * np.pi if best.covariate == "azimuth" else 0.0
    formula = best_formula(best.x, best.y, best.sigma, period)
    return Shape(
        best.channel, best.covariate, best.unit, best.x, best.y, best.sigma, formula, best.delta_bic, best.names
    )


def shape_column(fitted: Fitted, channel: Quantity, row: np.ndarray, bins: int) -> Column:
    """A parameter a bin; intensity changes in proportion to itself."""
    size = fitted.prediction.intensity if channel == "intensity" else np.ones(len(row))
    return Column({channel: np.where(row >= 0, size, 0.0)}, np.maximum(row, 0), bins)


def _shape(fitter: Fitter, fitted: Fitted, channel: Quantity, covariate: Covariate) -> Shape | None:
    evidence = fitted.evidence
    if channel not in evidence.score:
        return None
    used = (covariate.bin >= 0) & (evidence.information[channel] > 0)
    count = np.bincount(covariate.bin[used], minlength=len(covariate.centres))
    kept = np.flatnonzero(count >= _FEWEST)
    if len(kept) < 2:
        return None
    place = np.full(len(covariate.centres) + 1, -1)
    place[kept] = np.arange(len(kept))
    row = np.where(used, place[covariate.bin], -1)
    column = shape_column(fitted, channel, row, len(kept))
    step, covariance, gain = _solved(fitter, fitted, column, channel)
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0))
    delta = 2 * gain - len(kept) * np.log(len(fitter.sample))
    names = tuple(covariate.names[i] for i in kept) if covariate.names else ()
    return Shape(
        channel, covariate.name, covariate.unit, covariate.centres[kept], step, sigma, None, float(delta), names
    )


def _solved(fitter: Fitter, fitted: Fitted, column: Column, channel: Quantity) -> tuple[np.ndarray, np.ndarray, float]:
    """Values, their covariance, and the gain of log-likelihood of a column, pose errors in the background."""
    poses = fitter.pose_errors.slopes(fitted.pose) if channel == "range" else None
    normal = Normal.of([column], fitted.evidence, poses)
    size = normal.parameters
    matrix, right = normal.matrix[:size, :size], normal.right[:size]
    if poses is not None:
        precision = np.tile(1 / fitted.pose_sigma**2, len(fitter.sample.names))
        block = np.linalg.inv(normal.matrix[size:, size:] + np.diag(precision))
        shared = normal.matrix[:size, size:]
        matrix = matrix - shared @ block @ shared.T
        right = right - shared @ block @ (normal.right[size:] - precision * fitted.pose.ravel())
    covariance = np.linalg.inv(matrix + np.diag(1e-6 * np.diag(matrix) + 1e-12))
    step = covariance @ right
    return step, covariance, 0.5 * float(right @ step)
