"""Quantities that an unknown effect may depend on, binned."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from assets.materials import MATERIAL_NAMES
from cosim.discrepancy.sampling.gathering import BESIDE
from cosim.discrepancy.sampling.sample import Prediction, Sample

OF_SCANS = ("frame_time", "speed", "acceleration", "yaw_rate")


@dataclass(frozen=True, eq=False)
class Covariate:
    """One quantity of every beam of a sample.

    Attributes:
        name: as in `diagnose --json`.
        unit: of its values; empty for pure numbers and names.
        values: (n,) float; numbers of categories for names.
        bin: (n,) int; −1 where it is not known.
        centres: (b,) mean of each bin.
        names: (b,) of categories; empty for numbers.
        period: of angles that come round; 0 for others.
        of_scans: whether all beams of a scan have the same.
        of_neighbours: whether it was measured by other beams, whose noise it has.
    """

    name: str
    unit: str
    values: np.ndarray
    bin: np.ndarray
    centres: np.ndarray
    names: tuple[str, ...] = ()
    period: float = 0.0
    of_scans: bool = False
    of_neighbours: bool = False

    def basis(self, degree: int) -> np.ndarray:
        """(n, k) smooth functions without a mean: Legendre polynomials of ranks, or sines and cosines of angles."""
        known = np.isfinite(self.values)
        if self.period:
            turn = 2 * np.pi / self.period * np.nan_to_num(self.values)
            parts = [wave(k * turn) for k in range(1, degree // 2 + 2) for wave in (np.sin, np.cos)]
        else:
            order = np.searchsorted(np.sort(self.values[known]), np.nan_to_num(self.values))
            rank = 2 * (order + 0.5) / max(known.sum(), 1) - 1
            parts = [np.polynomial.legendre.Legendre.basis(k)(np.clip(rank, -1, 1)) for k in range(1, degree + 1)]
        return np.where(known[:, None], np.stack(parts, 1), 0.0)

    def binned(self, bins: int) -> Covariate:
        """The same in another number of bins; categories stay."""
        if self.names:
            return self
        found = _binned(self.name, self.unit, self.values, self.period, bins, 1)
        assert found is not None  # it has been binned before
        return replace(found, of_scans=self.of_scans, of_neighbours=self.of_neighbours)


def over_a_turn(name: str, values: np.ndarray, bins: int) -> Covariate:
    """A covariate that comes round: angles (n,) [rad] from −π to π."""
    found = _binned(name, "rad", values, 2 * np.pi, bins, 1)
    assert found is not None  # phases are many
    return found


def covariates(sample: Sample, expected: Prediction, bins: int) -> Iterator[Covariate]:
    """All that vary over a sample."""
    scan, by = sample.scan_values, sample.settings.screen
    resolved = {"speed": by.speed, "acceleration": by.acceleration, "yaw_rate": by.yaw_rate}
    nothing = sample.range_m * np.nan
    firing = np.where(np.isfinite(sample.range_m), sample.time_s, nothing)
    numbers = {
        "range": ("m", sample.range_m, 0.0),
        "incidence": ("°", np.degrees(np.arccos(np.clip(sample.cos_incidence, 0, 1))), 0.0),
        "elevation": ("°", sample.elevation_deg, 0.0),
        "azimuth": ("rad", sample.azimuth, 2 * np.pi),
        "firing_time": ("s", firing, 0.0),
        "frame_time": ("s", scan["time_s"][sample.frame], 0.0),
        "albedo": ("", sample.reflectance, 0.0),
        "intensity": ("", expected.intensity, 0.0),
        "speed": ("m/s", scan["speed_mps"][sample.frame], 0.0),
        "acceleration": ("m/s²", scan["acceleration_mps2"][sample.frame], 0.0),
        "yaw_rate": ("rad/s", scan["yaw_rate_radps"][sample.frame], 0.0),
    }
    if not sample.own_axes:  # of a world that scans share
        numbers |= {"world_x": ("m", sample.place[:, 0], 0.0), "world_y": ("m", sample.place[:, 1], 0.0)}
    beside = _of_neighbours(sample)
    for name in beside:
        values = sample.beside[name]
        numbers[name] = ("m" if name.endswith("_range") else "", values, 0.0)
    for name, (unit, values, period) in numbers.items():
        step = resolved.get(name, 0.0)
        told = np.asarray(values, float)
        found = _binned(name, unit, np.round(told / step) * step if step else told, period, bins, by.fewest_values)
        if found is not None:
            yield replace(found, of_scans=name in OF_SCANS, of_neighbours=name in BESIDE)
    groups = {
        "ring": (sample.ring, tuple(str(ring) for ring in range(int(sample.ring.max(initial=0)) + 1))),
        "block": (sample.block, ("upper", "lower")),
        "material": (np.where(sample.instance >= -1, sample.material, -1), MATERIAL_NAMES),
        "kind": (np.where(sample.kind > 0, sample.kind, -1), sample.kinds),
        "model": (np.where(sample.kind > 0, sample.model, -1), sample.models),
        **{name: (sample.beside[name].astype(int), ("seen", "lost")) for name in beside if name.endswith("_lost")},
    }
    for name, (codes, names) in groups.items():
        used = np.unique(codes[codes >= 0])
        if len(used) > (0 if name == "kind" else 1):
            place = np.full(int(used.max()) + 1, -1)
            place[used] = np.arange(len(used))
            row = np.where(codes >= 0, place[np.maximum(codes, 0)], -1)
            words = tuple(names[code] if code < len(names) else str(code) for code in used.tolist())
            yield Covariate(name, "", codes.astype(float), row, used.astype(float), words, of_neighbours=name in beside)


def _of_neighbours(sample: Sample) -> tuple[str, ...]:
    """Names of what neighbouring beams measured, as far as it tells of the sensor.

    Neighbours meet the same surfaces. Where the twin is not sure how far or how bright these are, what neighbours
    measured tells of that.
    """
    unsure_m, unsure_intensity = np.any(sample.unsure_m > 0), np.any(sample.unsure_intensity > 0)
    return tuple(name for name in BESIDE if not (unsure_intensity if name.endswith("_intensity") else unsure_m))


def _binned(name: str, unit: str, values: np.ndarray, period: float, bins: int, fewest: int) -> Covariate | None:
    known = np.isfinite(values)
    distinct = np.unique(values[known])
    if len(distinct) < fewest:
        return None
    if len(distinct) <= bins:
        edges = (distinct[1:] + distinct[:-1]) / 2
    elif period:
        edges = np.linspace(-period / 2, period / 2, bins + 1)[1:-1]
    else:
        edges = np.unique(np.quantile(values[known], np.linspace(0, 1, bins + 1)[1:-1]))
    row = np.where(known, np.searchsorted(edges, np.nan_to_num(values)), -1)
    count = np.bincount(row[known], minlength=len(edges) + 1)
    centres = np.bincount(row[known], values[known], len(edges) + 1) / np.maximum(count, 1)
    return Covariate(name, unit, values, row, centres, period=period)
