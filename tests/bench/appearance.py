"""What an engineer sees in scans, real and simulated: `python -m tests.bench.appearance DIR DIR...`.

One column for each data set in KITTI's layout, with labels. Regions are those of the two-sample test: ground is within
0.25 m of the lowest points around it, and scattered is what is neither ground nor object nor smooth along a row. All
figures are of the 90° around the forward direction, as means over frames.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from cosim.drives.kitti import Boxes, Frame, points_in_boxes
from cosim.stats.frame_set import FrameSet
from cosim.stats.two_sample.grid import PatchGrid
from cosim.stats.two_sample.regions import REGIONS, region_of_cells
from tests.bench.foliage import scatter_of, upright_of

_DARK = 0.15
_WINDOWS, _BODY = (0.6, 0.85), (0.15, 0.5)  # shares of a car's height
_AROUND_M = 0.3  # of a box: mirrors, and what labels leave out
_FAR_M = 40.0  # cars beyond have too few points
_TOP_LASERS = 16
_HIGH_M = 0.8  # above the sensor: 2.5 m above the ground
_GROUND, _OBJECTS, _SCATTERED = (REGIONS.index(name) for name in ("ground", "objects", "scattered"))


def measure_frame(frame: Frame, grid: PatchGrid) -> dict[str, float]:
    """The figures of a frame; NaN where there are too few points."""
    table, distance = grid.cells(frame)
    points, there = frame.points, table >= 0
    boxes = frame.labels.cared_for.boxes_velo(frame.calibration)
    on_object = points_in_boxes(points, boxes).any(0)
    region = region_of_cells(points, table, on_object)
    value = np.where(there, points[table, 3], np.nan)
    near = there & (distance[table] < 30)
    found = {
        "zero after zero, ground": _after_zero(value, near & (region == _GROUND)),
        "zero after zero, objects": _after_zero(value, near & (region == _OBJECTS)),
        "correlation of neighbours, ground": _correlation(value, near & (region == _GROUND)),
        "spread of non-zero intensities, ground": _spread(value[near & (region == _GROUND)]),
        "spread of non-zero intensities, scattered": _spread(value[near & (region == _SCATTERED)]),
        "zeros, scattered [%]": 100 * _mean(value[near & (region == _SCATTERED)] < 0.005),
        f"intensities above 0 and below {_DARK} [%]": 100 * _mean((value[there] >= 0.005) & (value[there] < _DARK)),
        "scattered among upright points [%]": 100 * _mean(scatter_of(points)[0]),
        "scattered above 2.5 m [points]": float(np.sum(_scattered_high(points))),
        f"cells without return, upper {_TOP_LASERS} lasers [%]": 100 * float((~there[:_TOP_LASERS]).mean()),
        "single losses, lasers 13 to 46 [%]": 100 * _single_losses(there[13:47]),
    }
    return found | _car_figures(points, frame.labels.of_type("Car").boxes_velo(frame.calibration))


def _after_zero(value: np.ndarray, inside: np.ndarray) -> float:
    pair = inside[:, 1:] & inside[:, :-1] & (value[:, :-1] < 0.005)
    return _mean(value[:, 1:][pair] < 0.005)


def _correlation(value: np.ndarray, inside: np.ndarray) -> float:
    pair = inside[:, 1:] & inside[:, :-1]
    return float(np.corrcoef(value[:, 1:][pair], value[:, :-1][pair])[0, 1]) if pair.sum() > 9 else np.nan


def _spread(values: np.ndarray) -> float:
    lit = values[values >= 0.005]
    return float(lit.std()) if len(lit) > 9 else np.nan


def _mean(values: np.ndarray) -> float:
    return float(np.mean(values)) if len(values) else np.nan


def _scattered_high(points: np.ndarray) -> np.ndarray:
    upright = points[upright_of(points)]
    return scatter_of(points)[0] & (upright[:, 2] > _HIGH_M)


def _single_losses(there: np.ndarray) -> float:
    single = there[:, :-2] & ~there[:, 1:-1] & there[:, 2:]
    return float(single.sum() / max(int((there[:, :-2] & there[:, 2:]).sum()), 1))


def _car_figures(points: np.ndarray, cars: Boxes) -> dict[str, float]:
    """Ratios over all cars within 40 m."""
    cars = cars[np.hypot(cars.centre[:, 0], cars.centre[:, 1]) < _FAR_M]
    windows = body = around = inside = zeros = 0
    for centre, size, yaw in zip(cars.centre, cars.size, cars.yaw, strict=True):
        away = points[:, :3] - centre
        along = np.cos(yaw) * away[:, 0] + np.sin(yaw) * away[:, 1]
        across = np.cos(yaw) * away[:, 1] - np.sin(yaw) * away[:, 0]
        beyond = np.maximum(np.abs(along) - size[0] / 2, np.abs(across) - size[1] / 2)
        height = away[:, 2] / size[2] + 0.5
        level = [(beyond < 0) & (height > low) & (height < high) for low, high in (_WINDOWS, _BODY)]
        windows, body = windows + int(level[0].sum()), body + int(level[1].sum())
        zeros += int((points[level[0], 3] < 0.005).sum())
        above_road = (height > _BODY[0]) & (height < 1)
        inside += int(((beyond < 0) & above_road).sum())
        around += int(((beyond >= 0) & (beyond < _AROUND_M) & above_road).sum())
    return {
        "window over body points": windows / body if body else np.nan,
        "zeros of window points [%]": 100 * zeros / windows if windows else np.nan,
        f"points up to {_AROUND_M} m around cars [%]": 100 * around / inside if inside else np.nan,
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="+", type=Path, metavar="DIR")
    options = parser.parse_args()
    sets = [FrameSet(path) for path in options.sets]
    grid = PatchGrid.common([list(source) for source in sets], 90.0)
    table = Table("", *(f"{source.title} ({len(source)})" for source in sets))
    columns = [[measure_frame(frame, grid) for frame in source] for source in sets]
    for key in columns[0][0]:
        cells = []
        for frames in columns:
            values = np.array([frame[key] for frame in frames])
            values = values[np.isfinite(values)]
            error = values.std() / np.sqrt(max(len(values), 1)) if len(values) else np.nan
            cells.append(f"{values.mean() if len(values) else np.nan:.3g} ± {error:.2g}")
        table.add_row(key, *cells)
    Console(width=160).print(table)


if __name__ == "__main__":
    main()
