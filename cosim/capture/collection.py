"""Which instants are worth a frame, and when an episode has nothing more to give."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from cosim.traffic.actors import Actors

COMPANY_M = 45.0  # in built-in towns
_AHEAD_RAD = np.radians(40.0)  # to each side: what KITTI's cameras see


class Collection(BaseModel):
    """When frames are recorded."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    every_s: float = Field(default=1.0, gt=0, le=600, description="least simulated time between frames [s]")
    min_travel_m: float = Field(
        default=1.0, ge=0, le=1000, description="least way of the ego vehicle between frames [m]"
    )
    company_m: float | None = Field(
        default=None,
        ge=0,
        le=1000,
        description="someone ahead must be this near, else it is empty; 0: never; none: 45 in built-in towns, 0 in "
        "one's own [m]",
    )
    patience_s: float = Field(
        default=90.0, gt=0, le=36000, description="an episode ends after so long without a frame [s]"
    )
    attempts: int = Field(default=4, ge=1, le=100, description="simulations started to fill one episode's frames")


class Watch:
    """Follows the ego vehicle through one simulation.

    Args:
        rules: when to record.
        actors: at the start.
        ego: id of the ego vehicle.
        company_m: someone ahead must be this near, where the rules do not say; 0: nobody need be.
    """

    def __init__(self, rules: Collection, actors: Actors, ego: str, company_m: float = COMPANY_M) -> None:
        self._rules = rules
        self._company_m = company_m if rules.company_m is None else rules.company_m
        self._ego = ego
        self._last_time_s = actors.time_s
        self._place = self._where(actors)

    def wants(self, actors: Actors) -> bool:
        """Whether this instant is worth a frame; what it says yes to counts as recorded."""
        here = self._where(actors)
        travelled = np.linalg.norm(here - self._place)
        if travelled < self._rules.min_travel_m or not self._has_company(actors, here):
            return False
        self._place, self._last_time_s = here, actors.time_s
        return True

    def end_reason(self, actors: Actors) -> str | None:
        """Why the episode cannot go on, if so."""
        if self._ego not in actors.ids:
            return "the ego vehicle left the road"
        waited = actors.time_s - self._last_time_s
        if waited <= self._rules.patience_s:
            return None
        standing = np.linalg.norm(self._where(actors) - self._place) < self._rules.min_travel_m
        return f"{'jam' if standing else 'empty roads'}: no frame for {waited:.0f} s"

    def _where(self, actors: Actors) -> np.ndarray:
        return actors.front[actors.ids.index(self._ego), :2]

    def _has_company(self, actors: Actors, here: np.ndarray) -> bool:
        heading = actors.heading_rad[actors.ids.index(self._ego)]
        return _in_company(actors, here, float(heading), self._company_m)


class StillWatch:
    """Watches from a place that does not move, as a mast's.

    Args:
        rules: when to record; nobody has to travel.
        time_s: now.
        place: (2,) axes of the town [m].
        heading_rad: which way it looks, counter-clockwise from east.
    """

    def __init__(self, rules: Collection, time_s: float, place: np.ndarray, heading_rad: float) -> None:
        self._rules, self._place, self._heading_rad = rules, place, heading_rad
        self._company_m = COMPANY_M if rules.company_m is None else rules.company_m
        self._last_time_s = time_s

    def wants(self, actors: Actors) -> bool:
        """Whether this instant is worth a frame; what it says yes to counts as recorded."""
        if not _in_company(actors, self._place, self._heading_rad, self._company_m):
            return False
        self._last_time_s = actors.time_s
        return True

    def end_reason(self, actors: Actors) -> str | None:
        """Why the episode cannot go on, if so."""
        waited = actors.time_s - self._last_time_s
        return None if waited <= self._rules.patience_s else f"empty roads: no frame for {waited:.0f} s"


def _in_company(actors: Actors, here: np.ndarray, heading_rad: float, company_m: float) -> bool:
    """Whether somebody ahead of a place is near enough."""
    if company_m == 0:
        return True
    way = actors.front[:, :2] - here
    along = way @ np.array([np.cos(heading_rad), np.sin(heading_rad)])
    distance = np.linalg.norm(way, axis=1)
    ahead = (distance > 0) & (along >= np.cos(_AHEAD_RAD) * distance)
    return bool((ahead & (distance < company_m)).any())
