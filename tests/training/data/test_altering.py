"""Frames keep their sense when they are altered."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.drives.kitti import Drive, points_in_boxes
from tests.training.tiny_drive import car_points
from training.data import IGNORED, Augment, FrameSource, ObjectBank, TrainingSample, augment, read_sample, read_samples
from training.data.object_bank import as_boxes
from training.errors import TrainingError
from training.evaluation.rotated_overlap import paired_intersections


def sample(rng: np.random.Generator, name: str = "a", cars: int = 3) -> TrainingSample:
    boxes = np.zeros((cars, 7), np.float32)
    boxes[:, 0], boxes[:, 1] = 10 + 9 * np.arange(cars), rng.uniform(-8, 8, cars)
    boxes[:, 3:6], boxes[:, 6] = [3.9, 1.6, 1.5], rng.uniform(-3, 3, cars)
    points = np.concatenate([car_points(box, rng) for box in boxes]).astype(np.float32)
    return TrainingSample(name, points, boxes, np.zeros(cars, np.int64))


@pytest.mark.parametrize("seed", range(5))
def test_points_stay_in_their_boxes_when_a_frame_is_flipped_turned_and_scaled(seed):
    rng = np.random.default_rng(seed)
    before = sample(rng)
    after = augment(before, Augment(flip=1, rotation_deg=90, scale=0.2, samples={}), None, rng)
    counts = [points_in_boxes(subset.points, as_boxes(subset.boxes)).sum(1) for subset in (before, after)]
    assert counts[0].tolist() == counts[1].tolist() and counts[0].min() > 200
    assert not np.allclose(before.boxes, after.boxes)


def test_a_scaled_object_keeps_its_points_at_its_faces_and_its_bottom_centre():
    rng = np.random.default_rng(3)
    before = sample(rng)
    settings = Augment(flip=0, rotation_deg=0, scale=0, samples={}, object_scale=0.2)
    after = augment(before, settings, None, rng)
    factor = after.boxes[:, 3:6] / before.boxes[:, 3:6]
    assert np.ptp(factor) > 0.05 and (np.abs(factor - 1) <= 0.2 + 1e-6).all()
    assert after.boxes[:, [0, 1, 6]] == pytest.approx(before.boxes[:, [0, 1, 6]], abs=1e-5)
    bottoms = [subset.boxes[:, 2] - subset.boxes[:, 5] / 2 for subset in (before, after)]
    assert bottoms[0] == pytest.approx(bottoms[1], abs=1e-5)
    for box in after.boxes:  # those of the roof lie as far under the top as car_points puts them
        own = points_in_boxes(after.points, as_boxes(box[None]), 0.01)[0]
        assert own.sum() == 250
        assert after.points[own, 2].max() == pytest.approx(box[2] + 0.49 * box[5], abs=1e-3)


def test_a_small_tilt_keeps_the_points_of_a_car_in_its_box():
    rng = np.random.default_rng(7)
    before = sample(rng)
    settings = Augment(flip=0, rotation_deg=0, scale=0, samples={}, tilt_deg=0.3, lift_m=0.3)
    after = augment(before, settings, None, rng)
    assert np.abs(after.boxes[:, 2] - before.boxes[:, 2]).max() > 0.01
    assert points_in_boxes(after.points, as_boxes(after.boxes), 0.03).sum(1).min() == 250


def test_the_same_seed_alters_equally():
    rng = np.random.default_rng(0)
    before = sample(rng)
    one, other = (augment(before, Augment(samples={}), None, np.random.default_rng([1, 2])) for _ in range(2))
    assert np.array_equal(one.points, other.points) and np.array_equal(one.boxes, other.boxes)


def test_objects_put_in_bring_their_points_and_overlap_nothing():
    rng = np.random.default_rng(4)
    bank = ObjectBank([sample(rng, str(number)) for number in range(12)], {0: 8})
    filled = bank.fill(sample(rng), rng)
    assert 3 < len(filled.boxes) <= 8
    columns = [0, 1, 3, 4, 6]
    for row in range(len(filled.boxes)):
        others = np.delete(filled.boxes, row, 0)[:, columns]
        own = np.repeat(filled.boxes[row : row + 1, columns], len(others), 0)
        assert paired_intersections(own, others).max() == 0
    assert points_in_boxes(filled.points, as_boxes(filled.boxes)).sum(1).min() > 200


def street(rng: np.random.Generator, height_m: float) -> np.ndarray:
    """Points (8000, 4) of level ground."""
    places = [rng.uniform(0, 40, 8000), rng.uniform(-15, 15, 8000), rng.normal(height_m, 0.01, 8000), np.zeros(8000)]
    return np.column_stack(places).astype(np.float32)


def test_objects_put_in_stand_as_high_above_the_ground_as_they_stood():
    rng = np.random.default_rng(6)
    low, above = -2.4, 0.04
    empty = TrainingSample("low", street(rng, low), np.zeros((0, 7), np.float32), np.zeros(0, np.int64))
    cars = sample(rng)
    for table in (cars.boxes, cars.points):
        table[:, 2] -= 1.0
    bottom = float(cars.boxes[0, 2] - cars.boxes[0, 5] / 2)
    donor = TrainingSample(
        "high", np.concatenate([cars.points, street(rng, bottom - above)]), cars.boxes, cars.class_ids
    )
    filled = ObjectBank([donor], {0: 3}).fill(empty, rng)
    assert len(filled.boxes) == 3
    assert filled.boxes[:, 2] - filled.boxes[:, 5] / 2 == pytest.approx(low + above, abs=0.02)
    assert points_in_boxes(filled.points, as_boxes(filled.boxes)).sum(1).min() > 200


def test_real_frames_keep_what_the_camera_sees_and_ignore_vans(kitti_root):
    drive = Drive(kitti_root)
    for frame in drive:
        read = read_sample(frame, ["Car"])
        assert 0.1 < len(read.points) / len(frame.points) < 0.3
        vans = sum(name == "Van" for name in frame.labels.type)
        assert (read.class_ids == IGNORED).sum() >= vans
        inside = points_in_boxes(read.points, as_boxes(read.boxes[read.class_ids == 0])).sum(1)
        assert (inside >= 5).all()


def test_an_empty_training_set_is_named(tiny_drive):
    with pytest.raises(TrainingError, match="empty"):
        read_samples([], ["Car"])
    with pytest.raises(TrainingError, match="none of its 4 frames has a labelled Cyclist"):
        read_samples([FrameSource(drive=tiny_drive)], ["Cyclist"])
