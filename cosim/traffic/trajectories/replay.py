"""Replay of trajectories: road users at their recorded positions at any time."""

from __future__ import annotations

import numpy as np

from cosim.traffic.actors import Actors
from cosim.traffic.trajectories.tracks import GAP_S, RoadTracks, TrajectoryError

_RIDDEN = ("car", "van", "truck", "bus", "motorcycle", "cyclist")  # the first of these kinds that drives
_STANDS_M = 0.5


class Replay:
    """Gives the road users of any instant.

    Places, headings and speeds are interpolated linearly between samples; accelerations and yaw rates are those of
    neighbouring samples. Who is not seen for more than 2.1 s is away in between.

    Args:
        tracks: tracks of all road users.
    """

    def __init__(self, tracks: RoadTracks) -> None:
        self._tracks = tracks
        self._still = [tracks.way_m(user) < _STANDS_M for user in range(len(tracks.ids))]
        self._rates = [self._rates_of(user) for user in range(len(tracks.ids))]

    @property
    def tracks(self) -> RoadTracks:
        """Tracks that are replayed."""
        return self._tracks

    def at(self, time_s: float) -> Actors:
        """All road users at an instant of the file's own time."""
        tracks = self._tracks
        present, values, lanes = [], [], []
        for user in range(len(tracks.ids)):
            rows = tracks.samples(user)
            times = tracks.time_s[rows]
            if not times[0] <= time_s <= times[-1]:
                continue
            after = min(int(np.searchsorted(times, time_s, side="right")), len(times) - 1)
            before = max(after - 1, 0)
            step = times[after] - times[before]
            if step > GAP_S and not self._still[user]:
                continue
            share = (time_s - times[before]) / step if step > 0 else 0.0
            present.append(user)
            values.append(self._between(user, rows.start + before, rows.start + after, share))
            lanes.append(tracks.lanes[rows.start + before])
        return self._actors(time_s, present, np.array(values).reshape(-1, 8), tuple(lanes))

    def draw_ego(self, wanted: str | None, needed_s: float, rng: np.random.Generator) -> str:
        """The id of a vehicle to ride in: the one wanted, or one that moves and is there for long, drawn.

        Args:
            wanted: its id, if it is known.
            needed_s: those who are there for so long come first.
            rng: draws.

        Raises:
            TrajectoryError: there is no such vehicle, or no vehicle moves.
        """
        tracks = self._tracks
        if wanted is not None:
            if wanted not in tracks.ids:
                known = ", ".join(tracks.ids[:8]) + (", …" if len(tracks.ids) > 8 else "")
                raise TrajectoryError(f"ego {wanted!r} is not in the trajectories; they hold {known}")
            if self._still[tracks.ids.index(wanted)]:
                raise TrajectoryError(f"ego {wanted!r} never moves; name one that does, or leave `ego` out")
            return wanted
        moving = [user for user in range(len(tracks.ids)) if tracks.kinds[user] in _RIDDEN and not self._still[user]]
        if not moving:
            raise TrajectoryError("no vehicle of the trajectories moves, so nothing can carry the sensors")
        kind = min((tracks.kinds[user] for user in moving), key=_RIDDEN.index)
        moving = [user for user in moving if tracks.kinds[user] == kind]
        lasts = np.array([np.ptp(tracks.time_s[tracks.samples(user)]) for user in moving])
        enough = lasts >= min(needed_s, float(lasts.max()))
        return tracks.ids[int(rng.choice(np.array(moving)[enough]))]

    def life(self, user: str) -> tuple[float, float]:
        """First and last time of a user [s]."""
        times = self._tracks.time_s[self._tracks.samples(self._tracks.ids.index(user))]
        return float(times[0]), float(times[-1])

    def _rates_of(self, user: int) -> np.ndarray:
        """Acceleration and yaw rate at each sample, (k, 2)."""
        rows = self._tracks.samples(user)
        times = self._tracks.time_s[rows]
        if len(times) < 2:
            return np.zeros((len(times), 2))
        columns = np.column_stack([self._tracks.speed_mps[rows], self._tracks.heading_rad[rows]])
        return np.gradient(columns, times, axis=0)

    def _between(self, user: int, before: int, after: int, share: float) -> tuple[float, ...]:
        """Place, heading, speed, acceleration, yaw rate and lamps."""
        tracks, start = self._tracks, int(self._tracks.first[user])
        position = (1 - share) * tracks.front[before] + share * tracks.front[after]
        heading = (1 - share) * tracks.heading_rad[before] + share * tracks.heading_rad[after]
        speed = (1 - share) * tracks.speed_mps[before] + share * tracks.speed_mps[after]
        rates = (1 - share) * self._rates[user][before - start] + share * self._rates[user][after - start]
        return (*position, heading, speed, *rates, float(tracks.signals[before]))

    def _actors(self, time_s: float, present: list[int], values: np.ndarray, lanes: tuple[str, ...]) -> Actors:
        tracks, none = self._tracks, np.zeros(len(present))
        return Actors(
            time_s=time_s,
            ids=tuple(tracks.ids[user] for user in present),
            types=tuple(tracks.types[user] for user in present),
            kinds=tuple(tracks.kinds[user] for user in present),
            lanes=lanes,
            front=values[:, :3],
            heading_rad=np.angle(np.exp(1j * values[:, 3])),
            speed_mps=values[:, 4],
            acceleration_mps2=values[:, 5],
            yaw_rate_radps=values[:, 6],
            size=tracks.size[present].reshape(-1, 3),
            signals=values[:, 7].astype(np.int64),
            lane_position_m=none,
            parked=np.array([self._still[user] for user in present], bool),
            lateral_mps=none,
            body_pitch_rad=none,
            body_roll_rad=none,
        )
