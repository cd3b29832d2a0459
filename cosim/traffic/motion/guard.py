"""Collision guard: a vehicle moves on only if all could still stop before they touch.

Each vehicle always has a trajectory without contact: braking with the steering angle kept. A step is taken only
if the ways out after it keep clear of each other, pose by pose; who may not take it takes his old way out one step
further, or another step that a caller offers. So no two boxes that were apart ever overlap (the argument of inevitable
collision states, Fraichard & Asama 2004).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cosim.traffic.motion.footprint import near_pairs, separation, separation_of
from cosim.traffic.motion.stopping import Stops

CLEAR_M = 0.02  # around every box
_BULGE_M = 0.5
_SLACK_M = 1e-4


@dataclass(frozen=True, eq=False)
class Guarded:
    """n vehicles about to take a step.

    Attributes:
        centre, heading_rad: (n, 2) and (n,) before it.
        half: (n, 2) half lengths and widths.
        wanted: stops after the step they want to take.
        brake: gives the stops after a step of their way out; called only if wanted steps clash.
        moves: (n,) whether the wanted step moves the vehicle, or its way out: who would stop dead may have to roll on.
        allowed: pairs of rows (i < j) that may touch.
    """

    centre: np.ndarray
    heading_rad: np.ndarray
    half: np.ndarray
    wanted: Stops
    brake: Callable[[], Stops]
    moves: np.ndarray
    allowed: frozenset[tuple[int, int]]

    @cached_property
    def out(self) -> Stops:
        """Stops after a step of their way out."""
        return self.brake()


Offer = Callable[[int, Callable[[Stops], np.ndarray]], Stops | None]


def choose(all_: Guarded, offer: Offer) -> tuple[dict[int, Stops | None], dict[int, int]]:
    """Rows that may not take the step they want, with the stops after the one they take; and who is in their way.

    Args:
        all_: the vehicles.
        offer: gives the stops (1 vehicle) after another step of a row for which a test holds, if there is one; the
            test takes k stops that the row might have and says which are clear (k,).

    Returns:
        Row → stops, None where it takes its way out; and row → row in its way.
    """
    half = all_.half + CLEAR_M
    taken = all_.wanted
    first, second = _candidates(all_, half, taken)
    before = separation(all_.centre, all_.heading_rad, half, first, second)
    bound = np.maximum(before, 0.0) + _SLACK_M
    depth, at = _depths(taken, taken, half, half, first, second)
    clash = set(np.flatnonzero(depth > bound).tolist())
    yields: dict[int, Stops | None] = {}
    blocks: dict[int, int] = {}
    if not clash:
        return yields, blocks
    steps = max(taken.centre.shape[1], all_.out.centre.shape[1])
    taken = Stops(_pad(taken.centre, steps), _pad(taken.heading_rad, steps), taken.last.copy())
    neighbours: dict[int, list[int]] = {}
    for pair, (i, j) in enumerate(zip(first.tolist(), second.tolist(), strict=True)):
        neighbours.setdefault(i, []).append(pair)
        neighbours.setdefault(j, []).append(pair)
    while clash:
        pair = min(clash)
        row = _who_yields(all_, taken, yields, half, int(first[pair]), int(second[pair]), int(at[pair]), bound[pair])
        if row is None:
            clash.discard(pair)
            continue
        pairs = np.array(neighbours[row])
        others = np.where(first[pairs] == row, second[pairs], first[pairs])

        def clear(stops: Stops, row: int = row, others: np.ndarray = others, pairs: np.ndarray = pairs) -> np.ndarray:
            return np.all(_against(stops, taken, half, row, others) <= bound[pairs], axis=1)

        again = row in yields
        blocks[row] = int(second[pair] if first[pair] == row else first[pair])
        taken.put(row, all_.out, row)
        yields[row] = None
        other = None if again else offer(row, clear)
        if other is not None:
            taken.put(row, other, 0)
            yields[row] = other
        now, when = _depths(taken, taken, half, half, first[pairs], second[pairs])
        at[pairs] = when
        clash -= set(pairs.tolist())
        clash |= set(pairs[now > bound[pairs]].tolist())
    return yields, blocks


def _candidates(all_: Guarded, half: np.ndarray, taken: Stops) -> tuple[np.ndarray, np.ndarray]:
    """Pairs whose ways may meet."""
    end = np.take_along_axis(taken.centre, taken.last[:, None, None], 1)[:, 0]
    way = np.hypot(*(end - all_.centre).T)
    first, second = near_pairs((all_.centre + end) / 2, np.hypot(*half.T) + way / 2 + _BULGE_M)
    moving = all_.moves[first] | all_.moves[second]
    if all_.allowed:
        free = np.array([pair not in all_.allowed for pair in zip(first.tolist(), second.tolist(), strict=True)], bool)
        moving &= free
    return first[moving], second[moving]


def _who_yields(
    all_: Guarded,
    taken: Stops,
    yields: dict[int, Stops | None],
    half: np.ndarray,
    i: int,
    j: int,
    at: int,
    bound: float,
) -> int | None:
    """Choose which of a pair does not take its step."""
    may = [row for row in (i, j) if row not in yields or yields[row] is not None]
    may = [row for row in may if all_.moves[row]]
    if not may:
        return None
    fresh = [row for row in may if row not in yields]
    if len(fresh) < 2:
        return (fresh or may)[0]
    helps = []
    for row, other in ((i, j), (j, i)):
        alone = all_.out.take(np.array([row]))
        helps.append(bool(_against(alone, taken, half, row, np.array([other]))[0, 0] <= bound))
    if helps[0] != helps[1]:
        return i if helps[0] else j
    ahead = []
    for row, other in ((i, j), (j, i)):
        here, there = (min(at, int(taken.last[r])) for r in (row, other))
        away = taken.centre[other, there] - taken.centre[row, here]
        heading = taken.heading_rad[row, here]
        ahead.append((away[0] * np.cos(heading) + away[1] * np.sin(heading)) / half[row, 0])
    return i if ahead[0] >= ahead[1] else j


def _against(stops: Stops, taken: Stops, half: np.ndarray, row: int, others: np.ndarray) -> np.ndarray:
    """Greatest depth of each of k stops that a vehicle might have in those of others (k, m)."""
    m, k = len(others), len(stops.last)
    theirs, own = np.tile(np.arange(m), k), np.repeat(np.arange(k), m)
    return _depths(taken.take(others), stops, half[others], half[[row] * k], theirs, own)[0].reshape(k, m)


def _pad(values: np.ndarray, steps: int) -> np.ndarray:
    return values[:, np.minimum(np.arange(steps), values.shape[1] - 1)]


def _depths(
    ones: Stops,
    others: Stops,
    half_1: np.ndarray,
    half_2: np.ndarray,
    first: np.ndarray,
    second: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Greatest depth of overlap of pairs (m,) at any instant, and the pose at which it is reached."""
    if not len(first):
        return np.zeros(0), np.zeros(0, int)
    last_1, last_2 = ones.last[first], others.last[second]
    count = np.maximum(last_1, last_2) + 1
    start = np.cumsum(count) - count
    pair = np.repeat(np.arange(len(first)), count)
    step = np.arange(len(pair)) - start[pair]
    k_1, k_2 = np.minimum(step, last_1[pair]), np.minimum(step, last_2[pair])
    one, two = first[pair], second[pair]
    depth = separation_of(
        (ones.centre[one, k_1], ones.heading_rad[one, k_1], half_1[one]),
        (others.centre[two, k_2], others.heading_rad[two, k_2], half_2[two]),
    )
    greatest = np.maximum.reduceat(depth, start)
    where = np.flatnonzero(depth >= greatest[pair])
    at = np.zeros(len(first), int)
    at[pair[where[::-1]]] = step[where[::-1]]
    return greatest, at
