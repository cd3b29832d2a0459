"""In what shape a channel depends on something that no candidate explains."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cosim.discrepancy.inference.score import Quantity
from cosim.discrepancy.settings import DEFAULT, Shapes

_TURN = "np.mod(x - centre + np.pi, 2 * np.pi) - np.pi"


@dataclass(frozen=True, eq=False)
class Formula:
    """y = level + amplitude·shape(x), the level only where data ask for one.

    Attributes:
        family: its name.
        words: its shape as people write it, with places for the parameters.
        code: as Python, in `x` and the names of `parameters`.
        parameters: amplitude first, level last if there is one.
        r2: share of the shape's (weighted) variance that it explains.
        bic: of the fit; lower is better.
    """

    family: str
    words: str
    code: str
    parameters: dict[str, float]
    r2: float
    bic: float

    @property
    def text(self) -> str:
        """As people write it, with numbers."""
        said = f"{self.parameters['amplitude']:.3g}·{self.words.format(**self.parameters)}"
        if "level" in self.parameters:
            said += f" + {self.parameters['level']:.3g}"
        said = re.sub(r"− -(?=[\d.])", "+ ", said)
        said = re.sub(r"\+ -(?=[\d.])", "− ", said)
        return re.sub(r"(?<![e\d])-(?=[\d.])", "−", said)


def best_formula(
    x: np.ndarray, y: np.ndarray, sigma: np.ndarray, period: float = 0.0, by: Shapes = DEFAULT.shapes
) -> Formula:
    """The formula of lowest BIC for a shape.

    Args:
        x: (b,) where.
        y: (b,) the shape.
        sigma: (b,) its standard errors.
        period: of x, if it comes round: 2π, or 0.
        by: numbers that decide.
    """
    weight, found = _weights(y, sigma), []
    root = np.sqrt(weight)
    for family, count, shape, text, code, extra in _families(x, period, by):
        for levels in (0, 1):
            basis = np.stack([shape, np.ones_like(x)][: 1 + levels], 1)
            solution, *_ = np.linalg.lstsq(basis * root[:, None], y * root, rcond=None)
            rest = float(weight @ (y - basis @ solution) ** 2)
            parameters = {"amplitude": float(solution[0]), **extra}
            if levels:
                parameters["level"] = float(solution[1])
            found.append(
                Formula(
                    family,
                    text,
                    f"level + amplitude * {code}" if levels else f"amplitude * {code}",
                    parameters,
                    _explained(y, y - basis @ solution, weight),
                    rest + (count + 1 + levels) * np.log(len(x)),
                )
            )
    return min(found, key=lambda one: one.bic)


_Family = tuple[str, int, np.ndarray, str, str, dict[str, float]]


def _families(x: np.ndarray, period: float, by: Shapes) -> Iterator[_Family]:
    """Name, number of shape parameters, shape at x, text, code and shape parameters of every member."""
    low, high = float(x.min()), float(x.max())
    inner = np.linspace(low, high, by.grid + 2)[1:-1]
    yield "linear", 0, x, "x", "x", {}
    if period:
        for k in range(1, by.harmonics + 1):
            for phase in np.linspace(0, np.pi, 37)[:-1]:
                shape = np.sin(2 * np.pi / period * k * x + phase)
                wave = 2 * np.pi / period * k
                text, code = "sin({wave:.3g}·x + {shift:.2f})", "np.sin(wave * x + shift)"
                yield "sine", 1, shape, text, code, {"wave": wave, "shift": float(phase)}
    if low > 0:
        yield "inverse", 0, 1 / x, "1/x", "1 / np.maximum(x, 1e-3)", {}
        yield "logarithm", 0, np.log(x), "ln x", "np.log(np.maximum(x, 1e-3))", {}
        for power in (0.5, 1.5, 2.0, 3.0, -2.0):
            yield "power", 1, x**power, "x^{power:.3g}", "np.maximum(x, 1e-3) ** power", {"power": power}
    for length in np.geomspace((high - low) / 20, (high - low) * 2, by.grid):
        shape = np.exp(-(x - low) / length)
        text, code = "exp(−(x − {start:.3g})/{length:.3g})", "np.exp(-(x - start) / length)"
        yield "exponential", 1, shape, text, code, {"start": low, "length": float(length)}
    for centre in np.linspace(low, high, by.centres):
        apart = np.mod(x - centre + np.pi, 2 * np.pi) - np.pi if period else x - centre
        for width in np.geomspace((high - low) / 40, (high - low) / 2, by.widths):
            turn = f"({_TURN})" if period else "(x - centre)"
            text, code = "exp(−((x − {centre:.3g})/{width:.3g})²)", f"np.exp(-(({turn} / width) ** 2))"
            shape, numbers = np.exp(-((apart / width) ** 2)), {"centre": float(centre), "width": float(width)}
            yield "bell", 2, shape, text, code, numbers
    for edge in inner:
        rises = (x > edge).astype(float)
        if 0 < rises.sum() < len(x):
            yield "step", 1, rises, "[x > {edge:.3g}]", "(x > edge)", {"edge": float(edge)}
        shape = np.maximum(x - edge, 0)
        yield "hinge", 1, shape, "max(0, x − {edge:.3g})", "np.maximum(x - edge, 0)", {"edge": float(edge)}
    if not period:
        for turns in np.linspace(0.5, 8, 31):
            wave = 2 * np.pi * turns / max(high - low, 1e-9)
            for phase in np.linspace(0, np.pi, 13)[:-1]:
                text, code = "sin({wave:.3g}·x + {shift:.2f})", "np.sin(wave * x + shift)"
                yield "sine", 2, np.sin(wave * x + phase), text, code, {"wave": wave, "shift": float(phase)}
    for start in inner[:: 2 if not period else 1]:
        for end in inner[inner > start]:
            within = ((x > start) & (x <= end)).astype(float)
            if 0 < within.sum() < len(x):
                text, code = "[{start:.3g} < x ≤ {end:.3g}]", "((x > start) & (x <= end))"
                yield "window", 2, within, text, code, {"start": float(start), "end": float(end)}
    if period:
        for turns in range(1, by.harmonics + 1):
            for start in inner[inner < low + period / turns]:
                shape = np.mod((x - start) / period * turns, 1.0) - 0.5
                text = "(frac((x − {start:.2f})/{period:.3g}) − ½)"
                code = "(np.mod((x - start) / period, 1.0) - 0.5)"
                yield "sawtooth", 2, shape, text, code, {"start": float(start), "period": period / turns}


def _weights(y: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Of a shape's values; a formula need not be better than a fiftieth of its size."""
    return 1 / (np.maximum(sigma, 1e-9) ** 2 + (0.02 * (y.max() - y.min())) ** 2 + 1e-24)


def _explained(y: np.ndarray, left: np.ndarray, weight: np.ndarray) -> float:
    total = float(weight @ (y - np.average(y, weights=weight)) ** 2)
    return 1 - float(weight @ left**2) / total if total > 0 else 0.0


def with_parameters(
    formula: Formula, values: Mapping[str, float], x: np.ndarray, y: np.ndarray, sigma: np.ndarray
) -> Formula:
    """A formula with other values of its parameters, and what it then explains of a shape, see `best_formula`."""
    told = replace(formula, parameters={name: float(values.get(name, old)) for name, old in formula.parameters.items()})
    return replace(told, r2=_explained(y, y - evaluate(told, x), _weights(y, sigma)))


def evaluate(formula: Formula, x: np.ndarray) -> np.ndarray:
    """Values of a formula at x."""
    shape: Callable[..., np.ndarray] = eval(  # our own code, from the table above
        f"lambda x, np, {', '.join(formula.parameters)}: {formula.code}", {"__builtins__": {}}
    )
    return np.asarray(shape(x, np, **formula.parameters), float)


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
