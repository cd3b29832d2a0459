"""Parameters that no slope tells of: hard limits, edges of sectors, and how often returns come from nowhere.

They are found by search, and their intervals by how far the likelihood lets them go: where it breaks off at a limit
there is no normal approximation, and 95 % of the likelihood lie within a fall of log 20 (Smith, Biometrika 1985).
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
    """Whether a parameter is found by search."""
    return unknown.rings == 1 and (isinstance(effect, ScanEffect) or is_flat(effect, unknown, column, by))


def is_flat(effect: Effect, unknown: Unknown, column: Column, by: Search) -> bool:
    """Whether at most a few beams notice a small change, or some that do get lost, found or another surface."""
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


def searched(
    effects: tuple[Effect, ...],
    which: Sequence[tuple[int, Unknown, Column]],
    lost: Loss,
    sample: Sample,
    residuals: Residuals,
    *,
    roughly: bool = False,
) -> tuple[Effect, ...]:
    """Effects with searched parameters where the likelihood is greatest.

    Args:
        effects: all of the sensor.
        which: place, parameter and column of each.
        lost: negative log-likelihood of effects.
        sample, residuals: the measurements, and how the effects as they are fit them.
        roughly: look once, and not closely, where every look costs new rays.
    """
    by = sample.settings.search
    names = {(place, unknown.name) for place, unknown, _ in which}
    sectors = {place for place, name in names if name == AZIMUTH and (place, WIDTH) in names}
    for place in sectors:
        trial = _with(effects, place, crowded_sector(sample, residuals, by))
        effects = trial if lost(trial) < lost(effects) else effects
    rest = [one for one in which if not (one[0] in sectors and one[1].name in (AZIMUTH, WIDTH))]
    settled = roughly and all(effects[place].by_search for place, _, _ in rest)
    most = by.passes if any(isinstance(effects[place], ScanEffect) for place, _, _ in rest) else 2
    passes = most if len(rest) > 1 and not settled else 1
    reached = lost(effects) if passes > 1 else 0.0
    for number in range(passes):
        before = effects
        for place, unknown, column in rest:
            dear = effects[place].by_search
            flat = is_flat(effects[place], unknown, column, by) and not dear
            close = by.roughly if roughly and dear else by.near
            effects = _best(effects, place, unknown, lost, flat, close, by)
        smooth = [(place, one) for place, one, column in rest if not is_flat(effects[place], one, column, by)]
        if number and len(smooth) > 1:
            effects = _along_valley(before, effects, smooth, lost, by.farthest)
        if number + 1 == passes:
            break
        fallen, reached = reached, lost(effects)
        if fallen - reached < by.enough:
            break
    return effects


def _along_valley(
    first: tuple[Effect, ...],
    second: tuple[Effect, ...],
    which: Sequence[tuple[int, Unknown]],
    lost: Loss,
    farthest: float,
) -> tuple[Effect, ...]:
    """The best on the line through what two passes over all parameters found (Powell, Computer J. 1964).

    Where parameters make up for one another, passes of one after the other creep along a valley towards its bottom.
    """

    def at(steps: float) -> tuple[Effect, ...]:
        effects = first
        for place, unknown in which:
            start, end = (float(getattr(one[place], unknown.name)) for one in (first, second))
            effects = _with(effects, place, {unknown.name: start + steps * (end - start)})
        return effects

    found = _least(lambda steps: lost(at(steps)), 1.0, farthest, 0.05)
    return at(float(found.x)) if found.fun < lost(second) else second


def likely_interval(
    effects: tuple[Effect, ...],
    place: int,
    unknown: Unknown,
    column: Column,
    lost: Loss,
    stray_weight: float,
    by: Search,
) -> tuple[float, float]:
    """How far down and up a parameter may go until the likelihood has fallen too far.

    Args:
        effects: all of the sensor.
        place, unknown, column: the parameter.
        lost: negative log-likelihood of effects, of a sample whose beams weigh one on average.
        stray_weight: what a stray weighs in it. Each is one fact.
        by: numbers that decide.
    """
    value, least = float(getattr(effects[place], unknown.name)), lost(effects)
    fall = by.fall if is_flat(effects[place], unknown, column, by) else by.smooth_fall
    if isinstance(effects[place], ScanEffect):
        fall *= stray_weight

    def fallen(apart: float) -> bool:
        if not unknown.low <= value + apart <= unknown.high:
            return True
        return min(lost(trial) for trial in _alternatives(effects, place, unknown, value, apart)) - least > fall

    ends = []
    for side in (-1.0, 1.0):
        near, far = 0.0, side * max(1e-3 * unknown.step, 1e-9)
        for _ in range(by.doublings):
            if fallen(far):
                break
            near, far = far, 2 * far
        for _ in range(by.bisections):
            middle = (near + far) / 2
            near, far = (near, middle) if fallen(middle) else (middle, far)
        ends.append(min(max(value + far, unknown.low), unknown.high))
    return ends[0], ends[1]


def widening(
    effects: tuple[Effect, ...],
    place: int,
    pairs: dict[str, tuple[float, float]],
    lost: Loss,
    by: Search = DEFAULT.search,
) -> dict[str, float]:
    """By how much intervals of smooth parameters of one effect are wider with the others free than with them held.

    Of a likelihood that is a paraboloid by √(R⁻¹)ᵢᵢ, R its coupling in units of the intervals with the others held,
    `pairs`.
    """
    names, effect = list(pairs), effects[place]
    if len(names) < 2:
        return dict.fromkeys(names, 1.0)
    value = {name: float(getattr(effect, name)) for name in names}
    half = {name: (pairs[name][1] - pairs[name][0]) / 2 for name in names}
    coupling, least = np.eye(len(names)), lost(effects)
    fall = lost(_with(effects, place, {names[0]: value[names[0]] + half[names[0]]})) - least
    for i, j in combinations(range(len(names)), 2):
        a, b = names[i], names[j]
        near = value[a] + half[a] / 2
        alike, unlike = (
            lost(_with(effects, place, {a: near, b: value[b] + side * half[b] / 2})) for side in (1.0, -1.0)
        )
        coupled = np.clip((alike - unlike) / max(fall, 1e-12), -by.most_coupled, by.most_coupled)
        coupling[i, j] = coupling[j, i] = coupled
    wider = np.sqrt(np.maximum(np.diag(np.linalg.inv(coupling)), 1.0))
    return dict(zip(names, wider.tolist(), strict=True))


def _alternatives(
    effects: tuple[Effect, ...], place: int, unknown: Unknown, value: float, apart: float
) -> Iterator[tuple[Effect, ...]]:
    """The parameter moved, alone or with one edge of its sector held."""
    effect, moved = effects[place], {unknown.name: value + apart}
    yield _with(effects, place, moved)
    other, factor = {AZIMUTH: (WIDTH, 2.0), WIDTH: (AZIMUTH, 0.5)}.get(unknown.name, ("", 0.0))
    if other and hasattr(effect, other):
        for side in (-factor, factor):
            yield _with(effects, place, moved | {other: getattr(effect, other) + side * apart})


def _best(
    effects: tuple[Effect, ...], place: int, unknown: Unknown, lost: Loss, flat: bool, close: float, by: Search
) -> tuple[Effect, ...]:
    """The effects with one parameter where it is likeliest, to as close a share of the reach."""
    value = float(getattr(effects[place], unknown.name))
    reach = max(by.reach * abs(value), by.reach_steps * unknown.step)

    def of(value: float) -> float:
        return lost(_with(effects, place, {unknown.name: value}))

    low, high = max(value - reach, unknown.low), min(value + reach, unknown.high)
    if not flat:
        within = close * reach
        found = _least(of, low, high, within)
        if within > by.blurred * abs(found.x):  # a value much smaller than the reach of the search
            aside = by.aside * within
            found = _least(of, max(found.x - aside, low), min(found.x + aside, high), close * aside)
        return _with(effects, place, {unknown.name: float(found.x)}) if found.fun < of(value) else effects
    best, least = value, of(value)
    grid = np.linspace(low, high, by.grid)
    for _ in range(by.zooms):
        losses = np.array([of(one) for one in grid])
        if losses.min() <= least:
            # Between two beams that tell the likelihood is level: its middle is as good a guess as any.
            best, least = float(np.median(grid[losses == losses.min()])), float(losses.min())
        apart = grid[1] - grid[0]
        grid = np.clip(best + apart * np.linspace(-0.75, 0.75, 7), unknown.low, unknown.high)
    return _with(effects, place, {unknown.name: best})


def _least(of: Callable[[float], float], low: float, high: float, within: float) -> Any:
    return optimize.minimize_scalar(of, bounds=(low, high), method="bounded", options={"xatol": within})


def _with(effects: tuple[Effect, ...], place: int, values: dict[str, float]) -> tuple[Effect, ...]:
    return (*effects[:place], with_values(effects[place], values), *effects[place + 1 :])


def crowded_sector(sample: Sample, residuals: Residuals, by: Search = DEFAULT.search) -> dict[str, float]:
    """Middle and width [°] of the sector whose share of strays stands out most from its share of beams.

    Kulldorff's scan statistic (Commun. Stat. 1997).
    """
    turn = np.degrees(sample.azimuth) % 360
    stray = sample.returned & sample.clear & (residuals.matched < 0.5)
    if not stray.any():
        return {AZIMUTH: 0.0, WIDTH: 360.0}
    strays, beams = _Share(turn[stray], sample.weight[stray]), _Share(turn, sample.weight)
    grid = np.arange(by.edges) * 360 / by.edges
    start, end = _likeliest(strays, beams, grid, grid, by)
    for _ in range(2):
        aside = np.linspace(-1.5, 1.5, by.fine + 1) * 360 / by.edges
        start, _ = _likeliest(strays, beams, start + aside, np.array([end]), by)
        _, end = _likeliest(strays, beams, np.array([start]), end + aside, by)
    width = (end - start) % 360
    middle = (start + width / 2 + 180) % 360 - 180
    return {AZIMUTH: float(middle), WIDTH: float(width)}


class _Share:
    """Share of a weight up to an azimuth."""

    def __init__(self, turn: np.ndarray, weight: np.ndarray) -> None:
        order = np.argsort(turn)
        self._turn, self._sum = turn[order], np.append(0.0, np.cumsum(weight[order]))
        self.total = float(self._sum[-1])

    def between(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Of azimuths from start (s, 1) on to end (e,), going round."""
        low, high = (self._sum[np.searchsorted(self._turn, edge % 360)] for edge in (start, end))
        return ((high - low) + self.total * ((end % 360) <= (start % 360))) / self.total


def _likeliest(strays: _Share, beams: _Share, starts: np.ndarray, ends: np.ndarray, by: Search) -> tuple[float, float]:
    inside, size = (share.between(starts[:, None], ends) for share in (strays, beams))
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = np.nan_to_num(inside * np.log(inside / size))
        gain += np.nan_to_num((1 - inside) * np.log((1 - inside) / (1 - size)))
    gain[(inside < size) | (size < by.least_sector) | (size > by.most_sector)] = -np.inf
    row, column = np.unravel_index(int(np.argmax(gain)), gain.shape)
    return float(starts[row]), float(ends[column])
