"""Point files without names or units: their meaning is found from the scans, or the reason of a refusal is stated."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cosim.drives.kitti import Drive
from cosim.recordings import open_recording
from cosim.recordings.recording import Recording, RecordingError

_CALIBRATION = "".join(f"P{k}: 700 0 600 0 0 700 180 0 0 0 1 0\n" for k in range(4)) + (
    "R0_rect: 1 0 0 0 1 0 0 0 1\nTr_velo_to_cam: 0 -1 0 0 0 0 -1 -0.08 1 0 0 -0.27\n"
)
LASERS, FIRINGS, MOUNT_M = 16, 900, 1.8


def scan(start_m: float, seed: int) -> np.ndarray:
    """(n, 4) x y z intensity between two walls, firing by firing, clockwise, of 16 lasers from -15° to 15°."""
    rng = np.random.default_rng(seed)
    azimuth = np.repeat(np.pi - 2 * np.pi * (np.arange(FIRINGS) + 0.5) / FIRINGS, LASERS)
    elevation = np.tile(np.radians(np.linspace(-15, 15, LASERS)), FIRINGS)
    way = np.column_stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    with np.errstate(divide="ignore"):
        ground = np.where(way[:, 2] < 0, -MOUNT_M / way[:, 2], np.inf)
        wall = np.where(way[:, 1] > 0, 7.0, -9.0) / way[:, 1]
    along = start_m + wall * way[:, 0]
    wall = wall - 0.6 * (np.mod(along, 11.0) < 3.0)
    reach = np.minimum(ground, wall)
    keep = reach < 60
    points = way[keep] * (reach[keep] + rng.normal(0, 0.01, keep.sum()))[:, None]
    return np.column_stack([points, rng.uniform(0.05, 0.6, keep.sum())])


def recording(folder: Path, change: Callable[[np.ndarray], np.ndarray]) -> Recording:
    for number in range(6):
        change(scan(1.0 * number, number)).astype("<f4").tofile(folder / f"{number:06d}.bin")
    return open_recording(folder)


def with_column(points: np.ndarray, column: np.ndarray) -> np.ndarray:
    return np.column_stack([points, column])


def replaced(points: np.ndarray, rows: object, columns: object, value: float) -> np.ndarray:
    points = points.copy()
    points[rows, columns] = value
    return points


@pytest.mark.parametrize(
    ("change", "left_out"),
    [
        (lambda p: with_column(p, np.random.default_rng(0).random(len(p)) * 0.3), 0),
        (lambda p: replaced(p, slice(None, None, 20), slice(0, 3), -1), 1),
        (lambda p: replaced(p, slice(None, None, 25), slice(0, 3), 0), 1),
        (lambda p: replaced(p, 5, 0, np.inf), 1),
        (lambda p: replaced(p[: len(p) // 3 * 3], slice(None, None, 50), 3, -1), 1),
    ],
    ids=["elongation", "minus one", "zeros", "infinite", "negative intensity"],
)
def test_columns_are_detected_and_points_without_return_are_counted(change, left_out, tmp_path):
    found = recording(tmp_path, change)
    assert list(found.schema.names) == ["x", "y", "z", "intensity"]
    assert found.schema.intensity_scale == 1.0
    assert (sum(found[0].left_out.values()) > 0) == bool(left_out)


def write_pcd(path: Path, points: np.ndarray, *more: tuple[str, np.ndarray | None, str, int]) -> None:
    """A binary PCD of x y z intensity and further fields (name, values, kind, count), as PCL writes it."""
    fields = [(name, points[:, at], "f4", 1) for at, name in enumerate(("x", "y", "z", "intensity"))]
    fields = [*fields[:3], *[each for each in more if each[0] == "_"], fields[3], *[e for e in more if e[0] != "_"]]
    record = np.zeros(len(points), [(f"f{at}", kind, (count,)) for at, (_, _, kind, count) in enumerate(fields)])
    for at, (_, values, _, count) in enumerate(fields):
        if values is not None and count:
            record[f"f{at}"] = values[:, None]
    types = [np.dtype(kind) for _, _, kind, _ in fields]
    lines = [
        "VERSION 0.7",
        f"FIELDS {' '.join(field[0] for field in fields)}",
        f"SIZE {' '.join(str(kind.itemsize) for kind in types)}",
        f"TYPE {' '.join(kind.kind.upper() for kind in types)}",
        f"COUNT {' '.join(str(field[3]) for field in fields)}",
        f"WIDTH {len(points)}",
        "HEIGHT 1",
        f"POINTS {len(points)}",
        "DATA binary",
    ]
    path.write_bytes(("\n".join(lines) + "\n").encode() + record.tobytes())


def times_of(points: np.ndarray, outlier_s: float, count: int) -> np.ndarray:
    """Firing times [ns] of a sweep of 0.1 s, the first points with a time of their own."""
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    times = ((np.pi - azimuth) / (2 * np.pi) * 1e8).astype("u4")
    times[:count] = int(outlier_s * 1e9)
    return times


@pytest.mark.parametrize(("outlier_s", "count"), [(0.36, 20), (3.9, 3), (0.5, 60)])
def test_time_outliers_are_left_out_and_counted(outlier_s, count, tmp_path):
    for number in range(3):
        points = scan(float(number), number)
        write_pcd(tmp_path / f"{number:06d}.pcd", points, ("t", times_of(points, outlier_s, count), "u4", 1))
    found = open_recording(tmp_path)
    assert found[0].time_s is not None and found[0].time_s.max() == pytest.approx(0.1, abs=2e-3)
    assert found[0].left_out == {"time outside the sweep": count}


@pytest.mark.parametrize("padding", [[("_", None, "u1", 4), ("_", None, "u1", 0)], [("_", None, "u1", 12)], []])
def test_padding_of_point_clouds_is_skipped(padding, tmp_path):
    points = scan(0.0, 0)
    rings = np.tile(np.arange(LASERS), FIRINGS)[: len(points)]
    write_pcd(tmp_path / "000000.pcd", points, *padding, ("label", rings, "u2", 1))
    found = open_recording(tmp_path)
    assert np.allclose(found[0].xyz, points[:, :3], atol=1e-5)
    assert np.allclose(found[0].intensity, points[:, 3], atol=1e-6)


@pytest.mark.parametrize(
    ("unit", "outlier", "scale"), [(100, 300, 255), (1, 7, 1), (255, 60_000, 255), (65535, 4e9, 65535)]
)
def test_one_bright_point_changes_no_scale(unit, outlier, scale, tmp_path):
    def change(points: np.ndarray) -> np.ndarray:
        return replaced(points * [1, 1, 1, unit], 3, 3, outlier)

    found = recording(tmp_path, change)
    assert found.schema.intensity_scale == pytest.approx(scale, rel=0.02)
    assert 0.25 < np.median(found[0].intensity) * scale / unit < 0.4 and found[0].intensity.max() == 1.0


def test_stamps_since_1970_are_no_intensities(tmp_path):
    found = recording(tmp_path, lambda p: np.column_stack([p[:, :3], np.full(len(p), 1.7e9), p[:, 3]]))
    assert found.schema.names["intensity"] == "column 5"
    assert np.allclose(found[0].intensity, scan(0.0, 0)[:, 3], atol=1e-6)


@pytest.mark.parametrize("kind", ["<f4", ">f4", "<f8"])
@pytest.mark.parametrize("extra", [0, 1, 5])
def test_drives_and_recordings_read_the_same_points(kind, extra, tmp_path):
    folder = tmp_path / "velodyne"
    folder.mkdir()
    (tmp_path / "calib").mkdir()
    (tmp_path / "drive.yaml").write_text("kind: measured\n")
    rng = np.random.default_rng(0)
    for number in range(2):
        points = scan(float(number), number)
        table = np.column_stack([points, *[rng.random(len(points)) * 0.3 for _ in range(extra)]])
        table.astype(kind).tofile(folder / f"{number:06d}.bin")
        (tmp_path / f"calib/{number:06d}.txt").write_text(_CALIBRATION)
    measured, recorded = Drive(tmp_path)["000001"].points, open_recording(tmp_path)[1]
    assert np.allclose(measured[:, :3], scan(1.0, 1)[:, :3], atol=1e-5)
    assert np.allclose(measured[:, :3], recorded.xyz, atol=1e-5) and np.allclose(measured[:, 3], recorded.intensity)


def test_what_is_undetermined_is_reported(tmp_path):
    order = np.random.default_rng(0).permutation
    found = recording(tmp_path, lambda p: p[order(len(p))] * [1, -1, 1, 1])
    assert any("left and right cannot be verified" in note for note in found.notes)
    assert not any("left and right" in note for note in open_recording(tmp_path, flip_y=True).notes)


def test_a_wall_close_by_is_no_ground(tmp_path):
    """Of scans over a part of the turn, a wall beside the sensor is a layer all around its normal."""

    def beside_a_wall(points: np.ndarray) -> np.ndarray:
        way = points[:, :3] / np.linalg.norm(points[:, :3], axis=1)[:, None]
        to_wall = way[:, 1] > 0.5
        return np.column_stack([way * (2.6 / way[:, 1])[:, None], points[:, 3]])[to_wall]

    assert len(recording(tmp_path, beside_a_wall)) == 6


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda p: p[:, [1, 2, 0, 3]] * [-1, -1, 1, 1], "points down, as in a camera"),
        (lambda p: p * [1, -1, -1, 1], "z axis points down"),
        (lambda p: p * np.array([1, -1, 1, 1]), "flip-y"),
        (lambda p: p + np.array([2000, 5000, 0, 0]), "georeferenced"),
    ],
    ids=["camera", "down", "left-handed", "georeferenced"],
)
def test_points_in_other_axes_are_refused_with_the_reason(change, says, tmp_path):
    with pytest.raises(RecordingError, match=says):
        recording(tmp_path, change)


def in_feet(points: np.ndarray) -> np.ndarray:
    return points / [0.3048, 0.3048, 0.3048, 1]


def with_far_points(points: np.ndarray) -> np.ndarray:
    """Every 60th point 110 m away."""
    way = points[:, :3] / np.linalg.norm(points[:, :3], axis=1)[:, None]
    far = np.arange(len(points)) % 60 == 0
    return np.column_stack([np.where(far[:, None], 110 * way, points[:, :3]), points[:, 3]])


def in_steps(points: np.ndarray, step_m: float = 0.004) -> np.ndarray:
    """Ranges as multiples of the sensor's resolution."""
    reach = np.linalg.norm(points[:, :3], axis=1)[:, None]
    return np.column_stack([points[:, :3] / reach * np.rint(reach / step_m) * step_m, points[:, 3]])


def on_a_mast(points: np.ndarray) -> np.ndarray:
    return points - [0, 0, 3.7, 0]


@pytest.mark.parametrize(
    ("change", "unit_m", "says"),
    [
        (
            lambda p: in_feet(with_far_points(p)),
            0.3048,
            "coordinates are feet: .* farther than a sensor sees in metres",
        ),
        (lambda p: in_feet(in_steps(p)), 0.3048, "coordinates are feet: .* multiples of a few millimetres"),
        (on_a_mast, 1.0, "coordinates are metres: .* too near for a sensor in feet"),
        (lambda p: in_steps(with_far_points(on_a_mast(p))), 1.0, "coordinates are metres: .* multiples"),
        (lambda p: p, 1.0, ""),
    ],
    ids=["far", "steps in feet", "mast", "steps on a mast", "car"],
)
def test_a_second_clue_distinguishes_feet_and_metres(change, unit_m, says, tmp_path):
    found = recording(tmp_path, change)
    assert found.schema.metres == unit_m
    assert any(re.search(says, note) for note in found.notes) if says else not any("feet" in n for n in found.notes)


def test_feet_or_metres_without_a_second_clue_are_refused(tmp_path):
    with pytest.raises(
        RecordingError, match=r"may be feet or metres: .*1.8 m if they are feet.*--metres 0.3048"
    ) as caught:
        recording(tmp_path, in_feet)
    assert "5.9 m if they are metres, as on a mast" in str(caught.value)
    found = open_recording(tmp_path, metres=0.3048)
    assert np.allclose(found[0].xyz, scan(0.0, 0)[:, :3], atol=1e-4)
