"""Rules for when a frame is recorded and when an episode ends."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from cosim.traffic.actors import Actors

COMPANY_M = 45.0  # default in built-in towns
_AHEAD_RAD = np.radians(40.0)  # half the horizontal field of view of KITTI's cameras


class Collection(BaseModel):
    """Rules for when a frame is recorded."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    every_s: float = Field(default=1.0, gt=0, le=600, description="minimum simulated time between two frames [s]")
    min_travel_m: float = Field(
        default=1.0, ge=0, le=1000, description="minimum distance that the ego vehicle moves between two frames [m]"
    )
    company_m: float | None = Field(
        default=None,
        ge=0,
        le=1000,
        description="a frame is recorded only if a road user ahead is within this distance; 0: always; none: 45 in "
        "built-in towns, 0 in other towns [m]",
    )
    patience_s: float = Field(
        default=90.0, gt=0, le=36000, description="an episode ends after this simulated time without a frame [s]"
    )
    attempts: int = Field(
        default=4, ge=1, le=100, description="maximum number of simulations started to record the frames of one episode"
    )


class FrameSelector:
    """Select the instants to record during one simulation, from the ego vehicle's position.

    Args:
        rules: rules for recording frames.
        actors: road users at the start.
        ego: id of the ego vehicle.
        company_m: default of `rules.company_m`; 0 records frames without a road user ahead, too [m].
    """

    def __init__(self, rules: Collection, actors: Actors, ego: str, company_m: float = COMPANY_M) -> None:
        self._rules = rules
        self._company_m = company_m if rules.company_m is None else rules.company_m
        self._ego = ego
        self._last_time_s = actors.time_s
        self._position = self._ego_position(actors)

    def selects(self, actors: Actors) -> bool:
        """Whether to record this instant; if True, the instant counts as recorded."""
        position = self._ego_position(actors)
        travelled_m = np.linalg.norm(position - self._position)
        if travelled_m < self._rules.min_travel_m or not self._has_company(actors, position):
            return False
        self._position, self._last_time_s = position, actors.time_s
        return True

    def end_reason(self, actors: Actors) -> str | None:
        """Reason why the episode ends, or None if it continues."""
        if self._ego not in actors.ids:
            return "the ego vehicle left the road"
        waited_s = actors.time_s - self._last_time_s
        if waited_s <= self._rules.patience_s:
            return None
        is_standing = np.linalg.norm(self._ego_position(actors) - self._position) < self._rules.min_travel_m
        return f"{'jam' if is_standing else 'empty roads'}: no frame for {waited_s:.0f} s"

    def _ego_position(self, actors: Actors) -> np.ndarray:
        return actors.front[actors.ids.index(self._ego), :2]

    def _has_company(self, actors: Actors, position: np.ndarray) -> bool:
        heading = actors.heading_rad[actors.ids.index(self._ego)]
        return _has_company_ahead(actors, position, float(heading), self._company_m)


class StationaryFrameSelector:
    """Select the instants to record from a fixed position, for example from a mast.

    Args:
        rules: rules for recording frames; `min_travel_m` is not used.
        time_s: current simulation time [s].
        position: (2,) position in the axes of the town [m].
        heading_rad: viewing direction, counter-clockwise from east [rad].
    """

    def __init__(self, rules: Collection, time_s: float, position: np.ndarray, heading_rad: float) -> None:
        self._rules, self._position, self._heading_rad = rules, position, heading_rad
        self._company_m = COMPANY_M if rules.company_m is None else rules.company_m
        self._last_time_s = time_s

    def selects(self, actors: Actors) -> bool:
        """Whether to record this instant; if True, the instant counts as recorded."""
        if not _has_company_ahead(actors, self._position, self._heading_rad, self._company_m):
            return False
        self._last_time_s = actors.time_s
        return True

    def end_reason(self, actors: Actors) -> str | None:
        """Reason why the episode ends, or None if it continues."""
        waited_s = actors.time_s - self._last_time_s
        return None if waited_s <= self._rules.patience_s else f"empty roads: no frame for {waited_s:.0f} s"


def _has_company_ahead(actors: Actors, position: np.ndarray, heading_rad: float, company_m: float) -> bool:
    """Whether a road user in the viewing direction is closer than `company_m`."""
    if company_m == 0:
        return True
    offset = actors.front[:, :2] - position
    along = offset @ np.array([np.cos(heading_rad), np.sin(heading_rad)])
    distance = np.linalg.norm(offset, axis=1)
    is_ahead = (distance > 0) & (along >= np.cos(_AHEAD_RAD) * distance)
    return bool((is_ahead & (distance < company_m)).any())
