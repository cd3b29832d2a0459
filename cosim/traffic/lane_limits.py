"""Limits of lanes in a running simulation: bends, and streets that are driven slower or faster."""

from __future__ import annotations

from types import ModuleType

import numpy as np

from cosim.traffic.motion.corners import corner_speed
from cosim.traffic.street_speed import StreetSpeed

_BEND_RAD, _SHORTEST_M = 0.3, 1e-3


def slow_for_bends(api: ModuleType, lateral_mps2: float | None = None) -> None:
    """Limit lanes to the speed that their bends allow; SUMO takes bends at 5.5 m/s² and faster.

    Args:
        api: the running libsumo.
        lateral_mps2: accepted lateral acceleration [m/s²]; v = √(a·R) with the lane's mean
            radius R. By default 2.8 at the sharpest bend.
    """
    for lane in api.lane.getIDList():
        shape = np.array(api.lane.getShape(lane))
        fastest = corner_speed(shape) if lateral_mps2 is None else float(np.sqrt(lateral_mps2 * _mean_radius(shape)))
        if fastest < api.lane.getMaxSpeed(lane) and tuple(api.lane.getAllowed(lane)) != ("pedestrian",):
            api.lane.setMaxSpeed(lane, fastest)


def _mean_radius(shape: np.ndarray) -> float:
    """Length of a lane over the angle that it turns by [m]; infinite for less than 0.3 rad."""
    piece = np.diff(shape[:, :2], axis=0)
    length = np.hypot(piece[:, 0], piece[:, 1])
    heading = np.unwrap(np.arctan2(piece[:, 1], piece[:, 0])[length > _SHORTEST_M])
    turned = float(np.ptp(heading)) if len(heading) > 1 else 0.0
    return float(length.sum()) / turned if turned > _BEND_RAD else float("inf")


def scale_limits(api: ModuleType, streets: StreetSpeed) -> None:
    """Multiply the limits of all lanes of some streets."""
    known = set(api.edge.getIDList())
    for edge in streets.edges:
        for index in range(api.edge.getLaneNumber(edge) if edge in known else 0):
            lane = f"{edge}_{index}"
            api.lane.setMaxSpeed(lane, api.lane.getMaxSpeed(lane) * streets.factor)
