"""Covariates of every beam: quantities on which a channel may depend, each with a partition into bins."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from assets.materials import MATERIAL_NAMES
from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.inference.score import SparseMatrix
from cosim.discrepancy.sampling.gathering import BESIDE
from cosim.discrepancy.sampling.sample import Prediction, Sample

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


def sample_covariates(sample: Sample, expected: Prediction, frames: tuple[TracedFrame, ...]) -> list[SampleCovariate]:
    """All covariates of a sample, in the coarse bins of the screening."""
    by = sample.settings.dictionary
    found: list[SampleCovariate | None] = []
    for name, (unit, values, period) in _numbers(sample, expected, frames).items():
        bins = max(len(sample.names) // by.scans_in_bin, 2) if name in SCAN_COVARIATES else by.bins
        fewest = by.fewest_values if name not in ("retro_distance", "object_distance") else 2
        covariate = numeric(name, unit, values, bins, period, fewest=fewest)
        if covariate is not None:
            covariate = replace(
                covariate, is_of_scan=name in SCAN_COVARIATES, is_of_neighbour=name in _of_neighbours(sample)
            )
        found.append(covariate)
    beside = [name for name in _of_neighbours(sample) if name.endswith("_lost")]
    on_something = sample.instance >= -1
    found += [
        categories("ring", sample.ring, tuple(map(str, range(int(sample.ring.max(initial=0)) + 1)))),
        categories("block", sample.block, ("upper", "lower")),
        categories("material", np.where(on_something, sample.material, -1), MATERIAL_NAMES),
        categories("kind", np.where(sample.kind > 0, sample.kind, -1), sample.kinds, fewest=1),
        categories("model", np.where(sample.kind > 0, sample.model, -1), sample.models),
        categories("edge", sample.edge.astype(int), ("clear", "edge")),
    ]
    for name in beside:
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


def _numbers(
    sample: Sample, expected: Prediction, frames: tuple[TracedFrame, ...]
) -> dict[str, tuple[str, np.ndarray, float]]:
    """Unit, values (n,) and period of every numeric covariate."""
    scan, by = sample.scan_values, sample.settings.dictionary
    nothing = sample.range_m * np.nan

    def of_scan(name: str, step: float) -> np.ndarray:
        return np.round(scan[name] / step)[sample.frame] * step

    world, from_objects, from_reflectors = _surroundings(sample, frames)
    numbers = {
        "range": ("m", sample.range_m, 0.0),
        "incidence": ("deg", np.degrees(np.arccos(np.clip(sample.cos_incidence, 0, 1))), 0.0),
        "elevation": ("deg", sample.elevation_deg, 0.0),
        "azimuth": ("rad", sample.azimuth, _TURN),
        "frame_time": ("s", scan["time_s"][sample.frame], 0.0),
        "albedo": ("", sample.reflectance, 0.0),
        "intensity": ("", expected.intensity, 0.0),
        "speed": ("m/s", of_scan("speed_mps", by.speed), 0.0),
        "acceleration": ("m/s²", of_scan("acceleration_mps2", by.acceleration), 0.0),
        "yaw_rate": ("rad/s", of_scan("yaw_rate_radps", by.yaw_rate), 0.0),
        "retro_distance": ("firings", from_reflectors, 0.0),
        "object_distance": ("m", from_objects, 0.0),
    }
    firing = np.where(np.isfinite(sample.range_m), sample.time_s, nothing)
    if abs(np.corrcoef(sample.azimuth, sample.time_s)[0, 1]) < _SAME_AZIMUTH:
        numbers["firing_time"] = ("s", firing, 0.0)
    if not sample.own_axes:  # the scans are in a common world frame
        numbers |= {"world_x": ("m", sample.place[:, 0], 0.0), "world_y": ("m", sample.place[:, 1], 0.0)}
        numbers["world_azimuth"] = ("rad", world, _TURN)
    for name in _of_neighbours(sample):
        if not name.endswith("_lost"):
            values = np.where(sample.edge, nothing, sample.neighbour_values[name])
            numbers[name] = ("m" if name.endswith("_range") else "", values, 0.0)
    return numbers


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


def _surroundings(sample: Sample, frames: tuple[TracedFrame, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Azimuth in the world [rad], distance of static hits from the nearest object [m], and from a reflector [firings].

    Each (n,); NaN where there is none within reach.
    """
    world, from_objects = np.zeros(len(sample)), np.full(len(sample), np.nan)
    from_reflectors = np.full(len(sample), np.nan)
    by = sample.settings.dictionary
    for number, frame in enumerate(frames):
        rows = np.flatnonzero(sample.frame == number)
        beam, pose = sample.beam[rows], frame.shot.hits.pose
        direction = frame.shot.rays.direction[beam] @ pose[:3, :3].T
        world[rows] = np.arctan2(direction[:, 1], direction[:, 0])
        position, nearest = sample.place[rows], np.full(len(rows), np.inf)
        for box, size in zip(frame.instances.poses, frame.instances.sizes, strict=True):
            if np.linalg.norm(box[:2, 3] - pose[:2, 3]) < by.object_reach_m:
                outside = np.abs((position - box[:3, 3]) @ box[:3, :2]) - size[:2] / 2
                nearest = np.minimum(nearest, np.hypot(*np.maximum(outside, 0).T))
        nearest = np.where(np.isfinite(nearest), np.minimum(nearest, by.object_far_m), np.nan)
        from_objects[rows] = np.where(sample.instance[rows] == -1, nearest, np.nan)
        solid, pattern = frame.shot.hits.solid, frame.shot.pattern
        retro = np.isin(solid.material, np.flatnonzero(frame.shot.hits.table.column("retro"))) & solid.exists
        steps = _firings_from(retro.reshape(pattern.rings, pattern.firings), by.retro_reach)
        from_reflectors[rows] = steps.ravel()[beam]
    return world, from_objects, np.exp2(np.round(np.log2(np.maximum(from_reflectors, 0.5))))


def _firings_from(marked: np.ndarray, reach: int) -> np.ndarray:
    """Firings (rings, firings) to the nearest marked beam of the same ring, at most twice `reach`."""
    nearest = np.where(marked, 0.0, 2.0 * reach)
    for step in range(1, reach + 1):
        for sign in (-1, 1):
            nearest = np.minimum(nearest, np.where(np.roll(marked, sign * step, 1), float(step), 2.0 * reach))
    return nearest
