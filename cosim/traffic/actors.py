"""All road users at one instant."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from cosim.traffic.headings import unit_vectors


@dataclass(frozen=True, eq=False)
class Actors:
    """All road users at one simulation step: a struct of arrays.

    Attributes:
        time_s: simulation time.
        ids: n SUMO ids.
        types: n vType ids.
        kinds: n kinds (`car`, `van`, `truck`, `bus`, `tram`, `motorcycle`, `cyclist`, `pedestrian`).
        lanes: n lane ids (empty for someone off the road).
        front: (n, 3) float64 world position of the front bumper's centre (the middle of a pedestrian) [m].
        heading_rad: (n,) float64 counter-clockwise from east.
        speed_mps: (n,) float64 along the heading.
        acceleration_mps2: (n,) float64 along the heading.
        yaw_rate_radps: (n,) float64, from the last step's heading.
        size: (n, 3) float64 length, width, height of the vType [m].
        signals: (n,) int64 SUMO's bit set of lamps.
        lane_position_m: (n,) float64 front bumper's distance from the lane's start; meaningless when parked [m].
        parked: (n,) bool, standing in a parking area.
        lateral_mps: (n,) float64 velocity of the box's centre across the heading, positive to the left; zero as SUMO
            reports it, filled in by `cosim.traffic.motion`.
        body_pitch_rad, body_roll_rad: (n,) float64 of the body against the road; nose down and leaning to the right
            are positive (right-handed about left and forward). Zero as SUMO reports it.
    """

    time_s: float
    ids: tuple[str, ...]
    types: tuple[str, ...]
    kinds: tuple[str, ...]
    lanes: tuple[str, ...]
    front: np.ndarray
    heading_rad: np.ndarray
    speed_mps: np.ndarray
    acceleration_mps2: np.ndarray
    yaw_rate_radps: np.ndarray
    size: np.ndarray
    signals: np.ndarray
    lane_position_m: np.ndarray
    parked: np.ndarray
    lateral_mps: np.ndarray
    body_pitch_rad: np.ndarray
    body_roll_rad: np.ndarray

    def to_front(self, heading_rad: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """From the middles of boxes to where `front` is (k, 2), of those of some rows (all by default) [m].

        Args:
            heading_rad: (n,) heading of each vehicle.
            rows: (k,).
        """
        rows = np.arange(len(self)) if rows is None else rows
        walks = np.array([self.kinds[row] == "pedestrian" for row in rows], bool)
        forward = unit_vectors(heading_rad[rows])
        return np.where(walks[:, None], 0.0, self.size[rows, :1] / 2) * forward

    def without(self, ids: Collection[str]) -> Actors:
        """All but some."""
        return self.take(np.array([row for row, name in enumerate(self.ids) if name not in ids], int))

    def take(self, rows: np.ndarray) -> Actors:
        """Those of some rows."""
        kept: dict[str, Any] = {}
        numbers = rows.tolist()
        for part in fields(self):
            values = getattr(self, part.name)
            if isinstance(values, tuple):
                kept[part.name] = tuple([values[row] for row in numbers])
            elif isinstance(values, np.ndarray):
                kept[part.name] = values[rows]
        return replace(self, **kept)

    def and_then(self, others: Actors) -> Actors:
        """These and after them others of the same instant."""
        joined: dict[str, Any] = {}
        for part in fields(self):
            ones, more = getattr(self, part.name), getattr(others, part.name)
            if isinstance(ones, tuple):
                joined[part.name] = (*ones, *more)
            elif isinstance(ones, np.ndarray):
                joined[part.name] = np.concatenate([ones, more])
        return replace(self, **joined)

    def __len__(self) -> int:
        return len(self.ids)
