"""The simplest formula of a curve over a numeric covariate.

A formula is y = amplitude·shape(x), or that plus a level. Its shape belongs to a family of functions with few
parameters; of all families the member with the lowest Bayesian information criterion is chosen (Schwarz 1978).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize

from cosim.discrepancy.unknown.families import FAMILIES, MOST_POWER, Family, Parameters
from sensors.effects.covariates import wrapped

_MOST_LEVEL = 5.0  # largest level relative to the curve; larger ones and the amplitude cancel each other
_MOST_BETWEEN = 3.0  # largest value between bins relative to the curve; narrower peaks are not resolved by the bins


@dataclass(frozen=True)
class FormulaGrid:
    """Grid of trial values for the parameters of families.

    Attributes:
        edges: positions within the covariate's range.
        centres, widths: of bells.
        harmonics: waves over a cyclic covariate, at most.
        waves: waves over the range of another one, at most.
        phases: of waves.
        refined: families, with and without level, whose parameters are then found closely.
    """

    edges: int = 25
    centres: int = 60
    widths: int = 32
    harmonics: int = 4
    waves: int = 8
    phases: int = 36
    refined: int = 6


@dataclass(frozen=True)
class Formula:
    """y = amplitude·shape(x), plus a level where the curve needs one.

    Attributes:
        family: name of the shape's family.
        values: amplitude first, then level if there is one, then the parameters of the family.
        r2: share of the curve's weighted variance that it explains.
        bic: Bayesian information criterion; lower is better.
    """

    family: str
    values: Mapping[str, float]
    r2: float
    bic: float

    @property
    def parameters(self) -> Parameters:
        """Parameters that fits may change: amplitude, level if there is one, and the shape's own."""
        fixed = FAMILIES[self.family].fixed
        return {name: value for name, value in self.values.items() if name not in fixed}

    def evaluate(self, x: np.ndarray, values: Mapping[str, float] | None = None) -> np.ndarray:
        """Return y at x, with the formula's own values or others for some of its parameters."""
        every = {**self.values, **(values or {})}
        shape = {name: value for name, value in every.items() if name not in ("amplitude", "level")}
        found = every["amplitude"] * FAMILIES[self.family].function(x, **shape)
        return every["level"] + found if "level" in every else found

    def code(self, x: str, name_of: Callable[[str], str]) -> str:
        """Return the formula as Python.

        Args:
            x: name of the variable.
            name_of: gives the code of a parameter from its name.
        """
        family = FAMILIES[self.family]
        names = {name: name_of(name) for name in (*family.free, *family.fixed)}
        product = f"{name_of('amplitude')} * {family.code.format(x=x, **names)}"
        return f"{name_of('level')} + {product}" if "level" in self.values else product

    def text(self, x: str) -> str:
        """Return the formula as people write it, with numbers, in a variable of that name."""
        numbers = {
            name: f"{value:.1f}" if 1e5 < abs(value) < 1e10 else f"{value:.3g}" for name, value in self.values.items()
        }
        if self.family == "sector":
            numbers["stop"] = f"{wrapped(self.values['start'] + self.values['width'], self.values['period']):.3g}"
        amplitude, level = numbers.pop("amplitude"), numbers.pop("level", "")
        if self.family == "constant":
            return _with_minus(amplitude)
        written = f"{amplitude}·{FAMILIES[self.family].text.format(x=x, **numbers)}"
        return _with_minus(f"{written} + {level}" if level else written)

    def with_values(self, values: Mapping[str, float], x: np.ndarray, y: np.ndarray, sigma: np.ndarray) -> Formula:
        """Return the formula with other values of its parameters, and the share of the curve that it explains then."""
        every = {name: float(values.get(name, old)) for name, old in self.values.items()}
        moved = replace(self, values=every)
        return replace(moved, r2=explained_share(y, moved.evaluate(x), weights(y, sigma)))


def best_formula(
    x: np.ndarray,
    y: np.ndarray,
    sigma: np.ndarray,
    period: float = 0.0,
    grid: FormulaGrid = FormulaGrid(),
) -> Formula:
    """Choose the formula of lowest BIC for a curve.

    Args:
        x: (b,) centres of the bins.
        y: (b,) the curve.
        sigma: (b,) its standard errors.
        period: of a cyclic x from −period/2 to period/2; 0 for others.
        grid: how finely parameters are tried.
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    weight = weights(y, np.asarray(sigma, float))
    if len(x) == 1:
        return Formula("constant", {"amplitude": _rounded(float(y[0]))}, 1.0, 0.0)
    candidates: list[tuple[float, Family, Parameters]] = []
    positions = _between(x)
    for family, members in _members(x, period, grid):
        shapes = np.stack([family.function(x, **member) for member in members])
        between = np.stack([family.function(positions, **member) for member in members])
        for is_levelled in (False, True) if family.name != "constant" else (False,):
            rest = _residual(shapes, between, y, weight, is_levelled)
            row = int(np.argmin(rest))
            values = {**members[row], "level": 0.0} if is_levelled else members[row]
            candidates.append((_bic(float(rest[row]), family, is_levelled, len(x)), family, values))
    nearest = sorted(candidates, key=lambda candidate: candidate[0])[: grid.refined]
    bic, family, refined = min(
        (_refined(*candidate[1:], x, y, weight) for candidate in nearest), key=lambda refined: refined[0]
    )
    parameters = _rounded_to_range({name: value for name, value in refined.items() if name != "level"}, x)
    coefficients = _coefficients(family, parameters, x, y, weight, "level" in refined)
    formula = Formula(family.name, {**coefficients, **parameters}, 0.0, bic)
    return replace(formula, r2=explained_share(y, formula.evaluate(x), weight))


def weights(y: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Return weights of a curve's values; 0 where it is not known.

    A formula need not be closer than a fiftieth of the curve's size: an exactly measured curve gets a simple one.
    """
    known = np.isfinite(y) & np.isfinite(sigma)
    size = np.ptp(y[known]) if known.any() else 0.0
    with np.errstate(invalid="ignore"):
        return np.where(known, 1 / (np.maximum(sigma, 1e-12) ** 2 + (0.02 * size) ** 2 + 1e-24), 0.0)


def explained_share(y: np.ndarray, predicted: np.ndarray, weight: np.ndarray) -> float:
    """Return the share of the weighted variance of y that a prediction explains (R²)."""
    used = weight > 0
    y, predicted, weight = y[used], predicted[used], weight[used]
    total = float(weight @ (y - np.average(y, weights=weight)) ** 2)
    return 1 - float(weight @ (y - predicted) ** 2) / total if total > 0 else 1.0


def number_code(value: float) -> str:
    """Return a number as Python reads it back exactly."""
    return repr(float(value)) if value >= 0 else f"({float(value)!r})"


def _members(x: np.ndarray, period: float, grid: FormulaGrid) -> Iterator[tuple[Family, list[Parameters]]]:
    """Families that fit a covariate, each with its members on the grid."""
    low, high = float(x.min()), float(x.max())
    span = max(high - low, 1e-12)
    inner = np.linspace(low, high, grid.edges + 2)[1:-1].tolist()
    is_far = abs(low) > 10 * span
    yield FAMILIES["constant"], [{}]
    yield FAMILIES["ramp" if is_far else "linear"], [{"start": low}] if is_far else [{}]
    phases = np.linspace(0, np.pi, grid.phases + 1)[:-1].tolist()
    if period:
        waves = [2 * np.pi / period * k for k in range(1, grid.harmonics + 1)]
        yield FAMILIES["harmonic"], [{"wave": wave, "shift": shift} for wave in waves for shift in phases]
        centres = np.linspace(-period / 2, period / 2, grid.centres + 1)[:-1].tolist()
        widths = np.geomspace(span / 40, span / 2, grid.widths).tolist()
        both = [{"centre": centre, "width": width, "period": period} for centre in centres for width in widths]
        yield FAMILIES["cyclic bell"], both
        starts = np.linspace(-period / 2, period / 2, 2 * grid.edges + 1)[:-1].tolist()
        widths = np.linspace(0, period, grid.edges + 1)[1:-1].tolist()
        yield FAMILIES["sector"], [{"start": s, "width": w, "period": period} for s in starts for w in widths]
        teeth = [period / k for k in range(1, grid.harmonics + 1)]
        yield FAMILIES["sawtooth"], [{"start": s, "tooth": tooth} for tooth in teeth for s in inner if s - low < tooth]
        return
    if low > 0 and not is_far:
        yield FAMILIES["inverse"], [{}]
        yield FAMILIES["logarithm"], [{}]
        yield FAMILIES["power"], [{"power": power} for power in (0.5, 1.5, 2.0, 3.0, -2.0)]
    lengths = np.geomspace(span / 20, span * 2, grid.edges).tolist()
    yield FAMILIES["decay"], [{"start": low, "length": length} for length in lengths]
    yield FAMILIES["growth"], [{"end": high, "length": length} for length in lengths]
    centres = np.linspace(low, high, grid.centres).tolist()
    widths = np.geomspace(span / 40, span / 2, grid.widths).tolist()
    yield FAMILIES["bell"], [{"centre": centre, "width": width} for centre in centres for width in widths]
    for name in ("step", "hinge", "hinge below"):
        yield FAMILIES[name], [{"edge": edge} for edge in inner]
    waves = (2 * np.pi / span * np.linspace(0.5, grid.waves, 4 * grid.waves - 1)).tolist()
    yield FAMILIES["sine"], [{"wave": wave, "shift": shift} for wave in waves for shift in phases[::3]]
    yield FAMILIES["window"], [{"start": start, "end": end} for start in inner for end in inner if end > start]


def _between(x: np.ndarray) -> np.ndarray:
    """Positions between bins at x, four per bin."""
    return np.interp(np.linspace(0, len(x) - 1, 4 * len(x)), np.arange(len(x)), x)


def _residual(
    shapes: np.ndarray, between: np.ndarray, y: np.ndarray, weight: np.ndarray, is_levelled: bool
) -> np.ndarray:
    """Weighted sum of squares (k,) that each shape leaves of y, its amplitude and level the best ones.

    Infinite for a shape that is much larger between the bins than the curve is in any bin.

    Args:
        shapes: (k, b) at the bins.
        between: (k, d) between them.
        y: (b,) the curve.
        weight: (b,) of its values.
        is_levelled: whether there is a level next to the amplitude.
    """
    y, level = np.where(weight > 0, y, 0.0), 0.0
    most = _MOST_BETWEEN * np.abs(y).max()
    if is_levelled:
        total = weight.sum()
        centre, level = (shapes @ weight / total)[:, None], weight @ y / total
        shapes, between, y = shapes - centre, between - centre, y - level
    size, common = shapes**2 @ weight, shapes @ (weight * y)
    amplitude = np.divide(common, size, out=np.zeros_like(size), where=size > 1e-300)
    largest = np.abs(amplitude[:, None] * between + level).max(1)
    return np.where(largest <= most, weight @ y**2 - amplitude * common, np.inf)


def _level(shape: np.ndarray, y: np.ndarray, weight: np.ndarray) -> float:
    """Best level next to the best amplitude of a shape (b,)."""
    share, y = weight / weight.sum(), np.where(weight > 0, y, 0.0)
    centred = shape - share @ shape
    return float(share @ y - (share * centred) @ y / max(float(share @ centred**2), 1e-300) * (share @ shape))


def _coefficients(
    family: Family, parameters: Parameters, x: np.ndarray, y: np.ndarray, weight: np.ndarray, is_levelled: bool
) -> Parameters:
    """Best amplitude, and level where there is one, of a shape."""
    shape = family.function(x, **parameters)
    basis = np.stack([shape, np.ones_like(x)][: 1 + is_levelled], 1)
    root, known = np.sqrt(weight), np.where(weight > 0, y, 0.0)
    solution, *_ = np.linalg.lstsq(basis * root[:, None], known * root, rcond=None)
    names = ("amplitude", "level")[: 1 + is_levelled]
    return {name: _rounded(float(value)) for name, value in zip(names, solution, strict=True)}


def _refined(
    family: Family, values: Parameters, x: np.ndarray, y: np.ndarray, weight: np.ndarray
) -> tuple[float, Family, Parameters]:
    """BIC, family and parameters of a shape where it leaves least, found from a member of the grid."""
    start = np.array([values[name] for name in family.free])
    is_levelled = "level" in values
    size = np.maximum(np.abs(start), 1e-3 * max(float(np.ptp(x)), 1e-12))
    largest, between = float(np.max(np.abs(y[weight > 0]), initial=0.0)), _between(x)

    def moved(parts: np.ndarray) -> Parameters:
        shape = {name: value for name, value in values.items() if name != "level"}
        return shape | dict(zip(family.free, (start + parts * size).tolist(), strict=True))

    def rest(parts: np.ndarray) -> float:
        shape = moved(parts)
        is_imitation = abs(shape.get("power", 0.0)) > MOST_POWER
        if is_imitation or any(shape[name] <= 0 for name in ("width", "length") if name in shape):
            return np.inf
        with np.errstate(all="ignore"):
            curve = family.function(x, **shape)
            if is_levelled and abs(_level(curve, y, weight)) > _MOST_LEVEL * largest:
                return np.inf
            left = _residual(curve[None], family.function(between, **shape)[None], y, weight, is_levelled)[0]
        return float(np.nan_to_num(left, nan=np.inf))

    least, best = rest(np.zeros(len(start))), np.zeros(len(start))
    if family.free:
        found = optimize.minimize(
            rest, best, method="Nelder-Mead", options={"maxiter": 120, "initial_simplex": _simplex(len(start))}
        )
        if found.fun < least:
            least, best = float(found.fun), found.x
    parameters = moved(best) | ({"level": 0.0} if is_levelled else {})
    return _bic(least, family, is_levelled, len(x)), family, parameters


def _bic(rest: float, family: Family, is_levelled: bool, count: int) -> float:
    """Bayesian information criterion of a weighted sum of squares."""
    return rest + (1 + len(family.free) + is_levelled) * float(np.log(count))


def _simplex(count: int) -> np.ndarray:
    return np.vstack([np.zeros(count), 0.05 * np.eye(count)])


def _rounded(value: float) -> float:
    return float(f"{value:.6g}")


def _rounded_to_range(values: Parameters, x: np.ndarray) -> Parameters:
    """Values to six digits, positions to a millionth of the covariate's range."""
    decimals = 6 - int(np.floor(np.log10(max(float(np.ptp(x)), 1e-300))))
    positions = ("start", "end", "edge", "centre")
    return {
        name: round(value, decimals) if name in positions else value if name in ("period", "tooth") else _rounded(value)
        for name, value in values.items()
    }


def _with_minus(text: str) -> str:
    """Text with proper minus signs, and a sum of negative numbers as a difference."""
    text = re.sub(r"− -(?=[\d.])", "+ ", text)
    text = re.sub(r"\+ -(?=[\d.])", "− ", text)
    text = re.sub(r"\((\w) [−+] 0\)", r"\1", text)
    text = re.sub(r"(?<!\()\b(\w) [−+] 0(?=[,)])", r"\1", text)
    text = text.replace("sin(1·", "sin(")
    return re.sub(r"(?<![e\d])-(?=[\d.])", "−", text)
