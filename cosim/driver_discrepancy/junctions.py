"""Channels of junctions: gap acceptance, entries at red, turns, U-turns, streets entered."""

from __future__ import annotations

import numpy as np

from cosim.driver_discrepancy.placed import Placed
from cosim.driver_discrepancy.values import RESTS_MPS, Values, inside_entries, street_entries

_LONGEST_GAP_S = 10.0
_WAITS_M = 15.0  # before a junction, from which a vehicle looks for a gap
_NEAR_M = 30.0  # before a junction, where a vehicle without priority may have to stop


def measure_junctions(placed: Placed, red: np.ndarray, planned: frozenset[tuple[str, str]]) -> dict[str, Values]:
    """Values of all channels of junctions; see `measure_channels` for the arguments."""
    entries = _yielding_entries(placed)
    return {
        "accepted_gap": _accepted_gap(placed, entries),
        "rejected_gap": _rejected_gap(placed, entries),
        "yielding": _yielding(placed),
        "red_entries": _red_entries(placed, red),
        "u_turns": _u_turns(placed, planned),
        "counts": _counts(placed),
        "left_turns": _turns(placed, "lL"),
        "right_turns": _turns(placed, "rR"),
    }


def _accepted_gap(placed: Placed, entries: list[tuple[int, np.ndarray]]) -> Values:
    """Time until a vehicle with priority enters the junction after one that had to yield to it did; limited."""
    rows = np.array([row for row, _ in entries], int)
    time_s = placed.tracks.time_s[rows]
    gaps = [_next_time(foes, now) - now for (_, foes), now in zip(entries, time_s.tolist(), strict=True)]
    return Values(rows, np.minimum(gaps, _LONGEST_GAP_S), np.ones(len(rows)))


def _rejected_gap(placed: Placed, entries: list[tuple[int, np.ndarray]]) -> Values:
    """Times between vehicles with priority that enter the junction while the first vehicle of a minor lane waits.

    The first gap starts when the vehicle is the first of its lane and near the junction (a lag; Raff and Hart 1950).
    """
    tracks = placed.tracks
    first_of_lane = (placed.leader < 0) & (placed.ends_m < _WAITS_M) & placed.on & ~placed.parked
    starts = np.concatenate([[True], (np.diff(tracks.vehicle) != 0) | (np.diff(placed.code) != 0)])
    begin = np.maximum.accumulate(np.where(starts, np.arange(len(tracks)), 0))
    rows, gaps = [], []
    for row, foes in entries:
        waits = np.flatnonzero(first_of_lane[begin[row - 1] : row])
        if not len(waits):
            continue
        since = float(tracks.time_s[begin[row - 1] + waits[0]])
        passed = foes[(foes > since) & (foes <= tracks.time_s[row])]
        rejected = np.diff(passed, prepend=since)
        rows += [row] * len(rejected)
        gaps += np.minimum(rejected, _LONGEST_GAP_S).tolist()
    return Values(np.array(rows, int), np.array(gaps, float), np.ones(len(rows)))


def _yielding_entries(placed: Placed) -> list[tuple[int, np.ndarray]]:
    """Samples with which vehicles enter a junction where they yield, and the times of entries with priority."""
    entries = inside_entries(placed)
    lane = [placed.lanes[code] for code in placed.code[entries].tolist()]
    by_lane: dict[str, list[float]] = {}
    for name, time_s in zip(lane, placed.tracks.time_s[entries].tolist(), strict=True):
        by_lane.setdefault(name, []).append(time_s)
    foes = {
        name: np.sort(np.concatenate([by_lane[foe] for foe in found if foe in by_lane] or [np.zeros(0)]))
        for name in by_lane
        if (found := placed.network.yields_to.get(name, ()))
    }
    return [(row, foes[name]) for row, name in zip(entries.tolist(), lane, strict=True) if name in foes]


def _next_time(times: np.ndarray, after_s: float) -> float:
    at = int(np.searchsorted(times, after_s, side="right"))
    return float(times[at]) if at < len(times) else np.inf


def _yielding(placed: Placed) -> Values:
    links = placed.network.links
    minor = {name for name, found in links.items() if any(not link.signal and not link.has_priority for link in found)}
    on = placed.of_lane(lambda name, _: float(name in minor)) > 0
    near = on & placed.on & ~placed.parked & (placed.ends_m < _NEAR_M)
    return Values.at(near, (placed.tracks.speed_mps < RESTS_MPS).astype(float))


def _u_turns(placed: Placed, planned: frozenset[tuple[str, str]]) -> Values:
    rows, edges = street_entries(placed)
    network, vehicle = placed.network, placed.tracks.vehicle
    turned = [
        rows[i]
        for i in range(1, len(rows))
        if vehicle[rows[i]] == vehicle[rows[i - 1]]
        and network.back.get(edges[i - 1]) == edges[i]
        and (placed.tracks.ids[vehicle[rows[i]]], edges[i - 1]) not in planned
        and bool({*network.onward.get(edges[i - 1], ())} - {edges[i]})
    ]
    return Values.per_exposure(np.array(turned, int), placed.on & ~placed.parked, placed.tracks.step_s / 3600)


def _red_entries(placed: Placed, red: np.ndarray) -> Values:
    tracks = placed.tracks
    signalled = {name for name, links in placed.network.links.items() if any(link.signal for link in links)}
    on = placed.of_lane(lambda name, _: float(name in signalled)) > 0
    rows = np.flatnonzero(on[:-1] & (np.diff(tracks.vehicle) == 0) & (np.diff(placed.code) != 0))
    inside = np.array([placed.lanes[placed.code[row + 1]][:1] == ":" for row in rows.tolist()], bool)
    rows = rows[inside] if len(rows) else rows
    return Values(rows, red[rows].astype(float), np.ones(len(rows)))


def _counts(placed: Placed) -> Values:
    rows, _ = street_entries(placed)
    first = np.searchsorted(placed.tracks.vehicle, np.arange(len(placed.tracks.ids)))
    return Values(
        np.concatenate([rows, first]),
        np.concatenate([np.ones(len(rows)), np.zeros(len(first))]),
        np.concatenate([np.zeros(len(rows)), np.ones(len(first))]),
    )


def _turns(placed: Placed, letters: str) -> Values:
    """Share of entries into junctions that turn; `letters` of SUMO's directions."""
    ways = {link.via: link.direction for links in placed.network.links.values() for link in links if link.via}
    rows = inside_entries(placed)
    rows = rows[[placed.lanes[code] in ways for code in placed.code[rows].tolist()]] if len(rows) else rows
    turned = [float(ways[placed.lanes[code]] in letters) for code in placed.code[rows].tolist()]
    return Values(rows, np.array(turned, float), np.ones(len(rows)))
