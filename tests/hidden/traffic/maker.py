"""Lets SUMO drive a town's traffic with a hidden habit and writes what was measured.

Run as a program, a process each: `python -m tests.hidden.traffic.maker TASK.json`.
"""

from __future__ import annotations

import csv
import json
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

STEP_S = 0.1
_PARKING = 2  # bit of SUMO's stop state
_PLAIN = {
    "speed": (1.0, 0.05),  # middle and half width of uniform draws
    "gap": (2.0, 0.5),
    "tau": (1.2, 0.2),
    "offset": (0.0, 0.0),
    "sigma": 0.5,
    "action_s": 0.0,
    "change_per_edge": 0.0,
    "u_turn_share": 0.0,  # of legs of a route that turn back
    "leaves_per_min": 0.0,
}


def make(
    config: Path, out: Path, hidden: dict, seed: int, drivers: int, parked: int, seconds: float, step_s: float = STEP_S
) -> None:
    """Write the CSV file of one measurement."""
    import libsumo

    habit = {**_PLAIN, **hidden}
    rng = np.random.default_rng([seed, 77])
    folder = out.parent / f"{out.stem}_sumo"
    folder.mkdir(parents=True, exist_ok=True)
    net, more = config.parent / "grid.net.xml", config.parent / "grid.add.xml"
    (folder / "all.rou.xml").write_text(_routes(net, more, habit, rng, drivers, parked, seconds))
    command = ["sumo", "-n", str(net), "-a", str(more), "-r", str(folder / "all.rou.xml"), "--seed", str(seed + 1)]
    command += ["--step-length", str(step_s), "--no-step-log", "--no-warnings", "--time-to-teleport", "-1"]
    libsumo.start([*command, "--lateral-resolution", "0.8", "--begin", "0"])
    rows, wishes, seen = [], {}, {}
    steps = round(seconds / step_s)
    for step in range(steps + round(20 / step_s)):
        libsumo.simulationStep()
        now = libsumo.simulation.getTime()
        for name in libsumo.vehicle.getIDList():
            _wish(libsumo, name, habit, rng, wishes, seen)
            if step >= round(20 / step_s):
                stands = libsumo.vehicle.getStopState(name) & _PARKING
                if stands and step % 50:
                    continue
                x, y = libsumo.vehicle.getPosition(name)
                angle, lane = libsumo.vehicle.getAngle(name), libsumo.vehicle.getLaneID(name)
                kind, speed = libsumo.vehicle.getTypeID(name).split("@")[0], libsumo.vehicle.getSpeed(name)
                rows.append([f"{now:.2f}", name, f"{x:.3f}", f"{y:.3f}", f"{speed:.4f}", f"{angle:.3f}", lane, kind])
    libsumo.close()
    with out.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time_s", "id", "x_m", "y_m", "speed_mps", "heading_deg", "lane", "type"])
        writer.writerows(rows)


def _wish(libsumo, name, habit, rng, wishes, seen) -> None:
    """Random lane changes without a reason, with some probability per road."""
    if not habit["change_per_edge"] or libsumo.vehicle.getStopState(name) & _PARKING:
        return
    edge = libsumo.vehicle.getRoadID(name)
    if edge[:1] == ":":
        return
    if seen.get(name) != edge:
        seen[name] = edge
        wishes.pop(name, None)
        if rng.random() < habit["change_per_edge"]:
            wishes[name] = rng.uniform(20, 110)
    if name in wishes and libsumo.vehicle.getLanePosition(name) > wishes[name] and libsumo.vehicle.getSpeed(name) > 3:
        del wishes[name]
        libsumo.vehicle.changeLane(name, 1 - libsumo.vehicle.getLaneIndex(name), 5.0)


def _routes(net: Path, more: Path, habit: dict, rng, drivers: int, parked: int, seconds: float) -> str:
    root = ET.parse(net).getroot()
    edges = {e.attrib["id"]: (e.attrib["from"], e.attrib["to"]) for e in root.iter("edge") if not e.get("function")}
    onward = {e: sorted(o for o in edges if edges[o][0] == edges[e][1] and edges[o][1] != edges[e][0]) for e in edges}
    links = {(link.get("from"), link.get("to")) for link in root.iter("connection")}
    back = {e: next(o for o in edges if edges[o] == edges[e][::-1]) for e in edges}
    back = {e: other for e, other in back.items() if (e, other) in links}
    types = ET.parse(more).getroot().findall("vType")
    lots = ET.parse(more).getroot().findall("parkingArea")
    names, lines = sorted(edges), []
    for number in range(drivers):
        lines.append((1 + 14 * number / drivers, f"v{number}", None, names[int(rng.integers(len(names)))]))
    for number, at in enumerate(rng.permutation(len(lots))[:parked].tolist()):
        lines.append((0.0, f"p{number}", lots[at], lots[at].attrib["lane"].rsplit("_", 1)[0]))
    leaves = np.sort(rng.uniform(20, 20 + seconds, rng.poisson(habit["leaves_per_min"] * seconds / 60)))
    who = rng.permutation(parked).tolist()
    stays = {f"p{who[i]}": float(at) for i, at in enumerate(leaves[:parked])}
    text = ["<routes>"]
    for depart, name, lot, edge in sorted(lines, key=lambda line: line[0]):
        base = dict(types[int(rng.integers(len(types)))].attrib)
        size = base["id"]
        low_gap = max(habit["gap"][0] + rng.uniform(-1, 1) * habit["gap"][1], 0.1)
        base |= {"id": f"{size}@{name}", "minGap": f"{low_gap:.3f}", "sigma": f"{habit['sigma']}"}
        base |= {"tau": f"{habit['tau'][0] + rng.uniform(-1, 1) * habit['tau'][1]:.3f}"}
        base |= {"speedFactor": f"{habit['speed'][0] + rng.uniform(-1, 1) * habit['speed'][1]:.4f}", "speedDev": "0"}
        base |= {"actionStepLength": f"{habit['action_s']:.2f}"} if habit["action_s"] else {}
        offset = habit["offset"][0] + rng.uniform(-1, 1) * habit["offset"][1]
        base |= {"latAlignment": f"{offset:.3f}" if offset else "center"}
        base |= {"lcMaxSpeedLatStanding": "0", "lcMaxSpeedLatFactor": "0.25"}
        text.append("<vType " + " ".join(f'{key}="{value}"' for key, value in base.items()) + "/>")
        route, turns = [edge], habit["u_turn_share"]
        while len(route) < 40:
            turned, options = turns and rng.random() < turns, onward[route[-1]]
            around = route[-1] in back and (turned or not options)
            route.append(back[route[-1]] if around else options[int(rng.integers(len(options)))])
        stop = ""
        if lot is not None:
            stop = f'<stop parkingArea="{lot.get("id")}" duration="{stays.get(name, 1e6):.1f}"/>'
        position = "stop" if lot is not None else "random_free"
        text.append(
            f'<vehicle id="{name}" type="{base["id"]}" depart="{depart:.1f}" departPos="{position}" departLane="best" '
            f'departSpeed="0"><route edges="{" ".join(route)}"/>{stop}</vehicle>'
        )
    return "".join([*text, "</routes>"])


if __name__ == "__main__":
    task = json.loads(Path(sys.argv[1]).read_text())
    make(Path(task.pop("config")), Path(task.pop("out")), **task)
