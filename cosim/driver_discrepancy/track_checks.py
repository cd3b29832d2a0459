"""Checks of trajectories against themselves: units, clock, ids, duration. Each names the reason that was verified."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from cosim.driver_discrepancy.settings import TrafficSettings
from cosim.driver_discrepancy.tracks import TrackError, Tracks, take_rows

_GAP_S, _FASTEST_MPS, _JITTER_M = 5.0, 90.0, 3.0
_SHORT_S = 3.0
_RECORDINGS_APART_S = 30.0
_FEWEST_ROWS = 20  # of samples, to compare with each other
_MOVES_MPS = 1.0
_SAME_PLACE_M = 1.0
_OVERLAPS_SHARE, _FEWEST_OVERLAPS = 0.05, 4  # of vehicles that come so near to another one
_TWO_WHEELS = ("motorcycle", "cyclist", "bicycle")
_STEPS_OVER_JUMP = 5  # usual steps, in which vehicles move over a jump of the clock at most
_SPLITS_SHARE = 0.02  # of samples, from which jumps are no reused ids
_UNITS = (
    (1e-3, "times look like milliseconds", "divide time_s by 1000"),
    (1e-6, "times look like microseconds", "divide time_s by 1 000 000"),
    (1e-9, "times look like nanoseconds", "divide time_s by 1e9"),
    (1 / 3.6, "speeds look like km/h", "divide speed_mps by 3.6"),
    (1 / 2.237, "speeds look like miles per hour", "multiply speed_mps by 0.447"),
    (3.281, "positions look like feet", "multiply x_m and y_m by 0.3048"),
)


def split_tracks(tracks: Tracks) -> tuple[Tracks, list[str]]:
    """Trajectories whose ids name one vehicle each: tracks are cut where a vehicle vanishes or jumps.

    Returns:
        Trajectories, and notes on what was changed.

    Raises:
        TrackError: units disagree with the positions, the clock jumps, vehicles overlap, or
            there are two recordings.
    """
    notes = []
    same = np.diff(tracks.vehicle) == 0
    twice = np.concatenate([[False], same & (np.diff(tracks.time_s) <= 0)])
    if twice.any():
        tracks = take_rows(tracks, ~twice)
        notes.append(f"{int(twice.sum())} samples with a time that their vehicle has already were left out")
        same = np.diff(tracks.vehicle) == 0
    _check_units(tracks)
    _check_clock(tracks)
    _check_overlaps(tracks)
    gap, move = np.diff(tracks.time_s), np.hypot(*np.diff(tracks.place, axis=0).T)
    cut = same & ((gap > _GAP_S) | (move > _FASTEST_MPS * gap + _JITTER_M))
    stood = same & (move < 1.0) & (tracks.speed_mps[:-1] < 0.5) & (tracks.speed_mps[1:] < 0.5)
    cut &= ~stood  # who is parked may be sampled seldom
    if cut.sum() > max(_SPLITS_SHARE * len(tracks), 3 * len(tracks.ids)):
        row = int(np.flatnonzero(cut)[0])
        raise TrackError(
            f"positions of {tracks.ids[tracks.vehicle[row]]!r} jump by {move[row]:.0f} m in {gap[row]:.2f} s at "
            f"{tracks.time_s[row]:.2f} s, and {int(cut.sum())} more like it; check the columns of time and id"
        )
    if not cut.any():
        return tracks, notes
    part = np.zeros(len(tracks), int)
    part[1:] = np.cumsum(cut)
    first = np.searchsorted(tracks.vehicle, np.arange(len(tracks.ids)))
    part -= part[first][tracks.vehicle]
    pieces = np.unique(np.column_stack([tracks.vehicle, part]), axis=0)
    number = {(int(who), int(at)): row for row, (who, at) in enumerate(pieces.tolist())}
    ids = tuple(tracks.ids[who] + (f"#{at + 1}" if at else "") for who, at in pieces.tolist())
    types = tuple(tracks.types[who] for who, _ in pieces.tolist())
    vehicle = np.array([number[int(w), int(p)] for w, p in zip(tracks.vehicle, part, strict=True)])
    order = np.argsort(np.array(ids))
    rank = np.argsort(order)
    vehicle = rank[vehicle]
    moved = np.lexsort((tracks.time_s, vehicle))
    split = replace(
        take_rows(replace(tracks, vehicle=vehicle), moved),
        ids=tuple(ids[at] for at in order.tolist()),
        types=tuple(types[at] for at in order.tolist()),
    )
    reused = int(np.unique(tracks.vehicle[:-1][cut]).size)
    notes.append(f"{reused} ids vanish or jump and appear again: they were split into {len(ids)} tracks in all")
    return split, notes


def check_duration(tracks: Tracks, by: TrafficSettings) -> None:
    """Refuse recordings that are too short or too long, without motion, or with tracks that are too short.

    Raises:
        TrackError: with the duration, the limit and the remedy.
    """
    if tracks.seconds < by.shortest_s:
        raise TrackError(
            f"the trajectories last {tracks.seconds:.1f} s; give at least {by.shortest_s:.0f} s of traffic"
        )
    if tracks.seconds > by.longest_s:
        raise TrackError(
            f"the trajectories last {tracks.seconds:.0f} s; give at most {by.longest_s:.0f} s, or check that time_s is "
            "in seconds"
        )
    _check_motion(tracks)
    first = np.searchsorted(tracks.vehicle, np.arange(len(tracks.ids) + 1))
    lasts = tracks.time_s[first[1:] - 1] - tracks.time_s[first[:-1]]
    if float(np.median(lasts)) < _SHORT_S:
        raise TrackError(
            f"half of the vehicles are seen for less than {np.median(lasts):.1f} s; give tracks of at least "
            f"{_SHORT_S:.0f} s, and check that ids stay the same along a track"
        )


def _check_motion(tracks: Tracks) -> None:
    if not (tracks.speed_mps > _MOVES_MPS).any():
        raise TrackError("all vehicles are at rest throughout; measured trajectories must move")


def _check_overlaps(tracks: Tracks) -> None:
    """Refuse vehicles that drive at the same place at the same time; two-wheelers may pass so near."""
    wide = ~np.isin(tracks.types, _TWO_WHEELS)[tracks.vehicle]
    rows = np.flatnonzero((tracks.speed_mps > _MOVES_MPS) & wide)
    if len(rows) < _FEWEST_ROWS:
        return
    step_s = max(tracks.step_s, 1e-3)
    instant = np.round((tracks.time_s[rows] - tracks.start_s) / step_s)
    # Instants lie farther apart than the radius, so that pairs are of one instant.
    points = np.column_stack([tracks.place[rows], 10 * _SAME_PLACE_M * instant])
    pairs = tracks.vehicle[rows[KDTree(points).query_pairs(_SAME_PLACE_M, output_type="ndarray")]]
    count, moving = len(np.unique(pairs[pairs[:, 0] != pairs[:, 1]])), len(np.unique(tracks.vehicle[rows]))
    if count >= _FEWEST_OVERLAPS and count > _OVERLAPS_SHARE * moving:
        raise TrackError(
            f"{count} of {moving} moving vehicles come within {_SAME_PLACE_M:g} m of another one at the same time: the "
            "file holds two recordings on one clock, or vehicles under two ids; give one of them"
        )


def _check_units(tracks: Tracks) -> None:
    """Compare the way between samples with speed times duration."""
    gap, move = np.diff(tracks.time_s), np.hypot(*np.diff(tracks.place, axis=0).T)
    speed = (tracks.speed_mps[:-1] + tracks.speed_mps[1:]) / 2
    own = gap[np.diff(tracks.vehicle) == 0]
    usual = float(np.median(own)) if len(own) else 0.0
    good = (np.diff(tracks.vehicle) == 0) & (gap > 0) & (gap < 3 * max(usual, 1e-9)) & (speed > 2) & (move > 0)
    if good.sum() < _FEWEST_ROWS:
        return
    ratio = float(np.median(move[good] / (speed[good] * gap[good])))
    if 0.7 < ratio < 1.4:
        return
    for factor, words, remedy in _UNITS:
        if 0.85 < ratio / factor < 1.15:
            raise TrackError(f"{words}: positions move {ratio:.3g} times as far as speed and time say; {remedy}")
    raise TrackError(
        f"positions move {ratio:.3g} times as far as speed and time say (median of {int(good.sum())} samples); check "
        "the units of time_s, speed_mps, x_m and y_m"
    )


def _check_clock(tracks: Tracks) -> None:
    """Find time intervals without vehicles, and report what they are."""
    times = np.unique(np.round(tracks.time_s, 6))
    gaps = np.diff(times)
    usual = float(np.median(gaps)) if len(gaps) else 0.0
    for at in np.flatnonzero(gaps > max(10 * usual, 1.5)).tolist():
        before, after = float(times[at]), float(times[at + 1])
        rows = np.flatnonzero(
            (np.diff(tracks.vehicle) == 0)
            & (np.abs(tracks.time_s[:-1] - before) < 1e-5 + usual)
            & (np.abs(tracks.time_s[1:] - after) < 1e-5 + usual)
            & (tracks.speed_mps[:-1] > 2)
        )
        way = np.hypot(*(tracks.place[rows + 1] - tracks.place[rows]).T)
        if len(rows) >= 3 and float(np.median(way / tracks.speed_mps[rows])) < _STEPS_OVER_JUMP * usual:
            raise TrackError(
                f"the clock jumps by {after - before:.1f} s after {before:.2f} s: vehicles move as far as in a usual "
                "step in that time; correct time_s, or give one part"
            )
        if after - before > _RECORDINGS_APART_S:
            raise TrackError(
                f"the file holds two recordings: it is empty from {before:.1f} to {after:.1f} s; give one of them"
            )
