"""Quantities in which two sets are compared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from cosim.stats.distance import FrameSample, Pair, estimate
from cosim.stats.tally import INTENSITIES, RANGES_M, Collected

DRAWS = 200
DIRECTIONS = 16


@dataclass(frozen=True)
class Distance:
    """Distance of two sets in one quantity.

    Attributes:
        key, title, unit: of the quantity; unit of `wasserstein`, `low`, `high`, `chance`, `floor`.
        wasserstein: 1-Wasserstein distance; of a plane, its mean over directions (sliced).
        low, high: 95 % interval over frames.
        chance: median distance between random halves of both sets together: what equal sets would show.
        floor: median distance of as many frames of the second set as the first has, but at most half, from its rest.
        relative: `wasserstein` in standard deviations of the second set; of headings, in right angles.
        kolmogorov: Kolmogorov–Smirnov statistic, 0–1 (of headings, Kuiper's); None for a plane.
    """

    key: str
    title: str
    unit: str
    wasserstein: float
    low: float
    high: float
    chance: float
    floor: float
    relative: float
    kolmogorov: float | None

    def as_json(self) -> dict[str, object]:
        """Under its key."""
        values = asdict(self)
        values["ci95"] = [values.pop("low"), values.pop("high")]
        return {name: value for name, value in values.items() if name != "key"}


@dataclass(frozen=True)
class _Quantity:
    key: str
    title: str
    unit: str
    of: Callable[[Collected], list[FrameSample]]  # a sample an axis
    period: float | None = None
    standardised: bool = False  # axes of a plane in standard deviations of the second set


def compare_sets(a: Collected, b: Collected, rng: np.random.Generator, draws: int = DRAWS) -> list[Distance]:
    """Distances in every quantity that both sets have.

    Args:
        a, b: `b` is the reference whose spread `relative` counts in.
        rng: draws frames for intervals and chance levels.
        draws: how often.
    """
    found = []
    for quantity in _QUANTITIES:
        axes_a, axes_b = quantity.of(a), quantity.of(b)
        if all(len(axis) for axis in [*axes_a, *axes_b]):
            found.append(_measure(quantity, axes_a, axes_b, draws, rng))
    return found


def points_ratio(a: Collected, b: Collected, edges_m: np.ndarray) -> np.ndarray:
    """Median points on a visible car of `a` over that of `b`, by distance; NaN where either has no such car."""
    medians = []
    for cars in (a.focus, b.focus):
        cars = cars[cars.visible & (cars.points >= 0)]
        bin_of = np.digitize(cars.distance_m, edges_m) - 1
        groups = (cars.points[bin_of == k] for k in range(len(edges_m) - 1))
        medians.append([float(np.median(group)) if len(group) else np.nan for group in groups])
    top, bottom = np.array(medians)
    return np.divide(top, bottom, out=np.full(len(top), np.nan), where=bottom > 0)


def _measure(
    quantity: _Quantity, a: list[FrameSample], b: list[FrameSample], draws: int, rng: np.random.Generator
) -> Distance:
    scales = [axis.spread or 1.0 for axis in b] if quantity.standardised else [1.0] * len(b)
    if len(b) == 1:
        samples = [(a[0], b[0])]
    else:
        angles = np.pi * (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
        samples = [(_project(a, scales, angle), _project(b, scales, angle)) for angle in angles]
    result = estimate(samples, quantity.period, draws, rng)
    once = np.ones((1, a[0].frames)), np.ones((1, b[0].frames))
    spread = float(np.sqrt(np.mean([(axis.spread / scale) ** 2 for axis, scale in zip(b, scales, strict=True)])))
    spread = spread if quantity.period is None else quantity.period / 4
    return Distance(
        quantity.key,
        quantity.title,
        quantity.unit,
        result.value,
        result.low,
        result.high,
        result.chance,
        result.floor,
        result.value / spread if spread > 0 else float(result.value > 0),
        float(Pair(a[0], b[0], quantity.period).kolmogorov(*once)[0]) if len(b) == 1 else None,
    )


def _project(axes: list[FrameSample], scales: list[float], angle: float) -> FrameSample:
    x, y = (axis.value / scale for axis, scale in zip(axes, scales, strict=True))
    return FrameSample(axes[0].frame, np.cos(angle) * x + np.sin(angle) * y, axes[0].weight, axes[0].frames)


def _cars(column: Callable[[Collected], np.ndarray]) -> Callable[[Collected], list[FrameSample]]:
    """A sample of a value a car; `column` gives (cars,) or (cars, axes)."""

    def of(collected: Collected) -> list[FrameSample]:
        values = np.asarray(column(collected), np.float64)
        table = values[None] if values.ndim == 1 else values.T
        rows, labelled = np.cumsum(collected.labelled) - 1, int(collected.labelled.sum())
        keep = np.isfinite(table).all(0)
        frame = rows[collected.focus.frame] if len(collected.focus) else np.zeros(0, np.int64)
        return [FrameSample.of(frame[keep], axis[keep], labelled) for axis in table]

    return of


def _frames(column: Callable[[Collected], np.ndarray]) -> Callable[[Collected], list[FrameSample]]:
    """A sample of a value a frame."""

    def of(collected: Collected) -> list[FrameSample]:
        values = column(collected)
        return [FrameSample.of(np.arange(len(values)), values, len(values))]

    return of


def _histograms(
    column: Callable[[Collected], np.ndarray], values: np.ndarray
) -> Callable[[Collected], list[FrameSample]]:
    def of(collected: Collected) -> list[FrameSample]:
        return [FrameSample.of_histograms(column(collected)[collected.scanned], values)]

    return of


def _log_points(collected: Collected) -> np.ndarray:
    points = collected.focus.points.astype(float)
    return np.log10(np.where(points > 0, points, np.nan))


def _zero_share(collected: Collected) -> np.ndarray:
    counts = collected.scans.intensity[collected.scanned]
    return counts[:, 0] / np.maximum(counts.sum(1), 1)


_QUANTITIES = (
    _Quantity("birds_eye", "position of cars, bird's-eye view", "m", _cars(lambda s: s.focus.centre[:, :2])),
    _Quantity(
        "side_view",
        "position of cars, distance × height",
        "sd",
        _cars(lambda s: np.stack([s.focus.distance_m, s.focus.centre[:, 2]], -1)),
        standardised=True,
    ),
    _Quantity("distance", "distance of cars", "m", _cars(lambda s: s.focus.distance_m)),
    _Quantity("centre_height", "height of cars' centres above the sensor", "m", _cars(lambda s: s.focus.centre[:, 2])),
    _Quantity("heading", "heading of cars", "°", _cars(lambda s: np.degrees(s.focus.yaw)), period=360.0),
    _Quantity("length", "length of cars", "m", _cars(lambda s: s.focus.size[:, 0])),
    _Quantity("width", "width of cars", "m", _cars(lambda s: s.focus.size[:, 1])),
    _Quantity("height", "height of cars", "m", _cars(lambda s: s.focus.size[:, 2])),
    _Quantity("cars_per_frame", "cars a frame", "cars", _frames(lambda s: s.focus_per_frame.astype(float))),
    _Quantity("points_per_car", "points on a car", "decades", _cars(_log_points)),
    _Quantity(
        "points_per_frame", "points a scan", "points", _frames(lambda s: s.scans.points[s.scanned].astype(float))
    ),
    _Quantity("range", "range of points", "m", _histograms(lambda s: s.scans.range_m, RANGES_M)),
    _Quantity("intensity", "intensity of points", "1", _histograms(lambda s: s.scans.intensity, INTENSITIES)),
    _Quantity(
        "car_intensity", "intensity of points on cars", "1", _histograms(lambda s: s.scans.car_intensity, INTENSITIES)
    ),
    _Quantity("zero_share", "share of points with intensity 0, a frame", "1", _frames(_zero_share)),
)
