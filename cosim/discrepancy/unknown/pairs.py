"""Terms of an unknown effect over two covariates: the product of two terms, or a table of both."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cosim.discrepancy.unknown.curve import Axis, Curve
from cosim.discrepancy.unknown.formula import Formula, explained_share, weights
from cosim.discrepancy.unknown.terms import ENOUGH, FAR_ABOVE, Term, TermTable, literal, rounded, term_over
from sensors.effects.covariates import cell_of, nearest_row


@dataclass(frozen=True, eq=False)
class Grid:
    """A value for each pair of bins of two covariates, times an amplitude; 0 where nothing is known.

    Attributes:
        rows, columns: (a,), (b,) centres of the bins, rising, or names of categories.
        table: (a, b) values.
        periods: of cyclic covariates; 0 for others.
    """

    rows: Axis
    columns: Axis
    table: np.ndarray
    periods: tuple[float, float] = (0.0, 0.0)
    parameters: Mapping[str, float] = field(default_factory=lambda: {"amplitude": 1.0})
    r2: float = 1.0

    def evaluate(self, x: Any, y: Any, values: Mapping[str, float] | None = None) -> np.ndarray:
        """Return the values at numbers or categories, each (m,)."""
        amplitude = {**self.parameters, **(values or {})}["amplitude"]
        row, column = nearest_row(x, self.rows, self.periods[0]), nearest_row(y, self.columns, self.periods[1])
        return amplitude * cell_of(self.table, row, column)

    def code(self, x: str, y: str, name_of: Callable[[str], str]) -> str:
        """Return the term as Python."""
        ends = [f", period={period!r}" if period else "" for period in self.periods]
        indices = [
            f"nearest_row({name}, {axis}{end})"
            for name, axis, end in zip((x, y), ("ROWS", "COLUMNS"), ends, strict=True)
        ]
        return f"{name_of('amplitude')} * cell_of(TABLE, {', '.join(indices)})"

    def constants(self) -> str:
        """Return bins and values as Python."""
        rows = [f"    [{', '.join(map(repr, row))}]," for row in self.table.tolist()]
        return "\n".join(
            [
                literal("ROWS = (", _written(self.rows), ")"),
                literal("COLUMNS = (", _written(self.columns), ")"),
                "TABLE = np.array([", *rows, "])",
            ]
        )  # fmt: skip

    def text(self, x: str, y: str) -> str:
        """Return the number of values and their extremes."""
        values = self.parameters["amplitude"] * self.table
        ends = [np.unravel_index(find(values), values.shape) for find in (np.argmin, np.argmax)]
        low, high = (
            f"{values[row, column]:.3g} at {x} = {_shown(self.rows[row])}, {y} = {_shown(self.columns[column])}"
            for row, column in ends
        )
        size = f"{len(self.rows)} × {len(self.columns)}"
        return f"table of {size} values, from {low}, to {high}".replace("-", "−")


def _written(axis: Axis) -> list[str]:
    return [f'"{value}"' if isinstance(value, str) else repr(float(f"{value:.7g}")) for value in axis]


def _shown(value: Any) -> str:
    return str(value) if isinstance(value, str) else f"{value:.3g}"


def terms_over(curve: Curve) -> tuple[Term, ...] | Grid:
    """Choose the terms of a curve over two covariates: one for each, whose product it is, or a table of both.

    The table is chosen where the product explains less than nine tenths of the curve and BIC clearly prefers the table.
    """
    parts = singular_pair(curve.y, curve.sigma)
    errors = factor_errors(np.where(curve.is_known, curve.sigma, np.inf), *parts)
    terms = tuple(
        term_over(*described) for described in zip(curve.covariates, curve.x, parts, errors, curve.periods, strict=True)
    )
    y, product, weight = curve.y.ravel(), product_at(terms, curve.x).ravel(), weights(curve.y, curve.sigma).ravel()
    if explained_share(y, product, weight) >= ENOUGH:
        return terms
    left = float(weight @ np.where(weight > 0, y - product, 0.0) ** 2)
    known = int(np.count_nonzero(weight))
    sizes = (
        len(term.parameters) if isinstance(term, Formula) else len(part)
        for term, part in zip(terms, parts, strict=True)
    )
    if left + (sum(sizes) - known) * np.log(known) < FAR_ABOVE:
        return terms
    table = np.vectorize(rounded)(np.where(curve.is_known, curve.y, 0.0))
    return Grid(curve.x[0], curve.x[1], table, (curve.periods[0], curve.periods[1]))


def product_at(terms: tuple[Term, ...], axes: tuple[Axis, ...]) -> np.ndarray:
    """Return the product (a, b) of two terms along the axes of a curve; 0 for categories without a value."""
    return np.outer(*(_filled(term, axis) for term, axis in zip(terms, axes, strict=True)))


def _filled(term: Term, axis: Axis) -> np.ndarray:
    if isinstance(term, TermTable) and isinstance(axis, tuple):
        return term.parameters["amplitude"] * np.array([term.values.get(name, 0.0) for name in axis])
    return term.evaluate(np.asarray(axis, float))


def singular_pair(table: np.ndarray, sigma: np.ndarray, steps: int = 50) -> tuple[np.ndarray, np.ndarray]:
    """Return the factors (b1,) and (b2,) whose product is nearest to a table, the second of size 1 at most.

    Alternating least squares with weights, unknown cells left out (first singular pair; Gabriel and Zamir,
    Technometrics 1979).

    Args:
        table, sigma: (b1, b2) values and standard errors; not finite where they are not known.
        steps: of the iteration.
    """
    known = np.isfinite(table) & np.isfinite(sigma)
    y = np.where(known, table, 0.0)
    weight = np.where(known, 1 / np.maximum(np.nan_to_num(sigma, posinf=1.0), 1e-9) ** 2, 0.0)
    start = np.abs(weight * y).sum(0)
    second = np.where(start > 0, 1.0, 0.0)
    row = int(np.argmax((weight * y**2).sum(1)))
    if np.any(weight[row] * y[row]):
        second = y[row] / max(float(np.abs(y[row]).max()), 1e-300)
    first = np.zeros(len(y))
    for _ in range(steps):
        first = (weight * y * second).sum(1) / np.maximum((weight * second**2).sum(1), 1e-300)
        second = (weight * y * first[:, None]).sum(0) / np.maximum((weight * first[:, None] ** 2).sum(0), 1e-300)
        second = second / max(float(np.abs(second).max()), 1e-300)
    first = (weight * y * second).sum(1) / np.maximum((weight * second**2).sum(1), 1e-300)
    if np.abs(second).max() > second.max():  # the largest value is below 0
        first, second = -first, -second
    return first, second


def factor_errors(sigma: np.ndarray, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return standard errors (b1,) and (b2,) of the factors of `singular_pair`; infinite where nothing is known."""
    weight = np.where(np.isfinite(sigma), 1 / np.maximum(np.nan_to_num(sigma, posinf=1.0), 1e-9) ** 2, 0.0)
    with np.errstate(divide="ignore"):
        return 1 / np.sqrt((weight * second**2).sum(1)), 1 / np.sqrt((weight * first[:, None] ** 2).sum(0))
