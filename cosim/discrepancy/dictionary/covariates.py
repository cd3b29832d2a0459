"""Covariates of every beam: quantities on which a channel may depend, each with a partition into bins."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from assets.materials import MATERIAL_NAMES
from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.inference.score import SparseMatrix
from cosim.discrepancy.sampling.gathering import BESIDE
from cosim.discrepancy.sampling.sample import Prediction, Sample
from sensors.hits import STATIC

SCAN_COVARIATES = ("frame_time", "speed", "acceleration", "yaw_rate")
_TURN = 2 * np.pi
_SAME_AZIMUTH = 0.98  # correlation of azimuth and firing time beyond which they are one covariate


@dataclass(frozen=True, eq=False)
class SampleCovariate:
    """A covariate of all beams of a sample, and its bins.

    Attributes:
        name: name as in `diagnose --json`; `A x B` for a pair.
        unit: unit of the values; empty for pure numbers and categories.
        values: (n,) numbers, or codes of categories.
        index: (n,) int bin of each beam; −1 if unknown.
        centres: (b,) mean value of each bin.
        labels: (b,) names of categories; empty for numbers.
        period: period of cyclic quantities; 0 for others.
        is_of_scan: whether all beams of a scan have the same value.
        is_of_neighbour: whether it was measured by neighbouring beams, so that it contains their noise.
        toward_next: (n,) weight of the next bin's centre, for piecewise linear functions.
        parts: the two covariates of a pair.
        original: for a coarse covariate the one with all bins.
    """

    name: str
    unit: str
    values: np.ndarray
    index: np.ndarray
    centres: np.ndarray
    labels: tuple[str, ...] = ()
    period: float = 0.0
    is_of_scan: bool = False
    is_of_neighbour: bool = False
    toward_next: np.ndarray | None = None
    parts: tuple[SampleCovariate, ...] = ()
    original: SampleCovariate | None = None

    def __len__(self) -> int:
        return len(self.centres)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of both covariates of a pair, or the own name."""
        return tuple(self.name.split(" x "))

    @cached_property
    def basis(self) -> SparseMatrix:
        """(n, b) indicator functions of the bins, or hat functions between their centres."""
        rows = np.flatnonzero(self.index >= 0)
        column, shape = self.index[rows], (len(self.index), len(self))
        if self.toward_next is None:
            return sparse.csr_matrix((np.ones(len(rows)), (rows, column)), shape)
        share = self.toward_next[rows]
        other = (column + 1) % len(self) if self.period else np.minimum(column + 1, len(self) - 1)
        values, places = np.append(1 - share, share), np.append(column, other)
        return sparse.csr_matrix((values, (np.append(rows, rows), places)), shape)

    def coarse(self, bins: int) -> SampleCovariate:
        """Merge bins to at most `bins`; categories are not merged."""
        if self.labels or len(self) <= bins:
            return self
        index = np.where(self.index >= 0, self.index * bins // len(self), -1)
        count = np.maximum(np.bincount(index[index >= 0], minlength=bins), 1)
        total = np.bincount(index[index >= 0], self.values[index >= 0], bins)
        return replace(self, index=index, centres=total / count, toward_next=None, original=self)

    def crossed(self, other: SampleCovariate) -> SampleCovariate:
        """Cross with another covariate; the bins of the other one vary fastest."""
        known = (self.index >= 0) & (other.index >= 0)
        index = np.where(known, self.index * len(other) + other.index, -1)
        return SampleCovariate(
            f"{self.name} x {other.name}",
            "",
            index.astype(float),
            index,
            np.arange(float(len(self) * len(other))),
            is_of_scan=self.is_of_scan and other.is_of_scan,
            is_of_neighbour=self.is_of_neighbour or other.is_of_neighbour,
            parts=(self, other),
        )


def constant(sample: Sample) -> SampleCovariate:
    """Covariate with one bin for all beams."""
    zeros = np.zeros(len(sample))
    return SampleCovariate("constant", "", zeros, zeros.astype(int), np.zeros(1))


def numeric(
    name: str, unit: str, values: np.ndarray, bins: int, period: float = 0.0, *, linear: bool = False, fewest: int = 2
) -> SampleCovariate | None:
    """A covariate in bins of equal numbers of beams, or of equal width where it is cyclic; None with too few values.

    Args:
        name, unit, values: name, unit and values (n,) of the covariate; NaN if unknown.
        bins: number of bins.
        period: period of a cyclic quantity that starts at −period/2.
        linear: hat functions between the bins' centres instead of indicator functions.
        fewest: minimum number of distinct values.
    """
    known = np.isfinite(values)
    distinct = np.unique(values[known])
    if len(distinct) < fewest:
        return None
    if period and linear:
        position = (np.nan_to_num(values) + period / 2) / period * bins - 0.5
        low = np.floor(position).astype(int)
        centres = (np.arange(bins) + 0.5) / bins * period - period / 2
        index = np.where(known, low % bins, -1)
        return SampleCovariate(name, unit, values, index, centres, period=period, toward_next=position - low)
    if len(distinct) <= bins:
        edges = (distinct[1:] + distinct[:-1]) / 2
    elif period:
        edges = np.linspace(-period / 2, period / 2, bins + 1)[1:-1]
    else:
        edges = np.unique(np.quantile(values[known], np.linspace(0, 1, bins + 1)[1:-1]))
    index = np.where(known, np.searchsorted(edges, np.nan_to_num(values), side="right"), -1)
    count = np.bincount(index[known], minlength=len(edges) + 1)
    centres = np.bincount(index[known], values[known], len(edges) + 1) / np.maximum(count, 1)
    if not linear or len(distinct) <= bins:
        return SampleCovariate(name, unit, values, index, centres, period=period)
    rank = np.interp(np.nan_to_num(values), centres, np.arange(float(len(centres))))
    low = np.minimum(rank.astype(int), len(centres) - 2)
    return SampleCovariate(name, unit, values, np.where(known, low, -1), centres, toward_next=rank - low)


def categories(name: str, codes: np.ndarray, names: tuple[str, ...], fewest: int = 2) -> SampleCovariate | None:
    """A covariate of categories that occur; codes below 0 are unknown. None with fewer than `fewest` of them."""
    used = np.unique(codes[codes >= 0])
    if len(used) < fewest:
        return None
    row_of = np.full(int(used.max()) + 1, -1)
    row_of[used] = np.arange(len(used))
    index = np.where(codes >= 0, row_of[np.maximum(codes, 0)], -1)
    labels = tuple(names[code] if code < len(names) else str(code) for code in used.tolist())
    return SampleCovariate(name, "", codes.astype(float), index, used.astype(float), labels)


def sample_covariates(
    sample: Sample, expected: Prediction, frames: tuple[TracedFrame, ...], names: Collection[str] | None = None
) -> list[SampleCovariate]:
    """Covariates of a sample, in the coarse bins of the screening; only those of some `names`, or all."""
    by = sample.settings.dictionary
    found: list[SampleCovariate | None] = []

    def is_wanted(name: str) -> bool:
        return names is None or name in names

    beside = _of_neighbours(sample)
    for name, quantity in _numbers(sample, expected, frames).items():
        if not is_wanted(name):
            continue
        bins = max(len(sample.names) // by.scans_in_bin, 2) if name in SCAN_COVARIATES else by.bins
        fewest = by.fewest_values if name not in ("retro_distance", "object_distance") else 2
        covariate = numeric(name, quantity.unit, quantity.values(), bins, quantity.period, fewest=fewest)
        if covariate is not None:
            covariate = replace(covariate, is_of_scan=name in SCAN_COVARIATES, is_of_neighbour=name in beside)
        found.append(covariate)
    on_something = sample.instance >= -1
    rings = tuple(map(str, range(int(sample.ring.max(initial=0)) + 1)))
    for name, codes, labels, fewest in (
        ("ring", sample.ring, rings, 2),
        ("block", sample.block, ("upper", "lower"), 2),
        ("material", np.where(on_something, sample.material, -1), MATERIAL_NAMES, 2),
        ("kind", np.where(sample.kind > 0, sample.kind, -1), sample.kinds, 1),
        ("model", np.where(sample.kind > 0, sample.model, -1), sample.models, 2),
        ("edge", sample.edge.astype(int), ("clear", "edge"), 2),
    ):
        if is_wanted(name):
            found.append(categories(name, codes, labels, fewest))
    for name in beside:
        if name.endswith("_lost") and is_wanted(name):
            is_lost = np.where(sample.edge, -1, sample.neighbour_values[name].astype(int))
            covariate = categories(name, is_lost, ("seen", "lost"))
            found.append(None if covariate is None else replace(covariate, is_of_neighbour=True))
    return [covariate for covariate in found if covariate is not None]


def refined(covariate: SampleCovariate, sample: Sample) -> SampleCovariate:
    """The covariate in the fine bins of a refit; piecewise linear for smooth quantities."""
    if covariate.parts:
        first, second = (
            refined(part, sample) if part.is_of_scan else part.original or part for part in covariate.parts
        )
        return first.crossed(second)
    if covariate.labels or covariate.name == "constant":
        return covariate
    by = sample.settings.dictionary
    bins = by.cyclic_bins if covariate.period else by.fine_bins
    if covariate.is_of_scan:
        bins = len(sample.names) if covariate.name == "frame_time" else by.bins
    linear = covariate.period > 0 or covariate.name in (
        "range",
        "intensity",
        "incidence",
        "elevation",
        "firing_time",
        "world_x",
        "world_y",
    )
    fine = numeric(covariate.name, covariate.unit, covariate.values, bins, covariate.period, linear=linear)
    assert fine is not None  # it had bins before
    return replace(fine, is_of_scan=covariate.is_of_scan, is_of_neighbour=covariate.is_of_neighbour)


@dataclass(frozen=True)
class _Quantity:
    """A numeric covariate that is computed where it is used: unit, (n,) values, and period of a cyclic one."""

    unit: str
    values: Callable[[], np.ndarray]
    period: float = 0.0


def _numbers(sample: Sample, expected: Prediction, frames: tuple[TracedFrame, ...]) -> dict[str, _Quantity]:
    """Every numeric covariate."""
    scan, by = sample.scan_values, sample.settings.dictionary
    nothing = sample.range_m * np.nan

    def of_scan(unit: str, name: str, step: float) -> _Quantity:
        return _Quantity(unit, lambda: np.round(scan[name] / step)[sample.frame] * step)

    def of_neighbour(name: str) -> _Quantity:
        unit = "m" if name.endswith("_range") else ""
        return _Quantity(unit, lambda: np.where(sample.edge, nothing, sample.neighbour_values[name]))

    numbers = {
        "range": _Quantity("m", lambda: sample.range_m),
        "incidence": _Quantity("deg", lambda: np.degrees(np.arccos(np.clip(sample.cos_incidence, 0, 1)))),
        "elevation": _Quantity("deg", lambda: sample.elevation_deg),
        "azimuth": _Quantity("rad", lambda: sample.azimuth, _TURN),
        "frame_time": _Quantity("s", lambda: scan["time_s"][sample.frame]),
        "albedo": _Quantity("", lambda: sample.reflectance),
        "intensity": _Quantity("", lambda: expected.intensity),
        "speed": of_scan("m/s", "speed_mps", by.speed),
        "acceleration": of_scan("m/s²", "acceleration_mps2", by.acceleration),
        "yaw_rate": of_scan("rad/s", "yaw_rate_radps", by.yaw_rate),
        "retro_distance": _Quantity("firings", lambda: _firings_to_reflectors(sample, frames)),
        "object_distance": _Quantity("m", lambda: _distance_to_objects(sample, frames)),
    }
    if abs(np.corrcoef(sample.azimuth, sample.time_s)[0, 1]) < _SAME_AZIMUTH:
        numbers["firing_time"] = _Quantity("s", lambda: np.where(np.isfinite(sample.range_m), sample.time_s, nothing))
    if not sample.own_axes:  # the scans are in a common world frame
        numbers["world_x"] = _Quantity("m", lambda: sample.place[:, 0])
        numbers["world_y"] = _Quantity("m", lambda: sample.place[:, 1])
        numbers["world_azimuth"] = _Quantity("rad", lambda: _world_azimuth(sample, frames), _TURN)
    return numbers | {name: of_neighbour(name) for name in _of_neighbours(sample) if not name.endswith("_lost")}


def _of_neighbours(sample: Sample) -> tuple[str, ...]:
    """Names of the measurements of neighbouring beams that can be used as covariates, away from edges.

    Neighbours hit the same surfaces: if range or reflectance of the twin is uncertain, they share its error. The map of
    a recording has one reflectance for each surface, while that of the real surface varies from place to place. Near an
    edge they share the error of its position: whether a neighbour is lost then says where the edge is.
    """
    uncertain = {
        "intensity": sample.of_own_map or bool(np.any(sample.twin_sigma_intensity > 0)),
        "range": bool(np.any(sample.twin_sigma_m > 0)),
    }
    uncertain["lost"] = uncertain["range"]
    return tuple(name for name in BESIDE if not uncertain[name.partition("_")[2]])


def _world_azimuth(sample: Sample, frames: tuple[TracedFrame, ...]) -> np.ndarray:
    """Azimuth (n,) [rad] of the beams in the world."""
    azimuth = np.zeros(len(sample))
    for number, frame in enumerate(frames):
        rows = sample.frame == number
        direction = frame.shot.rays.direction[sample.beam[rows]] @ frame.shot.hits.pose[:3, :3].T
        azimuth[rows] = np.arctan2(direction[:, 1], direction[:, 0])
    return azimuth


def _distance_to_objects(sample: Sample, frames: tuple[TracedFrame, ...]) -> np.ndarray:
    """Distance (n,) [m] of static hits from the nearest object in the ground plan; NaN where none is within reach."""
    distance_m = np.full(len(sample), np.nan)
    by = sample.settings.dictionary
    for number, frame in enumerate(frames):
        rows = np.flatnonzero((sample.frame == number) & (sample.instance == STATIC))
        position, nearest = sample.place[rows], np.full(len(rows), np.inf)
        poses, ego = frame.instances.poses, frame.shot.hits.pose[:2, 3]
        for near in np.flatnonzero(np.linalg.norm(poses[:, :2, 3] - ego, axis=1) < by.object_reach_m).tolist():
            pose, size = poses[near], frame.instances.sizes[near]
            outside = np.abs((position - pose[:3, 3]) @ pose[:3, :2]) - size[:2] / 2
            nearest = np.minimum(nearest, np.hypot(*np.maximum(outside, 0).T))
        distance_m[rows] = np.where(np.isfinite(nearest), np.minimum(nearest, by.object_far_m), np.nan)
    return distance_m


def _firings_to_reflectors(sample: Sample, frames: tuple[TracedFrame, ...]) -> np.ndarray:
    """Firings (n,) to the nearest beam of the ring that hits a reflector, rounded to powers of 2."""
    firings = np.full(len(sample), np.nan)
    for number, frame in enumerate(frames):
        rows = sample.frame == number
        solid, pattern = frame.shot.hits.solid, frame.shot.pattern
        retro = np.isin(solid.material, np.flatnonzero(frame.shot.hits.table.column("retro"))) & solid.exists
        steps = _firings_from(retro.reshape(pattern.rings, pattern.firings), sample.settings.dictionary.retro_reach)
        firings[rows] = steps.ravel()[sample.beam[rows]]
    return np.exp2(np.round(np.log2(np.maximum(firings, 0.5))))


def _firings_from(marked: np.ndarray, reach: int) -> np.ndarray:
    """Firings (rings, firings) to the nearest marked beam of the same ring, at most twice `reach`."""
    nearest = np.where(marked, 0.0, 2.0 * reach)
    for step in range(1, reach + 1):
        for sign in (-1, 1):
            nearest = np.minimum(nearest, np.where(np.roll(marked, sign * step, 1), float(step), 2.0 * reach))
    return nearest
