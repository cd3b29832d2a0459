"""Waterfall chart of an error that decreases in steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import norm

from cosim.report.plot import Axis, Plot

_LOG_RATIO = 10.0  # ratio of largest to smallest error above which the axis is logarithmic


def waterfall(
    steps: Sequence[tuple[str, float, float]], floor: float | None, label: str, coverage: float = 0.95
) -> str:
    """SVG chart of the initial error and the error after each step with intervals; the noise floor is dashed.

    The axis is logarithmic if the error decreases so much that the last steps would not be visible.

    Args:
        steps: name, error and standard error of each step.
        floor: noise floor; None if unknown.
        label: label of the axis.
        coverage: coverage of the intervals.
    """
    level = np.array([value for _, value, _ in steps])
    half = float(norm.ppf((1 + coverage) / 2)) * np.nan_to_num(np.array([error for _, _, error in steps]))
    shown = level if floor is None else np.append(level, floor)
    least, high = float(shown.min()), max(float((level + half).max()), float(shown.max()))
    is_log = least > 0 and level.max() > _LOG_RATIO * level.min()
    low, high = _padded(least, high) if is_log else _padded_evenly(min(least, float((level - half).min())), high)

    def raised(value: float, share: float) -> float:
        """Move a value up by a share of the axis."""
        return value * (high / low) ** share if is_log else value + share * (high - low)

    names = [name for name, _, _ in steps]
    x = Axis(-0.5, len(names) - 0.5, names=names)
    plot = Plot(
        x,
        Axis(low, high, label, log=is_log),
        "held-out error",
        max(620, 210 * len(names)),
        340,
    )
    for row in range(1, len(level)):
        ends = np.array([row - 0.28, row + 0.28])
        style = "fall" if level[row] <= level[row - 1] else "rise"
        plot.band(ends, np.full(2, level[row]), np.full(2, level[row - 1]), style)
        plot.line(np.array([row - 1, row + 0.28]), np.full(2, level[row - 1]), "link")
    if floor is not None:
        plot.line(np.array([-0.5, len(names) - 0.5]), np.full(2, floor), "floor")
        plot.note(len(names) - 0.52, raised(floor, -0.045), "noise floor", anchor="end")
    for row, (value, side) in enumerate(zip(level, half, strict=True)):
        plot.line(np.full(2, float(row)), np.array([max(value - side, low), value + side]), "whisker")
        plot.line(np.array([float(row)]), np.array([value]), "whisker", dots=True)
        plot.note(row + 0.05, raised(value + side, 0.03), f"{value:.3f}", anchor="start")
    return plot.svg()


def _padded_evenly(low: float, high: float) -> tuple[float, float]:
    pad = 0.16 * max(high - low, 0.01 * high, 1e-6)
    return max(low - pad, 0.0), high + 1.6 * pad


def _padded(low: float, high: float) -> tuple[float, float]:
    """Limits of a logarithmic axis with padding."""
    pad = (high / low) ** 0.1
    return low / pad, high * pad
