"""A small town of a grid of streets, built by SUMO's own program, with places to park."""

from __future__ import annotations

import math
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

_CARS = 'vClass="passenger" accel="1.6" decel="3.5" sigma="0.5" tau="1.2" minGap="2.0" width="1.7" height="1.5"'
_LENGTHS_M = (3.9, 4.3, 4.7)
BEHAVIOUR = {
    "preset": "calm",
    "gap_m": {"kind": "uniform", "min": 1.5, "max": 2.5},
    "headway_s": {"kind": "uniform", "min": 1.0, "max": 1.4},
    "speeding_share": {"kind": "uniform", "min": -0.05, "max": 0.05},
}
"""What the model believes of drivers: the same that the makers draw where nothing is hidden."""


def build_town(folder: Path, crossings: int = 4, street_m: float = 170.0, lots: int = 4) -> Path:
    """Build and return the `.sumocfg`."""
    import sumo

    folder.mkdir(parents=True, exist_ok=True)
    net = folder / "grid.net.xml"
    program = Path(sumo.SUMO_HOME) / "bin" / "netgenerate"
    grid = ["--grid", "--grid.number", str(crossings), "--grid.length", str(street_m)]
    more = ["--default.lanenumber", "2", "--default.speed", "13.89", "--tls.guess", "--seed", "1"]
    subprocess.run([program, *grid, *more, "-o", net], check=True, capture_output=True)
    _slow_in_corners(net)
    lines = [f'<vType id="car{size}" length="{size}" speedFactor="1" speedDev="0" {_CARS}/>' for size in _LENGTHS_M]
    for edge in ET.parse(net).getroot().iter("edge"):
        if edge.get("function"):
            continue
        for number in range(lots):
            start = 30 + number * 14
            lane = f"{edge.get('id')}_0"
            lines.append(
                f'<parkingArea id="p{number}_{edge.get("id")}" lane="{lane}" startPos="{start}" '
                f'endPos="{start + 8}" roadsideCapacity="1" width="2.2"/>'
            )
    (folder / "grid.add.xml").write_text(f"<additional>{''.join(lines)}</additional>")
    (folder / "grid.rou.xml").write_text("<routes/>")
    config = folder / "grid.sumocfg"
    config.write_text(
        "<configuration><net-file value='grid.net.xml'/><additional-files value='grid.add.xml'/>"
        "<route-files value='grid.rou.xml'/></configuration>"
    )
    return config


def _slow_in_corners(net: Path, sideways_mps2: float = 2.5) -> None:
    """Limits inside junctions that a driver would keep to, the radius taken from how far a lane turns on its way."""
    tree = ET.parse(net)
    for edge in tree.getroot().iter("edge"):
        for lane in edge.iter("lane") if edge.get("function") == "internal" else ():
            points = [tuple(float(v) for v in p.split(",")[:2]) for p in lane.get("shape", "").split()]
            first, last = (math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in (points[:2], points[-2:]))
            turn = abs(math.remainder(last - first, math.tau))
            if turn > 0.2:
                slow = max(math.sqrt(sideways_mps2 * float(lane.get("length", 1)) / turn), 2.5)
                lane.set("speed", f"{min(float(lane.get('speed', 9)), slow):.2f}")
    tree.write(net)
