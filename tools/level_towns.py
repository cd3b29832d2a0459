"""Small networks with streets on several levels, and traffic on all of them, for the pictures of `tools.pictures`."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import sumo

_HOME = Path(sumo.SUMO_HOME)
_PERIOD_S = 5.0


@dataclass(frozen=True)
class Crossing:
    """A network.

    Attributes:
        nodes: x, y, z [m] by name.
        streets: names of the nodes along each street; both directions, with pavements.
        ramps: likewise, one lane in this direction.
        trips: first and last street end of each stream of vehicles, as pairs of nodes.
    """

    nodes: dict[str, tuple[float, float, float]]
    streets: tuple[tuple[str, ...], ...]
    ramps: tuple[tuple[str, ...], ...]
    trips: tuple[tuple[str, str], ...]


OVERPASS = Crossing(
    {
        "west": (-220, 0, 0), "east": (220, 0, 0),
        "south": (30, -220, 0), "rise": (15, -110, 2.0), "over": (0, -32, 6.5), "beyond": (0, 32, 6.5),
        "fall": (-15, 110, 2.0), "north": (-30, 220, 0),
    },
    (("west", "east"), ("south", "rise", "over", "beyond", "fall", "north")),
    (),
    (("west", "east"), ("east", "west"), ("south", "north"), ("north", "south")),
)  # fmt: skip
UNDERPASS = Crossing(
    {
        "south": (0, -220, 0), "north": (0, 220, 0),
        "west": (-220, 0, 0), "dip": (-120, 0, -1.0), "under": (-40, 0, -6.2), "below": (40, 0, -6.2),
        "climb": (120, 0, -1.0), "east": (220, 0, 0),
    },
    (("south", "north"), ("west", "dip", "under", "below", "climb", "east")),
    (),
    (("west", "east"), ("east", "west"), ("south", "north"), ("north", "south")),
)  # fmt: skip
INTERCHANGE = Crossing(
    {
        "west": (-260, 0, 0), "exit": (-130, 0, 0), "entry": (130, 0, 0), "east": (260, 0, 0),
        "south": (0, -260, 0), "foot": (0, -150, 2.5), "lower": (0, -60, 6.5), "upper": (0, 60, 6.5),
        "head": (0, 150, 2.5), "north": (0, 260, 0),
        "ramp_s": (-70, -22, 1.6), "turn_s": (-22, -45, 5.0), "ramp_n": (22, 45, 5.0), "turn_n": (70, 22, 1.6),
        "corner": (-230, -190, 5), "steep": (-120, -98, 11.0), "high": (-50, -40, 13.2), "peak": (50, 40, 13.2),
        "down": (120, 98, 11.0), "far": (230, 190, 5),
    },
    (
        ("west", "exit", "entry", "east"),
        ("south", "foot", "lower", "upper", "head", "north"),
        ("corner", "steep", "high", "peak", "down", "far"),
    ),
    (("exit", "ramp_s", "turn_s", "lower"), ("upper", "ramp_n", "turn_n", "entry")),
    (
        ("west", "east"), ("east", "west"), ("south", "north"), ("north", "south"),
        ("corner", "far"), ("far", "corner"), ("west", "north"), ("south", "east"),
    ),
)  # fmt: skip


def write_crossing(crossing: Crossing, folder: Path) -> Path:
    """Write network, demand and configuration of a crossing; the path of its `.sumocfg`."""
    folder.mkdir(parents=True, exist_ok=True)
    nodes = "".join(
        f'<node id="{name}" x="{x}" y="{y}" z="{z}" type="priority"/>' for name, (x, y, z) in crossing.nodes.items()
    )
    (folder / "n.nod.xml").write_text(f"<nodes>{nodes}</nodes>")
    both = [pair for street in crossing.streets for line in (street, street[::-1]) for pair in _pairs(line)]
    edges = [_edge(*pair, lanes=1, more=' sidewalkWidth="2.0"') for pair in both]
    edges += [_edge(*pair, lanes=1) for ramp in crossing.ramps for pair in _pairs(ramp)]
    (folder / "n.edg.xml").write_text(f"<edges>{''.join(edges)}</edges>")
    command = [_HOME / "bin/netconvert", "-n", "n.nod.xml", "-e", "n.edg.xml", "-o", "n.net.xml"]
    quiet = ["--offset.disable-normalization", "--no-warnings", "--junctions.join-turns"]
    subprocess.run([*command, *quiet], check=True, cwd=folder, capture_output=True)
    flows = "".join(
        f'<flow id="f{number}" type="t" from="{_next_to(crossing, start, 0)}" to="{_next_to(crossing, end, 1)}" '
        f'begin="{number * 0.7:.1f}" end="900" period="{_PERIOD_S}" departSpeed="max"/>'
        for number, (start, end) in enumerate(crossing.trips)
    )
    kinds = '<vType id="t" vClass="passenger" speedFactor="normc(0.9,0.1,0.7,1.2)"/>'
    (folder / "n.rou.xml").write_text(f"<routes>{kinds}{flows}</routes>")
    path = folder / "n.sumocfg"
    path.write_text('<configuration><net-file value="n.net.xml"/><route-files value="n.rou.xml"/></configuration>')
    return path


def _pairs(line: Sequence[str]) -> list[tuple[str, str]]:
    return list(pairwise(line))


def _next_to(crossing: Crossing, node: str, side: int) -> str:
    """Edge that leaves an end of a street (side 0), or that arrives there (1)."""
    line = next(street for street in crossing.streets if node in (street[0], street[-1]))
    beside = line[1] if node == line[0] else line[-2]
    return f"{node}_{beside}" if side == 0 else f"{beside}_{node}"


def _edge(start: str, end: str, lanes: int, more: str = "") -> str:
    return f'<edge id="{start}_{end}" from="{start}" to="{end}" numLanes="{lanes}" speed="13.9"{more}/>'
