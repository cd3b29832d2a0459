"""The held-out error falling effect by effect."""

from __future__ import annotations

import numpy as np

from cosim.discrepancy.diagnosis import Diagnosis
from cosim.stats.plot import Axis, Plot

_SIGMAS = 1.96


def waterfall(found: Diagnosis) -> str:
    """SVG: the error as the sensor was and after each effect with 95 % intervals; dashed: the noise floor."""
    steps = _steps(found)
    level = np.array([value for _, value, _ in steps])
    half = _SIGMAS * np.nan_to_num(np.array([error for _, _, error in steps]))
    low, high = float((level - half).min()), float((level + half).max())
    if found.noise_floor is not None:
        low, high = min(low, found.noise_floor), max(high, found.noise_floor)
    pad = 0.16 * max(high - low, 0.01 * high, 1e-6)
    low, high = max(low - pad, 0.0), high + 1.6 * pad
    names = [name for name, _, _ in steps]
    x = Axis(-0.5, len(names) - 0.5, names=names)
    plot = Plot(x, Axis(low, high, "error on held-out frames"), "held-out error", max(620, 210 * len(names)), 340)
    for row in range(1, len(level)):
        ends = np.array([row - 0.28, row + 0.28])
        style = "fall" if level[row] <= level[row - 1] else "rise"
        plot.band(ends, np.full(2, level[row]), np.full(2, level[row - 1]), style)
        plot.line(np.array([row - 1, row + 0.28]), np.full(2, level[row - 1]), "link")
    if found.noise_floor is not None:
        plot.line(np.array([-0.5, len(names) - 0.5]), np.full(2, found.noise_floor), "floor")
        plot.note(len(names) - 0.52, found.noise_floor - 0.045 * (high - low), "noise floor", anchor="end")
    for row, (value, side) in enumerate(zip(level, half, strict=True)):
        plot.line(np.full(2, float(row)), np.array([value - side, value + side]), "whisker")
        plot.line(np.array([float(row)]), np.array([value]), "whisker", dots=True)
        plot.note(row + 0.05, value + side + 0.03 * (high - low), f"{value:.3f}", anchor="start")
    return plot.svg()


def _steps(found: Diagnosis) -> list[tuple[str, float, float]]:
    """Name, error and its standard error, from the sensor as given to the improved one.

    Where an effect begins at another error than the one before it ended at, something without a finding came between:
    an unknown effect, or the last joint fit.
    """
    first = found.effects[0].error_before.standard_error if found.effects else float("nan")
    steps = [("as given", found.error_before, first)]
    between = ["+ unknown"] if found.unknown is not None else []

    def pass_over(level: float, error: float) -> None:
        if abs(level - steps[-1][1]) > 1e-9:
            steps.append((between.pop() if between else "refitted", level, error))

    for one in found.effects:
        pass_over(one.error_before.error, one.error_before.standard_error)
        steps.append((f"+ {one.effect}", one.error_after.error, one.error_after.standard_error))
    pass_over(found.error_after, float("nan"))
    return steps
