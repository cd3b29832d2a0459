"""Line search for parameters in which the likelihood is not differentiable (hard limits, sectors, spurious returns).

Their intervals are likelihood intervals: at a discontinuity there is no normal approximation, and 95 % of the
likelihood lie within a fall of log 20 (Smith, Biometrika 72, 1985).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from scipy import optimize

from cosim.discrepancy.candidates import Unknown, with_values
from cosim.discrepancy.inference.likelihood import Residuals
from cosim.discrepancy.inference.score import Column
from cosim.discrepancy.sampling.sample import Sample
from cosim.discrepancy.settings import DEFAULT, Search
from sensors.effects.base import EchoEffect, Effect, ScanEffect

AZIMUTH, WIDTH = "azimuth_deg", "width_deg"

Loss = Callable[[tuple[Effect, ...]], float]


def is_searched(effect: Effect, unknown: Unknown, column: Column, by: Search) -> bool:
    """Whether a parameter is fitted by line search."""
    return unknown.rings == 1 and (isinstance(effect, ScanEffect) or is_flat(effect, unknown, column, by))


def is_flat(effect: Effect, unknown: Unknown, column: Column, by: Search) -> bool:
    """Whether a small change affects almost no beams, or switches returns on, off or to another surface."""
    if not column.delta or all(np.count_nonzero(values) < by.few * len(values) for values in column.delta.values()):
        return True
    if isinstance(effect, EchoEffect) and np.any(
        np.abs(column.delta.get("range", 0.0)) * unknown.step > by.elsewhere_m
    ):
        return True
    if "drop" not in column.delta:
        return False
    lost = np.abs(column.delta["drop"]) * unknown.step
    altogether = bool(np.all(lost[lost > 0] > by.altogether))
    return altogether and not any(np.any(values[lost == 0]) for values in column.delta.values())


def search_parameters(
    effects: tuple[Effect, ...],
    which: Sequence[tuple[int, Unknown, Column]],
    loss: Loss,
    sample: Sample,
    residuals: Residuals,
    *,
    roughly: bool = False,
) -> tuple[Effect, ...]:
    """Maximise the likelihood over the searched parameters by cyclic line searches.

    Args:
        effects: all effects of the sensor.
        which: effect index, parameter and column of each searched parameter.
        loss: negative log-likelihood as a function of the effects.
        sample, residuals: sample of measured beams and its residuals at the current effects.
        roughly: whether to make only one pass, with a coarse tolerance, if each evaluation requires ray casting.

    Returns:
        the effects with new values of these parameters.
    """
    by = sample.settings.search
    names = {(index, unknown.name) for index, unknown, _ in which}
    sectors = {index for index, name in names if name == AZIMUTH and (index, WIDTH) in names}
    for index in sectors:
        trial = _with_values(effects, index, crowded_sector(sample, residuals, by))
        effects = trial if loss(trial) < loss(effects) else effects
    rest = [item for item in which if not (item[0] in sectors and item[1].name in (AZIMUTH, WIDTH))]
    use_single_pass = roughly and all(effects[index].by_search for index, _, _ in rest)
    max_passes = by.passes if any(isinstance(effects[index], ScanEffect) for index, _, _ in rest) else 2
    passes = max_passes if len(rest) > 1 and not use_single_pass else 1
    reached = loss(effects) if passes > 1 else 0.0
    for number in range(passes):
        before = effects
        for index, unknown, column in rest:
            is_costly = effects[index].by_search
            flat = is_flat(effects[index], unknown, column, by) and not is_costly
            close = by.roughly if roughly and is_costly else by.near
            effects = _search_line(effects, index, unknown, loss, flat, close, by)
        smooth = [
            (index, unknown) for index, unknown, column in rest if not is_flat(effects[index], unknown, column, by)
        ]
        if number and len(smooth) > 1:
            effects = _along_valley(before, effects, smooth, loss, by.farthest)
        if number + 1 == passes:
            break
        previous, reached = reached, loss(effects)
        if previous - reached < by.enough:
            break
    return effects


def _along_valley(
    first: tuple[Effect, ...],
    second: tuple[Effect, ...],
    which: Sequence[tuple[int, Unknown]],
    loss: Loss,
    farthest: float,
) -> tuple[Effect, ...]:
    """Search along the line through the results of two passes over all parameters (Powell, Computer J. 7, 1964).

    If parameters compensate each other, one-by-one searches converge slowly along a valley of the objective.
    """

    def at(steps: float) -> tuple[Effect, ...]:
        effects = first
        for index, unknown in which:
            start, end = (float(getattr(one[index], unknown.name)) for one in (first, second))
            effects = _with_values(effects, index, {unknown.name: start + steps * (end - start)})
        return effects

    result = _minimise(lambda steps: loss(at(steps)), 1.0, farthest, 0.05)
    return at(float(result.x)) if result.fun < loss(second) else second


def likelihood_interval(
    effects: tuple[Effect, ...],
    index: int,
    unknown: Unknown,
    column: Column,
    loss: Loss,
    spurious_weight: float,
    by: Search,
) -> tuple[float, float]:
    """Likelihood interval (low, high) of a parameter.

    Args:
        effects: all effects of the sensor.
        index, unknown, column: effect index, parameter and its column.
        loss: negative log-likelihood as a function of the effects, for a sample with mean weight 1.
        spurious_weight: mean weight of a spurious return in it; each is one independent observation.
        by: settings of the search.
    """
    value, least = float(getattr(effects[index], unknown.name)), loss(effects)
    fall = by.fall if is_flat(effects[index], unknown, column, by) else by.smooth_fall
    if isinstance(effects[index], ScanEffect):
        fall *= spurious_weight

    def is_too_low(distance: float) -> bool:
        if not unknown.low <= value + distance <= unknown.high:
            return True
        return min(loss(trial) for trial in _alternatives(effects, index, unknown, value, distance)) - least > fall

    ends = []
    for side in (-1.0, 1.0):
        near, far = 0.0, side * max(1e-3 * unknown.step, 1e-9)
        for _ in range(by.doublings):
            if is_too_low(far):
                break
            near, far = far, 2 * far
        for _ in range(by.bisections):
            middle = (near + far) / 2
            near, far = (near, middle) if is_too_low(middle) else (middle, far)
        ends.append(min(max(value + far, unknown.low), unknown.high))
    return ends[0], ends[1]


def interval_widening(
    effects: tuple[Effect, ...],
    index: int,
    pairs: dict[str, tuple[float, float]],
    loss: Loss,
    by: Search = DEFAULT.search,
) -> dict[str, float]:
    """Factors by which intervals of smooth parameters of one effect widen if the other parameters are free, not fixed.

    For a quadratic log-likelihood the factor is √(R⁻¹)ᵢᵢ, where R is the Hessian in units of the intervals `pairs` that
    hold for fixed other parameters.
    """
    names, effect = list(pairs), effects[index]
    if len(names) < 2:
        return dict.fromkeys(names, 1.0)
    value = {name: float(getattr(effect, name)) for name in names}
    half = {name: (pairs[name][1] - pairs[name][0]) / 2 for name in names}
    coupling, least = np.eye(len(names)), loss(effects)
    fall = loss(_with_values(effects, index, {names[0]: value[names[0]] + half[names[0]]})) - least
    for i, j in combinations(range(len(names)), 2):
        a, b = names[i], names[j]
        near = value[a] + half[a] / 2
        similar, unlike = (
            loss(_with_values(effects, index, {a: near, b: value[b] + side * half[b] / 2})) for side in (1.0, -1.0)
        )
        coupled = np.clip((similar - unlike) / max(fall, 1e-12), -by.most_coupled, by.most_coupled)
        coupling[i, j] = coupling[j, i] = coupled
    wider = np.sqrt(np.maximum(np.diag(np.linalg.inv(coupling)), 1.0))
    return dict(zip(names, wider.tolist(), strict=True))


def _alternatives(
    effects: tuple[Effect, ...], index: int, unknown: Unknown, value: float, distance: float
) -> Iterator[tuple[Effect, ...]]:
    """Yield the effects with the parameter moved, only it or with one edge of its sector fixed."""
    effect, values = effects[index], {unknown.name: value + distance}
    yield _with_values(effects, index, values)
    other, factor = {AZIMUTH: (WIDTH, 2.0), WIDTH: (AZIMUTH, 0.5)}.get(unknown.name, ("", 0.0))
    if other and hasattr(effect, other):
        for side in (-factor, factor):
            yield _with_values(effects, index, values | {other: getattr(effect, other) + side * distance})


def _search_line(
    effects: tuple[Effect, ...], index: int, unknown: Unknown, loss: Loss, flat: bool, close: float, by: Search
) -> tuple[Effect, ...]:
    """Line search over one parameter; `close` is the tolerance as a fraction of the search range."""
    value = float(getattr(effects[index], unknown.name))
    reach = max(by.reach * abs(value), by.reach_steps * unknown.step)

    def loss_at(value: float) -> float:
        return loss(_with_values(effects, index, {unknown.name: value}))

    low, high = max(value - reach, unknown.low), min(value + reach, unknown.high)
    if not flat:
        tolerance = close * reach
        result = _minimise(loss_at, low, high, tolerance)
        if tolerance > by.blurred * abs(result.x):  # the value is much smaller than the search range
            margin = by.aside * tolerance
            result = _minimise(loss_at, max(result.x - margin, low), min(result.x + margin, high), close * margin)
        return _with_values(effects, index, {unknown.name: float(result.x)}) if result.fun < loss_at(value) else effects
    best, smallest = value, loss_at(value)
    grid = np.linspace(low, high, by.grid)
    for _ in range(by.zooms):
        losses = np.array([loss_at(trial) for trial in grid])
        if losses.min() <= smallest:
            # Between two informative beams the likelihood is constant: take the middle.
            best, smallest = float(np.median(grid[losses == losses.min()])), float(losses.min())
        spacing = grid[1] - grid[0]
        grid = np.clip(best + spacing * np.linspace(-0.75, 0.75, 7), unknown.low, unknown.high)
    return _with_values(effects, index, {unknown.name: best})


def _minimise(objective: Callable[[float], float], low: float, high: float, tolerance: float) -> Any:
    return optimize.minimize_scalar(objective, bounds=(low, high), method="bounded", options={"xatol": tolerance})


def _with_values(effects: tuple[Effect, ...], index: int, values: dict[str, float]) -> tuple[Effect, ...]:
    return (*effects[:index], with_values(effects[index], values), *effects[index + 1 :])


def crowded_sector(sample: Sample, residuals: Residuals, by: Search = DEFAULT.search) -> dict[str, float]:
    """Centre and width [°] of the azimuth sector with the most significant excess of spurious returns.

    Kulldorff's scan statistic (Commun. Stat. 26, 1997).
    """
    turn = np.degrees(sample.azimuth) % 360
    spurious_per_m = sample.returned & sample.clear & (residuals.matched < 0.5)
    if not spurious_per_m.any():
        return {AZIMUTH: 0.0, WIDTH: 360.0}
    spurious, beams = (
        _CumulativeWeight(turn[spurious_per_m], sample.weight[spurious_per_m]),
        _CumulativeWeight(turn, sample.weight),
    )
    grid = np.arange(by.edges) * 360 / by.edges
    start, end = _best_sector(spurious, beams, grid, grid, by)
    for _ in range(2):
        aside = np.linspace(-1.5, 1.5, by.fine + 1) * 360 / by.edges
        start, _ = _best_sector(spurious, beams, start + aside, np.array([end]), by)
        _, end = _best_sector(spurious, beams, np.array([start]), end + aside, by)
    width = (end - start) % 360
    middle = (start + width / 2 + 180) % 360 - 180
    return {AZIMUTH: float(middle), WIDTH: float(width)}


class _CumulativeWeight:
    """Cumulative weight of beams over azimuth."""

    def __init__(self, turn: np.ndarray, weight: np.ndarray) -> None:
        order = np.argsort(turn)
        self._turn, self._sum = turn[order], np.append(0.0, np.cumsum(weight[order]))
        self.total = float(self._sum[-1])

    def between(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """(s, e) share of the weight between azimuths start (s, 1) and end (e,) [°], with wrap-around."""
        low, high = (self._sum[np.searchsorted(self._turn, edge % 360)] for edge in (start, end))
        return ((high - low) + self.total * ((end % 360) <= (start % 360))) / self.total


def _best_sector(
    spurious: _CumulativeWeight, beams: _CumulativeWeight, starts: np.ndarray, ends: np.ndarray, by: Search
) -> tuple[float, float]:
    inside, size = (share.between(starts[:, None], ends) for share in (spurious, beams))
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = np.nan_to_num(inside * np.log(inside / size))
        gain += np.nan_to_num((1 - inside) * np.log((1 - inside) / (1 - size)))
    gain[(inside < size) | (size < by.least_sector) | (size > by.most_sector)] = -np.inf
    row, column = np.unravel_index(int(np.argmax(gain)), gain.shape)
    return float(starts[row]), float(ends[column])
