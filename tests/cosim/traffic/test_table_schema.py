"""Tables of trajectories: clocks, units, angles and axes are inferred with independent checks, or requested."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.traffic.trajectories import RoadTracks, TrajectoryError, read_trajectories
from tests.fuzz.table_variants import STREETS

_MPS = 9.0


def rows_of(header: str, row: str, step_s: float = 0.1, count: int = 60) -> str:
    """A table of two cars on the main road, one each way, at 9 m/s; both follow its slope."""
    lines = [header]
    slope = np.arctan2(40, 230)
    for k in range(count):
        for name, sign in ((1, 1.0), (2, -1.0)):
            start = np.array([10.0, -1.6 + 10 * 40 / 230]) if sign > 0 else np.array([210.0, 41.6 - 20 * 40 / 230])
            way = sign * np.array([np.cos(slope), np.sin(slope)])
            x, y = start + way * _MPS * step_s * k
            heading = slope if sign > 0 else slope - np.pi
            values = {"k": k, "s": step_s * k, "id": name, "x": x, "y": y, "rad": heading}
            values |= {"deg": np.degrees(heading), "vx": _MPS * way[0], "vy": _MPS * way[1]}
            lines.append(row.format(**values))
    return "\n".join(lines) + "\n"


def read(folder: Path, text: str, statements: str = "") -> RoadTracks:
    path = folder / "tracks.csv"
    path.write_text(text)
    if statements:
        path.with_name("tracks.csv.yaml").write_text(statements)
    return read_trajectories(path, STREETS)


def check(tracks: RoadTracks, step_s: float = 0.1) -> None:
    rows = tracks.samples(0)
    assert np.allclose(np.diff(tracks.time_s[rows]), step_s, atol=2e-3)
    assert np.allclose(tracks.speed_mps, _MPS, atol=0.05)
    assert np.allclose(tracks.heading_rad[rows], np.arctan2(40, 230), atol=0.02)


@pytest.mark.parametrize(
    ("header", "row", "step_s", "note"),
    [
        ("timestamp_ms,track_id,x,y,vx,vy,heading", "{s:.3f}e3,{id},{x},{y},{vx},{vy},{deg}", 0.1, "degrees from east"),
        (
            "frame_id,timestamp_ms,track_id,x,y,vx,vy",
            "{k},{s:.3f}e3,{id},{x},{y},{vx},{vy}",
            0.04,
            "timestamp_ms in ms",
        ),
        ("timestamp,track_id,x,y", "{s:.6f}e6,{id},{x},{y}", 0.1, "timestamp in µs"),
        ("timestamp,track_id,x,y", "17{s:011.6f}e3,{id},{x},{y}", 0.1, "timestamp in ms"),
        ("frame,track_id,x,y,vx,vy", "{k},{id},{x},{y},{vx},{vy}", 0.04, "frame at 25 Hz"),
        ("time;vehicle_id;x;y;speed", "{s};{id};{x};{y};32.4", 0.2, "speeds are in km/h"),
        ("t,id,x,y,speed_kmh,yaw", "{s},{id},{x},{y},32.4,{rad}", 0.2, "yaw is in radians from east"),
    ],
)
def test_clocks_and_units_are_detected_from_motion(header, row, step_s, note, tmp_path):
    tracks = read(tmp_path, rows_of(header, row, step_s))
    check(tracks, step_s)
    assert any(note in each for each in tracks.notes)
    assert tracks.inferred["time_unit_s"] > 0


@pytest.mark.parametrize(
    ("header", "row", "step_s", "option", "says"),
    [
        ("t,id,x,y", "{k},{id},{x},{y}", 0.04, "time_unit_s: 0.04", "holds whole numbers"),
        ("timestamp,id,x,y,vx,vy", "{k},{id},{x},{y},{vx},{vy}", 0.04, "time_unit_s: 0.04", "times as fast as"),
        ("timestamp_ms,id,x,y,vx,vy", "{s},{id},{x},{y},{vx},{vy}", 0.1, "time_unit_s: 1", "time_unit_s: 1"),
        ("frame_id,id,x,y", "{k},{id},{x},{y}", 0.1, "frame_rate_hz: 10", "frame_rate_hz"),
        (
            "time_s,id,x,y,heading_deg",
            "{s},{id},{x},{y},{rad}",
            0.1,
            "heading: radians from east",
            "along the way in radians",
        ),
        ("time_s,id,x,y,yaw", "{s},{id},{x},{y},1.9", 0.1, "heading: unused", "direction of travel in no reading"),
    ],
)
def test_a_contradiction_names_the_option_that_settles_it(header, row, step_s, option, says, tmp_path):
    text = rows_of(header, row, step_s)
    with pytest.raises(TrajectoryError, match=says) as caught:
        read(tmp_path, text)
    assert "\n" not in str(caught.value) and option.partition(":")[0] in str(caught.value)
    check(read(tmp_path, text, option), step_s)


@pytest.mark.parametrize(
    ("cells", "axes"), [("{x},-{y}", "x,-y"), ("-{x},{y}", "-x,y"), ("{y},{x}", "y,x"), ("-{x},-{y}", "-x,-y")]
)
def test_axes_are_checked_against_the_lanes(cells, axes, tmp_path):
    text = rows_of("time_s,id,x,y", "{s},{id}," + cells.replace("-{y}", "{y}*").replace("-{x}", "{x}*")).split("\n")
    turned = [text[0]]
    for line in text[1:-1]:
        turned.append(",".join(str(-float(c[:-1])) if c.endswith("*") else c for c in line.split(",")))
    with pytest.raises(TrajectoryError, match=f"axes: {axes}"):
        read(tmp_path, "\n".join(turned))
    check(read(tmp_path, "\n".join(turned), f"axes: {axes}"))


def test_wild_cells_are_left_out(tmp_path):
    text = rows_of("time_s,id,x,y,vx,vy,heading,length", "{s},{id},{x},{y},{vx},{vy},{rad},4.2").split("\n")
    for row, column, value in ((9, 4, "1e6"), (21, 6, "-999"), (1, 7, "-1"), (33, 7, "1e5"), (40, 6, "")):
        cells = text[row].split(",")
        cells[column] = value
        text[row] = ",".join(cells)
    tracks = read(tmp_path, "\n".join(text))
    check(tracks)
    assert np.allclose(tracks.size[:, 0], 4.2)


@pytest.mark.parametrize(
    ("header", "row", "note"),
    [
        ("time_s,id,x,y,speed", "{s},{id},{x},{y},0", "speed is 0 although road users move"),
        ("time_s,id,x,y,vx,vy", "{s},{id},{x},{y},0,0", "vx, vy is 0 although"),
        ("time_s,id,x,y,yaw", "{s},{id},{x},{y},0", "yaw is 0 whatever the direction"),
        ("global_time,time_s,id,x,y", "17000000{k:05d},{s},{id},{x},{y}", "time is time_s in s"),
    ],
)
def test_columns_that_were_not_measured_are_not_used(header, row, note, tmp_path):
    tracks = read(tmp_path, rows_of(header, row))
    check(tracks)
    assert any(note in each for each in tracks.notes)


@pytest.mark.parametrize(("row", "time"), [(30, "1e9"), (31, "-50"), (120, "77.5")])
def test_a_time_outlier_is_left_out_and_counted(row, time, tmp_path):
    text = rows_of("time_s,id,x,y,speed", "{s},{id},{x},{y},9").split("\n")
    text[row] = ",".join([time, *text[row].split(",")[1:]])
    tracks = read(tmp_path, "\n".join(text))
    assert np.ptp(tracks.time_s) < 6 and np.allclose(tracks.speed_mps, _MPS, atol=0.05)
    assert any("1 rows have times far from all others" in each for each in tracks.notes)


@pytest.mark.parametrize(("row", "x"), [(30, "0"), (31, "1e7"), (77, "120")])
def test_a_position_outlier_is_left_out_and_counted(row, x, tmp_path):
    text = rows_of("time_s,id,x,y", "{s},{id},{x},{y}").split("\n")
    cells = text[row].split(",")
    text[row] = ",".join([*cells[:2], x, cells[3]])
    tracks = read(tmp_path, "\n".join(text))
    assert len(tracks.time_s) == 119 and np.allclose(tracks.speed_mps, _MPS, atol=0.05)
    assert any("1 places are reached and left far faster" in each for each in tracks.notes)


def test_rows_that_are_there_twice_are_used_once(tmp_path):
    text = rows_of("time_s,id,x,y", "{s},{id},{x},{y}")
    tracks = read(tmp_path, text + "".join(f"{line}\n" for line in text.split("\n")[10:13]))
    check(tracks)
    assert any("3 rows are there twice" in each for each in tracks.notes)


@pytest.mark.parametrize("metres", [0.3048, 0.01, 0.001])
def test_another_unit_of_positions_is_named(metres, tmp_path):
    text = rows_of("time_s,id,x,y", "{s},{id},{x}*,{y}*").split("\n")
    lines = [text[0]]
    for line in text[1:-1]:
        lines.append(",".join(str(float(c[:-1]) / metres) if c.endswith("*") else c for c in line.split(",")))
    with pytest.raises(TrajectoryError, match=f"metres: {metres:g}|time"):
        read(tmp_path, "\n".join(lines))
    check(read(tmp_path, "\n".join(lines), f"metres: {metres}"))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time_s,id,x,y\n0,1,0\n", "line 2 has 3 values"),
        ("time_s,id,x,y\n0,1,zero,0\n0.1,1,1,0\n", "x is 'zero' in row 1"),
        ("time_s,id,x,x,y\n", "'x' more than once"),
        ("a,b,c\n1,2,3\n", "columns are missing"),
        ("", "is empty"),
    ],
)
def test_tables_that_are_none_are_refused(text, says, tmp_path):
    with pytest.raises(TrajectoryError, match=says):
        read(tmp_path, text)


@pytest.mark.parametrize("statements", ["axes: up", "rate: 5", "columns: {time: clock}"])
def test_statements_that_mean_nothing_are_refused(statements, tmp_path):
    with pytest.raises(TrajectoryError):
        read(tmp_path, rows_of("time_s,id,x,y", "{s},{id},{x},{y}"), statements)


def riders_fcd(marker: str) -> str:
    steps = []
    for k in range(40):
        vehicle = f'x="{10 + 0.9 * k:.2f}" y="0.0" angle="80.13" speed="9.00"'
        person = f'<person id="p" {vehicle} type="DEFAULT_PEDTYPE" pos="1" edge="we"{marker}/>' if k > 10 else ""
        walker = (
            f'<person id="w" x="{20 + 0.1 * k:.2f}" y="-5" angle="90" type="DEFAULT_PEDTYPE" speed="1.00" edge="we"/>'
        )
        body = f'<vehicle id="v" {vehicle} type="DEFAULT_VEHTYPE" lane="we_0"/>{person}{walker}'
        steps.append(f'<timestep time="{0.1 * k:.2f}">{body}</timestep>')
    return f"<fcd-export>{''.join(steps)}</fcd-export>"


@pytest.mark.parametrize("marker", ["", ' vehicle="v"'])
def test_persons_in_vehicles_are_no_road_users(marker, tmp_path):
    path = tmp_path / "fcd.xml"
    path.write_text(riders_fcd(marker))
    tracks = read_trajectories(path, STREETS)
    assert tracks.ids == ("v", "w")
    assert "29 samples of 1 persons riding in vehicles are left out" in tracks.notes[0]


def test_sumos_own_table_is_read_without_riders(tmp_path):
    rows = ["timestep_time;vehicle_id;vehicle_x;vehicle_y;vehicle_angle;vehicle_type;vehicle_speed;vehicle_lane"]
    for k in range(40):
        position = f"{10 + 0.9 * k:.2f};0.00;90.00"
        rows.append(f"{0.1 * k:.2f};v;{position};DEFAULT_VEHTYPE;9.00;we_0")
        rows.append(f"{0.1 * k:.2f};p;{position};DEFAULT_PEDTYPE;9.00;")
    tracks = read(tmp_path, "\n".join(rows))
    assert tracks.ids == ("v",) and tracks.sumo_clock and tracks.lanes[0] == "we_0"
    assert np.allclose(tracks.front[0, :2], [10, 0]) and np.allclose(tracks.heading_rad, 0)
