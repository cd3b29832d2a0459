"""Turn a CommonRoad motorway into a SUMO network: `python -m tests.hidden.traffic.lanelets FILE FOLDER`.

Lanelets side by side become the lanes of an edge, successors become connections. Junctions, signs and lights are not
converted: the map must be a motorway.
"""

from __future__ import annotations

import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

_LIMIT_MPS = 29.06  # 65 mph, where the map has no limit


def convert(source: Path, folder: Path) -> Path:
    """Write the network, vehicle types and a `.sumocfg`, and return the last."""
    import sumo

    folder.mkdir(parents=True, exist_ok=True)
    lanelets = {lanelet.get("id", ""): lanelet for lanelet in ET.parse(source).getroot().findall("lanelet")}
    edges = _edges(lanelets)
    position = {name: (number, index) for number, edge in enumerate(edges) for index, name in enumerate(edge)}
    nodes: dict[str, np.ndarray] = {}
    parts: list[str] = []
    links: list[str] = []
    for number, edge in enumerate(edges):
        after = {position[to][0] for name in edge for to in _refs(lanelets[name], "successor")}
        before = any(_refs(lanelets[name], "predecessor") for name in edge)
        begin = f"into{number}" if before else f"source{number}"
        end = f"into{min(after)}" if after else f"sink{number}"
        middle = _middle(lanelets[edge[len(edge) // 2]])
        nodes.setdefault(begin, middle[0])
        nodes.setdefault(end, middle[-1])
        lanes = "".join(
            f'<lane index="{index}" width="{_width(lanelets[name]):.2f}" shape="{_text(_middle(lanelets[name]))}"/>'
            for index, name in enumerate(edge)
        )
        parts.append(
            f'<edge id="e{number}" from="{begin}" to="{end}" numLanes="{len(edge)}" speed="{_LIMIT_MPS}" '
            f'priority="{len(edge)}" shape="{_text(middle)}">{lanes}</edge>'
        )
        for index, name in enumerate(edge):
            for to in _refs(lanelets[name], "successor"):
                other, lane = position[to]
                links.append(f'<connection from="e{number}" to="e{other}" fromLane="{index}" toLane="{lane}"/>')
    points = "".join(f'<node id="{name}" x="{x:.2f}" y="{y:.2f}"/>' for name, (x, y) in nodes.items())
    (folder / "m.nod.xml").write_text(f"<nodes>{points}</nodes>")
    (folder / "m.edg.xml").write_text(f"<edges>{''.join(parts)}</edges>")
    (folder / "m.con.xml").write_text(f"<connections>{''.join(links)}</connections>")
    command = [str(Path(sumo.SUMO_HOME) / "bin" / "netconvert"), "-o", str(folder / "net.net.xml")]
    for option, word in (("-n", "nod"), ("-e", "edg"), ("-x", "con")):
        command += [option, str(folder / f"m.{word}.xml")]
    command += ["--no-turnarounds", "--offset.disable-normalization", "--junctions.limit-turn-speed", "-1"]
    subprocess.run(command, check=True, capture_output=True)
    (folder / "types.rou.xml").write_text(
        '<routes><vType id="car" vClass="passenger"/><vType id="truck" vClass="truck"/></routes>'
    )
    config = folder / "town.sumocfg"
    config.write_text(
        '<configuration><net-file value="net.net.xml"/><route-files value="types.rou.xml"/></configuration>'
    )
    return config


def _edges(lanelets: dict[str, ET.Element]) -> list[list[str]]:
    """Lanelets side by side in the same direction, from right to left."""
    found = []
    for name, lanelet in lanelets.items():
        if any(ref.get("drivingDir") == "same" for ref in lanelet.findall("adjacentRight")):
            continue
        edge, left = [name], lanelet.find("adjacentLeft")
        while left is not None and left.get("drivingDir") == "same":
            edge.append(left.get("ref", ""))
            left = lanelets[edge[-1]].find("adjacentLeft")
        found.append(edge)
    return found


def _refs(lanelet: ET.Element, word: str) -> list[str]:
    return [link.get("ref", "") for link in lanelet.findall(word)]


def _bound(lanelet: ET.Element, word: str) -> np.ndarray:
    points = lanelet.findall(f"{word}/point")
    return np.array([[float(point.findtext(axis, "0")) for axis in ("x", "y")] for point in points])


def _middle(lanelet: ET.Element) -> np.ndarray:
    return (_bound(lanelet, "leftBound") + _bound(lanelet, "rightBound")) / 2


def _width(lanelet: ET.Element) -> float:
    return float(np.median(np.hypot(*(_bound(lanelet, "leftBound") - _bound(lanelet, "rightBound")).T)))


def _text(shape: np.ndarray) -> str:
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in shape)


if __name__ == "__main__":
    print(convert(Path(sys.argv[1]), Path(sys.argv[2])))
