"""Inputs as users have them, three for each kind of mistake that readers of such files make.

The kinds: a guess from one clue, extremes that decide a scale, two readers with two rules, a world of one level, a zero
where nothing is comparable, a message with a false cause, exceptions of other libraries.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from assets.streets import StreetLane, Streets
from cosim.drives.kitti import Drive
from cosim.point_files.scan import PointFileError
from cosim.recordings import open_recording
from cosim.recordings.recording import Recording, RecordingError
from cosim.traffic.trajectories import TrajectoryError, read_trajectories
from tests.cosim.point_files.test_schema_from_scans import _CALIBRATION, recording, scan, with_column, write_pcd
from tests.cosim.traffic.test_levels import OVERPASS, lane
from tests.cosim.traffic.test_openscenario import CAR, CONE, HEAD, follows, location, scenario, teleport
from tests.cosim.traffic.test_table_schema import check, read, rows_of
from tests.fuzz.table_variants import STREETS
from tests.training.evaluation.test_rules_by_hand import cars, sure
from training.evaluation import evaluate, pair_frames
from training.evaluation.as_json import as_json

_FRAMES = 41  # so many that a perfect detector reaches all 40 recall positions
_NO_3D = {
    "dimensions": np.full((1, 3), -1.0),
    "location": np.full((1, 3), -1000.0),
    "rotation_y": np.full(1, -10.0),
}


def ranges(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points[:, :3], axis=1)


def lasers(points: np.ndarray) -> np.ndarray:
    elevation = np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
    return np.round((elevation + 15) / 2)


def changed(text: str, column: int, change: Callable[[float], float], row: int | None = None) -> str:
    """A table with changed values in a column, in all rows or in one."""
    lines = text.rstrip("\n").split("\n")
    for number, line in enumerate(lines[1:], 1):
        if row in (None, number):
            cells = line.split(",")
            cells[column] = repr(change(float(cells[column])))
            lines[number] = ",".join(cells)
    return "\n".join(lines) + "\n"


# A guess from one clue


def test_headings_in_gradians_are_read(tmp_path):
    text = rows_of("time_s,id,x,y,heading", "{s},{id},{x},{y},{rad}")
    tracks = read(tmp_path, changed(text, 4, lambda angle: angle * 200 / np.pi))
    check(tracks)
    back = tracks.heading_rad[tracks.samples(1)]
    assert np.allclose(np.cos(back - np.arctan2(40, 230)), -1, atol=1e-3)
    assert any("gradians from east" in note for note in tracks.notes)


@pytest.mark.parametrize("unit", [1.0, 0.004, 1000.0])
def test_a_column_of_ranges_is_no_intensity(unit, tmp_path):
    found = recording(tmp_path, lambda p: np.column_stack([p[:, :3], ranges(p) * unit, p[:, 3]]))
    assert found.schema.names["intensity"] == "column 5"
    assert any("column 4 is the range" in note for note in found.notes)


@pytest.mark.parametrize("unit", [1.0, 100.0, np.pi / 180])
def test_a_column_of_azimuths_is_no_time(unit, tmp_path):
    found = recording(tmp_path, lambda p: with_column(p, np.degrees(np.arctan2(p[:, 1], p[:, 0])) % 360 * unit))
    assert "time" not in found.schema.names and found.schema.names["intensity"] == "column 4"
    assert any("column 5 is the azimuth" in note for note in found.notes)


# Extremes that decide


@pytest.mark.parametrize("value", [1e10, 65_535.0, -3e6])
def test_many_far_coordinates_are_left_out(value, tmp_path):
    def spoil(points: np.ndarray) -> np.ndarray:
        points[::9, 0] = value
        return points

    found = recording(tmp_path, spoil)
    assert found[0].left_out == {"too far": len(scan(0.0, 0)[::9])} and found.schema.is_frame_checked


def test_one_wrong_laser_number_does_not_decide_what_the_column_is(tmp_path):
    def spoil(points: np.ndarray) -> np.ndarray:
        points = with_column(points, lasers(points))
        points[7, 4] = 255
        return points

    assert recording(tmp_path, spoil).schema.names["ring"] == "column 5"


@pytest.mark.parametrize(("row", "time"), [(41, -1.0), (60, -0.8), (70, 9.0)])
def test_one_time_that_contradicts_its_place_moves_no_clock(row, time, tmp_path):
    text = rows_of("time_s,id,x,y,speed", "{s},{id},{x},{y},9", 0.2)
    tracks = read(tmp_path, changed(text, 0, lambda _: time, row))
    assert len(tracks.time_s) == 119 and tracks.time_s.min() == 0
    assert np.allclose(tracks.speed_mps, 9.0, atol=0.05)


# Two readers, two rules


def drive_of(folder: Path, tables: list[np.ndarray]) -> Path:
    for name in ("velodyne", "calib"):
        (folder / name).mkdir(parents=True)
    (folder / "drive.yaml").write_text("kind: measured\n")
    for number, table in enumerate(tables):
        table.astype("<f4").tofile(folder / f"velodyne/{number:06d}.bin")
        (folder / f"calib/{number:06d}.txt").write_text(_CALIBRATION)
    return folder


def opened(folder: Path) -> tuple[Drive, Recording]:
    return Drive(folder), open_recording(folder)


@pytest.mark.parametrize(
    "change",
    [
        lambda p: np.column_stack([p * [1, 1, 1, 255], lasers(p)]),
        lambda p: np.column_stack([p[:, :3], ranges(p), p[:, 3]]),
    ],
    ids=["five floats, intensities to 255", "ranges before intensities"],
)
def test_a_drive_and_a_recording_have_the_same_intensities(change, tmp_path):
    drive, recorded = opened(drive_of(tmp_path, [change(scan(float(k), k)) for k in range(3)]))
    for number in range(3):
        true = scan(float(number), number)
        np.testing.assert_allclose(drive[f"{number:06d}"].points, true, atol=1e-4)
        np.testing.assert_allclose(recorded[number].intensity, true[:, 3], atol=1e-4)


def test_scans_of_unequal_rows_are_refused_by_both(tmp_path):
    tables = [
        scan(float(k), k) if k % 2 else with_column(scan(float(k), k), np.zeros(len(scan(float(k), k))))
        for k in range(4)
    ]
    folder = drive_of(tmp_path, tables)
    with pytest.raises(RecordingError, match="2 with 4 columns, 2 with 5 columns"):
        open_recording(folder / "velodyne")
    with pytest.raises(PointFileError, match="rows of one length, but of 3 scans"):
        Drive(folder)["000000"].points  # noqa: B018


# A world of one level


def driven(streets: Streets) -> dict[str, np.ndarray]:
    """Positions (n, 3) of a vehicle on each lane, a second apart."""
    places = {}
    for each in streets.lanes:
        along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(each.centre[:, :2], axis=0), axis=1))])
        at = np.arange(20.0, along[-1] - 20, 9.0)
        places[each.edge] = np.column_stack([np.interp(at, along, each.centre[:, axis]) for axis in range(3)])
    return places


def write_fcd(
    path: Path, places: dict[str, np.ndarray], *, height: Callable[[float], float] | None, names_lane: bool
) -> None:
    steps = []
    for k in range(max(map(len, places.values()))):
        body = ""
        for name, way in places.items():
            if k < len(way):
                move = np.gradient(way, axis=0)[k]
                z = "" if height is None else f'z="{height(way[k, 2]):.2f}"'
                of_lane = f'lane="{name}_0"' if names_lane else ""
                angle = np.degrees(np.arctan2(move[0], move[1]))
                position = f'x="{way[k, 0]:.3f}" y="{way[k, 1]:.3f}" {z} angle="{angle:.2f}"'
                body += f'<vehicle id="{name}" {position} type="car" speed="9" {of_lane}/>'
        steps.append(f'<timestep time="{k}">{body}</timestep>')
    path.write_text(f"<fcd-export>{''.join(steps)}</fcd-export>")


def on_lanes(path: Path, streets: Streets, places: dict[str, np.ndarray]) -> tuple[str, ...]:
    """Check that all vehicles are at the height of their lane; returns the notes."""
    tracks = read_trajectories(path, streets)
    for user, name in enumerate(tracks.ids):
        high = tracks.front[tracks.samples(user), 2]
        assert np.allclose(high, places[name][: len(high), 2], atol=0.5), name
    return tracks.notes


def helix() -> StreetLane:
    turn = np.linspace(0, 4 * np.pi, 80)
    return lane("ramp", *zip(40 * np.cos(turn), 40 * np.sin(turn), 3 * turn / np.pi, strict=True))


@pytest.mark.parametrize("names_lane", [True, False])
def test_a_ramp_that_passes_above_itself_is_climbed(names_lane, tmp_path):
    streets = Streets("helix", (helix(),), (), (), ())
    places = driven(streets)
    write_fcd(tmp_path / "fcd.xml", places, height=None, names_lane=names_lane)
    on_lanes(tmp_path / "fcd.xml", streets, places)


@pytest.mark.parametrize("names_lane", [True, False])
@pytest.mark.parametrize("datum_m", [48.3, -31.0])
def test_heights_of_another_datum_are_shifted(datum_m, names_lane, tmp_path):
    places = driven(OVERPASS)
    write_fcd(tmp_path / "fcd.xml", places, height=lambda z: z + datum_m, names_lane=names_lane)
    notes = on_lanes(tmp_path / "fcd.xml", OVERPASS, places)
    assert any(f"{datum_m:.2f} m are subtracted" in note for note in notes)


@pytest.mark.parametrize("names_lane", [True, False])
def test_heights_that_were_not_measured_are_not_used(names_lane, tmp_path):
    places = driven(OVERPASS)
    write_fcd(tmp_path / "fcd.xml", places, height=lambda z: 0.0, names_lane=names_lane)
    assert any("heights are 0 m everywhere" in note for note in on_lanes(tmp_path / "fcd.xml", OVERPASS, places))


# A zero where nothing was comparable


@pytest.mark.parametrize("without", ["labels", "detections", "both"])
@pytest.mark.parametrize(
    "no_boxes", [_NO_3D, {"dimensions": np.zeros((1, 3)), "location": np.zeros((1, 3))}], ids=["-1", "0"]
)
def test_without_3d_boxes_only_the_image_is_scored(without, no_boxes):
    labels = cars() if without == "detections" else replace(cars(), **no_boxes)
    found = sure(cars()) if without == "labels" else replace(sure(cars()), **no_boxes)
    result = as_json(evaluate(pair_frames([labels] * _FRAMES, [found] * _FRAMES)))["Car"]
    assert result["3d"] is None and result["bev"] is None
    assert result["2d"]["R40"] == pytest.approx([100, 100, 100])
    assert "no 3D boxes" in result["rules"]


# A message with a false cause


def test_a_pointer_of_git_lfs_is_named(tmp_path):
    pointer = f"version https://git-lfs.github.com/spec/v1\noid sha256:{'a' * 64}\nsize 1893920\n"
    for number in range(3):
        (tmp_path / f"{number:06d}.bin").write_text(pointer)
    with pytest.raises(RecordingError, match="git lfs pull"):
        open_recording(tmp_path)


def test_a_clock_that_stands_is_named(tmp_path):
    with pytest.raises(TrajectoryError, match="time_s is 0 in all rows, so it is not the time"):
        read(tmp_path, rows_of("time_s,id,x,y", "0,{id},{x},{y}"))


def with_catalogue(path: Path, name: str, entries: str) -> None:
    text = f'<OpenSCENARIO>{HEAD}<Catalog name="{name}">{entries}</Catalog></OpenSCENARIO>'
    (path.parent / "c.xosc").write_text(text)
    catalogs = '<CatalogLocations><VehicleCatalog><Directory path="."/></VehicleCatalog></CatalogLocations>'
    path.write_text(path.read_text().replace("<CatalogLocations/>", catalogs))


START, END = np.array([10.0, -1.6 + 10 * 40 / 230]), np.array([100.0, -1.6 + 100 * 40 / 230])
HEADING = float(np.arctan2(40, 230))


def test_things_of_a_catalogue_are_no_road_users_and_not_missing(tmp_path):
    reference = '<CatalogReference catalogName="things" entryName="cone"/>'
    way = follows([(0.0, START), (9.0, END)], HEADING)
    path = scenario(tmp_path, {"cone": teleport(location(START, 0.0))}, {"ego": way}, ego=CAR, cone=reference)
    with_catalogue(path, "things", CONE)
    tracks = read_trajectories(path, STREETS)
    assert tracks.ids == ("ego",) and any("MiscObject" in note for note in tracks.notes)


# Exceptions of other libraries


def test_a_manoeuvre_of_a_catalogue_is_refused(tmp_path):
    way = follows([(0.0, START), (9.0, END)], HEADING)
    path = scenario(tmp_path, {}, {"ego": way}, ego=CAR)
    start, end = path.read_text().index("<Maneuver "), path.read_text().index("</Maneuver>") + len("</Maneuver>")
    text = path.read_text()
    path.write_text(f'{text[:start]}<CatalogReference catalogName="m" entryName="brake"/>{text[end:]}')
    with pytest.raises(TrajectoryError, match="'ego' has a manoeuvre of a catalogue"):
        read_trajectories(path, STREETS)


@pytest.mark.parametrize(
    "position",
    [
        '<RelativeLanePosition entityRef="ego" dLane="1" ds="5"/>',
        '<RelativeObjectPosition entityRef="ego" dx="5" dy="3"/>',
        '<RelativeWorldPosition entityRef="ego" dx="5" dy="3"/>',
    ],
)
def test_positions_without_optional_attributes_have_the_true_reason(position, tmp_path):
    way = follows([(0.0, START), (9.0, END)], HEADING)
    init = {"other": teleport(f"<Position>{position}</Position>")}
    path = scenario(tmp_path, init, {"ego": way}, ego=CAR, other=CAR)
    with pytest.raises(TrajectoryError, match=f"'other' has a {position[1:].split()[0]}"):
        read_trajectories(path, STREETS)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        ("time_s,id,x,y,größe\n0,1,2,3,4\n".encode("latin-1"), "not UTF-8 text .byte 0xf6 at position 16"),
        ("time_s,id,x,y\n0,1,2,3\n".encode("utf-16"), "not UTF-8 text"),
        (b"PAR1\x00\x00\x15\x04", "binary data"),
        (b'[{"time_s": 0, "id": 1}]', "is JSON"),
    ],
)
def test_files_that_are_no_text_tables_are_named(data, says, tmp_path):
    (tmp_path / "tracks.csv").write_bytes(data)
    with pytest.raises(TrajectoryError, match=says):
        read_trajectories(tmp_path / "tracks.csv", STREETS)


@pytest.mark.parametrize("pose", ["10 20 0 1 0 0 0", "0 0 0 0.7071 0 0 0.7071", "a b c"])
def test_points_taken_from_another_pose_are_refused(pose, tmp_path):
    write_pcd(tmp_path / "000000.pcd", scan(0.0, 0))
    data = (tmp_path / "000000.pcd").read_bytes()
    (tmp_path / "000000.pcd").write_bytes(data.replace(b"POINTS", f"VIEWPOINT {pose}\nPOINTS".encode()))
    with pytest.raises(RecordingError, match="VIEWPOINT"):
        open_recording(tmp_path)
    (tmp_path / "000000.pcd").write_bytes(data.replace(b"POINTS", b"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS"))
    assert len(open_recording(tmp_path)[0].xyz)


def test_pi_is_a_number_in_expressions(tmp_path):
    way = follows([(0.0, START), (9.0, END)], HEADING)
    path = scenario(tmp_path, {}, {"ego": way}, ego=CAR)
    turned = path.read_text().replace(f'h="{HEADING:.6f}"', 'h="${' + f"{HEADING:.6f} + 2 * pi" + '}"')
    assert "pi" in turned
    path.write_text(turned)
    heading = read_trajectories(path, STREETS).heading_rad
    assert np.allclose(np.sin(heading - HEADING), 0, atol=1e-5)
