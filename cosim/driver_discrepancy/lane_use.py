"""Channels of lanes: position in the lane, lane changes by reason, and use of lanes."""

from __future__ import annotations

import numpy as np

from cosim.driver_discrepancy.placed import Placed
from cosim.driver_discrepancy.values import CLEAR_OF_ENDS_M, MOVES_MPS, Values, on_street

_LANE_CHANGE_S = 2.0
_REASONS = ("speed", "right", "route", "other")


def measure_lanes(placed: Placed) -> dict[str, Values]:
    """Values of all channels of lanes."""
    rows, several = changes_of_lane(placed), _several_lanes(placed)
    reasons = _reasons(placed, rows)
    drives = several & ~placed.parked & (placed.tracks.speed_mps > MOVES_MPS)
    keeps = _keeps_lane(placed)
    index = placed.of_lane(lambda _, lane: float(lane.index))
    changes = {
        f"lane_changes_{reason}": Values.per_exposure(rows[reasons == reason], drives, placed.tracks.step_s / 60)
        for reason in _REASONS
    }
    return changes | {
        "lateral": Values.at(keeps, placed.left_m),
        "lateral_motion": Values.at(keeps, np.minimum(_lateral_speed(placed), 2.0)),
        "lane_use": Values.at(several & on_street(placed), (index > 0).astype(float)),
    }


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


def _lateral_speed(placed: Placed) -> np.ndarray:
    """Speed across the lane over half a second (n,) [m/s]; NaN at a lane's end."""
    lag = max(1, round(0.5 / max(placed.tracks.step_s, 1e-3)))
    motion = np.full(len(placed.tracks), np.nan)
    same = (placed.tracks.vehicle[lag:] == placed.tracks.vehicle[:-lag]) & (placed.code[lag:] == placed.code[:-lag])
    apart = np.abs(placed.left_m[lag:] - placed.left_m[:-lag]) / (lag * max(placed.tracks.step_s, 1e-3))
    motion[:-lag] = np.where(same, apart, np.nan)
    return motion


def _keeps_lane(placed: Placed) -> np.ndarray:
    """Samples (n,) that move along a straight lane and neither change it nor are near its ends."""
    tracks = placed.tracks
    keeps = placed.free_lane & ~placed.parked & (tracks.speed_mps > 3) & (np.abs(placed.left_m) < 1.2)
    keeps &= (placed.along_m > CLEAR_OF_ENDS_M) & (placed.ends_m > CLEAR_OF_ENDS_M)
    changed = (np.diff(tracks.vehicle) == 0) & (np.diff(placed.code) != 0)
    near = round(_LANE_CHANGE_S / max(tracks.step_s, 1e-3))
    for row in np.flatnonzero(changed).tolist():
        keeps[max(row - near, 0) : row + near] = False
    return keeps


def _several_lanes(placed: Placed) -> np.ndarray:
    counts: dict[str, int] = {}
    for lane in placed.network.lanes.values():
        counts[lane.edge] = counts.get(lane.edge, 0) + 1
    return placed.of_lane(lambda _, lane: float(not lane.inside and counts[lane.edge] > 1)) > 0
