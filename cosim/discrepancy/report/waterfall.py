"""The aligned held-out error falling effect by effect."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from cosim.discrepancy.diagnosis import Diagnosis
from cosim.discrepancy.report.layout import LAYOUT
from cosim.discrepancy.settings import DEFAULT
from cosim.stats.plot import Axis, Plot


def waterfall(found: Diagnosis) -> str:
    """SVG: the aligned error as the sensor was and after each effect with 95 % intervals; dashed: the noise floor.

    In decades where it falls so far that its last steps would not show.
    """
    steps = _steps(found)
    level = np.array([value for _, value, _ in steps])
    half = float(norm.ppf(DEFAULT.upper)) * np.nan_to_num(np.array([error for _, _, error in steps]))
    shown = level if found.noise_floor is None else np.append(level, found.noise_floor)
    least, high = float(shown.min()), max(float((level + half).max()), float(shown.max()))
    is_log = least > 0 and level.max() > LAYOUT.decades * level.min()
    low, high = _padded(least, high) if is_log else _padded_evenly(min(least, float((level - half).min())), high)

    def raised(value: float, share: float) -> float:
        """A value moved up by a share of the axis."""
        return value * (high / low) ** share if is_log else value + share * (high - low)

    names = [name for name, _, _ in steps]
    x = Axis(-0.5, len(names) - 0.5, names=names)
    plot = Plot(
        x,
        Axis(low, high, "aligned error, held-out frames", log=is_log),
        "held-out error",
        max(620, 210 * len(names)),
        340,
    )
    for row in range(1, len(level)):
        ends = np.array([row - 0.28, row + 0.28])
        style = "fall" if level[row] <= level[row - 1] else "rise"
        plot.band(ends, np.full(2, level[row]), np.full(2, level[row - 1]), style)
        plot.line(np.array([row - 1, row + 0.28]), np.full(2, level[row - 1]), "link")
    if found.noise_floor is not None:
        plot.line(np.array([-0.5, len(names) - 0.5]), np.full(2, found.noise_floor), "floor")
        plot.note(len(names) - 0.52, raised(found.noise_floor, -0.045), "noise floor", anchor="end")
    for row, (value, side) in enumerate(zip(level, half, strict=True)):
        plot.line(np.full(2, float(row)), np.array([max(value - side, low), value + side]), "whisker")
        plot.line(np.array([float(row)]), np.array([value]), "whisker", dots=True)
        plot.note(row + 0.05, raised(value + side, 0.03), f"{value:.3f}", anchor="start")
    return plot.svg()


def _padded_evenly(low: float, high: float) -> tuple[float, float]:
    pad = 0.16 * max(high - low, 0.01 * high, 1e-6)
    return max(low - pad, 0.0), high + 1.6 * pad


def _padded(low: float, high: float) -> tuple[float, float]:
    """The same of an axis of decades."""
    pad = (high / low) ** 0.1
    return low / pad, high * pad


def _steps(found: Diagnosis) -> list[tuple[str, float, float]]:
    """Name, error and its standard error, from the sensor as given to the improved one."""
    names = ["as given", *(f"+ {one.effect}" for one in found.effects), *("+ unknown" for _ in found.unknowns)]
    return [(name, one.error, one.standard_error) for name, one in zip(names, found.budget.aligned_steps, strict=False)]
