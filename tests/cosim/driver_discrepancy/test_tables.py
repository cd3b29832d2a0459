"""Tables of several origins are read in the same way; errors of ids and order are corrected and counted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.driver_discrepancy.table import read_measured
from cosim.driver_discrepancy.track_checks import split_tracks
from cosim.driver_discrepancy.tracks import Tracks, read_tracks, with_true_headings
from sumo_nets import Town, read_town

TIMES = np.arange(0, 12, 0.2)


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
