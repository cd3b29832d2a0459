"""Channels of motion along the road: speed, acceleration, jerk, following, queues, reaction, stops."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from cosim.driver_discrepancy.placed import Placed
from cosim.driver_discrepancy.values import CLEAR_OF_ENDS_M, MOVES_MPS, RESTS_MPS, Values, on_street

_FREE_M, _FREE_S = 40.0, 4.0
_FOLLOWS_S = 5.0  # time headway above which a driver does not follow, however equal the speeds are
_QUEUE_M = 8.0
_CHANGING_LANES_M = 0.8
_LONGEST_LAG_S = 5.0
_FLOW_MPS2 = 1.0
_BENDS_RAD = 0.4
_NEW_MPS2 = 0.12  # change of the acceleration that shows a decision


def _speed(placed: Placed) -> Values:
    share = placed.tracks.speed_mps / placed.limit_mps
    return Values.at(on_street(placed) & (placed.tracks.speed_mps > MOVES_MPS), np.minimum(share, 3))


def _free_speed(placed: Placed) -> Values:
    tracks = placed.tracks
    free = placed.free_lane & ~placed.parked & (tracks.speed_mps > 0.4 * placed.limit_mps) & _is_free(placed)
    free &= (placed.along_m > CLEAR_OF_ENDS_M) & (placed.ends_m > 2 * CLEAR_OF_ENDS_M)
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
    cruises &= (placed.ends_m > 2 * CLEAR_OF_ENDS_M) & (np.abs(np.nan_to_num(a, nan=9.0)) < _FLOW_MPS2)
    cruises &= np.abs(_smooth_acceleration(placed)) < 0.3
    return Values.at(cruises, np.abs(_jump(placed)))


def _headway(placed: Placed) -> Values:
    speed, leader = placed.tracks.speed_mps, placed.leader
    follows = (leader >= 0) & (speed > 4) & (placed.gap_m > 0) & (placed.gap_m < _FOLLOWS_S * speed)
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


def _stops(placed: Placed) -> Values:
    speed = placed.tracks.speed_mps
    begins = (np.diff(placed.tracks.vehicle) == 0) & (speed[:-1] >= MOVES_MPS) & (speed[1:] < MOVES_MPS)
    rows = np.flatnonzero(begins & on_street(placed)[1:]) + 1
    return Values.per_exposure(rows, on_street(placed), placed.tracks.step_s / 60)


def _standing(placed: Placed) -> Values:
    return Values.at(on_street(placed), (placed.tracks.speed_mps < RESTS_MPS).astype(float))


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


MOTION: Mapping[str, Callable[[Placed], Values]] = {
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
    "pull_outs": _pull_outs,
    "stops": _stops,
    "standing": _standing,
}
"""Channel → function that measures it."""
