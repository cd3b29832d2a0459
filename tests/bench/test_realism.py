"""The table tells nothing apart that is the same, and counts lost firings where there are some."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.kitti import write_points
from cosim.kitti.boxes import Boxes
from cosim.stats import FrameSet
from tests.bench.realism import Gap, Row, rows
from tests.bench.scan_signature import measure
from tests.cosim.stats.sets import cars, write_frame

_FIRINGS = 2000


def room(lost_every: int | None) -> np.ndarray:
    """Two rings of a round room of 12 m radius, top first; every so many firings lost."""
    azimuth = np.pi - 2 * np.pi * (np.arange(_FIRINGS) + 0.5) / _FIRINGS
    keep = np.ones(_FIRINGS, bool)
    if lost_every:
        keep[lost_every // 2 :: lost_every] = False
    rings = [
        np.stack([12 * np.cos(azimuth), 12 * np.sin(azimuth), np.full(_FIRINGS, height), np.full(_FIRINGS, 0.3)], 1)[
            keep
        ]
        for height in (0.5, -0.5)
    ]
    return np.concatenate(rings)


@pytest.mark.parametrize("lost_every", [None, 10, 25])
def test_lost_firings_are_counted_where_both_neighbours_lie_on_one_surface(
    tmp_path: Path, lost_every: int | None
) -> None:
    write_frame(tmp_path, "000000", cars((30, 2, -1)), ["Car"])
    write_points(tmp_path / "velodyne/000000.bin", room(lost_every))
    found = measure(FrameSet(tmp_path))
    missing, returned = found.lost.sum((0, 1))
    assert missing / (missing + returned) == pytest.approx(1 / lost_every if lost_every else 0, abs=0.003)
    assert found.lost[:, 2].sum() == found.lost.sum(), "all of it between 10 and 15 m"


def test_a_set_beside_itself_shows_no_difference(tmp_path: Path) -> None:
    boxes: Boxes = cars((10, 2, -1), (20, -3, -0.8))
    write_frame(tmp_path, "000000", boxes, ["Car", "Car"])
    found = measure(FrameSet(tmp_path))
    assert len(found.cars) == 2
    for item in rows(found, found):
        if isinstance(item, Gap):
            assert item.value == pytest.approx(0) or np.isnan(item.value)
        else:
            assert isinstance(item, Row)
            assert item.ours == item.real or (np.isnan(item.ours) and np.isnan(item.real))


def test_some_frames_of_a_set_can_be_named(tmp_path: Path) -> None:
    for name in ("000000", "000001", "000002"):
        write_frame(tmp_path, name, cars((10, 2, -1)), ["Car"])
    assert FrameSet(tmp_path, ["000002", "000000"]).names == ("000000", "000002")
    with pytest.raises(Exception, match="000007"):
        FrameSet(tmp_path, ["000007"])
