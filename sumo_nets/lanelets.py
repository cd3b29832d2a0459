"""Streets from the lanelets of a CommonRoad scenario.

Bender, Ziegler and Stiller, Lanelets: Efficient map representation for autonomous driving, IV 2014; CommonRoad XML
documentation 2020a: a lanelet lies between a left and a right bound, both in driving direction.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Literal

import numpy as np

from assets.streets import LaneUse, StreetLane, Streets
from sumo_nets.errors import TownError

_USES: dict[str, LaneUse] = {"sidewalk": "sidewalk", "bicycleLane": "cycle", "crosswalk": "crossing"}
_SPEED_MPS = 50 / 3.6
_POINTS = 12


def read_lanelets(path: Path, root: ET.Element, style: str) -> Streets:
    """Streets of a `commonRoad` document; heights are 0 where bounds have none.

    Raises:
        TownError: it has no lanelet, or a bound is not two points or more.
    """
    lanes = tuple(_lane(path, element) for element in root.findall("lanelet"))
    if not any(lane.use == "drive" for lane in lanes):
        raise TownError(f"{path}: holds no lanelet to drive on; give a scenario with its road network")
    return Streets(path.stem, lanes, (), (), (), style)


def _lane(path: Path, element: ET.Element) -> StreetLane:
    name = element.get("id", "")
    left, right = (_evenly(_bound(path, element, name, side)) for side in ("leftBound", "rightBound"))
    types = {kind.text for kind in element.findall("laneletType")}
    use = _use(types)
    width = float(np.median(np.linalg.norm((left - right)[:, :2], axis=1)))
    if width < 0.5:
        raise TownError(f"{path}: lanelet {name} is {width:.2f} m wide; bounds lie at least 0.5 m apart")
    internal = bool(types & {"intersection"})
    return StreetLane(f"{name}_0", name, use, (left + right) / 2, width, _SPEED_MPS, internal)


def _use(types: set[str | None]) -> LaneUse:
    for kind, use in _USES.items():
        if kind in types:
            return use
    return "drive"


def _bound(path: Path, element: ET.Element, name: str, side: Literal["leftBound", "rightBound"]) -> np.ndarray:
    try:
        points = [
            [float(point.findtext(axis) or ("nan" if axis != "z" else "0")) for axis in "xyz"]
            for point in element.findall(f"{side}/point")
        ]
        bound = np.array(points, float).reshape(-1, 3)
    except ValueError as error:
        raise TownError(f"{path}: lanelet {name}: {side} is not made of numbers ({error})") from None
    if len(bound) < 2 or not np.isfinite(bound).all():
        raise TownError(f"{path}: lanelet {name}: {side} has {len(bound)} points; give two or more, all finite")
    return bound


def _evenly(bound: np.ndarray) -> np.ndarray:
    """A line (n, 3) by points evenly along it, so that two bounds go together."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(bound, axis=0), axis=1))])
    at = np.linspace(0, along[-1], _POINTS)
    return np.column_stack([np.interp(at, along, bound[:, axis]) for axis in range(3)])
