"""Summary of each vehicle's trajectory: sums and weights of every column, channel × condition."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cosim.driver_discrepancy.channels import BASES, CHANNELS, between_drivers, measure_channels
from cosim.driver_discrepancy.conditions import CONDITIONS_OF, ConditionFrame, condition_codes, edge_codes
from cosim.driver_discrepancy.placed import FOUR_WHEELS, Placed, kind_of
from cosim.driver_discrepancy.values import Values

SPEED_BINS = np.arange(0.5, 40.01, 0.5)
HEADWAY_BINS = np.arange(0.0, 6.01, 0.1)
LATERAL_BINS = np.arange(-1.01, 1.011, 0.02)  # zero lies inside a bin
ACCELERATION_BINS = np.arange(-6.125, 6.13, 0.25)
_DIAGRAM_S = 1.0
_INTERVAL_S, _SHORTEST_INTERVAL_S = 30.0, 10.0  # of the fundamental diagram
_SHORTEST_STREET_M = 50.0


@dataclass(frozen=True)
class SummaryColumn:
    """A channel under a condition; the condition and its level are empty for the whole channel."""

    channel: str
    condition: str = ""
    level: str = ""

    @property
    def is_whole(self) -> bool:
        """Whether it is the whole channel."""
        return not self.condition


@dataclass(frozen=True, eq=False)
class Summary:
    """Vehicle by vehicle, v of them, and column by column, c of them.

    Attributes:
        ids: of the vehicles.
        columns: of the tables.
        sums, weights: (v, c); their ratio is the vehicle's value.
        histograms: `speed`, `headway`, `lateral`, `acceleration`: (bins + 2,) samples.
        fundamental: (m, 2) density [veh/km] and flow [veh/h] of streets in intervals of 30 s; the last may be shorter.
        space_time: (p, 3) vehicle, time since the start [s] and position [m] on the diagram's street.
        seconds: duration of the recording.
        street: id of the diagram's street; empty without one.
    """

    ids: tuple[str, ...]
    columns: tuple[SummaryColumn, ...]
    sums: np.ndarray
    weights: np.ndarray
    histograms: Mapping[str, np.ndarray]
    fundamental: np.ndarray
    space_time: np.ndarray
    seconds: float
    street: str = ""

    def of(self, ids: frozenset[str]) -> Summary:
        """The summary of some vehicles only; histograms remain those of all."""
        keep = np.array([name in ids for name in self.ids], bool)
        names = tuple(name for name in self.ids if name in ids)
        return Summary(
            names,
            self.columns,
            self.sums[keep],
            self.weights[keep],
            self.histograms,
            self.fundamental,
            self.space_time,
            self.seconds,
            self.street,
        )

    def ratios(self) -> np.ndarray:
        """Mean of each column over all vehicles (c,); NaN without exposure."""
        total = self.weights.sum(0)
        return np.divide(self.sums.sum(0), total, out=np.full(len(total), np.nan), where=total > 0)

    def statistics(self) -> dict[str, float]:
        """Mean of each whole channel."""
        return {
            column.channel: float(value)
            for column, value in zip(self.columns, self.ratios().tolist(), strict=True)
            if column.is_whole
        }

    def rows(self, ids: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Sums and weights of some vehicles in their order; zero for those that are missing."""
        at = {name: row for row, name in enumerate(self.ids)}
        found = np.array([at.get(name, -1) for name in ids], int)
        there = (found >= 0)[:, None]
        if not len(self.ids):
            return np.zeros((len(ids), len(self.columns))), np.zeros((len(ids), len(self.columns)))
        return np.where(there, self.sums[found], 0.0), np.where(there, self.weights[found], 0.0)


def summarise(
    placed: Placed, frame: ConditionFrame, clock_s: float = 0.0, planned: frozenset[tuple[str, str]] = frozenset()
) -> Summary:
    """Summarise four-wheeled vehicles; others take part in traffic only.

    Args:
        placed: trajectories on their network.
        frame: levels of conditions.
        clock_s: the trajectories' clock less the recording's [s].
        planned: vehicle and edge of U-turns that are part of the demand and not counted.
    """
    tracks = placed.tracks
    red = frame.phases.red(placed, clock_s)
    keep = np.isin(kind_of(tracks, placed.network), FOUR_WHEELS)
    measured = measure_channels(placed, red, planned)
    frame_now = _moved(frame, clock_s)
    codes = condition_codes(placed, frame_now, red)
    columns, sums, weights = _tables(placed, measured, codes, dict(frame.centres))
    speeds = measured["speed"].rows
    accelerations = np.flatnonzero(placed.on & ~placed.parked & np.isfinite(placed.acceleration_mps2))
    return Summary(
        ids=tuple(name for name, kept in zip(tracks.ids, keep.tolist(), strict=True) if kept),
        columns=columns,
        sums=sums[keep],
        weights=weights[keep],
        histograms={
            "speed": _histogram(tracks.speed_mps[speeds], SPEED_BINS),
            "headway": _histogram(_headways(placed), HEADWAY_BINS),
            "lateral": _histogram(measured["lateral"].values, LATERAL_BINS),
            "acceleration": _histogram(placed.acceleration_mps2[accelerations], ACCELERATION_BINS),
        },
        fundamental=_fundamental(placed),
        space_time=_space_time(placed, frame.diagram),
        seconds=tracks.seconds,
        street=frame.diagram,
    )


def centres_of(placed: Placed, red: np.ndarray) -> tuple[tuple[str, float], ...]:
    """Mean of the measured vehicles in each channel that differences between drivers are counted in."""
    measured = measure_channels(placed, red)
    found = []
    for base in sorted(set(BASES.values())):
        sums, weights = _by_vehicle(measured[base], placed.tracks.vehicle, len(placed.tracks.ids))
        known = weights > 0
        found.append((base, float(np.mean(sums[known] / weights[known])) if known.any() else 1.0))
    return tuple(found)


def _moved(frame: ConditionFrame, clock_s: float) -> ConditionFrame:
    return replace(frame, begin_s=frame.begin_s + clock_s)


def _tables(
    placed: Placed,
    measured: Mapping[str, Values],
    codes: Mapping[str, tuple[tuple[str, ...], np.ndarray]],
    centres: Mapping[str, float],
) -> tuple[tuple[SummaryColumn, ...], np.ndarray, np.ndarray]:
    vehicle, count = placed.tracks.vehicle, len(placed.tracks.ids)
    columns: list[SummaryColumn] = []
    tables: list[tuple[np.ndarray, np.ndarray]] = []
    whole = {name: _by_vehicle(values, vehicle, count) for name, values in measured.items()}
    for channel in CHANNELS:
        base = BASES.get(channel)
        columns.append(SummaryColumn(channel))
        tables.append(between_drivers(channel, *whole[base], centres[base]) if base else whole[channel])
    for channel, conditions in CONDITIONS_OF.items():
        values = measured[channel]
        for condition in conditions:
            levels, code = codes[condition]
            if not levels:
                continue
            sums, weights = _by_level(values, vehicle, count, code, len(levels))
            for at, level in enumerate(levels):
                columns.append(SummaryColumn(channel, condition, level))
                tables.append((sums[:, at], weights[:, at]))
            if channel == "counts":  # per vehicle, wherever it was
                for at in range(len(levels)):
                    tables[len(tables) - len(levels) + at] = (sums[:, at], whole[channel][1])
    return tuple(columns), np.stack([one for one, _ in tables], 1), np.stack([one for _, one in tables], 1)


def _by_vehicle(values: Values, vehicle: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    who = vehicle[values.rows]
    # Events carry the weight zero and exposure the value zero, so sums of both need no distinction.
    is_event = values.weights == 0
    amount = np.where(is_event, values.values, values.values * values.weights)
    return np.bincount(who, amount, minlength=count), np.bincount(who, values.weights, minlength=count)


def _by_level(
    values: Values, vehicle: np.ndarray, count: int, code: np.ndarray, levels: int
) -> tuple[np.ndarray, np.ndarray]:
    level = code[values.rows]
    good = level >= 0
    key = vehicle[values.rows][good] * levels + level[good]
    weight, value = values.weights[good], values.values[good]
    amount = np.where(weight == 0, value, value * weight)
    size = count * levels
    return (
        np.bincount(key, amount, minlength=size).reshape(count, levels),
        np.bincount(key, weight, minlength=size).reshape(count, levels),
    )


def _headways(placed: Placed) -> np.ndarray:
    speed = placed.tracks.speed_mps
    follows = (placed.gap_m < 60) & (placed.gap_m > 0) & (speed > 2)
    return placed.gap_m[follows] / speed[follows]


def _fundamental(placed: Placed) -> np.ndarray:
    """Density and flow after Edie: time spent and distance travelled over length times duration."""
    tracks = placed.tracks
    edge, names = edge_codes(placed)
    lengths: dict[str, float] = {}
    for lane in placed.network.lanes.values():
        lengths[lane.edge] = lengths.get(lane.edge, 0.0) + lane.length_m
    interval = ((tracks.time_s - tracks.start_s) / _INTERVAL_S).astype(int)
    count = int(interval.max(initial=0)) + 1
    good = edge >= 0
    key = edge[good] * count + interval[good]
    size = len(names) * count
    spent = np.bincount(key, minlength=size) * tracks.step_s
    travelled = np.bincount(key, tracks.speed_mps[good], minlength=size) * tracks.step_s
    last = float(tracks.time_s.max()) - tracks.start_s + tracks.step_s
    duration = np.clip(last - _INTERVAL_S * np.arange(count), 0.0, _INTERVAL_S)
    length = np.array([lengths[name] for name in names])
    area = np.outer(length, duration).ravel()
    used = (spent > 0) & np.outer(length > _SHORTEST_STREET_M, duration >= min(_SHORTEST_INTERVAL_S, last)).ravel()
    return np.column_stack([spent[used] / area[used] * 1000, travelled[used] / area[used] * 3600])


def _space_time(placed: Placed, street: str) -> np.ndarray:
    tracks = placed.tracks
    edge, names = edge_codes(placed)
    if street not in names:
        return np.zeros((0, 3))
    every = max(1, round(_DIAGRAM_S / max(tracks.step_s, 1e-3)))
    rows = np.flatnonzero(edge == names.index(street))[::every]
    return np.column_stack([tracks.vehicle[rows], tracks.time_s[rows] - tracks.start_s, placed.along_m[rows]])


def _histogram(values: np.ndarray, bins: np.ndarray) -> np.ndarray:
    cell = np.clip(np.searchsorted(bins, values, side="right"), 0, len(bins))
    return np.bincount(cell, minlength=len(bins) + 1).astype(float)
