"""Map matching: lanes of trajectories that come without them.

A hidden Markov model over lanes (Newson and Krumm, ACM GIS 2009): distance and heading are the observation, and
connectivity of the network the transition. It is solved by Viterbi's algorithm on about one sample a second.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.spatial import KDTree

from cosim.driver_discrepancy.network import Network
from cosim.driver_discrepancy.tracks import TrackError, Tracks

_SPACING_M, _REACH_M, _NEIGHBOURS = 2.0, 9.0, 16
_DISTANCE_M, _HEADING_RAD = 1.2, 0.35
_AGAINST_RAD = 1.3  # who is turned farther from a lane is not on it
_OFF_COURSE_DEG = 20.0  # median angle between heading and direction of travel, from which headings are wrong
_KEY_S = 1.0
_CHANGE, _SKIP, _UNCONNECTED = 2.0, 3.0, 14.0
_FEWEST_SHARE = 0.5  # of samples that lie on streets, to be of this town
_AXES_SHARE = 0.8  # of samples that lie on streets with other axes, to be an error of the axes


def match_lanes(tracks: Tracks, network: Network) -> tuple[Tracks, list[str]]:
    """Return the trajectories with lanes; those that have lanes of the network keep them.

    Headings that are NaN (a vehicle that never moves, in data without headings) become those of the lanes.

    Returns:
        Trajectories, and a note if lanes were matched.

    Raises:
        TrackError: most samples lie on no lane of the network.
    """
    given = np.char.str_len(tracks.lane.astype(str)) > 0
    if given.mean() > _FEWEST_SHARE:
        return tracks, []
    matcher = _Matcher(network)
    matcher.check(tracks)
    first = np.searchsorted(tracks.vehicle, np.arange(len(tracks.ids) + 1))
    lane = tracks.lane.astype("U64")
    keys = [_keys(tracks.time_s[start:end]) + start for start, end in pairwise(first.tolist())]
    options = matcher.options(tracks.place[np.concatenate(keys)], tracks.heading_rad[np.concatenate(keys)])
    at = 0
    for rows, (start, end) in zip(keys, pairwise(first.tolist()), strict=True):
        part = slice(start, end)
        own = options[at : at + len(rows)]
        lane[part] = matcher.match(tracks.place[part], tracks.heading_rad[part], rows - start, own)
        at += len(rows)
    lost = float((np.char.str_len(lane) == 0).mean())
    note = "lanes were found by map matching" + (f"; {lost:.0%} of the samples lie on none" if lost > 0.01 else "")
    heading = matcher.with_headings(tracks.place, lane, tracks.heading_rad)
    return replace(tracks, lane=lane, heading_rad=heading), [note]


class _Matcher:
    """Matches one vehicle after another."""

    def __init__(self, network: Network) -> None:
        self._names = sorted(network.lanes)
        row = self._row = {name: at for at, name in enumerate(self._names)}
        self._lanes = [network.lanes[name] for name in self._names]
        points, lanes, headings = [], [], []
        for at, lane in enumerate(self._lanes):
            dense, heading = _along(lane.shape)
            points.append(dense)
            headings.append(heading)
            lanes.append(np.full(len(dense), at))
        self._points = np.concatenate(points)
        self._lane, self._heading = np.concatenate(lanes), np.concatenate(headings)
        self._tree = KDTree(self._points)
        self._steps: dict[tuple[int, int], tuple[int, ...]] = {}
        follows: dict[int, list[tuple[int, ...]]] = {}
        for name, links in network.links.items():
            for link in links:
                if name not in row:
                    continue
                inside, target = row.get(link.via, -1), row[link.target]
                way = (row[name], inside, target) if inside >= 0 else (row[name], target)
                follows.setdefault(row[name], []).append(way)
                if inside >= 0:
                    self._steps[row[name], inside] = (row[name], inside)
                    self._steps[inside, target] = (inside, target)
                self._steps[row[name], target] = way
        for source, ways in follows.items():
            for way in ways:
                for onward in follows.get(way[-1], ()):
                    self._steps.setdefault((source, onward[-1]), (*way, *onward[1:]))
                    if len(onward) > 2:
                        self._steps.setdefault((source, onward[1]), (*way, onward[1]))
                        if len(way) > 2:
                            self._steps.setdefault((way[1], onward[1]), (way[1], *onward[:2]))
        self._edge = [lane.edge for lane in self._lanes]

    def check(self, tracks: Tracks) -> None:
        """Refuse trajectories that are not on the network, with the reason that was verified."""
        every = max(1, len(tracks) // 2000)
        position, heading = tracks.place[::every], tracks.heading_rad[::every]
        share = self._share(position, heading)
        if share >= _FEWEST_SHARE:
            return
        swapped = self._share(position[:, ::-1], np.pi / 2 - heading)
        mirrored = self._share(position * (1, -1), -heading)
        away = float(np.median(self._tree.query(position)[0]))
        middle, town = np.median(position, axis=0), np.median(self._points, axis=0)
        if swapped >= _AXES_SHARE:
            raise TrackError(
                f"x and y are exchanged: with them swapped {swapped:.0%} of the positions lie on the streets; swap them"
            )
        if mirrored >= _AXES_SHARE:
            raise TrackError(
                f"y points the wrong way: mirrored, {mirrored:.0%} of the positions lie on the streets; negate y"
            )
        off_course = _off_course_deg(tracks)
        if off_course > _OFF_COURSE_DEG:
            raise TrackError(
                f"headings differ from the direction of travel by {off_course:.0f}° (median); write heading_deg in "
                "degrees counter-clockwise from east, or clockwise from north"
            )
        if self._share(position, heading + np.pi) >= _AXES_SHARE:
            raise TrackError("vehicles drive against the lanes; check on which side the network's traffic drives")
        raise TrackError(
            f"most positions lie off the streets: {share:.0%} are on a lane of their direction (median distance to a "
            f"lane {away:.0f} m; tracks about ({middle[0]:.0f}, {middle[1]:.0f}) m, streets about ({town[0]:.0f}, "
            f"{town[1]:.0f}) m); give the configuration of the town that was measured, in the same axes"
        )

    def match(
        self, position: np.ndarray, heading: np.ndarray, keys: np.ndarray, options: Sequence[Mapping[int, float]]
    ) -> np.ndarray:
        """Lane of each sample of a vehicle (n,); empty where there is none.

        Args:
            place, heading: (n, 2) and (n,) of its samples.
            keys: (k,) samples at which lanes are decided; those between follow.
            options: lanes near each of them with their costs.
        """
        known = [at for at, option in enumerate(options) if option]
        found = np.full(len(position), "", dtype="U64")
        if not known:
            return found
        path = self._viterbi([options[at] for at in known])
        rows = keys[known]
        found[: rows[0] + 1] = self._names[path[0]]
        found[rows[-1] :] = self._names[path[-1]]
        for begin, end, a, b in zip(rows[:-1], rows[1:], path[:-1], path[1:], strict=True):
            span = slice(begin, end + 1)
            if a == b:
                found[span] = self._names[a]
                continue
            way = self._steps.get((a, b), (a, b))
            cost = np.stack([self._cost(lane, position[span], heading[span]) for lane in way])
            choice = np.maximum.accumulate(np.argmin(cost, axis=0))
            found[span] = np.array([self._names[lane] for lane in way])[choice]
        return found

    def options(self, position: np.ndarray, heading: np.ndarray) -> list[dict[int, float]]:
        """Lanes near places (n, 2) with headings (n,), and their costs."""
        away, near = self._tree.query(position, k=_NEIGHBOURS, distance_upper_bound=_REACH_M)
        known = np.isfinite(away)
        rows, lanes = np.unique(np.column_stack([np.nonzero(known)[0], self._lane[np.asarray(near)[known]]]), axis=0).T
        found: list[dict[int, float]] = [{} for _ in range(len(position))]
        order = np.argsort(lanes, kind="stable")
        for group in np.split(order, np.flatnonzero(np.diff(lanes[order])) + 1):
            if not len(group):
                continue
            lane, own = int(lanes[group[0]]), rows[group]
            costs = self._cost(lane, position[own], heading[own])
            for row, cost in zip(own.tolist(), costs.tolist(), strict=True):
                if np.isfinite(cost):
                    found[row][lane] = cost
        return found

    def with_headings(self, position: np.ndarray, lanes: np.ndarray, heading: np.ndarray) -> np.ndarray:
        """Headings (n,) with those that are NaN replaced by those of the lanes (n,) at the places (n, 2)."""
        found = heading.copy()
        for row in np.flatnonzero(np.isnan(heading)).tolist():
            own = np.flatnonzero(self._lane == self._row[lanes[row]]) if lanes[row] else np.arange(len(self._lane))
            apart = np.hypot(*(self._points[own] - position[row]).T)
            found[row] = self._heading[own[apart.argmin()]]
        return found

    def _share(self, position: np.ndarray, heading: np.ndarray) -> float:
        away, near = self._tree.query(position, k=4, distance_upper_bound=_REACH_M)
        good = np.isfinite(away)
        turned = np.abs(
            np.angle(np.exp(1j * (self._heading[np.minimum(near, len(self._lane) - 1)] - heading[:, None])))
        )
        return float((good & ~(turned > 0.6) & (away < 5.0)).any(1).mean())

    def _cost(self, lane: int, position: np.ndarray, heading: np.ndarray) -> np.ndarray:
        shape = self._lanes[lane].shape
        start, piece = shape[:-1], np.diff(shape, axis=0)
        length2 = np.maximum((piece**2).sum(1), 1e-12)
        away = position[:, None] - start
        share = np.clip(np.einsum("nij,ij->ni", away, piece) / length2, 0, 1)
        apart = np.hypot(*np.moveaxis(away - share[..., None] * piece, 2, 0))
        best = apart.argmin(1)
        rows = np.arange(len(position))
        turned = np.nan_to_num(np.angle(np.exp(1j * (np.arctan2(piece[best, 1], piece[best, 0]) - heading))))
        cost = 0.5 * (apart[rows, best] / _DISTANCE_M) ** 2 + 0.5 * (turned / _HEADING_RAD) ** 2
        return np.where(np.abs(turned) > _AGAINST_RAD, np.inf, cost)

    def _viterbi(self, options: Sequence[Mapping[int, float]]) -> list[int]:
        cost = dict(options[0])
        back: list[dict[int, int]] = []
        for option in options[1:]:
            came: dict[int, int] = {}
            new: dict[int, float] = {}
            for lane, own in option.items():
                before = min(cost, key=lambda other: cost[other] + self._transition(other, lane))
                came[lane], new[lane] = before, cost[before] + self._transition(before, lane) + own
            back.append(came)
            cost = new
        path = [min(cost, key=lambda lane: cost[lane])]
        for came in reversed(back):
            path.append(came[path[-1]])
        return path[::-1]

    def _transition(self, a: int, b: int) -> float:
        if a == b:
            return 0.0
        way = self._steps.get((a, b))
        if way is not None:
            return 0.0 if len(way) <= 3 else _SKIP
        return _CHANGE if self._edge[a] == self._edge[b] else _UNCONNECTED


def _off_course_deg(tracks: Tracks) -> float:
    """Median angle between heading and direction of travel."""
    move = np.diff(tracks.place, axis=0)
    apart = np.hypot(*move.T)
    moved = (np.diff(tracks.vehicle) == 0) & (apart > 0.1) & (apart < 50)
    if not moved.any():
        return 0.0
    angle = np.arctan2(move[:, 1], move[:, 0])[moved] - tracks.heading_rad[:-1][moved]
    return float(np.degrees(np.median(np.abs(np.angle(np.exp(1j * angle))))))


def _keys(time_s: np.ndarray) -> np.ndarray:
    """Samples about a second apart, the first and the last among them."""
    tick = np.floor((time_s - time_s[0]) / _KEY_S + 1e-6)
    keys = np.flatnonzero(np.concatenate([[True], np.diff(tick) > 0]))
    return np.unique(np.append(keys, len(time_s) - 1))


def _along(shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points every two metres along a line and its headings there."""
    piece = np.diff(shape, axis=0)
    length = np.hypot(piece[:, 0], piece[:, 1])
    way = np.concatenate([[0.0], np.cumsum(length)])
    at = np.linspace(0, way[-1], max(2, int(way[-1] / _SPACING_M) + 1))
    segment = np.clip(np.searchsorted(way, at, side="right") - 1, 0, len(piece) - 1)
    points = np.column_stack([np.interp(at, way, shape[:, axis]) for axis in (0, 1)])
    return points, np.arctan2(piece[segment, 1], piece[segment, 0])
