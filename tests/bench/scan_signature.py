"""What a set of labelled scans looks like to a sensor engineer, in one pass: counts a frame, for means with errors."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cosim.drives.kitti import Calibration, Frame, points_in_boxes
from cosim.stats import FrameSet, LabelledObjects
from sensors.cameras.kitti_rig import KITTI_CALIBRATION

RINGS = 64
REACH_EDGES_M = np.array([0, 5, 10, 15, 20, 30, 40, 50, 60, 80], float)
CAR_EDGES_M = np.array([0, 10, 20, 30, 40, 60], float)
INTENSITIES = np.arange(101) / 100  # KITTI's grid
SATURATED = 0.985
_CLEARANCE_M = 0.2  # of a box's bottom: what lies below is road
_WIDEST_GAP_RAD = np.radians(1.2)
_SAME_SURFACE = 0.05  # of the range: both ends of a gap lie on one surface
_FINEST_STEP_RAD = np.radians(0.05)
_QUARTILE = 0.3186  # a quarter of |N(0, 1)| lies below


@dataclass(eq=False)
class Signature:
    """Counts of f frames; sums of a range bin hold points, intensity, zeros, in that order.

    Attributes:
        points: (f,) points.
        rings: (f, 64) points by ring.
        reach, car_reach: (f, 9, 3), (f, 5, 3) sums by range, of all and of points on cars.
        intensity, car_intensity: (f, 101) histograms of points elsewhere than on cars, and on cars.
        lost: (f, 9, 2) firings without a return between two returns of one surface, and returns, by range.
        scatter_m: (f,) standard deviation of ranges along smooth surfaces within 20 m; NaN if unknown.
        elevation_deg: (f, 64) slope of the cone each ring's points lie on; NaN if unknown.
        cars: labelled cars with their points.
    """

    points: np.ndarray
    rings: np.ndarray
    reach: np.ndarray
    car_reach: np.ndarray
    intensity: np.ndarray
    car_intensity: np.ndarray
    lost: np.ndarray
    scatter_m: np.ndarray
    elevation_deg: np.ndarray
    cars: LabelledObjects = field(default_factory=lambda: LabelledObjects.merge([]))


def measure(source: FrameSet) -> Signature:
    """Read a set once; frames without labels count in no figure of cars."""
    bins, car_bins, frames = len(REACH_EDGES_M) - 1, len(CAR_EDGES_M) - 1, len(source)
    found = Signature(
        points=np.zeros(frames),
        rings=np.zeros((frames, RINGS)),
        reach=np.zeros((frames, bins, 3)),
        car_reach=np.zeros((frames, car_bins, 3)),
        intensity=np.zeros((frames, len(INTENSITIES))),
        car_intensity=np.zeros((frames, len(INTENSITIES))),
        lost=np.zeros((frames, bins, 2)),
        scatter_m=np.full(frames, np.nan),
        elevation_deg=np.full((frames, RINGS), np.nan),
    )
    tables = []
    for row, frame in enumerate(source):
        points = frame.points
        distance = np.linalg.norm(points[:, :3], axis=1)
        on_car = np.zeros(len(points), bool)
        if frame.has("label_2"):
            cars, on_car = _cars(row, frame, points)
            tables.append(cars)
        found.points[row] = len(points)
        found.reach[row] = _sums(distance, points[:, 3], REACH_EDGES_M)
        found.car_reach[row] = _sums(distance[on_car], points[on_car, 3], CAR_EDGES_M)
        found.intensity[row] = _histogram(points[~on_car, 3])
        found.car_intensity[row] = _histogram(points[on_car, 3])
        ring = frame.rays.ring
        if ring.max(initial=0) < RINGS:
            found.rings[row] = np.bincount(ring, minlength=RINGS)
            azimuth = np.arctan2(points[:, 1], points[:, 0], dtype=np.float64)
            found.lost[row] = _lost(ring, azimuth, distance)
            found.scatter_m[row] = _scatter_m(ring, azimuth, distance)
            found.elevation_deg[row] = _elevations(ring, points)
    found.cars = LabelledObjects.merge(tables).of_type("Car")
    return found


def _cars(row: int, frame: Frame, points: np.ndarray) -> tuple[LabelledObjects, np.ndarray]:
    labels = frame.labels.cared_for
    calibration = frame.calibration if frame.has("calib") else Calibration(**vars(KITTI_CALIBRATION))
    boxes = labels.boxes_velo(calibration)
    inside = points_in_boxes(points, boxes) if len(labels) else np.zeros((0, len(points)), bool)
    above = points[None, :, 2] > (boxes.centre[:, 2] - boxes.size[:, 2] / 2 + _CLEARANCE_M)[:, None]
    is_car = np.array([name == "Car" for name in labels.type], bool)
    on_car = np.asarray((inside & above)[is_car].any(0))
    return LabelledObjects.of(labels, calibration, row, inside.sum(1)), on_car


def _sums(distance: np.ndarray, intensity: np.ndarray, edges: np.ndarray) -> np.ndarray:
    columns = (None, intensity, (intensity < 0.005).astype(float))
    return np.stack([np.histogram(distance, edges, weights=column)[0] for column in columns], 1)


def _histogram(intensity: np.ndarray) -> np.ndarray:
    return np.bincount(np.clip(np.rint(intensity * 100), 0, 100).astype(np.int64), minlength=len(INTENSITIES))


def _lost(ring: np.ndarray, azimuth: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Gaps along the rings whose ends lie on one surface, in steps of the median firing."""
    order = np.lexsort((azimuth, ring))
    ring, azimuth, distance = ring[order], azimuth[order], distance[order]
    gap = np.diff(azimuth)
    near = np.minimum(distance[1:], distance[:-1])
    same = (ring[1:] == ring[:-1]) & (gap < _WIDEST_GAP_RAD)
    same &= np.abs(np.diff(distance)) < _SAME_SURFACE * near
    ordinary = gap[same & (gap > _FINEST_STEP_RAD) & (gap < np.radians(0.25))]
    step = ordinary.mean() if len(ordinary) else 1.0
    missing = np.where(same, np.maximum(np.rint(gap / step) - 1, 0), 0)
    counts = (np.histogram(near, REACH_EDGES_M, weights=column)[0] for column in (missing, same.astype(float)))
    return np.stack(list(counts), 1)


def _scatter_m(ring: np.ndarray, azimuth: np.ndarray, distance: np.ndarray) -> float:
    """From the lower quartile of second differences of three neighbours, which edges and texture do not affect."""
    order = np.lexsort((azimuth, ring))
    ring, azimuth, distance = ring[order], azimuth[order], distance[order].astype(np.float64)
    near = (ring[2:] == ring[:-2]) & (azimuth[2:] - azimuth[:-2] < np.radians(0.6)) & (distance[1:-1] < 20)
    if near.sum() < 100:
        return float("nan")
    bend = np.abs(distance[2:] - 2 * distance[1:-1] + distance[:-2])[near]
    return float(
        np.quantile(bend, 0.25) / _QUARTILE / np.sqrt(6)
    )  # a second difference of noise has six times its variance


def _elevations(ring: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Slope of z over ρ ring by ring, where the points lie at different distances."""
    reach, height = np.hypot(points[:, 0], points[:, 1], dtype=np.float64), points[:, 2].astype(np.float64)
    number = np.maximum(np.bincount(ring, minlength=RINGS), 1)
    reach -= (np.bincount(ring, reach, RINGS) / number)[ring]
    spread = np.bincount(ring, reach**2, RINGS)
    slope = np.bincount(ring, reach * height, RINGS) / np.where(spread > 0, spread, 1)
    return np.where(spread > number * 0.1**2, np.degrees(np.arctan(slope)), np.nan)
