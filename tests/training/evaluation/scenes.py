"""Random labels and detections for the evaluation's tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cosim.drives.kitti import Labels

EVERYTHING = ("Car", "Car", "Car", "Van", "Pedestrian", "Person_sitting", "Cyclist", "DontCare", "Truck")


def objects(rng: np.random.Generator, count: int, classes: tuple[str, ...] = EVERYTHING) -> Labels:
    """Objects anywhere before the camera, some crowding, some small, hidden or cut off."""
    position = np.column_stack([rng.uniform(-8, 8, count), rng.uniform(1, 2, count), rng.uniform(5, 55, count)])
    size = np.abs(rng.normal([1.5, 1.6, 3.9], [0.1, 0.1, 0.4], (count, 3)))
    left, height = 600 + 30 * position[:, 0], 1300 / position[:, 2]
    return Labels(
        tuple(rng.choice(classes, count)),
        rng.choice([0, 0, 0, 0.2, 0.4, 0.6], count),
        rng.choice([0, 0, 0, 1, 2, 3], count),
        rng.uniform(-3.1, 3.1, count),
        np.column_stack([left, 180 - height / 2, left + 1.5 * height, 180 + height / 2]),
        size,
        position,
        rng.uniform(-3.1, 3.1, count),
    )


def as_detections(rng: np.random.Generator, labels: Labels, spread: float = 0.08, ties: bool = True) -> Labels:
    """Each object detected up to three times, moved and turned a little, with things that are not there."""
    rows = np.repeat(np.arange(len(labels)), rng.integers(0, 4, len(labels)))
    found, count = labels[rows], len(rows)
    score = rng.uniform(0, 1, count + 4)
    found = replace(
        found,
        location=found.location + rng.normal(0, spread, (count, 3)),
        bbox=found.bbox + rng.normal(0, 40 * spread, (count, 4)),
        rotation_y=found.rotation_y + rng.normal(0, spread, count),
        alpha=found.alpha + rng.normal(0, 1, count),
    )
    known = {"Van": "Car", "DontCare": "Car", "Truck": "Car", "Person_sitting": "Pedestrian"}
    found = replace(found, type=tuple(known.get(name, name) for name in found.type))
    found = found.followed_by(objects(rng, 4, ("Car", "Pedestrian", "Cyclist")))
    found = replace(found, score=score.round(1) if ties else score)
    return found[rng.permutation(len(found))]


def perfect(labels: Labels) -> Labels:
    """The labels as detections with score 1."""
    return replace(labels.cared_for, score=np.ones(len(labels.cared_for)))
