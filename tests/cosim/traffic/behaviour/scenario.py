"""Streets and traffic for one test, as SUMO's files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from sumo_nets.tools import run_tool

CAR = 'length="4.3" width="1.75" height="1.5" vClass="passenger" accel="2.6" decel="4.5" sigma="0"'
"""What both scenarios' cars have; they add what they are about."""


def write_scenario(folder: Path, nodes: Iterable[str], edges: Iterable[str], routes: Iterable[str]) -> Path:
    """Have netconvert make the network, and return the path of the `.sumocfg`.

    Args:
        folder: where the files go.
        nodes, edges, routes: elements of SUMO's plain files.
    """
    for kind, root, elements in (("nod", "nodes", nodes), ("edg", "edges", edges), ("rou", "routes", routes)):
        (folder / f"x.{kind}.xml").write_text(f"<{root}>{''.join(elements)}</{root}>")
    run_tool("netconvert", "-n", "x.nod.xml", "-e", "x.edg.xml", "-o", "x.net.xml", cwd=folder)
    config = folder / "x.sumocfg"
    inputs = '<net-file value="x.net.xml"/><route-files value="x.rou.xml"/>'
    config.write_text(f"<configuration>{inputs}</configuration>")
    return config
