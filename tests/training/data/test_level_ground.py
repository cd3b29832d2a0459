"""Heights above the local ground: found under cars, across gaps and on slopes, and put back."""

from __future__ import annotations

import numpy as np
import torch

from tests.training.tiny_drive import car_points
from training.data.batch import collate
from training.data.frame import TrainingSample
from training.data.level_ground import LEVEL_M, find_ground
from training.models.settings import ModelSettings

GRID = ModelSettings().grid


def slope(x, y):
    """Height of a street that rises ahead and falls to the left."""
    return LEVEL_M + 0.03 * x - 0.04 * y + 0.1


def street(seed: int = 0) -> TrainingSample:
    """Points on that street, thinner the farther, with cars and a wall on it."""
    rng = np.random.default_rng(seed)
    away, angle = rng.uniform(4, 55, 12000), rng.uniform(-0.7, 0.7, 12000)
    x, y = away * np.cos(angle), away * np.sin(angle)
    ground = np.column_stack([x, y, slope(x, y) + rng.normal(0, 0.01, len(x)), np.full(len(x), 0.2)])
    boxes = np.array([[10, 2, 0, 4, 1.7, 1.5, 0.3], [12, -3, 0, 4, 1.7, 1.5, 1.4], [32, 5, 0, 4, 1.7, 1.5, 0]], float)
    boxes[:, 2] = slope(boxes[:, 0], boxes[:, 1]) + boxes[:, 5] / 2
    ground = ground[~(np.hypot(x - 10, y - 2) < 2.2)]  # no ground is seen about the first car
    wall_x = rng.uniform(5, 50, 3000)
    wall = np.column_stack([wall_x, np.full(3000, 8.0), slope(wall_x, 8.0) + rng.uniform(0, 4, 3000), np.ones(3000)])
    points = np.concatenate([ground, wall, *(car_points(box, rng) for box in boxes)]).astype(np.float32)
    return TrainingSample("street", points, boxes.astype(np.float32), np.zeros(3, np.int64))


def test_the_ground_of_a_slope_is_detected_also_where_cars_hide_it():
    ground = find_ground(collate([street()]).points, 1, GRID)
    position = torch.tensor([[10.0, 2.0], [12.0, -3.0], [32.0, 5.0], [20.0, 0.0], [45.0, -10.0]])
    rise = ground.rise(torch.zeros(len(position), dtype=torch.int64), position)
    expected = torch.tensor(slope(*position.T.numpy()) - LEVEL_M)
    assert torch.allclose(rise, expected, atol=0.06)


def test_cars_on_level_ground_stand_at_one_height_and_return_to_their_own():
    batch = collate([street(0), street(1)])
    ground = find_ground(batch.points, 2, GRID)
    level = ground.levelled(batch)
    for frame, boxes in enumerate(level.boxes):
        assert torch.allclose(boxes[:, 2] - boxes[:, 5] / 2, torch.tensor(LEVEL_M), atol=0.06)
        assert torch.allclose(ground.raised(boxes, frame), batch.boxes[frame], atol=1e-5)


def test_where_nothing_is_seen_the_ground_is_level():
    ground = find_ground(torch.zeros(0, 5), 1, GRID)
    assert torch.allclose(ground.height, torch.tensor(LEVEL_M))


def test_a_higher_sensor_sees_the_same_cars_on_level_ground():
    here, up = street(), np.float32([0, 0, 0.2])
    moved = np.pad(up, (0, 4))
    lifted = TrainingSample("lifted", here.points + moved[:4], here.boxes + moved, here.class_ids)
    report = [
        find_ground(collate([subset]).points, 1, GRID).levelled(collate([subset])).boxes[0] for subset in (here, lifted)
    ]
    assert torch.allclose(*report, atol=0.03)
