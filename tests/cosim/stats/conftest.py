"""Small sets of known content."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.stats import Collected, FrameSet, collect
from tests.cosim.stats.sets import cars, write_frame


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """Three frames: two cars, a car and a pedestrian, nothing."""
    root = tmp_path / "small"
    write_frame(root, "000000", cars((10, 2, -1), (20, -3, -0.8)), ["Car", "Car"])
    write_frame(root, "000001", cars((30, 0, -1), (8, 4, -0.9)), ["Car", "Pedestrian"])
    write_frame(root, "000002", cars(), [])
    return root


@pytest.fixture
def labels_only(tmp_path: Path) -> Path:
    root = tmp_path / "labels"
    write_frame(root, "000000", cars((10, 2, -1), (20, -3, -0.8)), ["Car", "Car"], scan=False)
    write_frame(root, "000001", cars((30, 0, -1)), ["Car"], scan=False)
    return root


@pytest.fixture
def found(drive: Path) -> Collected:
    return collect(FrameSet(drive))
