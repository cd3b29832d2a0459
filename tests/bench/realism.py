"""Simulated and real scans: `python -m tests.bench.realism [DRIVE...] [--variants DIR] --real DIR [--frames FILE]`.

A DRIVE is any folder in KITTI's layout with labels: a drive, or what `cosim variants` wrote of one. `--variants DIR`
takes all that `cosim variants --out DIR` wrote and says which is nearest to the real scans.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from cosim.errors import CosimError
from cosim.stats import FrameSet, LabelledObjects
from tests.bench.scan_signature import CAR_EDGES_M, INTENSITIES, REACH_EDGES_M, RINGS, SATURATED, Signature, measure

CAR_DISTANCES_M = np.array([5, 10, 15, 20, 25, 30, 35, 40, 50], float)
TOLERANCE = 0.10


@dataclass(frozen=True)
class Row:
    """One quantity of both sets, each with the standard error of its mean; `distance` closes a group."""

    group: str
    name: str
    ours: float
    real: float
    ours_error: float = float("nan")
    real_error: float = float("nan")

    @property
    def ratio(self) -> float:
        """Ours over real."""
        return self.ours / self.real if self.real else float("nan")

    @property
    def ratio_error(self) -> float:
        """Its standard error, from those of both sides."""
        if not self.ours or not self.real:
            return float("nan")
        return abs(self.ratio) * float(np.hypot(self.ours_error / self.ours, self.real_error / self.real))

    @property
    def verdict(self) -> str:
        """Whether the ratio is within the tolerance; `unclear` where it is not, but might be within two errors."""
        away = abs(self.ratio - 1)
        if away <= TOLERANCE:
            return "yes"
        return "unclear" if away <= TOLERANCE + 2 * np.nan_to_num(self.ratio_error) else "no"


@dataclass(frozen=True)
class Gap:
    """The one number of a group of rows."""

    group: str
    name: str
    value: float


def rows(ours: Signature, real: Signature) -> Iterator[Row | Gap]:
    """Every quantity, group by group, each group with its distance."""
    yield _row("scan", "points a frame", *(_mean(s.points, np.ones(len(s.points))) for s in (ours, real)))
    yield Gap("scan", "1-Wasserstein distance of points a frame", _wasserstein(ours.points, real.points))
    yield _row("scan", "scatter of ranges, smooth surfaces [m]", *(_mean_of_known(s.scatter_m) for s in (ours, real)))
    yield from _group("points a visible car", "mean |ln ratio|", _car_points(ours, real))
    like = "points a visible car, by its outline [1/msr]"
    yield from _group(like, "mean |ln ratio|", _car_points(ours, real, like))
    blocks = {"upper block": slice(0, 32), "rings 32–47": slice(32, 48), "rings 48–63": slice(48, 64)}
    for name, part in blocks.items():
        yield _row("returns a ring", name, *(_mean(s.rings[:, part].mean(1), None) for s in (ours, real)))
    by_ring = [s.rings.mean(0) for s in (ours, real)]
    yield Gap("returns a ring", "mean |ln ratio| over 64 rings", _log_distance(*by_ring))
    places = [f"{low:.0f}–{high:.0f} m" for low, high in pairwise(REACH_EDGES_M)]
    lost = [
        _row("share of firings lost", position, *(_share(s.lost[:, k, 0], s.lost[:, k].sum(1)) for s in (ours, real)))
        for k, position in enumerate(places)
    ]
    yield from _group("share of firings lost", "mean |difference|", lost, logarithmic=False)
    for title, column in (("intensity elsewhere", "intensity"), ("intensity on cars", "car_intensity")):
        yield from _histogram(title, getattr(ours, column), getattr(real, column))
    yield from _histogram("intensity of all", *(s.intensity + s.car_intensity for s in (ours, real)))
    for title, column, edges in (("all", "reach", REACH_EDGES_M), ("cars", "car_reach", CAR_EDGES_M)):
        for word, sums in (("mean intensity", 1), ("zero share", 2)):
            group = f"{word} by range, {title}"
            found = [
                _row(
                    group,
                    f"{low:.0f}–{high:.0f} m",
                    *(_share(getattr(s, column)[:, k, sums], getattr(s, column)[:, k, 0]) for s in (ours, real)),
                )
                for k, (low, high) in enumerate(pairwise(edges))
            ]
            yield from _group(group, "mean |difference|", found, logarithmic=False)
    spacing = [np.ma.median(np.ma.masked_invalid(s.elevation_deg), axis=0).filled(np.nan) for s in (ours, real)]
    difference = np.diff(spacing[0]) - np.diff(spacing[1])
    if np.isnan(difference).all():
        return
    yield Row("rings", "mean spacing [°]", *(float(np.nanmean(-np.diff(elevation))) for elevation in spacing))
    yield Gap("rings", f"RMS difference of spacing over {RINGS} rings [°]", float(np.sqrt(np.nanmean(difference**2))))


def _car_points(ours: Signature, real: Signature, outlined: str = "") -> list[Row]:
    """Rows by distance; of the group `outlined`, points over the solid angle that a car's box subtends.

    The few cars of a bin differ in size and aspect as much as the bins' means do; their outlines take that out.
    """
    found = []
    for low, high in pairwise(CAR_DISTANCES_M):
        values, counts = [], []
        for cars in (ours.cars, real.cars):
            chosen = cars.visible & (cars.distance_m >= low) & (cars.distance_m < high)
            counts.append(int(chosen.sum()))
            points = cars.points[chosen].astype(float)
            values.append(_mean(points / _outline_msr(cars)[chosen] if outlined else points, None))
        name = f"{low:.0f}–{high:.0f} m ({counts[0]}, {counts[1]} cars)"
        found.append(_row(outlined or "points a visible car", name, *values))
    return found


def _outline_msr(cars: LabelledObjects) -> np.ndarray:
    """Solid angle of the boxes seen from the side, (n,) [msr]: height × (length·|sin| + width·|cos|) of the aspect."""
    aspect = cars.yaw - np.arctan2(cars.centre[:, 1], cars.centre[:, 0])
    length, width, height = cars.size.T
    across = np.abs(length * np.sin(aspect)) + np.abs(width * np.cos(aspect))
    return 1e3 * height * across / np.maximum(cars.distance_m, 1) ** 2


def _histogram(group: str, ours: np.ndarray, real: np.ndarray) -> Iterator[Row | Gap]:
    sides = (ours, real)
    yield _row(group, "mean", *(_share(side @ INTENSITIES, side.sum(1)) for side in sides))
    yield _row(group, "zero share", *(_share(side[:, 0], side.sum(1)) for side in sides))
    bright = INTENSITIES > SATURATED
    yield _row(group, "saturated share", *(_share(side[:, bright].sum(1), side.sum(1)) for side in sides))
    shares = [side.sum(0).cumsum() / max(side.sum(), 1) for side in sides]
    yield Gap(group, "1-Wasserstein distance", float(np.abs(shares[0] - shares[1]).sum() * (INTENSITIES[1])))


def _group(group: str, name: str, result: list[Row], *, logarithmic: bool = True) -> Iterator[Row | Gap]:
    yield from result
    ours, real = (np.array([getattr(row, side) for row in result]) for side in ("ours", "real"))
    apart = np.abs(ours - real)[np.isfinite(ours - real)]
    value = _log_distance(ours, real) if logarithmic else float(apart.mean()) if len(apart) else float("nan")
    yield Gap(group, name, value)


def _log_distance(ours: np.ndarray, real: np.ndarray) -> float:
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(np.log(ours / real))
    ratio = ratio[np.isfinite(ratio)]
    return float(ratio.mean()) if len(ratio) else float("nan")


def _wasserstein(a: np.ndarray, b: np.ndarray) -> float:
    share = (np.arange(1000) + 0.5) / 1000
    return float(np.abs(np.quantile(a, share) - np.quantile(b, share)).mean())


def _row(group: str, name: str, ours: tuple[float, float], real: tuple[float, float]) -> Row:
    return Row(group, name, ours[0], real[0], ours[1], real[1])


def _mean(values: np.ndarray, weights: np.ndarray | None) -> tuple[float, float]:
    return _share(values, np.ones(len(values)) if weights is None else weights)


def _mean_of_known(values: np.ndarray) -> tuple[float, float]:
    return _mean(values[np.isfinite(values)], None)


def _share(part: np.ndarray, whole: np.ndarray) -> tuple[float, float]:
    """Ratio of sums over frames and its standard error, frames being what is drawn (Cochran 1977, section 6.4)."""
    total = whole.sum()
    if not total:
        return float("nan"), float("nan")
    ratio = part.sum() / total
    rows_ = np.count_nonzero(whole)
    error = np.sqrt(((part - ratio * whole) ** 2).sum() * rows_ / max(rows_ - 1, 1)) / total
    return float(ratio), float(error)


def _table(title: str, result: list[Row | Gap]) -> Table:
    table = Table(title=title)
    for column in ("quantity", "ours", "±", "real", "±", "ratio", "±", f"within {TOLERANCE:.0%}"):
        table.add_column(column, justify="left" if column == "quantity" else "right")
    group = ""
    for item in result:
        if item.group != group:
            group = item.group
            table.add_section()
            table.add_row(f"[bold]{group}")
        if isinstance(item, Gap):
            table.add_row(f"  [italic]{item.name}", _text(item.value))
            continue
        values = (item.ours, item.ours_error, item.real, item.real_error)
        table.add_row(
            f"  {item.name}",
            *(_text(value) for value in values),
            f"{item.ratio:.3f}",
            _text(item.ratio_error),
            item.verdict,
        )
    return table


def _text(value: float) -> str:
    if not np.isfinite(value):
        return ""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def main() -> None:
    """Print a table for every drive, and one for all variants."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.realism", description=__doc__)
    parser.add_argument("drives", nargs="*", type=Path, metavar="DRIVE")
    parser.add_argument("--variants", type=Path, metavar="DIR", help="what cosim variants wrote: one table for all")
    parser.add_argument("--real", type=Path, required=True, metavar="DIR", help="measured frames in KITTI's layout")
    parser.add_argument("--frames", type=Path, metavar="FILE", help="names of the measured frames to use, one a line")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    options = parser.parse_args()
    if not options.drives and options.variants is None:
        parser.error("nothing to compare with the real frames; give a DRIVE or --variants DIR")
    try:
        result = _report(options)
    except CosimError as error:
        parser.error(str(error))
    if options.json:
        options.json.write_text(json.dumps(result, indent=1), encoding="utf-8")


def _report(options: argparse.Namespace) -> dict[str, list[dict[str, Any]]]:
    from tests.bench.variant_realism import side_by_side

    names = options.frames.read_text(encoding="utf-8").split() if options.frames else None
    real = measure(FrameSet(options.real, names))
    result = {}
    for drive in options.drives:
        found = list(rows(measure(FrameSet(drive)), real))
        Console(width=120).print(_table(f"{drive} beside {options.real}", found))
        result[str(drive)] = _as_rows(found)
    if options.variants is not None:
        table, found_by_set = side_by_side(options.variants, real, FrameSet(options.real), names)
        Console(width=180).print(table)
        result |= {name: _as_rows(found) for name, found in found_by_set.items()}
    return result


def _as_rows(result: list[Row | Gap]) -> list[dict[str, Any]]:
    return [
        {"group": item.group, "name": item.name}
        | (
            {"distance": item.value}
            if isinstance(item, Gap)
            else {"ours": item.ours, "real": item.real, "ratio_error": item.ratio_error, "within": item.verdict}
        )
        for item in result
    ]


if __name__ == "__main__":
    from tests.bench.realism import main  # so that there is one class Gap, not a second of __main__

    main()
