"""Simulates a network in SUMO with a hidden behaviour, and writes what a camera above would measure.

Run as a program, a process each: `python -m tests.hidden.traffic.sumo_maker TASK.json`. It shares no code with cosim.
"""

from __future__ import annotations

import csv
import json
import math
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

STEP_S, WARM_S = 0.1, 60.0


def main(task: dict) -> None:
    """Write the table of one recording."""
    import libsumo

    folder, hidden = Path(task["folder"]), task["hidden"]
    rng = np.random.default_rng([task["seed"], 31])
    (folder / "all.rou.xml").write_text(_routes(folder / "net.net.xml", task, hidden, rng))
    options = ["sumo", "-n", str(folder / "net.net.xml"), "-r", str(folder / "all.rou.xml"), "--seed"]
    options += [str(task["seed"] + 1), "--step-length", str(STEP_S), "--no-step-log", "--no-warnings"]
    libsumo.start([*options, "--time-to-teleport", "-1", *hidden.get("options", [])])
    _change_lanes_limits(libsumo, hidden, rng)
    acts, rows = _Acts(libsumo, hidden, rng), []
    for step in range(round((WARM_S + task["seconds"]) / STEP_S)):
        libsumo.simulationStep()
        now = libsumo.simulation.getTime()
        names = libsumo.vehicle.getIDList()
        acts.step(names, now - WARM_S)
        if step * STEP_S < WARM_S:
            continue
        for name in names:
            x, y = libsumo.vehicle.getPosition(name)
            speed, angle = libsumo.vehicle.getSpeed(name), libsumo.vehicle.getAngle(name)
            rows.append([now, name, x, y, speed, angle, libsumo.vehicle.getTypeID(name).split("@")[0]])
    libsumo.close()
    _write(folder / "measured.csv", rows, hidden, rng)


def _write(path: Path, rows: list, hidden: dict, rng: np.random.Generator) -> None:
    offset, noise = hidden.get("lateral", (0.0, 0.0)), hidden.get("noise_m", 0.0)
    places: dict[str, float] = {}
    centre = np.array([[row[2], row[3]] for row in rows]).mean(0)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time_s", "id", "x_m", "y_m", "speed_mps", "heading_deg", "type"])
        for time_s, name, x, y, speed, angle, kind in rows:
            left = places.setdefault(name, offset[0] + offset[1] * rng.uniform(-1, 1) * 3**0.5)
            left += hidden.get("weaving_m", 0.0) * math.sin(2 * math.pi * time_s / 4 + hash_of(name))
            bearing = math.radians(angle)
            x, y = x - left * math.cos(bearing), y + left * math.sin(bearing)
            if hidden.get("crop_m") and math.hypot(x - centre[0], y - centre[1]) > hidden["crop_m"]:
                continue
            x, y = x + noise * rng.standard_normal(), y + noise * rng.standard_normal()
            time_s += hidden.get("shift_s", 0.0)
            values = [f"{time_s:.2f}", name, f"{x:.3f}", f"{y:.3f}", f"{speed:.3f}", f"{angle:.2f}", kind]
            writer.writerow(values)


def hash_of(name: str) -> float:
    """A phase of a vehicle."""
    return sum(map(ord, name)) % 63 / 10


def _routes(net: Path, task: dict, hidden: dict, rng: np.random.Generator) -> str:
    root = ET.parse(net).getroot()
    edges = [e.get("id", "") for e in root.iter("edge") if not e.get("function")]
    onward: dict[str, set[str]] = {}
    for link in root.iter("connection"):
        if link.get("from", "")[:1] != ":":
            onward.setdefault(link.get("from", ""), set()).add(link.get("to", ""))
    entered = {to for found in onward.values() for to in found}
    sources = sorted(set(edges) - entered) or sorted(edges)
    if len(sources) < 6 and task["network"] != "motorway":
        sources = sorted(edges)
    text, count = ["<routes>"], task["vehicles"]
    departs = np.sort(rng.uniform(0, WARM_S + task["seconds"] - 5, count))
    for number, depart in enumerate(departs.tolist()):
        kind = "truck" if rng.random() < 0.15 else "car"
        base = {"vClass": "truck", "length": "9"} if kind == "truck" else {"vClass": "passenger"}
        mean, dev = (0.95, 0.05) if kind == "truck" else (1.0, 0.08)
        factor = float(np.clip(rng.normal(mean, dev), 0.6, 1.5)) * hidden.get("speed_ratio", 1.0)
        if hidden.get("classes") and rng.random() < hidden["classes"][0]:
            factor *= hidden["classes"][1]
        base |= {"speedFactor": f"{factor:.4f}", "speedDev": "0"}
        base |= {key: str(value) for key, value in hidden.get("vtype", {}).items()}
        if kind == "truck":
            base |= {key: str(value) for key, value in hidden.get("truck", {}).items()}
        words = " ".join(f'{key}="{value}"' for key, value in base.items())
        route = [sources[int(rng.integers(len(sources)))]]
        while len(route) < 14 and onward.get(route[-1]):
            options = sorted(onward[route[-1]])
            route.append(options[int(rng.integers(len(options)))])
        text.append(f'<vType id="{kind}@v{number}" {words}/>')
        text.append(
            f'<vehicle id="v{number}" type="{kind}@v{number}" depart="{depart:.1f}" departLane="best" '
            f'departSpeed="max"><route edges="{" ".join(route)}"/></vehicle>'
        )
    return "".join([*text, "</routes>"])


def _change_lanes_limits(libsumo, hidden: dict, rng: np.random.Generator) -> None:
    lanes = libsumo.lane.getIDList()
    if "cornering_mps2" in hidden:
        for lane in lanes:
            shape = np.array(libsumo.lane.getShape(lane))
            piece = np.diff(shape, axis=0)
            turn = np.ptp(np.unwrap(np.arctan2(piece[:, 1], piece[:, 0])))
            if turn > 0.4:
                radius = float(np.hypot(*piece.T).sum()) / turn
                slow = math.sqrt(hidden["cornering_mps2"] * radius)
                libsumo.lane.setMaxSpeed(lane, min(slow, libsumo.lane.getMaxSpeed(lane)))
    if "slow_quarter" in hidden:
        places = {lane: np.mean(libsumo.lane.getShape(lane), axis=0) for lane in lanes if lane[0] != ":"}
        middle = np.median(list(places.values()), axis=0)
        for lane, position in places.items():
            if (position < middle).all():
                libsumo.lane.setMaxSpeed(lane, libsumo.lane.getMaxSpeed(lane) * hidden["slow_quarter"])


class _Acts:
    """What single drivers do now and then."""

    def __init__(self, libsumo, hidden: dict, rng: np.random.Generator) -> None:
        self._sumo, self._hidden, self._rng = libsumo, hidden, rng
        self._edges: dict[str, str] = {}
        self._slowed: set[str] = set()
        self._stopped: set[str] = set()
        self._factor: dict[str, float] = {}

    def step(self, names: tuple[str, ...], since_s: float) -> None:
        """Act after a step."""
        api, hidden, rng = self._sumo.vehicle, self._hidden, self._rng
        for name in names:
            road = api.getRoadID(name)
            new = road[:1] != ":" and self._edges.get(name) != road
            if new:
                self._edges[name] = road
            if hidden.get("changes") and new and rng.random() < hidden["changes"]:
                lanes = self._sumo.edge.getLaneNumber(road)
                if lanes > 1:
                    api.changeLane(name, 1 - min(api.getLaneIndex(name), 1), 5.0)
            if hidden.get("brakes_per_s") and rng.random() < hidden["brakes_per_s"] * STEP_S and api.getSpeed(name) > 6:
                api.slowDown(name, max(api.getSpeed(name) - 5, 0.5), 1.2)
            if hidden.get("stops") and new and name not in self._stopped and rng.random() < hidden["stops"]:
                length = self._sumo.lane.getLength(api.getLaneID(name))
                if length > 120:
                    self._stopped.add(name)
                    api.setStop(name, road, length * 0.6, api.getLaneIndex(name), 12.0)
            if hidden.get("late_ratio") and since_s > 45 and name not in self._slowed:
                self._slowed.add(name)
                api.setSpeedFactor(name, api.getSpeedFactor(name) * hidden["late_ratio"])
            if hidden.get("swings"):
                own = self._factor.setdefault(name, api.getSpeedFactor(name))
                swing = 1 + hidden["swings"] * math.sin(2 * math.pi * since_s / 6 + hash_of(name))
                api.setSpeedFactor(name, own * swing)


if __name__ == "__main__":
    main(json.loads(Path(sys.argv[1]).read_text()))
