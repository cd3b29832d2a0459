"""Equal data have distance 0 in the table, and lost firings are counted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.drives.kitti import write_points
from cosim.drives.kitti.boxes import Boxes
from cosim.errors import CosimError
from cosim.stats import FrameSet
from tests.bench.realism import Gap, Row, rows
from tests.bench.scan_signature import measure
from tests.bench.variant_realism import distance, side_by_side
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


def test_a_set_compared_with_itself_shows_no_difference(tmp_path: Path) -> None:
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


def row(ours: float, real: float) -> Row:
    return Row("share of firings lost", "0–5 m", ours, real)


def test_the_distance_is_zero_for_equal_values_and_otherwise_the_logarithm_of_the_ratio() -> None:
    assert distance([row(0.2, 0.2), row(0.0, 0.0)]) == 0
    assert distance([row(0.1, 0.2)]) == pytest.approx(np.log(2))
    assert distance([row(0.1, 0.2)]) == pytest.approx(distance([row(0.2, 0.1)])), "symmetric"
    assert distance([row(0.0, 0.2)]) == pytest.approx(np.log(10)), "what is missing counts as a factor of ten"
    assert distance([row(1e-9, 0.2)]) == pytest.approx(np.log(10)), "and nothing for more"
    with_unknown = [row(0.1, 0.2), row(float("nan"), 0.2)]
    assert distance(with_unknown) == pytest.approx(np.log(2)), "unknown values do not count"


@pytest.mark.parametrize("sigma_m", [0.0, 0.01, 0.1])
def test_scatter_of_ranges_is_that_of_the_noise(tmp_path: Path, sigma_m: float) -> None:
    write_frame(tmp_path, "000000", cars((30, 2, -1)), ["Car"])
    points = room(None)
    noise = np.random.default_rng(0).normal(0, sigma_m, len(points))
    points[:, :3] *= 1 + (noise / np.linalg.norm(points[:, :3], axis=1))[:, None]
    write_points(tmp_path / "velodyne/000000.bin", points)
    assert measure(FrameSet(tmp_path)).scatter_m[0] == pytest.approx(sigma_m, rel=0.05, abs=1e-3)


def test_variants_stand_in_columns_with_a_distance_each(tmp_path: Path) -> None:
    for name in ("dual", "noise"):
        write_frame(tmp_path / name, "000000", cars((10, 2, -1)), ["Car"])
    measured = FrameSet(tmp_path / "dual")
    table, found = side_by_side(tmp_path, measure(measured), measured, None)
    assert list(found) == ["dual", "noise"]
    assert [column.header for column in table.columns] == ["quantity", "real", "dual", "noise"]
    assert all(distance(items) == 0 for items in found.values())
    with pytest.raises(CosimError, match="holds no drives"):
        side_by_side(tmp_path / "dual", measure(measured), measured, None)
