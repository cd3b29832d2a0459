"""Point files without names or units: their meaning is found from the scans, or the reason of a refusal is stated."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cosim.recordings import open_recording
from cosim.recordings.recording import Recording, RecordingError

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
def test_columns_are_found_and_points_without_return_are_counted(change, left_out, tmp_path):
    found = recording(tmp_path, change)
    assert list(found.schema.names) == ["x", "y", "z", "intensity"]
    assert found.schema.intensity_scale == 1.0
    assert (sum(found[0].left_out.values()) > 0) == bool(left_out)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda p: p * np.array([1, -1, 1, 1]), "flip-y"),
        (lambda p: p + np.array([2000, 5000, 0, 0]), "georeferenced"),
    ],
    ids=["left-handed", "georeferenced"],
)
def test_points_in_other_axes_are_refused_with_the_reason(change, says, tmp_path):
    with pytest.raises(RecordingError, match=says):
        recording(tmp_path, change)
