"""Where streets cross at different levels, road users are on their own level, whatever a file states of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from assets.streets import StreetLane, Streets
from cosim.traffic.trajectories import read_trajectories

_MPS = 9.0


def lane(name: str, *points: tuple[float, float, float]) -> StreetLane:
    return StreetLane(f"{name}_0", name, "drive", np.array(points, float), 3.2, 13.9, False)


LOW = lane("low", (-150, 0, 0), (150, 0, 0))
UP = lane("up", (0, -150, 0), (0, -40, 7), (0, 40, 7), (0, 150, 0))
SUNK = lane("sunk", (-150, 3, 0), (-60, 3, -6), (60, 3, -6), (150, 3, 0))
TOP = lane("top", (-100, -100, 6), (-40, -40, 13), (40, 40, 13), (100, 100, 6))
OVERPASS = Streets("overpass", (LOW, UP), (), (), ())
UNDERPASS = Streets("underpass", (lane("flat", (0, -150, 0), (0, 150, 0)), SUNK), (), (), ())
THREE = Streets("three", (LOW, UP, TOP), (), (), ())


def write(path: Path, streets: Streets, states: str) -> dict[str, np.ndarray]:
    """One vehicle along each lane, and its true places (n, 3); `states` is what the file says of levels."""
    places = {}
    for each in streets.lanes:
        along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(each.centre[:, :2], axis=0), axis=1))])
        at = np.arange(20.0, along[-1] - 20, _MPS)
        places[each.edge] = np.column_stack([np.interp(at, along, each.centre[:, axis]) for axis in range(3)])
    if path.suffix == ".xml":
        steps: list[list[str]] = [[] for _ in range(40)]
        for edge, way in places.items():
            angle = np.degrees(np.arctan2(*(way[1] - way[0])[:2]))
            for k, (x, y, _) in enumerate(way):
                lane_name = f'lane="{edge}_0"' if states == "lane" else ""
                steps[k].append(
                    f'<vehicle id="{edge}" x="{x}" y="{y}" angle="{angle}" type="car" speed="{_MPS}" {lane_name}/>'
                )
        body = "".join(f'<timestep time="{k}">{"".join(step)}</timestep>' for k, step in enumerate(steps))
        path.write_text(f"<fcd-export>{body}</fcd-export>")
    else:
        rows = [
            f"{k},{edge},{x},{y},{z if states == 'z' else ''}"
            for edge, way in places.items()
            for k, (x, y, z) in enumerate(way)
        ]
        path.write_text("\n".join(["time_s,id,x,y,z", *rows]) + "\n")
    return places


@pytest.mark.parametrize("streets", [OVERPASS, UNDERPASS, THREE], ids=lambda streets: streets.name)
@pytest.mark.parametrize(("name", "states"), [("a.xml", "lane"), ("a.xml", ""), ("a.csv", "z"), ("a.csv", "")])
def test_vehicles_are_on_their_level(streets, name, states, tmp_path):
    path = tmp_path / name
    places = write(path, streets, states)
    tracks = read_trajectories(path, streets)
    for user, edge in enumerate(tracks.ids):
        high = tracks.front[tracks.samples(user), 2]
        assert np.allclose(high, places[edge][: len(high), 2], atol=0.5), edge
