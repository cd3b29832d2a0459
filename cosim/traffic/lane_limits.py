"""Limits of lanes in a running simulation: bends, and streets that are driven slower or faster."""

from __future__ import annotations

from types import ModuleType

import numpy as np

from cosim.traffic.motion.corners import corner_speed
from cosim.traffic.street_speed import StreetSpeed

_COMFORT_MPS2 = 2.8  # of `corner_speed`


def slow_for_bends(api: ModuleType, lateral_mps2: float | None = None) -> None:
    """Limit lanes to the speed that their bends allow; SUMO takes bends at 5.5 m/s² and faster.

    Args:
        api: the running libsumo.
        lateral_mps2: accepted lateral acceleration [m/s²]; by default 2.8. Speeds in bends grow with its root.
    """
    scale = 1.0 if lateral_mps2 is None else float(np.sqrt(lateral_mps2 / _COMFORT_MPS2))
    for lane in api.lane.getIDList():
        comfortable = scale * corner_speed(np.array(api.lane.getShape(lane)))
        if comfortable < api.lane.getMaxSpeed(lane) and tuple(api.lane.getAllowed(lane)) != ("pedestrian",):
            api.lane.setMaxSpeed(lane, comfortable)


def scale_limits(api: ModuleType, streets: StreetSpeed) -> None:
    """Multiply the limits of all lanes of some streets."""
    known = set(api.edge.getIDList())
    for edge in streets.edges:
        for index in range(api.edge.getLaneNumber(edge) if edge in known else 0):
            lane = f"{edge}_{index}"
            api.lane.setMaxSpeed(lane, api.lane.getMaxSpeed(lane) * streets.factor)
