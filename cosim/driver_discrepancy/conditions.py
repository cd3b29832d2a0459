"""Conditions under which channels are looked at: street, lane, time, class of vehicle, signal, density."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cosim.driver_discrepancy.placed import Placed, kind_of
from cosim.driver_discrepancy.signals import Phases

_STREETS, _TIMES = 96, 3
_FEWEST_OF_CLASS = 8
CONDITIONS_OF: dict[str, tuple[str, ...]] = {
    "speed": ("street", "lane", "time", "class", "signal", "density"),
    "free_speed": ("street", "lane", "time", "class"),
    "bend_speed": ("class", "time"),
    "acceleration": ("class", "time", "signal"),
    "deceleration": ("class", "time", "signal"),
    "headway": ("class", "lane", "time"),
    "space_headway": ("class", "density"),
    "standing_gap": ("class",),
    "startup_lag": ("signal",),
    "lateral": ("street", "lane", "class", "time"),
    "unsteadiness": ("class", "time"),
    "lane_changes_other": ("time",),
    "lane_use": ("class",),
    "yielding": ("street",),
    "stops": ("street",),
    "standing": ("street", "lane", "time", "class", "signal"),
    "red_entries": ("street",),
    "counts": ("street",),
}
"""Conditions of each channel; those that are not named are looked at as a whole only."""


@dataclass(frozen=True)
class ConditionFrame:
    """Definitions that measurement and simulations share: levels of the conditions, centres, and phases of signals.

    Attributes:
        streets: edges with most vehicle time, the longest first.
        classes: kinds with enough vehicles, if there are two or more.
        dense: vehicles per kilometre of lane from which traffic counts as dense.
        begin_s, seconds: of the recording, by its own clock.
        phases: of traffic lights, by the recording's clock.
        centres: channel → mean of the measured vehicles, about which differences between drivers are counted.
        diagram: the street of the space–time diagram, that with most distance driven.
    """

    streets: tuple[str, ...]
    classes: tuple[str, ...]
    dense: float
    begin_s: float
    seconds: float
    phases: Phases
    centres: tuple[tuple[str, float], ...]
    diagram: str


def choose_frame(placed: Placed, phases: Phases, centres: tuple[tuple[str, float], ...]) -> ConditionFrame:
    """Choose the levels of all conditions from the measured trajectories."""
    edges = edge_codes(placed)
    names = tuple(dict.fromkeys(edges[1]))
    weight = np.bincount(edges[0][edges[0] >= 0], minlength=len(names)) * placed.tracks.step_s
    distance = np.bincount(edges[0][edges[0] >= 0], placed.tracks.speed_mps[edges[0] >= 0], minlength=len(names))
    order = [names[at] for at in np.argsort(-weight, kind="stable")[:_STREETS].tolist() if weight[at] > 0]
    types = kind_of(placed.tracks, placed.network)
    counts = {kind: int((types == kind).sum()) for kind in np.unique(types.astype(str)).tolist()}
    classes = tuple(kind for kind, count in counts.items() if count >= _FEWEST_OF_CLASS)
    density = densities(placed)
    known = density[np.isfinite(density)]
    return ConditionFrame(
        streets=tuple(order),
        classes=classes if len(classes) > 1 else (),
        dense=float(np.median(known)) if len(known) else np.inf,
        begin_s=placed.tracks.start_s,
        seconds=placed.tracks.seconds,
        phases=phases,
        centres=centres,
        diagram=names[int(np.argmax(distance))] if len(distance) else "",
    )


def condition_codes(
    placed: Placed, frame: ConditionFrame, red: np.ndarray
) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """Levels of each condition and the level of each sample (n,), −1 for none.

    Args:
        placed: trajectories.
        frame: levels.
        red: (n,) whether the link ahead shows red.
    """
    tracks = placed.tracks
    edge, names = edge_codes(placed)
    row = {name: at for at, name in enumerate(frame.streets)}
    street = np.array([row.get(name, -1) for name in names] + [-1], int)[edge]
    lane = placed.of_lane(lambda _, one: -1.0 if one.inside else min(one.index, 2))
    elapsed = (tracks.time_s - frame.begin_s) / max(frame.seconds, 1e-9)
    index_of = {name: at for at, name in enumerate(frame.classes)}
    kind = np.array([index_of.get(name, -1) for name in kind_of(tracks, placed.network)], int)[tracks.vehicle]
    signalled = frame.phases.signalled(placed.network)
    lights = placed.of_lane(lambda name, _: float(name in signalled)) > 0
    density = densities(placed)
    dense = np.where(np.isfinite(density), (density > frame.dense).astype(int), -1)
    ends = np.linspace(0, frame.seconds, _TIMES + 1)
    times = tuple(f"{begin:.0f} to {end:.0f} s" for begin, end in pairwise(ends))
    return {
        "street": (frame.streets, street),
        "lane": (("right lane", "second lane", "further lanes"), np.nan_to_num(lane, nan=-1).astype(int)),
        "time": (times, np.clip((elapsed * _TIMES).astype(int), 0, _TIMES - 1)),
        "class": (frame.classes, kind),
        "signal": (("red ahead", "green ahead"), np.where(lights, np.where(red, 0, 1), -1)),
        "density": (("light traffic", "dense traffic"), dense),
    }


def edge_codes(placed: Placed) -> tuple[np.ndarray, list[str]]:
    """Code of each sample's edge (n,), −1 inside junctions and off lanes, and the edges' names."""
    lanes = placed.network.lanes
    of_lane = [lanes[name].edge if name in lanes and not lanes[name].inside else "" for name in placed.lanes]
    names = sorted(set(of_lane) - {""})
    number = {name: at for at, name in enumerate(names)}
    code = np.array([number.get(name, -1) for name in of_lane], int)[placed.code]
    return np.where(placed.parked, -1, code), names


def densities(placed: Placed) -> np.ndarray:
    """Vehicles per kilometre of lane on each sample's lane at its time (n,); NaN inside junctions."""
    tracks = placed.tracks
    instant = np.round((tracks.time_s - tracks.start_s) / max(tracks.step_s, 1e-3)).astype(np.int64)
    key = np.where(placed.parked, -1, instant * (len(placed.lanes) + 1) + placed.code)
    _, inverse, count = np.unique(key, return_inverse=True, return_counts=True)
    length = placed.of_lane(lambda _, lane: np.nan if lane.inside else max(lane.length_m, 20.0))
    return np.where(placed.parked, np.nan, count[inverse] / length * 1000)
