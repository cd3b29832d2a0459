"""Tables of several origins are read in the same way; errors of ids and order are corrected and counted."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars
import pytest
import sumo

from cosim.driver_discrepancy.network import read_network
from cosim.driver_discrepancy.table import read_measured
from cosim.driver_discrepancy.track_checks import split_tracks
from cosim.driver_discrepancy.tracks import TrackError, Tracks, read_tracks, with_true_headings
from sumo_nets import Town, read_town

TIMES = np.arange(0, 12, 0.2)
SHIFT = np.array((60.0, 0.0))  # to lie on the streets of the town


@pytest.fixture(scope="module")
def town() -> Town:
    return read_town("town01")


def true_position(who: int) -> np.ndarray:
    """Front bumper of two vehicles at 10 and 12 m/s, eastwards and northwards."""
    way = (10.0 + 2 * who) * TIMES
    return np.column_stack([way, np.zeros(len(way))] if who == 0 else [np.full(len(way), 5.0), way])


def check(tracks: Tracks) -> None:
    tracks = with_true_headings(tracks)
    assert len(tracks.ids) == 2
    for who in range(2):
        rows = tracks.vehicle == who
        assert tracks.time_s[rows] - tracks.time_s.min() == pytest.approx(TIMES, abs=1e-6)
        assert tracks.place[rows] == pytest.approx(true_position(who), abs=0.02)
        assert tracks.speed_mps[rows] == pytest.approx(10.0 + 2 * who, rel=1e-3)
        assert np.cos(tracks.heading_rad[rows] - who * np.pi / 2) == pytest.approx(1.0, abs=1e-6)


def loop_rows(offset_s: float = 0.0) -> list[str]:
    rows = []
    for who in range(2):
        for time_s, (x, y) in zip(TIMES, true_position(who), strict=True):
            rows.append(f"{time_s + offset_s:.3f},v{who},{x},{y},{10 + 2 * who},{90 * who}")
    return rows


def write_loop(path: Path, rows: list[str]) -> Path:
    path.write_text("\n".join(["time_s,id,x_m,y_m,speed_mps,heading_deg", *rows, ""]))
    return path


def test_rows_in_any_order_and_times_since_1970(tmp_path: Path) -> None:
    rows = loop_rows(1_700_000_000.0)
    np.random.default_rng(0).shuffle(rows)
    tracks = read_tracks(write_loop(tmp_path / "m.csv", rows))
    check(tracks)
    assert tracks.start_s == 1_700_000_000.0


def test_ind(tmp_path: Path, town: Town) -> None:
    lines = ["recordingId,trackId,frame,xCenter,yCenter,heading,width,length,xVelocity,yVelocity"]
    for who in range(2):
        ahead = np.array([[1.0, 0.0], [0.0, 1.0]])[who]
        for frame, position in enumerate(true_position(who) - 2.0 * ahead):
            vx, vy = (10 + 2 * who) * ahead
            lines.append(f"0,{who},{frame},{position[0]},{position[1]},{90 * who},1.8,4.0,{vx},{vy}")
    (tmp_path / "00_tracks.csv").write_text("\n".join(lines))
    (tmp_path / "00_tracksMeta.csv").write_text("recordingId,trackId,class\n0,0,car\n0,1,truck_bus\n")
    (tmp_path / "00_recordingMeta.csv").write_text("recordingId,frameRate\n0,5\n")
    tracks = read_measured(tmp_path / "00_tracks.csv", town)
    check(tracks)
    assert tracks.types == ("car", "truck")


def test_highd(tmp_path: Path, town: Town) -> None:
    lines = ["frame,id,x,y,width,height,xVelocity,yVelocity"]
    for who in range(2):
        ahead = np.array([[1.0, 0.0], [0.0, 1.0]])[who]
        for frame, position in enumerate(true_position(who) - 2.0 * ahead):
            vx, vy = (10 + 2 * who) * ahead
            corner = position[0] - 2.0, -position[1] - 0.9
            lines.append(f"{frame},{who},{corner[0]},{corner[1]},4.0,1.8,{vx},{-vy}")
    (tmp_path / "01_tracks.csv").write_text("\n".join(lines))
    (tmp_path / "01_tracksMeta.csv").write_text("id,class\n0,Car\n1,Car\n")
    (tmp_path / "01_recordingMeta.csv").write_text("id,frameRate\n1,5\n")
    check(read_measured(tmp_path / "01_tracks.csv", town))


def test_ngsim(tmp_path: Path, town: Town) -> None:
    lines = ["Vehicle_ID,Frame_ID,Global_Time,Global_X,Global_Y,v_Vel,v_Class"]
    for who in range(2):
        for frame, position in enumerate(true_position(who) / 0.3048):
            time_ms = 1118846979700 + 200 * frame
            lines.append(f"{who},{frame},{time_ms},{position[0]},{position[1]},{(10 + 2 * who) / 0.3048},2")
    path = tmp_path / "ngsim.csv"
    path.write_text("\n".join(lines))
    check(read_measured(path, town))


def test_sumos_table(tmp_path: Path, town: Town) -> None:
    lines = ["timestep_time;vehicle_id;vehicle_x;vehicle_y;vehicle_angle;vehicle_type;vehicle_speed;vehicle_lane"]
    for step, time_s in enumerate(TIMES):
        for who in range(2):
            x, y = true_position(who)[step]
            lines.append(f"{time_s:.2f};v{who};{x:.2f};{y:.2f};{90 - 90 * who};car;{10 + 2 * who};a_0")
    path = tmp_path / "fcd.csv"
    path.write_text("\n".join([*lines, ""]))
    check(read_measured(path, town))


def test_an_id_that_is_used_again_is_split_and_counted(tmp_path: Path) -> None:
    again = [row.replace(",v0,", ",v1,") for row in loop_rows(40.0) if ",v0," in row]
    tracks, notes = split_tracks(read_tracks(write_loop(tmp_path / "m.csv", [*loop_rows(), *again])))
    assert tracks.ids == ("v0", "v1", "v1#2")
    assert np.bincount(tracks.vehicle).tolist() == [len(TIMES)] * 3
    assert "1 ids vanish or jump" in notes[0]


def test_samples_that_are_there_twice_are_left_out(tmp_path: Path) -> None:
    tracks, notes = split_tracks(read_tracks(write_loop(tmp_path / "m.csv", [*loop_rows(), *loop_rows()])))
    assert len(tracks) == 2 * len(TIMES)
    assert f"{2 * len(TIMES)} samples" in notes[0]


AV2_COLUMNS = (
    *("observed", "track_id", "object_type", "object_category", "timestep", "position_x", "position_y", "heading"),
    *("velocity_x", "velocity_y", "scenario_id", "start_timestamp", "end_timestamp", "num_timestamps"),
    *("focal_track_id", "city"),
)


@pytest.mark.parametrize("suffix", [".parquet", ".feather"])
def test_a_scenario_of_argoverse_2(tmp_path: Path, town: Town, suffix: str) -> None:
    rows = []
    for who in range(2):
        ahead = np.array([[1.0, 0.0], [0.0, 1.0]])[who]
        for step, position in enumerate(true_position(who)):
            middle, velocity = position - 3.88 / 2 * ahead - SHIFT, (20 + 4 * who) * ahead
            cells = (step < 50, f"13890{who}", "vehicle", 1, step, *middle, who * np.pi / 2, *velocity)
            rows.append((*cells, "0a1e", 3.1597e17, 3.15970012e17, 60, "138900", "austin"))
        rows.append(
            (True, "7", "background", 0, who, 0.0, 0.0, 0.0, 0.0, 0.0, "0a1e", 0.0, 0.0, 60, "138900", "austin")
        )
    table = polars.DataFrame(rows, schema=list(AV2_COLUMNS), orient="row")
    path = tmp_path / f"scenario_0a1e{suffix}"
    (table.write_parquet if suffix == ".parquet" else table.write_ipc)(path)
    tracks = read_measured(path, town)
    assert tracks.ids == ("138900", "138901") and not tracks.derives_speed
    for who in range(2):
        rows_of = tracks.vehicle == who
        assert tracks.time_s[rows_of] == pytest.approx(0.1 * np.arange(len(TIMES)), abs=1e-6)
        assert tracks.place[rows_of] == pytest.approx(true_position(who) - SHIFT, abs=0.01)
        assert tracks.speed_mps[rows_of] == pytest.approx(20 + 4 * who)
    assert any("1 of 'background'" in note for note in tracks.notes)


def test_interaction(tmp_path: Path, town: Town) -> None:
    lines = ["track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,psi_rad,length,width"]
    for who in range(2):
        ahead = np.array([[1.0, 0.0], [0.0, 1.0]])[who]
        for frame, position in enumerate(true_position(who) - 2.1 * ahead - SHIFT):
            cells = (who + 1, frame + 1, 200 * (frame + 1), "car", *position, *((10 + 2 * who) * ahead))
            lines.append(",".join(map(str, (*cells, who * np.pi / 2, 4.2, 1.8))))
    (tmp_path / "vehicle_tracks_000.csv").write_text("\n".join(lines))
    tracks = read_measured(tmp_path / "vehicle_tracks_000.csv", town)
    check(replace(tracks, place=tracks.place + SHIFT))


def test_waymo(tmp_path: Path, town: Town) -> None:
    names = "object_id,timestamp,center_x,center_y,center_z,length,width,height,heading,velocity_x,velocity_y,valid"
    lines = [f"scenario_id,{names},object_type"]
    for who in range(2):
        ahead = np.array([[1.0, 0.0], [0.0, 1.0]])[who]
        for time_s, position in zip(TIMES, true_position(who) - 2.3 * ahead - SHIFT, strict=True):
            cells = ("637f20cafde22ff8", 1200 + who, time_s, *position, 0.8, 4.6, 2.0, 1.6, who * np.pi / 2)
            lines.append(",".join(map(str, (*cells, *((10 + 2 * who) * ahead), 1, 1))))
            lines.append(",".join(map(str, (*cells[:2], time_s + 50, *([-1] * 9), 0, 1))))
    (tmp_path / "scenario.csv").write_text("\n".join(lines))
    tracks = read_measured(tmp_path / "scenario.csv", town)
    check(replace(tracks, place=tracks.place + SHIFT))


def test_exid_has_columns_that_hold_several_values(tmp_path: Path, town: Town) -> None:
    lines = [
        "recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,xVelocity,yVelocity,"
        "latLaneCenterOffset,laneletId,laneChange,odrLaneId"
    ]
    for who in range(2):
        ahead = np.array([[1.0, 0.0], [0.0, 1.0]])[who]
        for frame, position in enumerate(true_position(who) - 2.0 * ahead):
            cells = (0, who, frame, frame, *position, 90 * who, 1.8, 4.0, *((10 + 2 * who) * ahead))
            lines.append(",".join(map(str, (*cells, "0.2;-3.5", "1412;1417", 0, "1.0.-2"))))
    lines += [f"0,9,{frame},{frame},3,3,0,0.6,1.8,1,0,0,1,0,1" for frame in range(3)]
    (tmp_path / "00_tracks.csv").write_text("\n".join(lines))
    (tmp_path / "00_tracksMeta.csv").write_text("recordingId,trackId,class\n0,0,car\n0,1,truck\n0,9,bicycle\n")
    (tmp_path / "00_recordingMeta.csv").write_text("recordingId,frameRate\n0,5\n")
    tracks = read_measured(tmp_path / "00_tracks.csv", town)
    check(tracks)
    assert tracks.notes == ("1 road users that are no motor vehicles were left out",)


@pytest.fixture(scope="module")
def athens(tmp_path_factory: pytest.TempPathFactory) -> Town:
    """A straight street from west to east in Athens, imported from OpenStreetMap's format."""
    folder = tmp_path_factory.mktemp("athens")
    nodes = "".join(f'<node id="{k}" lat="37.98" lon="{23.73 + 0.002 * k}" version="1"/>' for k in range(3))
    way = "".join(f'<nd ref="{k}"/>' for k in range(3))
    tags = '<tag k="highway" v="primary"/><tag k="oneway" v="yes"/>'
    (folder / "m.osm.xml").write_text(f'<osm version="0.6">{nodes}<way id="9" version="1">{way}{tags}</way></osm>')
    command = [Path(sumo.SUMO_HOME) / "bin/netconvert", "--osm-files", folder / "m.osm.xml"]
    subprocess.run([*command, "-o", folder / "athens.net.xml"], check=True, capture_output=True)
    return read_town(folder / "athens.net.xml")


def test_pneuma(tmp_path: Path, athens: Town, town: Town) -> None:
    lines = ["track_id; type; traveled_d; avg_speed; lat; lon; speed; lon_acc; lat_acc; time"]
    metres_per_deg = 111_320 * np.cos(np.radians(37.98))
    for who, kind in enumerate(("Car", "Medium Vehicle", "Pedestrian")):
        states = []
        for number in range(300 + 20 * who):
            lon = 23.7305 + (20.0 * who + 10.0 * 0.04 * number) / metres_per_deg
            states.append(f"37.980000; {lon:.7f}; 36.0000; 0.0; 0.0; {0.04 * number:.6f}; ")
        lines.append(f"{who + 1}; {kind}; 120.0; 36.0; {''.join(states)}")
    path = tmp_path / "20181024_d1_0830_0900.csv"
    path.write_text("\n".join(lines))
    tracks = read_measured(path, athens)
    assert tracks.types == ("car", "van") and np.bincount(tracks.vehicle).tolist() == [300, 320]
    assert tracks.speed_mps == pytest.approx(10.0) and np.cos(tracks.heading_rad).min() > 0.999
    lane = next(iter(read_network(athens.net, ()).lanes.values()))
    along, left = lane.project(tracks.place[:1])
    start = lane.project(np.array([athens_xy(athens, 23.7305)]))[0]
    assert along - start == pytest.approx(3.88 / 2, abs=0.05) and abs(left[0]) < 3
    assert np.diff(tracks.place[tracks.vehicle == 0, 0]) == pytest.approx(0.4, abs=0.02)
    assert tracks.notes == ("1 road users that are no motor vehicles were left out",)
    with pytest.raises(TrackError, match="no geographic projection"):
        read_measured(path, town)


def athens_xy(town: Town, lon_deg: float) -> tuple[float, float]:
    """Position of a longitude on the street, from the nodes that the network was made of."""
    nodes = {node.getID(): node.getCoord() for node in town.network.getNodes()}
    (x0, y0), (x2, y2) = nodes["0"][:2], nodes["2"][:2]
    share = (lon_deg - 23.73) / 0.004
    return x0 + share * (x2 - x0), y0 + share * (y2 - y0)
