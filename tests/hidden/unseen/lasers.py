"""Faults of single lasers and circuit boards."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.hidden.scan import Scan
from tests.hidden.truth import Finding
from tests.hidden.unseen.kind import (
    RINGS,
    TIME,
    Kind,
    NotApplicableError,
    Parameters,
    World,
    amplitude,
    pick,
    uniform,
)

_BOARDS = 4
_SHARE_HIT = 0.3  # of a laser's beams must return something
_FEWEST_RINGS_BETWEEN, _MOST_RINGS_BETWEEN = 2, 12


def _board(rng: np.random.Generator, rings: int) -> list[int]:
    """Rings of one circuit board: neighbours, or every fourth."""
    board = int(rng.integers(_BOARDS))
    if rng.random() < 0.5:
        return list(range(board, rings, _BOARDS))
    size = rings // _BOARDS
    return list(range(board * size, (board + 1) * size))


def _on(scan: Scan, rings: list[int]) -> np.ndarray:
    return np.isin(scan.beams.ring, rings)


def _draw_drift(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    channel = pick(rng, ("range", "intensity"))
    size = amplitude(rng, level, "range_m" if channel == "range" else "intensity", signed=True)
    duration = world.duration_s
    times = np.array([frame["time_s"] for frame in world.frames]) - world.frames[0]["time_s"]
    p = {
        "channel": channel,
        "size": size,
        "rings": _board(rng, world.beams.rings),
        "shape": pick(rng, ("line", "settling")),
        "duration_s": round(duration, 3),
        "tau_s": round(duration * uniform(rng, 0.2, 0.5), 3),
        "mean": 0.0,
    }
    return {**p, "mean": round(float(_level(p, times).mean()), 5)}


def _level(p: Parameters, elapsed_s: np.ndarray) -> np.ndarray:
    """Share of the size over time, about −1…1, mean 0."""
    if p["shape"] == "line":
        return 2 * elapsed_s / p["duration_s"] - 1 - p["mean"]
    return 2 * (1 - np.exp(-elapsed_s / p["tau_s"])) - p["mean"]


def _drift(scan: Scan, rng: np.random.Generator, p: Parameters) -> None:
    value = p["size"] * _level(p, scan.elapsed_s + scan.beams.time_s) * _on(scan, p["rings"])
    if p["channel"] == "range":
        scan.range_m += value
    else:
        scan.intensity *= np.maximum(1 + value, 0.05)


def _truth_drift(p: Parameters, world: World) -> tuple[Finding, ...]:
    in_scan = Finding((f"shared_{p['channel']}",), (("ring",),))
    per_laser = ("ring_range_offset",) if p["channel"] == "range" else ("ring_gain",)
    return (Finding((p["channel"],), (TIME, RINGS), beside=per_laser, also=(in_scan,)),)


def _draw_dead_or_weak(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    rings = _rings_with_returns(world)
    if len(rings) < 2:
        raise NotApplicableError
    first, second = (int(ring) for ring in rng.choice(rings, 2, replace=False))
    which = pick(rng, ("dead", "weak", "both"))
    p: dict[str, Any] = {"dead": first if which != "weak" else None, "weak": second if which != "dead" else None}
    return p | {"loss": uniform(rng, 0.3, 0.6), "gain": round(1 - min(2 * amplitude(rng, level, "intensity"), 0.8), 4)}


def _rings_with_returns(world: World) -> list[int]:
    found = np.mean([scan.found.reshape(world.beams.rings, -1).mean(1) for scan in world.scans], axis=0)
    return [int(ring) for ring in np.flatnonzero(found >= _SHARE_HIT)]


def _dead_or_weak(scan: Scan, rng: np.random.Generator, p: Parameters) -> None:
    if p["dead"] is not None:
        scan.found &= scan.beams.ring != p["dead"]
    if p["weak"] is not None:
        scan.intensity[scan.beams.ring == p["weak"]] *= p["gain"]


def _truth_dead_or_weak(p: Parameters, world: World) -> tuple[Finding, ...]:
    truths = []
    if p["dead"] is not None:
        truths.append(Finding(("drop", "shared_drop"), (RINGS,)))
    if p["weak"] is not None:
        truths.append(Finding(("intensity",), (RINGS,), effects=("ring_gain",)))
    return tuple(truths)


def _draw_swap(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    rings = _rings_with_returns(world)
    pairs = [
        (one, other) for one in rings for other in rings if _FEWEST_RINGS_BETWEEN <= other - one <= _MOST_RINGS_BETWEEN
    ]
    return {"rings": list(pick(rng, pairs))}


def _swap(scan: Scan, rng: np.random.Generator, p: Parameters) -> None:
    one, other = p["rings"]
    shape = (scan.beams.rings, scan.beams.firings)
    for values in (scan.found, scan.range_m, scan.intensity, scan.material, scan.instance, scan.cos, scan.rho):
        grid = values.reshape(shape)
        grid[[one, other]] = grid[[other, one]]


def _truth_swap(p: Parameters, world: World) -> tuple[Finding, ...]:
    return (Finding(("wiring", "elevation_error"), (RINGS,), effects=("ring_elevation",)),)


def _draw_far(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    rings, grid = (
        world.beams.rings,
        np.concatenate(
            [np.where(scan.found, scan.range_m, np.nan).reshape(world.beams.rings, -1) for scan in world.scans], axis=1
        ),
    )
    far = []
    for start in range(0, rings - rings // _BOARDS + 1, rings // 16):
        group = list(range(start, start + rings // _BOARDS))
        values = grid[group][np.isfinite(grid[group])]
        if len(values) / grid[group].size > _SHARE_HIT and np.quantile(values, 0.9) > 2.5 * np.quantile(values, 0.1):
            far.append((group, float(np.quantile(values, 0.9))))
    group, reach = pick(rng, far)
    return {"rings": group, "size": amplitude(rng, level, "loss"), "reach_m": round(reach, 2)}


def _far(scan: Scan, rng: np.random.Generator, p: Parameters) -> None:
    chance = p["size"] * np.clip(scan.range_m / p["reach_m"], 0, 1.5) * _on(scan, p["rings"])
    scan.found &= rng.random(len(chance)) >= chance


def _truth_far(p: Parameters, world: World) -> tuple[Finding, ...]:
    return (Finding(("drop",), (("range",), RINGS), beside=("path_dropout", "random_dropout")),)


LASERS: dict[str, Kind] = {
    "board_drift": Kind(_draw_drift, _truth_drift, lambda p: "range" if p["channel"] == "range" else "signal", _drift),
    "dead_or_weak_laser": Kind(_draw_dead_or_weak, _truth_dead_or_weak, lambda p: "signal", _dead_or_weak),
    "swapped_lasers": Kind(_draw_swap, _truth_swap, lambda p: "reported", _swap),
    "losses_far_on_rings": Kind(_draw_far, _truth_far, lambda p: "detected", _far, is_random=lambda p: True),
}
