"""Moving obstacles of a CommonRoad scenario.

Althoff, Koschi and Manzinger, CommonRoad: Composable benchmarks for motion planning on roads, IV 2017, and its XML
documentation 2020a: states hold the middle of a shape; orientation counts counter-clockwise from x.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

from cosim.traffic.trajectories.kinds import user_of
from cosim.traffic.trajectories.tracks import RoadTracks, TrackSample, TrajectoryError, User, gather


def read_commonroad(path: Path, root: ET.Element, left_out: Counter[str]) -> RoadTracks:
    """Tracks of the obstacles of a `commonRoad` document, static ones included.

    Raises:
        TrajectoryError: a value is missing or no number, or see `gather`.
    """
    step_s = _number(path, root.get("timeStepSize"), "timeStepSize")
    samples: list[TrackSample] = []
    users: dict[str, User] = {}
    for element in root:
        if element.tag not in ("dynamicObstacle", "staticObstacle", "obstacle"):
            continue
        name, word = element.get("id", ""), (element.findtext("type") or "").strip()
        rectangle = element.find("shape/rectangle")
        length, width = (
            (None, None)
            if rectangle is None
            else tuple(_number(path, rectangle.findtext(key), f"{name}: {key}") for key in ("length", "width"))
        )
        user = user_of(word, (length, width, None))
        if user is None:
            left_out[word] += 1
            continue
        users[name] = user
        states = [*element.findall("initialState"), *element.findall("trajectory/state")]
        samples += [_sample(path, state, name, step_s) for state in states]
    if samples:
        samples += _standing(root, samples)
    return gather(path, samples, users, centred=True)


def _standing(root: ET.Element, samples: list[TrackSample]) -> list[TrackSample]:
    """Repeat static obstacles at the end: they are present throughout."""
    end_s = max(one.time_s for one in samples)
    still = {element.get("id", "") for element in root if element.tag == "staticObstacle"}
    return [
        TrackSample(end_s, one.user, one.x_m, one.y_m, heading_rad=one.heading_rad, speed_mps=0.0)
        for one in samples
        if one.user in still and one.time_s < end_s
    ]


def _sample(path: Path, state: ET.Element, name: str, step_s: float) -> TrackSample:
    def value(key: str, default: str | None = None) -> float:
        text = state.findtext(f"{key}/exact")
        return _number(path, default if text is None else text, f"obstacle {name}: {key}")

    point = state.find("position/point")
    if point is None:
        raise TrajectoryError(f"{path}: obstacle {name} has a state without position/point; give exact states")
    x, y = (_number(path, point.findtext(axis), f"obstacle {name}: {axis}") for axis in "xy")
    time_s = value("time", "0") * step_s
    return TrackSample(time_s, name, x, y, heading_rad=value("orientation"), speed_mps=abs(value("velocity", "0")))


def _number(path: Path, text: str | None, what: str) -> float:
    try:
        return float("" if text is None else text)
    except ValueError:
        raise TrajectoryError(f"{path}: {what} is {text!r}; write a number") from None
