"""The figures of the page: each takes the sets and gives a picture with its words, or nothing where data is absent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.report.plot import Axis, Plot, nice_top
from cosim.stats.heat_map import VIEWS, HeatMapView, density_colours, difference_colours, smoothing_cells
from cosim.stats.objects import LabelledObjects, difficulty
from cosim.stats.summary import DISTANCE_EDGES_M, OCCLUSIONS, histogram_mean, points_per_car, zero_share
from cosim.stats.tally import INTENSITIES, INTENSITY_STEP, RANGE_STEP_M, RANGES_M, REACHES_M, Collected

STYLES = ("a", "b", "c")
_MOST_CLASSES = 9
Sets = Sequence[Collected]


@dataclass(frozen=True)
class Chart:
    """A picture and its words; `wide` charts span the page's columns."""

    title: str
    text: str
    svg: str
    size: str = ""


def position_charts(sets: Sets) -> list[Chart]:
    """Heat maps of every set from above and from the side, and of their difference."""
    sets = [found for found in sets if len(found.focus)]
    return [chart for view in VIEWS for chart in _heat_maps(view, sets)] if sets else []


def point_charts(sets: Sets) -> list[Chart]:
    """Points on cars against distance, by occlusion."""
    sets = [found for found in sets if found.scanned.any() and len(found.focus)]
    if not sets:
        return []
    chosen: list[tuple[str, Callable[[LabelledObjects], np.ndarray]]] = [
        ("all", lambda cars: np.ones(len(cars), bool)),
        *((word, lambda cars, level=int(level): _occluded(cars, level)) for level, word in OCCLUSIONS.items()),
    ]
    return [_points_against_distance(sets, word, rows) for word, rows in chosen]


def scan_charts(sets: Sets) -> list[Chart]:
    """Intensity, range, points and rings of the scans."""
    sets = [found for found in sets if found.scanned.any()]
    if not sets:
        return []
    edges = np.append(INTENSITIES, 1 + INTENSITY_STEP) - INTENSITY_STEP / 2
    charts = [
        _intensity("Intensity of all points", sets, edges, [found.scans.intensity.sum(0) for found in sets]),
        _intensity("Intensity on cars", sets, edges, [found.scans.car_intensity.sum(0) for found in sets]),
        _against_range("Mean intensity against range", "mean intensity", sets, lambda s: s.scans.reach_sum),
        _against_range("Zeros against range", "share of zeros", sets, lambda s: s.scans.reach_zero, percent=True),
        _histogram(
            "Range of points",
            "Distance from the sensor. "
            + _means([histogram_mean(s.scans.range_m.sum(0), RANGES_M) for s in sets], sets, " m"),
            "range (m)",
            np.append(RANGES_M - RANGE_STEP_M / 2, RANGES_M[-1] + RANGE_STEP_M / 2),
            [found.scans.range_m.sum(0) for found in sets],
            high=80.0,
        ),
        _values("Points a scan", "points (thousands)", sets, lambda s: s.scans.points[s.scanned] / 1000, 30),
        _rings(sets),
    ]
    return [chart for chart in charts if chart is not None]


def label_charts(sets: Sets) -> list[Chart]:
    """Classes, occlusion, difficulty, numbers, sizes, headings."""
    sets = [found for found in sets if found.labelled.any()]
    if not any(found.classes for found in sets):
        return []
    charts = [_classes(sets)]
    if not any(len(found.focus) for found in sets):
        return charts
    with_cars = [found for found in sets if len(found.focus)]
    top = max(int(found.focus_per_frame.max()) for found in with_cars)
    per_frame = [np.bincount(found.focus_per_frame, minlength=top + 1) for found in with_cars]
    charts += [
        _histogram(
            "Cars a frame",
            _means([float(found.focus_per_frame.mean()) for found in with_cars], with_cars),
            "labelled cars in a frame",
            np.arange(top + 2) - 0.5,
            per_frame,
        ),
        _shares("Occlusion of cars", "as labelled", with_cars, _occlusion_counts),
        _shares("Difficulty of cars", "an easy car is also a moderate and a hard one", with_cars, _difficulty_counts),
        _shares("Truncation of cars", "share outside the image", with_cars, _truncation_counts),
        _values("Distance of cars", "ground distance (m)", with_cars, lambda s: s.focus.distance_m, 36),
        _values("Height of cars' centres", "above the sensor (m)", with_cars, lambda s: s.focus.centre[:, 2], 40),
        _values("Heading of cars", "heading against the LiDAR's (°)", with_cars, _headings, 48, (-90, 270)),
    ]
    for column, side in enumerate(("Length", "Width", "Height")):
        charts.append(
            _values(
                f"{side} of cars",
                f"{side.lower()} (m)",
                with_cars,
                lambda s, column=column: s.focus.size[:, column],
                40,
            )
        )
    return charts


def _heat_maps(view: HeatMapView, sets: Sets) -> list[Chart]:
    word = "From above" if view.key == "birds_eye" else "From the side"
    sigma = smoothing_cells(min(len(found.focus) for found in sets))
    densities = [view.density(found.focus, sigma) for found in sets]
    top = max(float(np.quantile(density[density > 0], 0.995)) for density in densities)
    charts = []
    for found, density in zip(sets, densities, strict=True):
        title = f"{word}: {found.title}"
        plot = view.plot(density_colours(density, top), title)
        blur = f"{sigma * view.cell[0]:.1f} × {sigma * view.cell[1]:.1g} m"
        text = f"{len(found.focus):,} cars, smoothed by {blur}; one scale."
        if view.outside(found.focus) > 0.0005:
            text += f" {view.outside(found.focus):.1%} lie outside."
        charts.append(Chart(title, text, plot.svg()))
    for one, other in ((0, 1), (2, 1), (0, 2))[: {2: 1, 3: 3}.get(len(sets), 0)]:
        title = f"{word}: difference" if len(sets) == 2 else f"{word}: {sets[one].title} − {sets[other].title}"
        plot = view.plot(difference_colours(densities[one], densities[other], top), title)
        text = f"Orange: more of {sets[one].title}; blue: more of {sets[other].title}."
        charts.append(Chart(title, text, plot.svg()))
    return charts


def _points_against_distance(sets: Sets, word: str, rows: Callable[[LabelledObjects], np.ndarray]) -> Chart:
    word = f"{word} cars"
    plot = Plot(
        Axis(0, 90, "ground distance (m)"), Axis(0.8, 10_000, "points on the car", log=True), f"points on {word}", 760
    )
    number = []
    for style, found in zip(_styles(sets), sets, strict=True):
        cars = found.focus[rows(found.focus)]
        table = points_per_car(cars, DISTANCE_EDGES_M)
        middle = np.array([(row["from_m"] + row["to_m"]) / 2 for row in table])
        low, median, high = (np.array([row[key] for row in table], float) for key in ("p10", "median", "p90"))
        number.append(float(len(cars)))
        if len(table):
            plot.band(middle, low, high, style)
            plot.line(middle, np.where(median > 0, median, np.nan), style, dots=True)
    text = "Median, and 10 to 90 % of them. " + _counts(number, sets, "cars")
    return Chart(f"Points on {word}", text, plot.svg())


def _intensity(title: str, sets: Sets, edges: np.ndarray, counts: list[np.ndarray]) -> Chart | None:
    means = [histogram_mean(count, INTENSITIES) for count in counts]
    zeros = [zero_share(count) for count in counts]
    if not any(count.sum() for count in counts):
        return None
    text = (
        "Mean " + _join([f"{mean:.3f}" for mean in means], sets) + "; zeros " + _join([f"{z:.1%}" for z in zeros], sets)
    )
    without = [np.concatenate([[0], count[1:]]) / max(count.sum(), 1) for count in counts]
    top = nice_top(max(float(np.quantile(share, 0.995)) for share in without))
    plot = Plot(Axis(-0.01, 1.0, "intensity"), Axis(0, top, "share of points a step of 0.01", percent=True), title)
    for style, share in zip(_styles(sets), without, strict=True):
        plot.steps(edges, share, style)
    return Chart(title, text + ". Zeros are left out of the curve.", plot.svg())


def _against_range(
    title: str, label: str, sets: Sets, column: Callable[[Collected], np.ndarray], percent: bool = False
) -> Chart:
    lines = []
    for found in sets:
        count = found.scans.reach_count
        lines.append(np.divide(column(found), count, out=np.full(len(count), np.nan), where=count > 0))
    top = 1.0 if percent else nice_top(max(float(np.nanmax(line)) for line in lines))
    plot = Plot(Axis(0, 84, "range (m)"), Axis(0, top, label, percent=percent), title)
    for style, line in zip(_styles(sets), lines, strict=True):
        plot.line(REACHES_M[REACHES_M < 84], line[REACHES_M < 84], style, dots=True)
    return Chart(title, "All points, in steps of 4 m.", plot.svg())


def _rings(sets: Sets) -> Chart | None:
    lines = []
    for found in sets:
        scan_count = int(((found.scans.rings > 0) & found.scanned).sum())
        used = int(np.flatnonzero(found.scans.ring_points).max(initial=-1)) + 1
        lines.append(found.scans.ring_points[:used] / max(scan_count, 1))
    if not any(len(line) for line in lines):
        return None
    top, widest = nice_top(max(float(line.max(initial=0)) for line in lines)), max(len(line) for line in lines)
    plot = Plot(Axis(0, max(widest, 2), "ring, 0 on top"), Axis(0, top, "points a scan"), "points by ring", 1720)
    for style, line in zip(_styles(sets), lines, strict=True):
        plot.steps(np.arange(len(line) + 1), line, style)
    return Chart("Points by ring", "Mean over scans whose rings are known or can be recovered.", plot.svg(), "full")


def _classes(sets: Sets) -> Chart:
    names = sorted(set().union(*(found.classes for found in sets)), key=lambda n: -max(s.classes[n] for s in sets))
    names = names[:_MOST_CLASSES]
    values = [np.array([s.classes[name] / max(s.labelled.sum(), 1) for name in names]) for s in sets]
    top = nice_top(1.1 * max((float(value.max(initial=0)) for value in values), default=1))
    plot = Plot(Axis(-0.5, len(names) - 0.5, names=names), Axis(0, top, "objects a frame"), "classes", width=1140)
    for row, (style, value, found) in enumerate(zip(_styles(sets), values, sets, strict=True)):
        words = [f"{found.classes[name]:,}" for name in names]
        plot.bars(_side_by_side(len(names), row, len(sets)), value, 0.7 / len(sets), style, words)
    return Chart("Classes", "Height: objects a labelled frame; numbers: objects.", plot.svg(), "wide")


def _shares(
    title: str, text: str, sets: Sets, counts: Callable[[LabelledObjects], tuple[list[str], np.ndarray]]
) -> Chart:
    names = counts(sets[0].focus)[0]
    plot = Plot(Axis(-0.5, len(names) - 0.5, names=names), Axis(0, 1.1, "share of cars", percent=True), title)
    for row, (style, found) in enumerate(zip(_styles(sets), sets, strict=True)):
        number = counts(found.focus)[1]
        share = number / max(len(found.focus), 1)
        words = [f"{value:.0%}" for value in share]
        plot.bars(_side_by_side(len(names), row, len(sets)), share, 0.7 / len(sets), style, words)
    return Chart(title, f"{text[0].upper()}{text[1:]}.", plot.svg())


def _occlusion_counts(cars: LabelledObjects) -> tuple[list[str], np.ndarray]:
    names = ["visible", "partly", "largely", "unknown"]
    return names, np.array([(cars.occluded == level).sum() for level in range(4)])


def _difficulty_counts(cars: LabelledObjects) -> tuple[list[str], np.ndarray]:
    levels = difficulty(cars)
    return [*levels, "none"], np.array([*(rows.sum() for rows in levels.values()), (~levels["hard"]).sum()])


def _truncation_counts(cars: LabelledObjects) -> tuple[list[str], np.ndarray]:
    places = np.digitize(cars.truncated, [1e-9, 0.15 + 1e-9, 0.30 + 1e-9, 0.50 + 1e-9])
    return ["none", "to 0.15", "to 0.30", "to 0.50", "above"], np.bincount(places, minlength=5)


def _occluded(cars: LabelledObjects, level: int) -> np.ndarray:
    return cars.visible if level == 0 else cars.occluded == level


def _headings(collected: Collected) -> np.ndarray:
    return (np.degrees(collected.focus.yaw) + 90) % 360 - 90


def _values(
    title: str,
    label: str,
    sets: Sets,
    column: Callable[[Collected], np.ndarray],
    bins: int,
    bounds: tuple[float, float] | None = None,
) -> Chart:
    values = [np.asarray(column(found), float) for found in sets]
    together = np.concatenate(values)
    low, high = bounds or (float(edge) for edge in np.quantile(together, [0.001, 0.999]))
    if high - low < 1e-6:
        low, high = low - 0.5, high + 0.5
    edges = np.linspace(low, high, bins + 1)
    counts = [np.histogram(np.clip(value, low, high), edges)[0] for value in values]
    if bounds:
        text = "0°: the ego vehicle's way; 180°: towards it; 90°: to its left."
    else:
        text = "Mean ± sd: " + _join(
            [f"{value.mean():.2f} ± {value.std():.2f}" if len(value) else "—" for value in values], sets
        )
    return _histogram(title, text, label, edges, counts)


def _histogram(
    title: str, text: str, label: str, edges: np.ndarray, counts: list[np.ndarray], high: float | None = None
) -> Chart:
    shares = [count / max(count.sum(), 1) for count in counts]
    top = nice_top(max(float(share.max()) for share in shares))
    plot = Plot(Axis(float(edges[0]), high or float(edges[-1]), label), Axis(0, top, "share", percent=True), title)
    for style, share in zip(_styles(counts), shares, strict=True):
        plot.steps(edges, share, style)
    return Chart(title, text, plot.svg())


def _side_by_side(groups: int, row: int, rows: int) -> np.ndarray:
    return np.arange(groups) + (row - (rows - 1) / 2) * 0.7 / rows


def _means(means: list[float], sets: Sets, unit: str = "") -> str:
    return "Mean " + _join([f"{mean:.2f}{unit}" for mean in means], sets) + "."


def _counts(numbers: list[float], sets: Sets, what: str) -> str:
    return _join([f"{number:,.0f}" for number in numbers], sets) + f" {what}."


def _join(words: list[str], sets: Sets) -> str:
    return " against ".join(words) if len(sets) > 1 else words[0]


def _styles(sets: Sequence[object]) -> tuple[str, ...]:
    return STYLES[: len(sets)]
