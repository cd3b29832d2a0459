"""SUMO's floating car data, `sumo --fcd-output FILE.xml`.

SUMO user documentation, Simulation/Output/FCDOutput: x, y are the middle of the front bumper, angles count clockwise
from north.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from cosim.traffic.trajectories.kinds import sumo_types, user_of
from cosim.traffic.trajectories.riders import is_rider
from cosim.traffic.trajectories.tracks import RoadTracks, TrackSample, TrajectoryError, User, gather


def read_fcd(path: Path, root: ET.Element, type_files: Iterable[Path], left_out: Counter[str]) -> RoadTracks:
    """Tracks of an `fcd-export` document; whom no vType makes a road user is counted in `left_out`.

    Raises:
        TrajectoryError: an attribute is missing or no number, or see `gather`.
        TownError: a file of types cannot be read.
    """
    known = sumo_types(type_files)
    samples: list[TrackSample] = []
    carried: list[bool] = []
    on_foot: list[bool] = []
    users: dict[str, User] = {}
    strangers: dict[str, str] = {}
    for step in root.iter("timestep"):
        time_s = _number(path, step, "time")
        for element in step:
            if element.tag not in ("vehicle", "person"):
                continue
            name = element.get("id", "")
            if name not in users and name not in strangers:
                usual = "DEFAULT_PEDTYPE" if element.tag == "person" else "DEFAULT_VEHTYPE"
                word = element.get("type", usual)
                user = known.get(word) or known.get(word.partition("@")[0]) or user_of(word)
                if user is None:
                    strangers[name] = word
                else:
                    users[name] = user
            if name in users:
                samples.append(_sample(path, element, name, time_s))
                on_foot.append(element.tag == "person")
                carried.append(element.tag == "person" and bool(element.get("vehicle")))
    left_out.update(strangers.values())
    riding = is_rider(samples, on_foot, carried)
    kept = [sample for sample, rides in zip(samples, riding.tolist(), strict=True) if not rides]
    tracks = replace(gather(path, kept, users, centred=False), sumo_clock=True)
    if not riding.any():
        return tracks
    riders = {sample.user for sample, rides in zip(samples, riding.tolist(), strict=True) if rides}
    note = f"{path}: {int(riding.sum())} samples of {len(riders)} persons riding in vehicles are left out"
    return replace(tracks, notes=(note,))


def _sample(path: Path, element: ET.Element, name: str, time_s: float) -> TrackSample:
    x, y = _number(path, element, "x"), _number(path, element, "y")
    return TrackSample(
        time_s=time_s,
        user=name,
        x_m=x,
        y_m=y,
        z_m=_number(path, element, "z") if "z" in element.attrib else math.nan,
        heading_rad=math.radians(90.0 - _number(path, element, "angle")),
        speed_mps=_number(path, element, "speed"),
        signals=int(element.get("signals", "0") or 0),
        lane=element.get("lane", ""),
    )


def _number(path: Path, element: ET.Element, key: str) -> float:
    text = element.get(key)
    try:
        return float("" if text is None else text)
    except ValueError:
        what = f"{element.tag} {element.get('id', '')}".strip()
        raise TrajectoryError(
            f"{path}: {what} has {key} {text!r}; write FCD output with its usual attributes, metres and no geo"
        ) from None
