"""Counts are those of the files, and difficulty is KITTI's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.errors import DriveError
from cosim.stats import Collected, FrameSet, LabelledObjects, collect, difficulty, summarise
from cosim.stats.summary import points_per_car
from tests.cosim.stats.sets import INSIDE, ZEROS, cars, write_frame


def test_objects_are_counted_by_class_and_frame(found: Collected) -> None:
    assert found.classes == {"Car": 3, "Pedestrian": 1}
    assert found.focus_per_frame.tolist() == [2, 1, 0]
    summary = summarise(found)["labels"]
    assert summary["by_class"]["Pedestrian"]["objects"] == 1
    assert summary["cars_per_frame"]["histogram"] == [1, 1, 1]


def test_positions_and_sizes_come_back_in_lidar_axes(found: Collected) -> None:
    np.testing.assert_allclose(found.focus.centre, [[10, 2, -1], [20, -3, -0.8], [30, 0, -1]], atol=1e-5)
    np.testing.assert_allclose(found.focus.size, np.tile([4.0, 1.6, 1.5], (3, 1)), atol=1e-5)
    np.testing.assert_allclose(found.focus.yaw, 0, atol=1e-5)
    np.testing.assert_allclose(found.focus.distance_m, np.hypot([10, 20, 30], [2, 3, 0]), atol=1e-5)


def test_points_in_boxes_and_their_zeros_are_counted(found: Collected) -> None:
    assert found.objects.points.tolist() == [INSIDE] * 4
    assert found.scans.points.tolist() == [2 * INSIDE + 5, 2 * INSIDE + 5, 5]
    on_cars = summarise(found)["points"]["car_intensity"]
    assert sum(on_cars["histogram"]) == 3 * INSIDE, "the pedestrian's points are not a car's"
    assert on_cars["zero_share"] == pytest.approx(ZEROS / INSIDE)
    assert on_cars["mean"] == pytest.approx(0.5 * (1 - ZEROS / INSIDE))


def test_every_point_is_in_every_histogram(found: Collected) -> None:
    scans = found.scans
    assert (scans.intensity.sum(1) == scans.points).all()
    assert (scans.range_m.sum(1) == scans.points).all()
    assert scans.reach_count.sum() == scans.ring_points.sum() == scans.points.sum()


def test_points_near_the_road_do_not_count_for_a_cars_intensity(tmp_path: Path) -> None:
    write_frame(tmp_path / "low", "000000", cars((10, 0, 0)), ["Car"])
    scan = tmp_path / "low/velodyne/000000.bin"
    points = np.fromfile(scan, "<f4").reshape(-1, 4)
    points[:INSIDE, 2] = -0.75 + 0.1
    points.tofile(scan)
    found = collect(FrameSet(tmp_path / "low"))
    assert found.objects.points.tolist() == [INSIDE]
    assert found.scans.car_intensity.sum() == 0


def test_labels_alone_have_no_points_and_say_so(labels_only: Path) -> None:
    found = collect(FrameSet(labels_only))
    summary = summarise(found)
    assert summary["points"] is None
    assert summary["labels"]["points_per_car"] is None
    assert summary["labels"]["classes"] == {"Car": 3}
    assert any("velodyne/ is absent" in note for note in summary["absent"])


def test_scans_without_labels_say_so(drive: Path) -> None:
    for file in (drive / "label_2").iterdir():
        file.unlink()
    summary = summarise(collect(FrameSet(drive)))
    assert summary["labels"] is None
    assert summary["points"]["frames"] == 3
    assert any("label_2/ is absent" in note for note in summary["absent"])


def test_a_frame_without_labels_is_no_frame_without_cars(drive: Path) -> None:
    (drive / "label_2/000002.txt").unlink()
    assert collect(FrameSet(drive)).focus_per_frame.tolist() == [2, 1]


@pytest.mark.parametrize("part", ["nothing", "empty", "file"])
def test_what_is_no_set_is_refused_in_a_line(tmp_path: Path, part: str) -> None:
    (tmp_path / "empty/label_2").mkdir(parents=True)
    (tmp_path / "file").write_text("")
    with pytest.raises(DriveError) as caught:
        FrameSet(tmp_path / part)
    assert "\n" not in str(caught.value)


def test_a_folder_of_neither_scans_nor_labels_names_both(tmp_path: Path) -> None:
    with pytest.raises(DriveError, match=r"velodyne/ nor label_2/"):
        FrameSet(tmp_path)


def table(height: float, occluded: int, truncated: float, points: int = 0, distance: float = 10.0) -> LabelledObjects:
    return LabelledObjects(
        frame=np.zeros(1, np.int64),
        type=np.array(["Car"]),
        size=np.ones((1, 3)),
        centre=np.array([[distance, 0.0, 0.0]]),
        yaw=np.zeros(1),
        truncated=np.array([truncated]),
        occluded=np.array([occluded]),
        bbox=np.array([[100.0, 100.0, 200.0, 100.0 + height]]),
        points=np.array([points]),
    )


@pytest.mark.parametrize(
    ("height", "occluded", "truncated", "levels"),
    [
        (60, 0, 0.0, "easy moderate hard"),
        (40, 0, 0.0, "moderate hard"),  # the devkit ignores heights up to the limit
        (30, 0, 0.0, "moderate hard"),
        (25, 0, 0.0, ""),
        (60, 1, 0.0, "moderate hard"),
        (60, 2, 0.0, "hard"),
        (60, 3, 0.0, ""),
        (60, -1, 0.0, ""),
        (60, 0, 0.15, "easy moderate hard"),
        (60, 0, 0.30, "moderate hard"),
        (60, 0, 0.50, "hard"),
        (60, 0, 0.51, ""),
    ],
)
def test_difficulty_is_kittis(height: float, occluded: int, truncated: float, levels: str) -> None:
    found = difficulty(table(height, occluded, truncated))
    assert [name for name, rows in found.items() if rows[0]] == levels.split()


@given(st.floats(0, 200), st.integers(-1, 3), st.floats(0, 1))
def test_an_easier_level_is_part_of_a_harder_one(height: float, occluded: int, truncated: float) -> None:
    found = difficulty(table(height, occluded, truncated))
    assert (found["easy"] <= found["moderate"]).all()
    assert (found["moderate"] <= found["hard"]).all()


@given(st.lists(st.tuples(st.floats(0, 89), st.integers(0, 3000)), min_size=1, max_size=30))
def test_cars_are_binned_by_distance_without_loss(seen: list[tuple[float, int]]) -> None:
    objects = LabelledObjects.merge(table(50, 0, 0, points, distance) for distance, points in seen)
    rows = points_per_car(objects)
    assert sum(row["cars"] for row in rows) == len(seen)
    total = sum(row["cars"] * row["mean"] for row in rows)
    assert total == pytest.approx(sum(points for _, points in seen))
    assert all(row["p10"] <= row["median"] <= row["p90"] for row in rows)


def test_real_labels_give_the_published_counts(kitti_source: Path, tmp_path: Path) -> None:
    import tarfile

    packed = kitti_source / "statistics/label_2_all_7481.tar.xz"
    if not packed.is_file():
        pytest.skip("no labels of the whole training set")
    with tarfile.open(packed) as archive:
        archive.extractall(tmp_path, filter="data")
    found = collect(FrameSet(tmp_path))
    assert len(found.frames) == 7481
    assert found.classes == {
        **{"Car": 28742, "DontCare": 11295, "Pedestrian": 4487, "Van": 2914, "Cyclist": 1627, "Truck": 1094},
        **{"Misc": 973, "Tram": 511, "Person_sitting": 222},
    }
    assert found.focus_per_frame.mean() == pytest.approx(3.84, abs=0.005)
    assert np.bincount(found.focus.occluded).tolist() == [13457, 8184, 6173, 928]
    assert any("calib/ is absent" in note for note in found.notes)
