"""Quantities that an unknown effect may depend on, binned."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from assets.materials import MATERIAL_NAMES
from cosim.discrepancy.data.sample import Sample
from cosim.discrepancy.inference.fit import Fitted

BINS = 40
_FEWEST_VALUES = 4
_OF_SCANS = ("frame_time", "speed", "acceleration", "yaw_rate")
_RESOLVED = {"speed": 0.01, "acceleration": 0.01, "yaw_rate": 1e-3}  # who drives straight on turns by less


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
    """

    name: str
    unit: str
    values: np.ndarray
    bin: np.ndarray
    centres: np.ndarray
    names: tuple[str, ...] = ()
    period: float = 0.0
    of_scans: bool = False


def covariates(sample: Sample, fitted: Fitted) -> Iterator[Covariate]:
    """All that vary over a sample."""
    numbers = {
        "range": ("m", sample.range_m, 0.0),
        "incidence": ("°", np.degrees(np.arccos(np.clip(sample.cos_incidence, 0, 1))), 0.0),
        "azimuth": ("rad", sample.azimuth, 2 * np.pi),
        "frame_time": ("s", sample.scan_values["time_s"][sample.frame], 0.0),
        "albedo": ("", sample.reflectance, 0.0),
        "intensity": ("", fitted.prediction.intensity, 0.0),
        "previous_intensity": ("", sample.previous_intensity, 0.0),
        "speed": ("m/s", sample.scan_values["speed_mps"][sample.frame], 0.0),
        "acceleration": ("m/s²", sample.scan_values["acceleration_mps2"][sample.frame], 0.0),
        "yaw_rate": ("rad/s", sample.scan_values["yaw_rate_radps"][sample.frame], 0.0),
    }
    if not sample.map_is_off:
        numbers |= {f"world_{axis}": ("m", sample.place[:, row], 0.0) for row, axis in enumerate("xy")}
    for name, (unit, values, period) in numbers.items():
        step = _RESOLVED.get(name, 0.0)
        told = np.asarray(values, float)
        found = _binned(name, unit, np.round(told / step) * step if step else told, period)
        if found is not None:
            yield replace(found, of_scans=name in _OF_SCANS)
    groups = {
        "ring": (sample.ring, tuple(str(ring) for ring in range(int(sample.ring.max(initial=0)) + 1))),
        "material": (np.where(sample.instance >= -1, sample.material, -1), MATERIAL_NAMES),
    }
    for name, (codes, names) in groups.items():
        used = np.unique(codes[codes >= 0])
        if len(used) > 1:
            place = np.full(int(used.max()) + 1, -1)
            place[used] = np.arange(len(used))
            row = np.where(codes >= 0, place[np.maximum(codes, 0)], -1)
            words = tuple(names[code] if code < len(names) else str(code) for code in used.tolist())
            yield Covariate(name, "", codes.astype(float), row, used.astype(float), words)


def _binned(name: str, unit: str, values: np.ndarray, period: float) -> Covariate | None:
    known = np.isfinite(values)
    distinct = np.unique(values[known])
    if len(distinct) < _FEWEST_VALUES:
        return None
    if len(distinct) <= BINS:
        edges = (distinct[1:] + distinct[:-1]) / 2
    elif period:
        edges = np.linspace(-period / 2, period / 2, BINS + 1)[1:-1]
    else:
        edges = np.unique(np.quantile(values[known], np.linspace(0, 1, BINS + 1)[1:-1]))
    row = np.where(known, np.searchsorted(edges, np.nan_to_num(values)), -1)
    count = np.bincount(row[known], minlength=len(edges) + 1)
    centres = np.bincount(row[known], values[known], len(edges) + 1) / np.maximum(count, 1)
    return Covariate(name, unit, values, row, centres, period=period)
