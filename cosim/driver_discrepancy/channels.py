"""Channels of driving behaviour: each gives values at samples or events, whose weighted mean is the statistic.

All statistics are ratios of sums, so that they can be restricted to a street, a time or a class of vehicles, and
attributed to single vehicles.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from cosim.driver_discrepancy.placed import Placed

MOVES_MPS, RESTS_MPS = 0.5, 0.1
_FREE_M, _FREE_S = 40.0, 4.0
_CLEAR_OF_ENDS_M = 12.0
_QUEUE_M = 8.0
_CHANGING_LANES_M = 0.8
_LONGEST_LAG_S, _LONGEST_GAP_S = 5.0, 10.0
_WAITS_M = 15.0  # before a junction, from which a vehicle looks for a gap
_LANE_CHANGE_S = 2.0
_FLOW_MPS2 = 1.0
_FAST, _SLOW = 1.12, 0.88  # limits of the shares of fast and slow drivers, of the mean free speed
_BENDS_RAD = 0.4
_NEW_MPS2 = 0.12  # change of the acceleration that shows a decision


@dataclass(frozen=True, eq=False)
class Values:
    """Values of a channel.

    Attributes:
        rows: (m,) samples at which they were taken.
        values: (m,) in the channel's unit.
        weights: (m,) exposure; for events per exposure, values are counts of weight 0 and exposure has value 0.
    """

    rows: np.ndarray
    values: np.ndarray
    weights: np.ndarray

    @classmethod
    def at(cls, chosen: np.ndarray, values: np.ndarray, weights: np.ndarray | float = 1.0) -> Values:
        """Those of a mask (n,) of samples."""
        rows = np.flatnonzero(chosen & np.isfinite(values))
        weight = np.broadcast_to(np.asarray(weights, float), values.shape)[rows]
        return cls(rows, values[rows], weight)

    @classmethod
    def per_exposure(cls, events: np.ndarray, exposed: np.ndarray, each: float) -> Values:
        """Events (rows) per exposure: so much for each sample of a mask."""
        rows = np.flatnonzero(exposed)
        return cls(
            np.concatenate([events, rows]),
            np.concatenate([np.ones(len(events)), np.zeros(len(rows))]),
            np.concatenate([np.zeros(len(events)), np.full(len(rows), each)]),
        )


@dataclass(frozen=True)
class Channel:
    """A channel.

    Attributes:
        group: the channel of the error that it belongs to.
        unit: of its values.
        scale: difference that counts one in the error.
        resolution: differences so small are not attributed to drivers.
        words: description on pages.
        is_event: counted by vehicle in the error, instead of averaged.
    """

    group: str
    unit: str
    scale: float
    resolution: float
    words: str
    is_event: bool = False


CHANNELS: dict[str, Channel] = {
    "speed": Channel("speed", "of the limit", 0.1, 0.01, "speed when moving"),
    "free_speed": Channel("speed", "of the limit", 0.05, 0.01, "speed without a leader"),
    "free_speed_spread": Channel("speed", "of the limit²", 0.005, 0.001, "spread of the free speed between drivers"),
    "slow_drivers": Channel("speed", "", 0.2, 0.02, "share of drivers far below the mean free speed"),
    "fast_drivers": Channel("speed", "", 0.2, 0.02, "share of drivers far above the mean free speed"),
    "bend_speed": Channel("speed", "m/s", 0.5, 0.12, "speed in bends"),
    "acceleration": Channel("acceleration", "m/s²", 0.2, 0.05, "acceleration on a free road"),
    "deceleration": Channel("deceleration", "m/s²", 0.3, 0.08, "deceleration when braking"),
    "jerk": Channel("jerk", "m/s³", 1.0, 0.15, "change of the acceleration"),
    "unsteadiness": Channel("jerk", "m/s²", 0.2, 0.04, "change of the acceleration when cruising"),
    "headway": Channel("headway", "s", 0.3, 0.06, "time headway when following"),
    "space_headway": Channel("headway", "m", 3.0, 0.5, "distance to the leader"),
    "standing_gap": Channel("standing_gap", "m", 0.3, 0.08, "gap to the leader in a queue"),
    "startup_lag": Channel("startup_lag", "s", 0.4, 0.1, "delay behind the leader when a queue starts"),
    "acceleration_memory": Channel("reaction", "", 0.2, 0.03, "acceleration left after 0.4 s"),
    "acceleration_memory_1s": Channel("reaction", "", 0.2, 0.03, "acceleration left after 1 s"),
    "follower_response": Channel("reaction", "", 0.3, 0.08, "response to the leader's acceleration after 1 s"),
    "decisions": Channel("reaction", "", 0.2, 0.004, "share of time steps with a new acceleration"),
    "lateral": Channel("lateral", "m", 0.05, 0.012, "lateral position in the lane, to the left"),
    "lateral_spread": Channel("lateral", "m²", 0.005, 0.001, "spread of the lateral position between drivers"),
    "lateral_motion": Channel("lateral", "m/s", 0.05, 0.01, "lateral speed in the lane"),
    "lane_changes_speed": Channel("lane_changes", "/min", 0.3, 0.1, "lane changes past a slow leader", True),
    "lane_changes_right": Channel("lane_changes", "/min", 0.3, 0.1, "lane changes to the right", True),
    "lane_changes_route": Channel("lane_changes", "/min", 0.3, 0.1, "lane changes before a turn", True),
    "lane_changes_other": Channel("lane_changes", "/min", 0.3, 0.1, "lane changes without a reason", True),
    "accepted_gap": Channel("gap_acceptance", "s", 1.0, 0.2, "accepted gap in the major stream, 10 s at most"),
    "rejected_gap": Channel("gap_acceptance", "s", 1.0, 0.2, "rejected gap in the major stream, 10 s at most"),
    "yielding": Channel("gap_acceptance", "", 0.2, 0.02, "share of time standing before a junction without priority"),
    "u_turns": Channel("u_turns", "/h", 0.3, 0.0, "U-turns", True),
    "pull_outs": Channel("pull_outs", "/h", 0.3, 0.0, "pull-outs of parked vehicles", True),
    "stops": Channel("stops", "/min", 0.5, 0.1, "stops", True),
    "standing": Channel("stops", "", 0.1, 0.015, "share of time standing"),
    "red_entries": Channel("signals", "", 0.1, 0.02, "share of vehicles that enter a junction at red"),
    "counts": Channel("counts", "/vehicle", 1.0, 0.02, "streets entered", True),
    "left_turns": Channel("counts", "", 0.3, 0.02, "share of left turns"),
    "right_turns": Channel("counts", "", 0.3, 0.02, "share of right turns"),
}
"""The dictionary's channels."""


def measure_channels(
    placed: Placed, red: np.ndarray, planned: frozenset[tuple[str, str]] = frozenset()
) -> dict[str, Values]:
    """Values of all channels that are sampled; those about differences between drivers follow from vehicles' means.

    Args:
        placed: trajectories on their network.
        red: (n,) whether the link ahead shows red; from `signals`.
    """
    found = {name: function(placed) for name, function in _FUNCTIONS.items()}
    return found | {"red_entries": _red_entries(placed, red), "u_turns": _u_turns(placed, planned)}


def between_drivers(name: str, sums: np.ndarray, weights: np.ndarray, centre: float) -> tuple[np.ndarray, np.ndarray]:
    """A channel about differences between drivers, from the sums and weights (v,) of its base channel.

    Args:
        name: `free_speed_spread`, `slow_drivers`, `fast_drivers` or `lateral_spread`.
        sums, weights: of `BASES[name]`.
        centre: mean over measured drivers, about which differences are counted.
    """
    counts = weights > 0
    mean = np.divide(sums, weights, out=np.full(len(sums), centre), where=counts)
    value = {
        "free_speed_spread": np.minimum((mean - centre) ** 2, 0.25),
        "lateral_spread": np.minimum((mean - centre) ** 2, 0.25),
        "slow_drivers": (mean < _SLOW * centre).astype(float),
        "fast_drivers": (mean > _FAST * centre).astype(float),
    }[name]
    return np.where(counts, value, 0.0), counts.astype(float)


BASES = {
    "free_speed_spread": "free_speed",
    "slow_drivers": "free_speed",
    "fast_drivers": "free_speed",
    "lateral_spread": "lateral",
}


def _speed(placed: Placed) -> Values:
    share = placed.tracks.speed_mps / placed.limit_mps
    return Values.at(_street(placed) & (placed.tracks.speed_mps > MOVES_MPS), np.minimum(share, 3))


def _free_speed(placed: Placed) -> Values:
    tracks = placed.tracks
    free = placed.free_lane & ~placed.parked & (tracks.speed_mps > 0.4 * placed.limit_mps) & _is_free(placed)
    free &= (placed.along_m > _CLEAR_OF_ENDS_M) & (placed.ends_m > 2 * _CLEAR_OF_ENDS_M)
    free &= np.abs(_smooth_acceleration(placed)) < 0.35
    return Values.at(free, np.minimum(tracks.speed_mps / placed.limit_mps, 3))


def _bend_speed(placed: Placed) -> Values:
    turn = placed.of_lane(lambda _, lane: _turned_rad(lane.shape))
    bends = placed.on & (np.nan_to_num(turn) > _BENDS_RAD) & (placed.gap_m > 15) & (placed.tracks.speed_mps > 1.5)
    return Values.at(bends, placed.tracks.speed_mps)


def _acceleration(placed: Placed) -> Values:
    a, speed = placed.acceleration_mps2, placed.tracks.speed_mps
    with np.errstate(invalid="ignore"):
        chosen = placed.on & (a > 0.3) & (a < 8) & (speed > 1) & (speed < 0.7 * placed.limit_mps)
    return Values.at(chosen & (placed.gap_m > 25) & (placed.ends_m > 25), a)


def _deceleration(placed: Placed) -> Values:
    a = placed.acceleration_mps2
    with np.errstate(invalid="ignore"):
        return Values.at(placed.on & (a < -0.8) & (a > -12) & (placed.tracks.speed_mps > 1.5), -a)


def _jerk(placed: Placed) -> Values:
    jump = _jump(placed) / max(placed.tracks.step_s, 1e-3)
    return Values.at(placed.on & (placed.tracks.speed_mps > 2), np.minimum(np.abs(jump), 40))


def _unsteadiness(placed: Placed) -> Values:
    tracks, a = placed.tracks, placed.acceleration_mps2
    cruises = placed.free_lane & (tracks.speed_mps > 0.7 * placed.limit_mps) & (placed.gap_m > _FREE_M)
    cruises &= (placed.ends_m > 2 * _CLEAR_OF_ENDS_M) & (np.abs(np.nan_to_num(a, nan=9.0)) < _FLOW_MPS2)
    cruises &= np.abs(_smooth_acceleration(placed)) < 0.3
    return Values.at(cruises, np.abs(_jump(placed)))


def _headway(placed: Placed) -> Values:
    speed, leader = placed.tracks.speed_mps, placed.leader
    follows = (leader >= 0) & (speed > 4) & (placed.gap_m > 0) & (placed.gap_m < 3.0 * speed)
    follows &= np.abs(speed - speed[np.maximum(leader, 0)]) < 0.8
    follows &= np.abs(np.nan_to_num(placed.acceleration_mps2, nan=9.0)) < _FLOW_MPS2
    return Values.at(follows, placed.gap_m / np.maximum(speed, 1.0))


def _space_headway(placed: Placed) -> Values:
    follows = (placed.leader >= 0) & (placed.gap_m < 60) & (placed.gap_m > 0) & (placed.tracks.speed_mps > 2)
    return Values.at(follows, placed.gap_m)


def _standing_gap(placed: Placed) -> Values:
    speed, leader = placed.tracks.speed_mps, placed.leader
    stands = (leader >= 0) & (speed < RESTS_MPS) & (placed.gap_m < _QUEUE_M) & (placed.gap_m > -0.5)
    stands &= (speed[np.maximum(leader, 0)] < RESTS_MPS) & (np.abs(placed.left_m) < _CHANGING_LANES_M)
    return Values.at(stands, placed.gap_m)


def _startup_lag(placed: Placed) -> Values:
    tracks = placed.tracks
    speed, time_s = tracks.speed_mps, tracks.time_s
    same = np.diff(tracks.vehicle) == 0
    sets_off = np.flatnonzero(same & (speed[:-1] < MOVES_MPS) & (speed[1:] >= MOVES_MPS) & ~placed.parked[1:])
    starts: dict[int, list[float]] = {}
    for row in sets_off.tolist():
        starts.setdefault(int(tracks.vehicle[row]), []).append(float(time_s[row]))
    rows, lags = [], []
    for row in sets_off.tolist():
        rest = _last_rest(placed, row)
        if rest < 0:
            continue
        leader = int(tracks.vehicle[placed.leader[rest]])
        before = [then for then in starts.get(leader, ()) if then <= time_s[row]]
        if before and time_s[row] - before[-1] < _LONGEST_LAG_S:
            rows.append(row)
            lags.append(time_s[row] - before[-1])
    return Values(np.array(rows, int), np.array(lags, float), np.ones(len(rows)))


def _memory(lag_s: float) -> Callable[[Placed], Values]:
    def measure(placed: Placed) -> Values:
        tracks, a = placed.tracks, placed.acceleration_mps2
        lag = max(1, round(lag_s / max(tracks.step_s, 1e-3)))
        now, then = a[:-lag], a[lag:]
        both = (tracks.vehicle[:-lag] == tracks.vehicle[lag:]) & np.isfinite(now) & np.isfinite(then)
        both &= (tracks.speed_mps[:-lag] > 2) & (np.abs(now) < 5) & (np.abs(then) < 5) & placed.on[:-lag]
        rows = np.flatnonzero(both & (now**2 > 1e-4))
        return Values(rows, then[rows] / now[rows], now[rows] ** 2)

    return measure


def _follower_response(placed: Placed) -> Values:
    tracks, a = placed.tracks, placed.acceleration_mps2
    rows = np.flatnonzero((placed.leader >= 0) & (placed.gap_m < 35) & (tracks.speed_mps > 2))
    ahead = a[placed.leader[rows]]
    then = np.minimum(rows + round(1.0 / max(tracks.step_s, 1e-3)), len(tracks) - 1)
    good = np.isfinite(ahead) & np.isfinite(a[then]) & (tracks.vehicle[then] == tracks.vehicle[rows])
    good &= (np.abs(ahead) > 0.2) & (np.abs(ahead) < 5) & (np.abs(a[then]) < 5)
    rows, ahead, then = rows[good], ahead[good], then[good]
    return Values(rows, a[then] / ahead, ahead**2)


def _decisions(placed: Placed) -> Values:
    jump = _jump(placed)
    moves = placed.on & (placed.tracks.speed_mps > 2) & np.isfinite(jump)
    return Values.at(moves, (np.abs(jump) > _NEW_MPS2).astype(float))


def _lateral(placed: Placed) -> Values:
    return Values.at(keeps_lane(placed), placed.left_m)


def _lateral_motion(placed: Placed) -> Values:
    lag = max(1, round(0.5 / max(placed.tracks.step_s, 1e-3)))
    motion = np.full(len(placed.tracks), np.nan)
    same = (placed.tracks.vehicle[lag:] == placed.tracks.vehicle[:-lag]) & (placed.code[lag:] == placed.code[:-lag])
    apart = np.abs(placed.left_m[lag:] - placed.left_m[:-lag]) / (lag * max(placed.tracks.step_s, 1e-3))
    motion[:-lag] = np.where(same, apart, np.nan)
    return Values.at(keeps_lane(placed), np.minimum(motion, 2.0))


def _lane_changes(reason: str) -> Callable[[Placed], Values]:
    def measure(placed: Placed) -> Values:
        rows = changes_of_lane(placed)
        drives = _several_lanes(placed) & ~placed.parked & (placed.tracks.speed_mps > MOVES_MPS)
        chosen = rows[_reasons(placed, rows) == reason]
        return Values.per_exposure(chosen, drives, placed.tracks.step_s / 60)

    return measure


def changes_of_lane(placed: Placed) -> np.ndarray:
    """Last samples on the old lane, of changes between lanes of the same edge."""
    tracks, lanes = placed.tracks, placed.network.lanes
    rows = np.flatnonzero((np.diff(tracks.vehicle) == 0) & (np.diff(placed.code) != 0))
    rows = rows[placed.on[rows] & placed.on[rows + 1] & ~placed.parked[rows]]
    same = [
        not lanes[placed.lanes[placed.code[row]]].inside
        and lanes[placed.lanes[placed.code[row]]].edge == lanes[placed.lanes[placed.code[row + 1]]].edge
        for row in rows.tolist()
    ]
    return rows[np.array(same, bool)] if len(rows) else rows


def _reasons(placed: Placed, rows: np.ndarray) -> np.ndarray:
    """Reason of each change of lane: `route`, `speed`, `right` or `other`, in this order of precedence."""
    tracks, network = placed.tracks, placed.network
    nexts = _next_edges(placed)
    reasons = []
    for row in rows.tolist():
        old, new = (network.lanes[placed.lanes[placed.code[at]]] for at in (row, row + 1))
        reaches = {network.lanes[link.target].edge for link in network.links.get(old.id, ())}
        leader = int(placed.leader[row])
        slow = leader >= 0 and placed.gap_m[row] < 60 and tracks.speed_mps[leader] < 0.9 * old.limit_mps
        if nexts[row] and nexts[row] not in reaches:
            reasons.append("route")
        elif slow:
            reasons.append("speed")
        else:
            reasons.append("right" if new.index < old.index else "other")
    return np.array(reasons, dtype=object)


def _next_edges(placed: Placed) -> np.ndarray:
    """Edge that each sample's vehicle goes to after the present one; empty at the end."""
    lanes = placed.network.lanes
    edges = [lanes[name].edge if name in lanes and not lanes[name].inside else "" for name in placed.lanes]
    names = sorted(set(edges) - {""})
    number = {name: at for at, name in enumerate(names)}
    code = np.array([number.get(edge, -1) for edge in edges], int)[placed.code]
    found = np.full(len(code), "", dtype=object)
    rows = np.flatnonzero(code >= 0)
    if not len(rows):
        return found
    new = np.ones(len(rows), bool)
    new[1:] = (code[rows][1:] != code[rows][:-1]) | (np.diff(placed.tracks.vehicle[rows]) != 0)
    begin = np.flatnonzero(new)
    following = np.append(begin[1:], len(rows) - 1)
    visit = np.cumsum(new) - 1
    after = rows[following[visit]]
    same = (placed.tracks.vehicle[after] == placed.tracks.vehicle[rows]) & (code[after] != code[rows])
    found[rows[same]] = np.array(names, dtype=object)[code[after[same]]]
    return found


def _accepted_gap(placed: Placed) -> Values:
    """Time until a vehicle with priority enters the junction after one that had to yield to it did; limited."""
    entries = _yielding_entries(placed)
    rows = np.array([row for row, _ in entries], int)
    time_s = placed.tracks.time_s[rows]
    gaps = [_next_time(foes, now) - now for (_, foes), now in zip(entries, time_s.tolist(), strict=True)]
    return Values(rows, np.minimum(gaps, _LONGEST_GAP_S), np.ones(len(rows)))


def _rejected_gap(placed: Placed) -> Values:
    """Times between vehicles with priority that enter the junction while the first vehicle of a minor lane waits.

    The first gap starts when the vehicle is the first of its lane and near the junction (a lag; Raff and Hart 1950).
    """
    tracks = placed.tracks
    first_of_lane = (placed.leader < 0) & (placed.ends_m < _WAITS_M) & placed.on & ~placed.parked
    starts = np.concatenate([[True], (np.diff(tracks.vehicle) != 0) | (np.diff(placed.code) != 0)])
    begin = np.maximum.accumulate(np.where(starts, np.arange(len(tracks)), 0))
    rows, gaps = [], []
    for row, foes in _yielding_entries(placed):
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
    near = on & placed.on & ~placed.parked & (placed.ends_m < 30)
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


def _pull_outs(placed: Placed) -> Values:
    tracks = placed.tracks
    first = np.searchsorted(tracks.vehicle, np.arange(len(tracks.ids)))
    begins = placed.parked[first]
    moves = placed.on & ~placed.parked & (tracks.speed_mps > 1.0)
    left = np.bincount(tracks.vehicle[moves], minlength=len(first)) > 0
    hours = max(tracks.seconds, 1.0) / 3600
    rows = first[begins]
    return Values(
        np.concatenate([first[begins & left], rows]),
        np.concatenate([np.ones(int((begins & left).sum())), np.zeros(len(rows))]),
        np.concatenate([np.zeros(int((begins & left).sum())), np.full(len(rows), hours)]),
    )


def _stops(placed: Placed) -> Values:
    speed = placed.tracks.speed_mps
    begins = (np.diff(placed.tracks.vehicle) == 0) & (speed[:-1] >= MOVES_MPS) & (speed[1:] < MOVES_MPS)
    rows = np.flatnonzero(begins & _street(placed)[1:]) + 1
    return Values.per_exposure(rows, _street(placed), placed.tracks.step_s / 60)


def _standing(placed: Placed) -> Values:
    return Values.at(_street(placed), (placed.tracks.speed_mps < RESTS_MPS).astype(float))


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


def _turns(letters: str) -> Callable[[Placed], Values]:
    def measure(placed: Placed) -> Values:
        ways = {link.via: link.direction for links in placed.network.links.values() for link in links if link.via}
        rows = inside_entries(placed)
        rows = rows[[placed.lanes[code] in ways for code in placed.code[rows].tolist()]] if len(rows) else rows
        turned = [float(ways[placed.lanes[code]] in letters) for code in placed.code[rows].tolist()]
        return Values(rows, np.array(turned, float), np.ones(len(rows)))

    return measure


def street_entries(placed: Placed) -> tuple[np.ndarray, list[str]]:
    """Samples (m,) with which vehicles enter an edge outside junctions, and those edges."""
    lanes = placed.network.lanes
    edge_of = [lanes[name].edge if name in lanes and not lanes[name].inside else "" for name in placed.lanes]
    number = {edge: at for at, edge in enumerate(sorted(set(edge_of)))}
    code = np.array([number[edge] if edge else -1 for edge in edge_of], int)[placed.code]
    rows = np.flatnonzero((code >= 0) & ~placed.parked)
    new = np.ones(len(rows), bool)
    new[1:] = (np.diff(placed.tracks.vehicle[rows]) != 0) | (np.diff(code[rows]) != 0)
    rows = rows[new]
    return rows, [edge_of[at] for at in placed.code[rows].tolist()]


def inside_entries(placed: Placed) -> np.ndarray:
    """Samples with which vehicles enter a lane inside a junction."""
    inside = placed.of_lane(lambda _, lane: float(lane.inside)) > 0
    rows = np.flatnonzero(inside)
    rows = rows[rows > 0]
    new = (placed.code[rows] != placed.code[rows - 1]) & (
        placed.tracks.vehicle[rows] == placed.tracks.vehicle[rows - 1]
    )
    return rows[new]


def keeps_lane(placed: Placed) -> np.ndarray:
    """Samples (n,) that move along a straight lane and neither change it nor are near its ends."""
    tracks = placed.tracks
    keeps = placed.free_lane & ~placed.parked & (tracks.speed_mps > 3) & (np.abs(placed.left_m) < 1.2)
    keeps &= (placed.along_m > _CLEAR_OF_ENDS_M) & (placed.ends_m > _CLEAR_OF_ENDS_M)
    changed = (np.diff(tracks.vehicle) == 0) & (np.diff(placed.code) != 0)
    near = round(_LANE_CHANGE_S / max(tracks.step_s, 1e-3))
    for row in np.flatnonzero(changed).tolist():
        keeps[max(row - near, 0) : row + near] = False
    return keeps


def _street(placed: Placed) -> np.ndarray:
    return placed.on & ~placed.parked & (placed.of_lane(lambda _, lane: float(lane.inside)) == 0)


def _several_lanes(placed: Placed) -> np.ndarray:
    counts: dict[str, int] = {}
    for lane in placed.network.lanes.values():
        counts[lane.edge] = counts.get(lane.edge, 0) + 1
    return placed.of_lane(lambda _, lane: float(not lane.inside and counts[lane.edge] > 1)) > 0


def _is_free(placed: Placed) -> np.ndarray:
    return (placed.gap_m > _FREE_M) | (placed.gap_m > _FREE_S * placed.tracks.speed_mps)


def _smooth_acceleration(placed: Placed) -> np.ndarray:
    """Change of speed over the second around a sample [m/s²]; NaN at a vehicle's ends."""
    tracks, half = placed.tracks, max(1, round(0.5 / max(placed.tracks.step_s, 1e-3)))
    found = np.full(len(tracks), np.nan)
    if len(tracks) > 2 * half:
        same = tracks.vehicle[2 * half :] == tracks.vehicle[: -2 * half]
        lasts = tracks.time_s[2 * half :] - tracks.time_s[: -2 * half]
        change = (tracks.speed_mps[2 * half :] - tracks.speed_mps[: -2 * half]) / np.maximum(lasts, 1e-3)
        found[half:-half] = np.where(same, change, np.nan)
    return found


def _jump(placed: Placed) -> np.ndarray:
    jump = np.full(len(placed.tracks), np.nan)
    jump[:-1] = np.where(np.diff(placed.tracks.vehicle) == 0, np.diff(placed.acceleration_mps2), np.nan)
    return jump


def _turned_rad(shape: np.ndarray) -> float:
    piece = np.diff(shape, axis=0)
    heading = np.unwrap(np.arctan2(piece[:, 1], piece[:, 0]))
    return float(np.ptp(heading)) if len(heading) > 1 else 0.0


def _last_rest(placed: Placed, row: int) -> int:
    """The latest sample within 5 s before one at which a vehicle was at rest behind a leader; −1 without one."""
    tracks = placed.tracks
    for before in range(row, max(row - round(_LONGEST_LAG_S / max(tracks.step_s, 1e-3)), -1), -1):
        if tracks.vehicle[before] != tracks.vehicle[row]:
            return -1
        if tracks.speed_mps[before] < RESTS_MPS and placed.leader[before] >= 0:
            leader_rests = tracks.speed_mps[placed.leader[before]] < RESTS_MPS
            if placed.gap_m[before] < _QUEUE_M and leader_rests:
                return before
    return -1


_FUNCTIONS: Mapping[str, Callable[[Placed], Values]] = {
    "speed": _speed,
    "free_speed": _free_speed,
    "bend_speed": _bend_speed,
    "acceleration": _acceleration,
    "deceleration": _deceleration,
    "jerk": _jerk,
    "unsteadiness": _unsteadiness,
    "headway": _headway,
    "space_headway": _space_headway,
    "standing_gap": _standing_gap,
    "startup_lag": _startup_lag,
    "acceleration_memory": _memory(0.4),
    "acceleration_memory_1s": _memory(1.0),
    "follower_response": _follower_response,
    "decisions": _decisions,
    "lateral": _lateral,
    "lateral_motion": _lateral_motion,
    "lane_changes_speed": _lane_changes("speed"),
    "lane_changes_right": _lane_changes("right"),
    "lane_changes_route": _lane_changes("route"),
    "lane_changes_other": _lane_changes("other"),
    "accepted_gap": _accepted_gap,
    "rejected_gap": _rejected_gap,
    "yielding": _yielding,
    "pull_outs": _pull_outs,
    "stops": _stops,
    "standing": _standing,
    "counts": _counts,
    "left_turns": _turns("lL"),
    "right_turns": _turns("rR"),
}
