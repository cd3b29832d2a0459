"""Labels: KITTI's files byte for byte, its angles, and boxes in both axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.drives.kitti.boxes import Boxes, points_in_boxes, wrap_angle
from cosim.drives.kitti.calibration import Calibration
from cosim.drives.kitti.labels import Labels, format_labels, parse_labels, read_labels
from cosim.errors import FormatError

LINE = "Car 0.00 0 -1.57 614.24 181.78 727.31 284.77 1.57 1.73 4.15 1.00 1.75 13.22 1.62"
SQUARE = Calibration(
    P2=np.array([[700, 0, 600, 0], [0, 700, 170, 0], [0, 0, 1, 0]], float),
    R0_rect=np.eye(3),
    Tr_velo_to_cam=np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.08], [1, 0, 0, -0.27]]),
)


def _boxes(seed: int, count: int = 6) -> Boxes:
    rng = np.random.default_rng(seed)
    yaw = rng.uniform(-np.pi, np.pi, count)
    return Boxes(rng.uniform([3, -30, -2], [70, 30, 2], (count, 3)), rng.uniform(0.4, 6, (count, 3)), yaw)


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_labels_survive_the_file_to_their_decimals(seed: int, scored: bool) -> None:
    rng = np.random.default_rng(seed)
    score = rng.random(6) if scored else None
    bbox = rng.uniform(0, 1000, (6, 4))
    labels = Labels.from_boxes(_boxes(seed), ["Car", "Van"] * 3, SQUARE, bbox=bbox, occluded=2, score=score)
    read = parse_labels(format_labels(labels))
    assert read.type == labels.type
    assert (read.occluded == 2).all()
    for name in ("truncated", "alpha", "bbox", "dimensions", "location", "rotation_y"):
        assert np.abs(getattr(read, name) - getattr(labels, name)).max() <= 0.005 + 1e-9
    assert (read.score is None) == (not scored)


@given(st.integers(0, 2**32 - 1))
def test_boxes_go_to_labels_and_back(seed: int) -> None:
    boxes = _boxes(seed)
    back = Labels.from_boxes(boxes, ["Car"] * 6, SQUARE).boxes_velo(SQUARE)
    assert np.allclose(back.centre, boxes.centre, atol=1e-9)
    assert np.allclose(back.size, boxes.size)
    assert np.allclose(wrap_angle(back.yaw - boxes.yaw), 0, atol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_squarely_mounted_rotation_y_is_minus_yaw_minus_a_right_angle(seed: int) -> None:
    boxes = _boxes(seed)
    labels = Labels.from_boxes(boxes, ["Car"] * 6, SQUARE)
    assert np.allclose(wrap_angle(labels.rotation_y + boxes.yaw + np.pi / 2), 0, atol=1e-9)
    bearing = np.arctan2(labels.location[:, 0], labels.location[:, 2])
    assert np.allclose(wrap_angle(labels.alpha - labels.rotation_y + bearing), 0, atol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_the_corners_are_the_same_in_both_axes(seed: int) -> None:
    boxes = _boxes(seed, 1)
    labels = Labels.from_boxes(boxes, ["Car"], SQUARE)
    velo = SQUARE.velo_to_rect(boxes.corners.reshape(-1, 3))
    rect = labels.corners_rect.reshape(-1, 3)
    gaps = np.linalg.norm(velo[:, None] - rect[None], axis=2)
    assert gaps.min(1).max() < 1e-9


def test_a_car_ahead_driving_ahead_appears_as_in_kitti() -> None:
    ahead = Boxes(np.array([[20.0, 0, -0.9]]), np.array([[4, 1.7, 1.5]]), np.array([0.0]))
    labels = Labels.from_boxes(ahead, ["Car"], SQUARE)
    assert labels.rotation_y[0] == pytest.approx(-np.pi / 2)
    assert labels.alpha[0] == pytest.approx(-np.pi / 2, abs=0.01)
    assert labels.dimensions[0].tolist() == [1.5, 1.7, 4]
    assert labels.location[0, 1] == pytest.approx(0.9 + 0.75 - 0.08)


@given(st.integers(0, 2**32 - 1))
def test_a_point_is_in_a_box_if_its_share_of_each_half_side_is_below_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = _boxes(seed, 4)
    share = rng.uniform(-1.5, 1.5, (50, 3))
    for row in range(4):
        local = share * boxes.size[row] / 2
        cos, sin = np.cos(boxes.yaw[row]), np.sin(boxes.yaw[row])
        turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        points = local @ turn.T + boxes.centre[row]
        inside = points_in_boxes(points, boxes)
        assert inside.shape == (4, 50)
        assert np.array_equal(inside[row], (np.abs(share) <= 1).all(1))


def test_some_rows_are_chosen_by_mask_and_class() -> None:
    labels = parse_labels("\n".join([LINE, LINE.replace("Car", "DontCare"), LINE.replace("Car", "van")]))
    assert labels.cared_for.type == ("Car", "van")
    assert labels.of_type("Van", "car").type == ("Car", "van")
    assert labels[labels.rotation_y > 9].type == ()
    assert len(Labels.empty()) == 0 == len(parse_labels("\n\n"))
    assert format_labels(Labels.empty()) == ""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LINE + "\n" + LINE.rsplit(" ", 1)[0], "label:2: 14 columns; expected 15, or 16 with a score"),
        (LINE + " 0.5 1", "label:1: 17 columns"),
        (LINE + "\n" + LINE + " 0.5", "label:2: 16 columns after lines of 15"),
        (LINE.replace("1.73", "wide"), "label:1: 'wide' is not a number"),
        (LINE.replace("1.73", "nan"), "label:1: 'nan' is not finite"),
        (LINE.replace(" 0 ", " 0.5 ", 1), "label:1: occluded is 0.5"),
    ],
)
def test_faults_are_named_with_their_line(text: str, message: str) -> None:
    with pytest.raises(FormatError, match=message):
        parse_labels(text, "label")


def test_values_that_cannot_be_written_are_refused() -> None:
    labels = parse_labels(LINE)
    with pytest.raises(FormatError, match="must be one word"):
        format_labels(Labels.from_boxes(_boxes(0, 1), ["my car"], SQUARE))
    labels.location[0, 0] = np.nan
    with pytest.raises(FormatError, match=r"row 0 \(Car\) holds NaN"):
        format_labels(labels)


def test_real_files_are_rewritten_byte_for_byte(kitti_source: Path) -> None:
    for file in sorted((kitti_source / "label_2").glob("*.txt")):
        assert format_labels(read_labels(file)) == file.read_text()
