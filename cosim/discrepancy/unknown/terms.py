"""Terms of an unknown effect: how it depends on one covariate, as a formula, a table, a line or a wave.

All terms have the interface of `Formula`: `parameters` that fits may change, amplitude first; `evaluate`; `code`, the
same as Python; and `text`, human-readable. `constants` are lines that the code needs before it.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cosim.discrepancy.unknown.formula import Formula, best_formula, explained_share, weights
from sensors.effects.covariates import Categories, level_at

_AMPLITUDE = {"amplitude": 1.0}
ENOUGH = 0.9  # share of a curve, above which a formula is preferred to the curve itself
FAR_ABOVE = 10.0  # by which BIC prefers the curve itself otherwise: very strong evidence (Kass and Raftery 1995)


@dataclass(frozen=True)
class TermTable:
    """A value for each category, times an amplitude; 0 for others."""

    values: Mapping[str, float]
    sigma: Mapping[str, float]
    parameters: Mapping[str, float] = field(default_factory=lambda: dict(_AMPLITUDE))
    r2: float = 1.0

    def evaluate(self, x: Any, values: Mapping[str, float] | None = None) -> np.ndarray:
        """Return the values at categories, (m,) `Categories` or names."""
        amplitude = {**self.parameters, **(values or {})}["amplitude"]
        looked_up = x.look_up(self.values) if isinstance(x, Categories) else np.array([self.values[name] for name in x])
        return amplitude * looked_up

    def code(self, x: str, name_of: Callable[[str], str]) -> str:
        """Return the term as Python."""
        return f"{name_of('amplitude')} * {x}.look_up({constant_name(x)})"

    def constants(self, x: str) -> str:
        """Return the table as Python."""
        return literal(f"{constant_name(x)} = {{", [f'"{name}": {value!r}' for name, value in self.values.items()], "}")

    def text(self, x: str) -> str:
        """Return the categories that differ most from 0, in standard errors."""
        amplitude = self.parameters["amplitude"]
        parts = [f"{name}: {amplitude * self.values[name]:+.3g}" for name in self.outstanding()]
        more = len(self.values) - len(parts)
        return (", ".join(parts) + (f" and {more} more" if more else "")).replace("-", "−")

    def outstanding(self, most: int = 6, sigmas: float = 2.0) -> list[str]:
        """Return names of the values that are most significant: beyond so many standard errors, or at least one."""
        z = {name: abs(value) / max(self.sigma[name], 1e-12) for name, value in self.values.items()}
        order = sorted(z, key=lambda name: -z[name])[:most]
        return [name for name in order if z[name] > sigmas] or order[:1]


@dataclass(frozen=True)
class Levels:
    """A level for each scan by its pose time, times an amplitude; 0 for scans at other times."""

    values: Mapping[float, float]
    parameters: Mapping[str, float] = field(default_factory=lambda: dict(_AMPLITUDE))
    r2: float = 1.0

    def evaluate(self, x: Any, values: Mapping[str, float] | None = None) -> np.ndarray:
        """Return the values at pose times (m,)."""
        return {**self.parameters, **(values or {})}["amplitude"] * level_at(np.asarray(x, float), self.values)

    def code(self, x: str, name_of: Callable[[str], str]) -> str:
        """Return the term as Python."""
        return f"{name_of('amplitude')} * level_at({x}, {constant_name(x)})"

    def constants(self, x: str) -> str:
        """Return the levels as Python."""
        start = f"{constant_name(x)} = {{  # by pose time [s]; other scans have other levels, which are not known"
        return literal(start, [f"{time!r}: {value!r}" for time, value in self.values.items()], "}")

    def text(self, x: str) -> str:
        """Return their mean and standard deviation."""
        levels = self.parameters["amplitude"] * np.array(list(self.values.values()))
        return f"a level for each scan, {levels.std():.3g} about {levels.mean():.3g}".replace("-", "−")


@dataclass(frozen=True)
class Line:
    """The curve itself, linear between its points, times an amplitude."""

    x: tuple[float, ...]
    y: tuple[float, ...]
    period: float = 0.0
    parameters: Mapping[str, float] = field(default_factory=lambda: dict(_AMPLITUDE))
    r2: float = 1.0

    def evaluate(self, x: Any, values: Mapping[str, float] | None = None) -> np.ndarray:
        """Return the values at x (m,)."""
        amplitude = {**self.parameters, **(values or {})}["amplitude"]
        if self.period:
            return amplitude * np.interp(x, self.x, self.y, period=self.period)
        return amplitude * np.interp(x, self.x, self.y)

    def code(self, x: str, name_of: Callable[[str], str]) -> str:
        """Return the term as Python."""
        cyclic = f", period={self.period!r}" if self.period else ""
        return f"{name_of('amplitude')} * np.interp({x}, {constant_name(x)}_X, {constant_name(x)}_Y{cyclic})"

    def constants(self, x: str) -> str:
        """Return the points as Python."""
        name = constant_name(x)
        at = literal(f"{name}_X = (", [repr(value) for value in self.x], ")")
        return at + "\n" + literal(f"{name}_Y = (", [repr(value) for value in self.y], ")")

    def text(self, x: str) -> str:
        """Return the number of points and their extremes."""
        y = self.parameters["amplitude"] * np.array(self.y)
        low, high = int(np.argmin(y)), int(np.argmax(y))
        written = (
            f"piecewise linear through {len(y)} points, from {y[low]:.3g} at {x} = {self.x[low]:.3g} "
            f"to {y[high]:.3g} at {x} = {self.x[high]:.3g}"
        )
        return written.replace("-", "−")


@dataclass(frozen=True)
class Wave:
    """A swing at a frequency in absolute time: cosine·cos(2πf(t − start)) + sine·sin(2πf(t − start))."""

    frequency_hz: float
    start_s: float
    parameters: Mapping[str, float]
    r2: float = 1.0

    def evaluate(self, x: Any, values: Mapping[str, float] | None = None) -> np.ndarray:
        """Return the values at times (m,) [s]."""
        every = {**self.parameters, **(values or {})}
        turn = 2 * np.pi * self.frequency_hz * (x - self.start_s)
        return every["cosine"] * np.cos(turn) + every["sine"] * np.sin(turn)

    def code(self, x: str, name_of: Callable[[str], str]) -> str:
        """Return the term as Python."""
        return f"{name_of('cosine')} * np.cos(turn) + {name_of('sine')} * np.sin(turn)"

    def preparation(self, x: str) -> str:
        """Return the line that its code needs before it."""
        return f"turn = 2 * np.pi * FREQUENCY_HZ * ({x} - START_S)"

    def constants(self, x: str) -> str:
        """Return frequency and start as Python."""
        return f"FREQUENCY_HZ = {self.frequency_hz!r}\nSTART_S = {self.start_s!r}"

    def text(self, x: str) -> str:
        """Return amplitude and frequency, with its phase."""
        cosine, sine = self.parameters["cosine"], self.parameters["sine"]
        size, phase = float(np.hypot(cosine, sine)), float(np.arctan2(cosine, sine))
        begin = f" − {self.start_s:.10g}" if self.start_s else ""
        at = f"({x}{begin})" if begin else x
        written = f"{size:.3g}·sin(2π·{self.frequency_hz:.6g} Hz·{at} + {phase:.2f})"
        return written.replace("+ -", "− ").replace("-", "−")


@dataclass(frozen=True)
class ObjectTable:
    """Changes of size or place along the three axes of objects, by class, times an amplitude."""

    changes_m: Mapping[str, tuple[float, float, float]]
    axes: tuple[str, ...]
    parameters: Mapping[str, float] = field(default_factory=lambda: dict(_AMPLITUDE))
    r2: float = 1.0

    def text(self, x: str) -> str:
        """Return the changes of each class."""
        amplitude = self.parameters["amplitude"]
        parts = [
            f"{kind}: " + ", ".join(f"{axis} {amplitude * c:+.3g}" for axis, c in zip(self.axes, changes, strict=True))
            for kind, changes in self.changes_m.items()
        ]
        return "; ".join(parts).replace("-", "−")


def object_table(types: tuple[str, ...], axes: tuple[str, ...], y: np.ndarray) -> ObjectTable:
    """Return the table of measured changes (kinds, 3) [m]; 0 where they are not known."""
    rows = np.nan_to_num(np.asarray(y, float))
    changes = {kind: (rounded(row[0]), rounded(row[1]), rounded(row[2])) for kind, row in zip(types, rows, strict=True)}
    return ObjectTable(changes, axes)


Term = Formula | TermTable | Levels | Line | Wave
"""Terms that are functions of one covariate."""


def term_over(
    covariate: str, x: np.ndarray | tuple[str, ...], y: np.ndarray, sigma: np.ndarray, period: float = 0.0
) -> Term:
    """Choose the term of a curve over one covariate.

    Categories get a table, scans a level each. Of numbers the simplest formula is chosen; where that explains less than
    nine tenths of the curve and BIC prefers the curve itself clearly, the curve itself.

    Args:
        covariate: its name.
        x: (b,) centres of bins, or names of categories.
        y, sigma: (b,) the curve and its standard errors; not finite where it is not known.
        period: of a cyclic covariate.
    """
    known = np.flatnonzero(np.isfinite(y) & np.isfinite(sigma))
    y, sigma = np.asarray(y, float)[known], np.asarray(sigma, float)[known]
    if isinstance(x, tuple):
        names = [x[row] for row in known]
        values = {name: rounded(value) for name, value in zip(names, y, strict=True)}
        return TermTable(values, dict(zip(names, sigma.tolist(), strict=True)))
    x = np.asarray(x, float)[known]
    order = np.argsort(x)
    x, y, sigma = x[order], y[order], sigma[order]
    if covariate == "scan":
        return Levels({round(float(at), 6): rounded(value) for at, value in zip(x, y, strict=True)})
    formula = best_formula(x, y, sigma, period)
    if formula.r2 >= ENOUGH or formula.bic - len(x) * np.log(len(x)) < FAR_ABOVE or len(x) < 4:
        return formula
    decimals = 6 - int(np.floor(np.log10(np.ptp(x))))
    line = Line(tuple(round(float(v), decimals) for v in x), tuple(rounded(value) for value in y), period)
    return replace(line, r2=explained_share(y, line.evaluate(x), weights(y, sigma)))


def wave_of(frequency_hz: float, start_s: float, y: np.ndarray) -> Wave:
    """Return the wave of measured amplitudes of cosine and sine."""
    return Wave(float(frequency_hz), float(start_s), {"cosine": rounded(y[0]), "sine": rounded(y[1])})


def constant_name(x: str) -> str:
    """Return the name of a table in a file: that of the first covariate is `TABLE`."""
    return "TABLE" if x == "x" else f"TABLE_OF_{x.upper()}"


def rounded(value: float) -> float:
    """Round to five digits."""
    return float(f"{float(value):.5g}")


def literal(start: str, parts: list[str], end: str) -> str:
    """Return a Python literal over several lines, at most 110 columns wide."""
    whole = f"{start}{', '.join(parts)}{end}"
    if len(whole) <= 110 and "#" not in start:
        return whole
    joined = ", ".join(part.replace(" ", "\x00") for part in parts)  # keeps a name and its value on one line
    lines = textwrap.wrap(joined + ",", 106, break_long_words=False, break_on_hyphens=False)
    return "\n".join([start, *(f"    {line}" for line in lines), end]).replace("\x00", " ")
