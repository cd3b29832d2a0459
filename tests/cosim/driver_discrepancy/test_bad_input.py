"""Trajectories that cannot be used are refused in one line with the verified reason and the remedy."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from cosim.cli import main
from cosim.driver_discrepancy.network import read_network
from cosim.driver_discrepancy.tracks import read_tracks
from sumo_nets import read_town

HEADER = "time_s,id,x_m,y_m,speed_mps,heading_deg,lane,type"
Rows = list[str]


def sample(time_s: object, name: str = "a", speed: object = 5.0, lane: str = "A0_A1_1") -> str:
    return f"{time_s},{name},0,0,{speed},90,{lane},car"


GOOD = [sample(t, name) for name in ("a", "b") for t in (0.0, 0.1, 0.2)]


def refused(tmp_path: Path, capsys, town: str = "town01") -> str:
    """The error's line."""
    (tmp_path / "run.yaml").write_text(f"town: {town}\n")
    assert main(["traffic-compare", str(tmp_path / "m.csv"), "--config", str(tmp_path / "run.yaml")]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    return line


@pytest.mark.parametrize(
    ("header", "rows", "says"),
    [
        (HEADER.replace(",y_m", ""), [], "missing columns y_m"),
        (HEADER, [], "holds no samples"),
        (HEADER, [*GOOD, sample(0.3, "a", "nan")], "speed_mps is nan in line 8"),
        (HEADER, [*GOOD, sample("soon")], "time_s is 'soon' in line 8"),
        (HEADER, [sample(t) for t in (0.0, 0.1)], "holds one vehicle only ('a')"),
        (HEADER, [sample(t, n, -1) for n in "ab" for t in (0.0, 0.1)], "speeds are not negative"),
        (HEADER, [*GOOD, "1,2"], "has 2 values"),
        (HEADER, [sample(0), sample(1, "b")], "last 1.0 s"),
        (
            HEADER,
            [sample(t, n, 5, "nowhere_0") for n in "ab" for t in range(0, 21, 4)],
            "lane 'nowhere_0' is not in the town",
        ),
        (HEADER, [sample(t, n, 0) for n in "ab" for t in (0, 9000)], "give at most 7200 s"),
        (HEADER, [sample(20 * k, f"v{k}") for k in range(3)], "seen for less than 0.0 s"),
    ],
)
def test_bad_trajectories(tmp_path: Path, capsys, header: str, rows: Rows, says: str) -> None:
    (tmp_path / "m.csv").write_text("\n".join([header, *rows, ""]))
    assert says in refused(tmp_path, capsys)


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda folder: (folder / "m.csv").unlink(), "cannot read"),
        (lambda folder: (folder / "m.csv").write_text(""), "is empty"),
        (lambda folder: (folder / "m.csv").write_bytes(b"\xff\xfe\x00"), "is not CSV"),
        (lambda folder: (folder / "run.yaml").write_text("town: atlantis\n"), "'atlantis' does not exist"),
        (lambda folder: (folder / "run.yaml").write_text("twon: town01\n"), "twon"),
    ],
)
def test_bad_files(tmp_path: Path, capsys, damage: Callable[[Path], object], says: str) -> None:
    (tmp_path / "m.csv").write_text("\n".join([HEADER, *(sample(t, n) for n in "ab" for t in (0, 20)), ""]))
    (tmp_path / "run.yaml").write_text("town: town01\n")
    damage(tmp_path)
    assert main(["traffic-compare", str(tmp_path / "m.csv"), "--config", str(tmp_path / "run.yaml")]) == 2
    assert says in capsys.readouterr().err


@cache
def drives() -> np.ndarray:
    """Two vehicles on the two longest streets of a town at 8 m/s: time, vehicle, x, y, speed, heading [°]."""
    town = read_town("town01")
    lanes = [lane for lane in read_network(town.net, town.additional).lanes.values() if not lane.inside]
    lanes.sort(key=lambda lane: -lane.length_m)
    rows = []
    for who, lane in enumerate(lanes[:2]):
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(lane.shape, axis=0).T))])
        for number in count():
            at = 8.0 * 0.2 * number
            if at > min(way[-1], 8.0 * 14):
                break
            x, y = (np.interp(at, way, lane.shape[:, axis]) for axis in (0, 1))
            segment = max(int(np.searchsorted(way, at)) - 1, 0)
            ahead = lane.shape[segment + 1] - lane.shape[segment]
            rows.append((0.2 * number, who, x, y, 8.0, np.degrees(np.arctan2(ahead[1], ahead[0]))))
    return np.array(rows)


def write(path: Path, table: np.ndarray, kind: str = "car") -> None:
    lines = ["time_s,id,x_m,y_m,speed_mps,heading_deg,type"]
    lines += [f"{t},v{int(who)},{x},{y},{v},{heading},{kind}" for t, who, x, y, v, heading in table.tolist()]
    path.write_text("\n".join(lines) + "\n")


def scaled(column: int, factor: float) -> np.ndarray:
    table = drives().copy()
    table[:, column] *= factor
    return table


def jumping(after_s: float, by_s: float) -> np.ndarray:
    rows = drives()
    table = np.concatenate([rows, rows + np.array((0, 2, 0, 0, 0, 0))])
    table[table[:, 0] > after_s, 0] += by_s
    return table


def overlaid() -> np.ndarray:
    """A second recording on the same clock, in which slower vehicles on the same streets are overtaken."""
    slower = drives() * (4 / 3, 1, 1, 1, 3 / 4, 1) + (2, 2, 0, 0, 0, 0)
    return np.concatenate([drives() + np.array((4, 0, 0, 0, 0, 0)), slower])


def tracks_of_two_seconds() -> np.ndarray:
    short = drives()[drives()[:, 0] <= 2]
    return np.concatenate([short + np.array((3.0 * k, 2 * k, 0, 0, 0, 0)) for k in range(6)])


@pytest.mark.parametrize(
    ("table", "says"),
    [
        (lambda: scaled(0, 1000), "times look like milliseconds"),
        (lambda: scaled(4, 3.6), "speeds look like km/h"),
        (lambda: drives()[:, [0, 1, 3, 2, 4, 5]] * (1, 1, 1, 1, 1, -1) + (0, 0, 0, 0, 0, 90), "x and y are exchanged"),
        (lambda: drives() + np.array((0, 0, 50_000, 0, 0, 0)), "most positions lie off the streets"),
        (lambda: jumping(6.0, 40.0), "the clock jumps by 40.2 s after 6.00 s"),
        (
            lambda: np.concatenate([drives(), drives() + np.array((400, 5, 0, 0, 0, 0))]),
            "the file holds two recordings",
        ),
        (
            lambda: np.concatenate([drives(), drives() + np.array((400, 0, 0, 0, 0, 0))]),
            "the file holds two recordings",
        ),
        (overlaid, "4 of 4 moving vehicles come within 1 m of another one at the same time"),
        (lambda: jumping(6.0, -5.0), "the clock goes back by 4.8 s after 6.00 s"),
        (
            lambda: np.concatenate([drives(), drives() + np.array((0, 5, 0, 0, 0, 0))]),
            "come within 1 m of another one at the same time: the file holds two recordings on one clock",
        ),
        (lambda: drives() + np.array((0, 0, 0, 0, 0, 70)), "headings differ from the direction of travel by 70°"),
        (lambda: tracks_of_two_seconds(), "half of the vehicles are seen for less than 2.0 s"),
        (
            lambda: drives() * (1, 1, 0, 0, 0, 1) + (0, 0, *drives()[0, 2:4], 0, 0),
            "all vehicles are at rest throughout",
        ),
    ],
)
def test_units_clocks_and_axes(tmp_path: Path, capsys, table: Callable[[], np.ndarray], says: str) -> None:
    write(tmp_path / "m.csv", table())
    assert says in refused(tmp_path, capsys)


@pytest.mark.parametrize("town", ["town02", "town03", "town05"])
def test_a_table_of_another_town(tmp_path: Path, capsys, town: str) -> None:
    write(tmp_path / "m.csv", drives())
    assert "most positions lie off the streets" in refused(tmp_path, capsys, town=town)


def test_persons_only(tmp_path: Path, capsys) -> None:
    write(tmp_path / "m.csv", drives(), "pedestrian")
    assert "holds people on foot only" in refused(tmp_path, capsys)


def test_persons_among_vehicles_are_left_out_and_counted(tmp_path: Path) -> None:
    write(tmp_path / "m.csv", drives())
    vehicles = read_tracks(tmp_path / "m.csv")
    lines = (tmp_path / "m.csv").read_text() + "0,p,1,1,1,0,pedestrian\n0.2,p,1.2,1,1,0,person\n"
    (tmp_path / "m.csv").write_text(lines)
    tracks = read_tracks(tmp_path / "m.csv")
    assert tracks.ids == vehicles.ids and len(tracks) == len(vehicles)
    assert tracks.notes == ("1 people on foot were left out",)


def test_a_relative_town_belongs_to_the_folder_of_the_configuration(tmp_path: Path, capsys, monkeypatch) -> None:
    town = read_town("town01")
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "net.net.xml").write_bytes(Path(town.net).read_bytes())
    (tmp_path / "deep" / "s.sumocfg").write_text('<configuration><net-file value="net.net.xml"/></configuration>')
    (tmp_path / "deep" / "run.yaml").write_text("town: s.sumocfg\nbehaviour: sumo\n")
    write(tmp_path / "m.csv", drives() + np.array((0, 0, 50_000, 0, 0, 0)))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert main(["traffic-compare", "../m.csv", "--config", "../deep/run.yaml"]) == 2
    assert "most positions lie off the streets" in capsys.readouterr().err
