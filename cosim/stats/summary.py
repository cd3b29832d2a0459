"""The numbers of a set as JSON."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from cosim.stats.objects import LabelledObjects, difficulty
from cosim.stats.tally import INTENSITIES, RANGES_M, REACHES_M, Collected

DISTANCE_EDGES_M = np.array([0, 5, 10, 15, 20, 25, 30, 35, 40, 50, 60, 70, 90], float)
OCCLUSIONS = {"0": "fully visible", "1": "partly occluded", "2": "largely occluded"}
_FEW_POINTS = 5
_HEADING_EDGES_DEG = np.arange(-180, 181, 15)


def summarise(collected: Collected) -> dict[str, Any]:
    """Every figure of a set; parts that are absent are null."""
    labelled = bool(collected.labelled.any())
    return {
        "name": collected.title,
        "kind": collected.kind,
        "path": collected.path,
        "frames": len(collected.frames),
        "absent": list(collected.notes),
        "labels": _labels(collected) if labelled else None,
        "points": _points(collected) if collected.scanned.any() else None,
    }


def points_per_car(cars: LabelledObjects, edges_m: np.ndarray = DISTANCE_EDGES_M) -> list[dict[str, float | int]]:
    """Quantiles of the number of points on cars by ground distance; bins without a car are left out."""
    cars = cars[cars.points >= 0]
    bin_of = np.digitize(cars.distance_m, edges_m) - 1
    rows = []
    for row, (low, high) in enumerate(pairwise(edges_m)):
        points = cars.points[bin_of == row]
        if not len(points):
            continue
        p10, p25, median, p75, p90 = np.quantile(points, [0.1, 0.25, 0.5, 0.75, 0.9])
        rows.append(
            {
                "from_m": float(low),
                "to_m": float(high),
                "cars": len(points),
                "mean": float(points.mean()),
                "p10": float(p10),
                "p25": float(p25),
                "median": float(median),
                "p75": float(p75),
                "p90": float(p90),
                "zero_share": float((points == 0).mean()),
                "under_5_share": float((points < _FEW_POINTS).mean()),
            }
        )
    return rows


def describe(values: np.ndarray) -> dict[str, float]:
    """Mean, standard deviation and quantiles; empty for no values."""
    if not len(values):
        return {}
    low, p5, median, p95, high = np.quantile(values, [0, 0.05, 0.5, 0.95, 1])
    return {
        "mean": float(np.mean(values)),
        "sd": float(np.std(values)),
        "min": float(low),
        "p5": float(p5),
        "median": float(median),
        "p95": float(p95),
        "max": float(high),
    }


def histogram_mean(counts: np.ndarray, values: np.ndarray) -> float:
    """Mean of binned values; NaN without any."""
    return float(counts @ values / counts.sum()) if counts.sum() else float("nan")


def zero_share(counts: np.ndarray) -> float:
    """Share of the first bin; NaN without any."""
    return float(counts[0] / counts.sum()) if counts.sum() else float("nan")


def _labels(collected: Collected) -> dict[str, Any]:
    objects, names = collected.objects, sorted(set(collected.objects.type.tolist()))
    cars = collected.focus
    return {
        "frames": int(collected.labelled.sum()),
        "objects": len(objects),
        "classes": dict(collected.classes.most_common()),
        "by_class": {name: _class(objects.of_type(name)) for name in names},
        "cars_per_frame": describe(collected.focus_per_frame)
        | {"histogram": np.bincount(collected.focus_per_frame).tolist()},
        "points_per_car": {
            "all": points_per_car(cars),
            "visible": points_per_car(cars[cars.visible]),
            **{f"occluded_{level}": points_per_car(cars[cars.occluded == int(level)]) for level in ("1", "2")},
        }
        if collected.scanned.any()
        else None,
    }


def _class(objects: LabelledObjects) -> dict[str, Any]:
    occluded = {str(level): int((objects.occluded == level).sum()) for level in sorted(set(objects.occluded.tolist()))}
    heading, _ = np.histogram(np.degrees(objects.yaw), _HEADING_EDGES_DEG)
    return {
        "objects": len(objects),
        "difficulty": {name: int(rows.sum()) for name, rows in difficulty(objects).items()},
        "occluded": occluded,
        "truncated": {
            "none": int((objects.truncated <= 0).sum()),
            "up_to_0.15": int(((objects.truncated > 0) & (objects.truncated <= 0.15)).sum()),
            "above_0.15": int((objects.truncated > 0.15).sum()),
        },
        "dimensions_m": {
            side: describe(objects.size[:, column]) for column, side in enumerate(("length", "width", "height"))
        },
        "position_m": {
            axis: describe(objects.centre[:, column]) for column, axis in enumerate(("forward", "left", "up"))
        }
        | {"distance": describe(objects.distance_m)},
        "heading_deg": {"edges": _HEADING_EDGES_DEG.tolist(), "histogram": heading.tolist()},
    }


def _points(collected: Collected) -> dict[str, Any]:
    scans, rows = collected.scans, collected.scanned
    everything, cars = scans.intensity.sum(0), scans.car_intensity.sum(0)
    with_rings = rows & (scans.rings > 0)
    reached = scans.reach_count > 0
    ranges = scans.range_m.sum(0)
    used = int(np.flatnonzero(scans.ring_points).max(initial=-1)) + 1
    return {
        "frames": int(rows.sum()),
        "per_frame": describe(scans.points[rows]),
        "rings": describe(scans.rings[with_rings]) or None,
        "per_ring": (scans.ring_points[:used] / max(int(with_rings.sum()), 1)).round(2).tolist() if used else None,
        "intensity": _intensity(everything),
        "car_intensity": _intensity(cars),
        "range_m": {
            "mean": histogram_mean(ranges, RANGES_M),
            "median": _quantile(ranges, RANGES_M, 0.5),
            "centres": RANGES_M.tolist(),
            "histogram": ranges.tolist(),
        },
        "intensity_by_range": [
            {
                "centre_m": float(centre),
                "points": int(count),
                "mean": float(total / count),
                "zero_share": float(zero / count),
            }
            for centre, count, total, zero in zip(
                REACHES_M[reached],
                *(column[reached] for column in (scans.reach_count, scans.reach_sum, scans.reach_zero)),
                strict=True,
            )
        ],
    }


def _intensity(counts: np.ndarray) -> dict[str, Any] | None:
    if not counts.sum():
        return None
    return {
        "mean": histogram_mean(counts, INTENSITIES),
        "zero_share": zero_share(counts),
        "values": INTENSITIES.round(2).tolist(),
        "histogram": counts.tolist(),
    }


def _quantile(counts: np.ndarray, values: np.ndarray, share: float) -> float:
    return float(values[np.searchsorted(np.cumsum(counts), share * counts.sum())])
