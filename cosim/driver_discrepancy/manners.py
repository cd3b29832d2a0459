"""How one drives, measured: each function gives sums and weights (v,) whose ratio is a vehicle's value."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cosim.driver_discrepancy.placed import Placed

Parts = tuple[np.ndarray, np.ndarray]
_MOVES_MPS, _RESTS_MPS = 0.5, 0.1
_FREE_M, _FREE_S = 40.0, 4.0
_CLEAR_OF_ENDS_M = 12.0
_QUEUE_M = 8.0
_ASIDE_M = 0.8  # who stands farther from the middle is changing lanes
_LONGEST_LAG_S = 5.0
_MEMORY_S = 0.4
_HOLDS_S = 2.0  # around a change of lane the place beside its middle means nothing
_FLOW_MPS2 = 1.0
_STEADY_MPS = 0.3  # change of a cruising speed within a second


def speeds(placed: Placed) -> tuple[np.ndarray, np.ndarray]:
    """Rows of samples that move, and their speeds."""
    rows = np.flatnonzero(placed.on & (placed.tracks.speed_mps > _MOVES_MPS))
    return rows, placed.tracks.speed_mps[rows]


def headways(placed: Placed) -> tuple[np.ndarray, np.ndarray]:
    """Rows of samples that follow, and their time headways [s]."""
    speed = placed.tracks.speed_mps
    rows = np.flatnonzero((placed.gap_m < 60) & (placed.gap_m > 0) & (speed > 2))
    return rows, placed.gap_m[rows] / speed[rows]


def laterals(placed: Placed) -> tuple[np.ndarray, np.ndarray]:
    """Rows of samples that keep their lane, and how far they are to the left of its middle [m]."""
    rows = np.flatnonzero(_keeps_lane(placed))
    return rows, placed.left_m[rows]


def free_speed(placed: Placed) -> Parts:
    """Share of the limit that a driver reaches where nothing holds him up: the upper decile of his free samples."""
    tracks = placed.tracks
    free = placed.free_lane & ~placed.parked & (tracks.speed_mps > 0.4 * placed.limit_mps)
    free &= (placed.gap_m > _FREE_M) | (placed.gap_m > _FREE_S * tracks.speed_mps)
    free &= (placed.along_m > _CLEAR_OF_ENDS_M) & (placed.ends_m > _CLEAR_OF_ENDS_M)
    return _per_vehicle(placed, free, tracks.speed_mps / placed.limit_mps, lambda x: float(np.quantile(x, 0.9)), 2.0, 1)


def standing_gap(placed: Placed) -> Parts:
    """Gap to the leader when both stand [m]."""
    speed, leader = placed.tracks.speed_mps, placed.leader
    stands = (leader >= 0) & (speed < _RESTS_MPS) & (placed.gap_m < _QUEUE_M) & (placed.gap_m > -0.5)
    stands &= (speed[np.maximum(leader, 0)] < _RESTS_MPS) & (np.abs(placed.left_m) < _ASIDE_M)
    return _per_vehicle(placed, stands, placed.gap_m, lambda x: float(np.median(x)), 1.0, 1)


def headway(placed: Placed) -> Parts:
    """Time headway to the leader at about his speed [s]."""
    speed, leader = placed.tracks.speed_mps, placed.leader
    follows = (leader >= 0) & (speed > 4) & (placed.gap_m > 0) & (placed.gap_m < 3.0 * speed)
    follows &= np.abs(speed - speed[np.maximum(leader, 0)]) < 0.8
    follows &= np.abs(np.nan_to_num(placed.acceleration_mps2, nan=9.0)) < _FLOW_MPS2
    value = placed.gap_m / np.maximum(speed, 1.0)
    return _per_vehicle(placed, follows, value, lambda x: float(np.median(x)), 1.0, 5)


def lateral(placed: Placed) -> Parts:
    """Place beside the lane's middle, positive to the left [m]."""
    return _per_vehicle(placed, _keeps_lane(placed), placed.left_m, lambda x: float(np.median(x)), 1.0, 5)


def lane_changes(placed: Placed) -> Parts:
    """Changes of lane on a road, a minute of driving on roads of several lanes."""
    tracks, network = placed.tracks, placed.network
    info = {name: network.lanes.get(name) for name in np.unique(tracks.lane.astype(str))}
    several = {name for name, lane in info.items() if lane and not lane.inside and len(network.lanes_of(lane.edge)) > 1}
    on = np.array([name in several for name in tracks.lane], bool) & ~placed.parked
    edge = np.array([lane.rpartition("_")[0] for lane in tracks.lane], dtype=object)
    same = (np.diff(tracks.vehicle) == 0) & on[1:] & on[:-1] & (edge[1:] == edge[:-1])
    changed = np.flatnonzero(same & (tracks.lane[1:] != tracks.lane[:-1]))
    moves = on & (tracks.speed_mps > _MOVES_MPS)
    count = len(tracks.ids)
    return (
        np.bincount(tracks.vehicle[changed], minlength=count).astype(float),
        np.bincount(tracks.vehicle[moves], minlength=count) * tracks.step_s / 60,
    )


def u_turns(placed: Placed) -> Parts:
    """Turns back where one could have gone on, an hour of driving."""
    tracks, network, count = placed.tracks, placed.network, len(placed.tracks.ids)
    rows, edges = entries(placed)
    turned = np.zeros(count)
    for i in range(1, len(rows)):
        if rows[i] == rows[i - 1] and network.back.get(edges[i - 1]) == edges[i]:
            turned[rows[i]] += bool({*network.onward.get(edges[i - 1], ())} - {edges[i]})
    moves = placed.on & ~placed.parked
    return turned, np.bincount(tracks.vehicle[moves], minlength=count) * tracks.step_s / 3600


def pull_outs(placed: Placed) -> Parts:
    """Vehicles that leave the kerb, an hour for each that began parked."""
    tracks, count = placed.tracks, len(placed.tracks.ids)
    first = np.searchsorted(tracks.vehicle, np.arange(count))
    parked = placed.parked[first]
    end = np.maximum.reduceat(tracks.time_s, first)
    moves = placed.on & ~placed.parked & (tracks.speed_mps > 1.0)
    left = np.bincount(tracks.vehicle[moves], minlength=count) > 0
    hours = np.full(count, np.maximum(end.max() - tracks.start_s, 1.0)) / 3600
    return (parked & left).astype(float), np.where(parked, hours, 0.0)


def acceleration_noise(placed: Placed) -> Parts:
    """Unsteadiness of the acceleration where nothing calls for any [m/s²]."""
    tracks, a = placed.tracks, placed.acceleration_mps2
    jump = np.full(len(tracks), np.nan)
    jump[:-1] = np.where(np.diff(tracks.vehicle) == 0, np.diff(a), np.nan)
    cruises = placed.free_lane & (tracks.speed_mps > 0.75 * placed.limit_mps) & (placed.gap_m > _FREE_M)
    cruises &= placed.ends_m > 2 * _CLEAR_OF_ENDS_M
    second = max(1, round(1 / max(tracks.step_s, 1e-3)))
    cruises[:-second] &= np.abs(tracks.speed_mps[second:] - tracks.speed_mps[:-second]) < _STEADY_MPS
    cruises &= (np.abs(np.nan_to_num(a, nan=9.0)) < _FLOW_MPS2) & np.isfinite(jump)
    return _per_vehicle(placed, cruises, jump, lambda x: float(np.sqrt(np.mean(x**2) / 2)), 1.0, 10)


def acceleration_memory(placed: Placed) -> Parts:
    """How much of the acceleration is left after 0.4 s [1]: its covariance with itself, over its variance."""
    tracks, a, count = placed.tracks, placed.acceleration_mps2, len(placed.tracks.ids)
    lag = max(1, round(_MEMORY_S / max(tracks.step_s, 1e-3)))
    now, then = a[:-lag], a[lag:]
    both = (tracks.vehicle[:-lag] == tracks.vehicle[lag:]) & np.isfinite(now) & np.isfinite(then)
    both &= (tracks.speed_mps[:-lag] > 2) & (np.abs(now) < 5) & (np.abs(then) < 5) & placed.on[:-lag]
    who = tracks.vehicle[:-lag][both]
    return (
        np.bincount(who, (now * then)[both], minlength=count),
        np.bincount(who, (now**2)[both], minlength=count),
    )


def startup_lag(placed: Placed) -> Parts:
    """How much later than his leader in a queue one sets off [s]."""
    tracks, count = placed.tracks, len(placed.tracks.ids)
    sums, weights = np.zeros(count), np.zeros(count)
    speed, time_s = tracks.speed_mps, tracks.time_s
    sets_off = np.flatnonzero(
        (np.diff(tracks.vehicle) == 0) & (speed[:-1] < _MOVES_MPS) & (speed[1:] >= _MOVES_MPS) & ~placed.parked[1:]
    )
    starts: dict[int, list[int]] = {}
    for row in sets_off.tolist():
        starts.setdefault(int(tracks.vehicle[row]), []).append(row)
    for row in sets_off.tolist():
        rest = _last_rest(placed, row)
        if rest < 0:
            continue
        leader = int(tracks.vehicle[placed.leader[rest]])
        then = [time_s[other] for other in starts.get(leader, ()) if time_s[other] <= time_s[row]]
        lag = time_s[row] - max(then) if then else np.inf
        if lag < _LONGEST_LAG_S:
            sums[tracks.vehicle[row]] += lag
            weights[tracks.vehicle[row]] += 1
    return sums, weights


def lagged(placed: Placed, lags_s: np.ndarray) -> np.ndarray:
    """Covariance (v, lags) of a follower's acceleration with his leader's so much earlier [m²/s⁴]."""
    tracks, a, count = placed.tracks, placed.acceleration_mps2, len(placed.tracks.ids)
    rows = np.flatnonzero((placed.leader >= 0) & (placed.gap_m < 35) & (tracks.speed_mps > 2))
    ahead = a[placed.leader[rows]]
    found = np.zeros((count, len(lags_s)))
    for i, lag in enumerate(lags_s):
        then = np.minimum(rows + round(lag / max(tracks.step_s, 1e-3)), len(tracks) - 1)
        product = a[then] * ahead
        good = np.isfinite(product) & (tracks.vehicle[then] == tracks.vehicle[rows]) & (np.abs(product) < 25)
        found[:, i] = np.bincount(tracks.vehicle[rows][good], product[good], minlength=count)
    return found


def entries(placed: Placed) -> tuple[np.ndarray, np.ndarray]:
    """Vehicle and edge of every entry into an edge, in order."""
    tracks = placed.tracks
    outside = np.flatnonzero(placed.on & ~placed.parked & np.array([name[:1] != ":" for name in tracks.lane], bool))
    edge = np.array([tracks.lane[row].rpartition("_")[0] for row in outside.tolist()], dtype=object)
    who = tracks.vehicle[outside]
    new = np.ones(len(outside), bool)
    new[1:] = (who[1:] != who[:-1]) | (edge[1:] != edge[:-1])
    return who[new], edge[new]


def _keeps_lane(placed: Placed) -> np.ndarray:
    tracks = placed.tracks
    keeps = placed.free_lane & ~placed.parked & (tracks.speed_mps > 3) & (np.abs(placed.left_m) < 1.2)
    keeps &= (placed.along_m > _CLEAR_OF_ENDS_M) & (placed.ends_m > _CLEAR_OF_ENDS_M)
    changed = (np.diff(tracks.vehicle) == 0) & (tracks.lane[1:] != tracks.lane[:-1])
    near = round(_HOLDS_S / max(tracks.step_s, 1e-3))
    for row in np.flatnonzero(changed).tolist():
        keeps[max(row - near, 0) : row + near] = False
    return keeps


def _last_rest(placed: Placed, row: int) -> int:
    """The latest sample before one at which a vehicle stood behind a leader; −1 if there is none within 5 s."""
    tracks = placed.tracks
    for before in range(row, max(row - round(_LONGEST_LAG_S / max(tracks.step_s, 1e-3)), -1), -1):
        if tracks.vehicle[before] != tracks.vehicle[row]:
            return -1
        if tracks.speed_mps[before] < _RESTS_MPS and placed.leader[before] >= 0:
            leader_rests = tracks.speed_mps[placed.leader[before]] < _RESTS_MPS
            if placed.gap_m[before] < _QUEUE_M and leader_rests:
                return before
    return -1


def _per_vehicle(
    placed: Placed,
    chosen: np.ndarray,
    values: np.ndarray,
    middle: Callable[[np.ndarray], float],
    least_s: float,
    cap_s: float,
) -> Parts:
    """A middle value of each vehicle's chosen samples, weighing their seconds up to a cap, from some on."""
    tracks, count = placed.tracks, len(placed.tracks.ids)
    sums, weights = np.zeros(count), np.zeros(count)
    rows = np.flatnonzero(chosen)
    who = tracks.vehicle[rows]
    bounds = np.searchsorted(who, np.arange(count + 1))
    least = max(2, round(least_s / max(tracks.step_s, 1e-3)))
    for vehicle in range(count):
        mine = rows[bounds[vehicle] : bounds[vehicle + 1]]
        if len(mine) >= least:
            weights[vehicle] = min(len(mine) * tracks.step_s / cap_s, 1.0)
            sums[vehicle] = weights[vehicle] * middle(values[mine])
    return sums, weights
