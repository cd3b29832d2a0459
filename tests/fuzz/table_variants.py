"""Variants of one table of trajectories whose truth is known: units, clocks, names, axes, outliers, order of rows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from assets.streets import StreetLane, Streets
from cosim.traffic.trajectories import RoadTracks, read_trajectories
from tests.fuzz.variants import Trial

_STEP_S, _SAMPLES = 0.04, 150
LIMIT_MPS = 13.9


def _lane(name: str, *points: tuple[float, float]) -> StreetLane:
    centre = np.array([(x, y, 0.0) for x, y in points])
    return StreetLane(f"{name}_0", name, "drive", centre, 3.2, LIMIT_MPS, False)


#: A main road with a bend, driven on the right, and a side road to the north: no symmetry maps it onto itself.
STREETS = Streets(
    "bend",
    (
        _lane("we", (-210, -31.6), (0, -1.6), (230, 38.4)),
        _lane("ew", (230, 41.6), (0, 1.6), (-210, -28.4)),
        _lane("sn", (71.6, 12), (71.6, 260)),
        _lane("ns", (68.4, 260), (68.4, 12)),
    ),
    (),
    (),
    (),
)


@dataclass(frozen=True)
class Truth:
    """What was driven.

    Attributes:
        time_s: (n,) since the first sample.
        middle: (vehicles, n, 2) middle of each vehicle [m].
        heading_rad: (vehicles, n).
        speed_mps: (vehicles, n).
        length_m: (vehicles,).
    """

    time_s: np.ndarray
    middle: np.ndarray
    heading_rad: np.ndarray
    speed_mps: np.ndarray
    length_m: np.ndarray


def drive_vehicles(rng: np.random.Generator) -> Truth:
    """Vehicles on every lane, each with a speed of its own that changes."""
    time_s = np.arange(_SAMPLES) * _STEP_S
    middles, headings, speeds = [], [], []
    for lane in STREETS.lanes:
        for _ in range(2):
            mean, swing = rng.uniform(6, 13), rng.uniform(0, 2)
            speed = mean + swing * np.sin(time_s * rng.uniform(0.5, 1.5))
            along = rng.uniform(10, 60) + np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2 * _STEP_S)])
            ends = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(lane.centre[:, :2], axis=0), axis=1))])
            middle = np.column_stack([np.interp(along, ends, lane.centre[:, axis]) for axis in (0, 1)])
            move = np.gradient(middle, axis=0)
            middles.append(middle)
            headings.append(np.arctan2(move[:, 1], move[:, 0]))
            speeds.append(speed)
    return Truth(time_s, np.array(middles), np.array(headings), np.array(speeds), rng.uniform(3.8, 4.9, len(middles)))


_TIMES: dict[str, tuple[float, ...]] = {
    "time_s": (1,),
    "timestamp_ms": (1e-3,),
    "timestamp_us": (1e-6,),
    "timestamp_ns": (1e-9,),
    "timestamp": (1, 1e-3, 1e-6, 1e-9, _STEP_S),
    "t": (1, 1e-3, _STEP_S),
}
_AXES = {
    "x,y": ((1, 0), (0, 1)),
    "x,-y": ((1, 0), (0, -1)),
    "-x,y": ((-1, 0), (0, 1)),
    "y,x": ((0, 1), (1, 0)),
    "-y,x": ((0, -1), (1, 0)),
    "-x,-y": ((-1, 0), (0, -1)),
}


def write_variant(truth: Truth, rng: np.random.Generator, path: Path, said: list[str]) -> None:
    """Write the truth as a table in a way drawn at random, and append what was drawn."""
    stride = int(rng.choice([1, 1, 2, 5, 10]))
    time = truth.time_s[::stride]
    position, heading = truth.middle[:, ::stride], truth.heading_rad[:, ::stride]
    speed = truth.speed_mps[:, ::stride]
    said.append(f"every {stride * _STEP_S:g} s")
    name = str(rng.choice(list(_TIMES)))
    unit = float(rng.choice(_TIMES[name]))
    lies = rng.random() < 0.15  # the name states another unit than the numbers
    if lies:
        unit = float(rng.choice([1, 1e-3, 1e-6]))
    epoch = float(rng.choice([0.0, 0.0, 0.0, 17.36, 1.7e9]))
    said.append(f"{name} in {unit:g} s from {epoch:g} s")
    axes = str(rng.choice(list(_AXES), p=[0.6, 0.1, 0.1, 0.1, 0.05, 0.05]))
    said.append(f"axes {axes}")
    turn = np.array(_AXES[axes], float)
    metres = float(rng.choice([1.0, 1.0, 1.0, 1.0, 0.3048, 0.01]))
    said.append(f"positions in {metres:g} m")
    position = position @ turn.T / metres
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=-1) @ turn.T
    velocity = ahead * speed[..., None]
    stored_heading = np.arctan2(ahead[..., 1], ahead[..., 0])
    users, count = position.shape[:2]
    columns: dict[str, list[str]] = {}
    ticks = [(epoch + value) / unit for value in time]
    digits = 0 if unit < 1e-2 else 3
    columns[name] = [f"{tick:.{digits}f}" for _ in range(users) for tick in ticks]
    columns["track_id"] = [str(user + 1) for user in range(users) for _ in range(count)]
    columns["x"] = [f"{value:.3f}" for value in position[..., 0].ravel()]
    columns["y"] = [f"{value:.3f}" for value in position[..., 1].ravel()]
    if rng.random() < 0.6:
        words = {"heading": (1.0, "east"), "heading_deg": (np.pi / 180, "east"), "psi_rad": (1.0, "east")}
        word = str(rng.choice(list(words)))
        angle = float(rng.choice([1.0, np.pi / 180])) if word == "heading" or rng.random() < 0.1 else words[word][0]
        north = rng.random() < 0.3
        value = (np.pi / 2 - stored_heading if north else stored_heading) / angle
        if rng.random() < 0.5:
            value = np.mod(value, 2 * np.pi / angle)
        said.append(f"{word} in {angle:.3g} rad from {'north' if north else 'east'}")
        columns[word] = [f"{each:.4f}" for each in value.ravel()]
    draw = rng.random()
    speed_unit = float(rng.choice([1.0, 1.0, 1 / 3.6, 0.44704, metres]))
    if draw < 0.4:
        columns["vx"] = [f"{value:.3f}" for value in (velocity[..., 0] / speed_unit).ravel()]
        columns["vy"] = [f"{value:.3f}" for value in (velocity[..., 1] / speed_unit).ravel()]
        said.append(f"vx, vy in {speed_unit:.3g} m/s")
    elif draw < 0.7:
        columns["speed"] = [f"{value:.3f}" for value in (speed / speed_unit).ravel()]
        said.append(f"speed in {speed_unit:.3g} m/s")
    if rng.random() < 0.4:
        columns["frame_id"] = [str(int(frame)) for _ in range(users) for frame in range(count)]
        said.append("frame_id")
        if rng.random() < 0.3:
            del columns[name]
            said.append("no time")
    if rng.random() < 0.5:
        said.append("length")
        columns["length"] = [f"{value / metres:.2f}" for value in np.repeat(truth.length_m, count)]
    if rng.random() < 0.7:
        columns["agent_type"] = ["car"] * (users * count)
    _add_columns(columns, users, count, rng, said)
    rows = [list(row) for row in zip(*columns.values(), strict=True)]
    names = list(columns)
    if rng.random() < 0.3:
        order = rng.permutation(len(names))
        names, rows = [names[at] for at in order], [[row[at] for at in order] for row in rows]
    if rng.random() < 0.5:
        rows = [rows[at] for at in rng.permutation(len(rows))]
    _spoil_cells(names, rows, rng, said)
    separator, end = str(rng.choice([",", ",", ";", "\t"])), str(rng.choice(["\n", "\n", "\r\n"]))
    if rng.random() < 0.1:
        rows = [[f'"{cell}"' for cell in row] for row in rows]
    text = end.join([separator.join(names), *(separator.join(row) for row in rows)]) + end
    path.write_bytes(text.encode("utf-8-sig" if rng.random() < 0.1 else "utf-8"))


def _add_columns(
    columns: dict[str, list[str]], users: int, count: int, rng: np.random.Generator, said: list[str]
) -> None:
    """Columns that exports add, some of which look like clocks or measurements and are none."""
    rows = users * count
    draw = str(
        rng.choice(["", "received", "empty", "zero speed", "zero heading", "index", "width"], p=[0.58, *[0.07] * 6])
    )
    match draw:
        case "received":  # a second clock: when a message arrived, in batches of a second
            batch = [1.7e9 + np.floor(_STEP_S * frame) for _ in range(users) for frame in range(count)]
            columns["global_time"] = [f"{stamp * 1e3:.0f}" for stamp in batch]
        case "empty":
            columns[str(rng.choice(["z", "lane", "height", "yaw"]))] = [""] * rows
        case "zero speed" if "speed" not in columns and "vx" not in columns:
            columns["speed"] = ["0.0"] * rows
        case "zero heading" if not {"heading", "heading_deg", "psi_rad"} & set(columns):
            columns["heading"] = ["0.0"] * rows
        case "index":
            columns["row"] = [str(row) for row in range(rows)]
        case "width":
            columns["width"] = ["1.8"] * rows
        case _:
            return
    said.append(draw)


def _spoil_cells(names: list[str], rows: list[list[str]], rng: np.random.Generator, said: list[str]) -> None:
    """Cells that are empty or extreme, places that jump, and rows that are there twice."""
    measured = [name for name in names if name in ("speed", "vx", "vy", "heading", "psi_rad", "length")]
    for _ in range(int(rng.choice([0, 0, 0, 1, 3]))):
        if measured:
            name = str(rng.choice(measured))
            rows[int(rng.integers(len(rows)))][names.index(name)] = str(rng.choice(["", "nan", "1e6", "-999"]))
            said.append(f"a wild {name}")
    draw = rng.random()
    if draw < 0.06:
        rows.extend([list(rows[at]) for at in rng.integers(0, len(rows), 5)])
        said.append("rows twice")
    elif draw < 0.12:
        axis = names.index(str(rng.choice(["x", "y"])))
        rows[int(rng.integers(len(rows)))][axis] = str(rng.choice(["1e7", "0", "-9999", "nan"]))
        said.append("a place that jumps")
    elif draw < 0.16:
        clocks = [name for name in names if name in _TIMES]
        if clocks:
            row = rows[int(rng.integers(len(rows)))]
            row[names.index(clocks[0])] = str(rng.choice(["0", "-1", "nan", "1e15"]))
            said.append("a wild clock")


def find_error(truth: Truth, tracks: RoadTracks, said: str) -> str | None:
    """What of the tracks differs from the truth; None where they agree."""
    if len(tracks.ids) != len(truth.middle):
        return f"{len(tracks.ids)} road users of {len(truth.middle)}"
    for user, name in enumerate(tracks.ids):
        number = int(name) - 1
        rows = tracks.samples(user)
        time_s = tracks.time_s[rows] - tracks.time_s.min()
        heading = tracks.heading_rad[rows]
        middle = tracks.front[rows, :2] - np.column_stack([np.cos(heading), np.sin(heading)]) * (
            tracks.size[user, 0] / 2
        )
        if "length" in said and abs(tracks.size[user, 0] - truth.length_m[number]) > 0.02:
            return f"{name} is {tracks.size[user, 0]:.2f} m long"
        true = np.column_stack([np.interp(time_s, truth.time_s, truth.middle[number, :, axis]) for axis in (0, 1)])
        away = np.linalg.norm(middle - true, axis=1)
        if np.quantile(away, 0.9) > 0.3:
            return f"{name} is {np.quantile(away, 0.9):.2f} m away"
        speed = np.interp(time_s, truth.time_s, truth.speed_mps[number])
        if np.quantile(np.abs(tracks.speed_mps[rows] - speed), 0.9) > 0.5:
            return f"speed of {name} differs by {np.quantile(np.abs(tracks.speed_mps[rows] - speed), 0.9):.2f} m/s"
        true_heading = np.unwrap(truth.heading_rad[number])
        turned = np.abs(np.angle(np.exp(1j * (heading - np.interp(time_s, truth.time_s, true_heading)))))
        if np.quantile(turned, 0.9) > 0.1:
            return f"heading of {name} differs by {np.quantile(turned, 0.9):.2f} rad"
    return None


def table_trial(folder: Path) -> Trial:
    """A trial that writes a variant into a folder and reads it."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "tracks.csv"

    def trial(rng: np.random.Generator, drawn: list[str]) -> str | None:
        truth = drive_vehicles(rng)
        write_variant(truth, rng, path, drawn)
        return find_error(truth, read_trajectories(path, STREETS), "; ".join(drawn))

    return trial
