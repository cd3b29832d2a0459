"""Shape and permitted use of sumolib's lanes."""

from __future__ import annotations

from typing import Any

import numpy as np

from assets.streets import LaneUse

_DRIVERS = {"passenger", "delivery", "truck", "bus", "motorcycle", "taxi", "coach", "private", "hov", "evehicle"}
_DRIVERS |= {"trailer", "moped", "emergency", "army", "vip", "authority"}
TRAMS = frozenset({"tram", "rail_urban"})
RAILWAYS = frozenset({"rail", "rail_electric", "rail_fast", "subway", "cable_car"})
_FARTHEST_M = 4e7


def points(shape: Any) -> np.ndarray:
    """Return a sumolib shape as a read-only (k, 3) array, world metres; heights that are missing are zero.

    Raises:
        ValueError: a coordinate is not finite, or larger than the Earth's circumference.
    """
    array = np.array([(*p, 0.0)[:3] for p in shape], dtype=np.float64).reshape(-1, 3)
    if not (np.abs(array) < _FARTHEST_M).all():
        raise ValueError(f"a shape has the coordinate {array[~(np.abs(array) < _FARTHEST_M)][0]:g} m")
    array.setflags(write=False)
    return array


def use_of(edge: Any, lane: Any) -> LaneUse | None:
    """Return the road users of a sumolib lane, None for lanes of trains, ships etc."""
    allowed = set(lane.getPermissions())
    if edge.getFunction() == "crossing":
        return "crossing"
    if allowed & _DRIVERS:
        return "drive"
    if "pedestrian" in allowed:
        return "sidewalk"
    if "bicycle" in allowed:
        return "cycle"
    return "tram" if allowed & TRAMS else None


def has_tracks(lane: Any) -> bool:
    """Whether a sumolib lane is meant for trams; a lane that is open even to ships has no restriction at all."""
    allowed = set(lane.getPermissions())
    return bool(allowed & TRAMS) and "ship" not in allowed
