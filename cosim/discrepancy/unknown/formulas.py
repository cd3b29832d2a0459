"""Simple formulas for a binned shape: the simplest that the data support, by BIC."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

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
