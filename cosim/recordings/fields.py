"""Which column of a file is what: fields by name, units of time, the scale of intensities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cosim.recordings.scan import RecordingError, Scan

Columns = Mapping[str, np.ndarray]

_INTENSITY = ("intensity", "reflectivity", "reflectance", "remission", "intensities", "i", "signal")
_RING = ("ring", "line", "channel", "laser_id", "laser_number", "laser", "beam")
_TIME = ("t", "time", "timestamp", "offset_time", "time_stamp", "time_s", "offset_ns", "time_offset", "point_time")
_UNITS_S = (1.0, 1e-3, 1e-6, 1e-9)
_SWEEP_S = (0.015, 0.6)  # no spinning sensor turns faster or slower; tells the unit of a time
_BYTE, _WORD = 255.0, 65535.0


@dataclass(frozen=True)
class Units:
    """What the numbers of a recording's files mean; one for all its scans.

    Attributes:
        intensity_scale: what intensities are divided by to lie in 0–1.
        time_unit_s: length of one unit of the points' times [s]; 0 where they tell no time within a sweep.
    """

    intensity_scale: float = 1.0
    time_unit_s: float = 0.0


def find_units(samples: list[Columns], intensity_scale: float | None = None) -> tuple[Units, tuple[str, ...]]:
    """The units of a recording from some of its scans, and a sentence on each that had to be guessed.

    Intensities of whole bytes or 16 bits are divided by what such a field can hold; floats by 1, 255 or 65535,
    whichever first reaches the largest value. Times are in that unit of 1 s, 1 ms, 1 µs, 1 ns in which a scan
    lasts as long as a sweep does.

    Raises:
        RecordingError: `intensity_scale` is not above 0.
    """
    if intensity_scale is not None and not (np.isfinite(intensity_scale) and intensity_scale > 0):
        raise RecordingError(f"--intensity-scale is {intensity_scale:g}; give what full intensity reads, as 255")
    notes = []
    scale, said = (intensity_scale, "") if intensity_scale is not None else _intensity_scale(samples)
    unit, doubt = _time_unit(samples)
    notes += [note for note in (said, doubt) if note]
    return Units(scale, unit), tuple(notes)


def make_scan(columns: Columns, name: str, units: Units, stamp_s: float | None = None) -> Scan:
    """A scan from a file's columns; rows that are no returns are left out.

    Args:
        columns: arrays (n,) by the names the file gives them, of any case.
        name: of the scan.
        units: see `find_units`.
        stamp_s: when it was taken.

    Raises:
        RecordingError: x, y or z is missing.
    """
    given = {key.lower(): np.asarray(values).reshape(-1) for key, values in columns.items()}
    absent = [axis for axis in "xyz" if axis not in given]
    if absent:
        raise RecordingError(
            f"{name}: no field {', '.join(absent)} among {', '.join(columns) or 'none'}; a scan needs x, y and z"
        )
    xyz = np.stack([given[axis].astype(np.float64) for axis in "xyz"], 1)
    with np.errstate(invalid="ignore"):
        good = np.isfinite(xyz).all(1) & (np.abs(xyz) > 1e-6).any(1)
    intensity, ring, time = (_first(given, names) for names in (_INTENSITY, _RING, _TIME))
    if intensity is not None:
        finite = np.nan_to_num(intensity[good].astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0)
        intensity = np.clip(finite / units.intensity_scale, 0, 1).astype(np.float32)
        intensity = intensity if intensity.any() else None
    time_s = None
    if time is not None and units.time_unit_s and good.any():
        kept = time[good]
        time_s = (kept - kept.min()).astype(np.float64) * units.time_unit_s
    return Scan(
        name=name,
        xyz=xyz[good],
        intensity=intensity,
        ring=None if ring is None else ring[good].astype(np.int64),
        time_s=time_s,
        stamp_s=stamp_s,
        dropped=int((~good).sum()),
    )


def unnamed(rows: np.ndarray, source: str) -> Columns:
    """Columns of a table (n, 3 … 6) whose fields have no names: x y z, intensity, ring, time in their usual order."""
    count = rows.shape[1]
    if not 3 <= count <= 6:
        raise RecordingError(f"{source}: {count} columns without names; give 3 to 6: x y z, intensity, ring, time")
    names = ["x", "y", "z", "intensity"][:count]
    for column in rows.T[4:]:
        whole = bool(np.all(column == np.round(column)) and len(column) and 0 <= column.min() <= column.max() < 256)
        names.append("ring" if whole and "ring" not in names else "time")
    return dict(zip(names, rows.T, strict=True))


def _first(given: Columns, names: tuple[str, ...]) -> np.ndarray | None:
    return next((given[name] for name in names if name in given), None)


def _intensity_scale(samples: list[Columns]) -> tuple[float, str]:
    found = [_first({key.lower(): value for key, value in one.items()}, _INTENSITY) for one in samples]
    seen = [values for values in found if values is not None and values.size]
    if not seen:
        return 1.0, ""
    kind = seen[0].dtype
    if kind == np.uint8:
        return _BYTE, ""
    largest = max(float(np.nanmax(values)) for values in seen)
    if kind.kind in "ui":
        scale = _BYTE if largest <= _BYTE else _WORD
    else:
        scale = next((limit for limit in (1.0, _BYTE) if largest <= limit * 1.001), _WORD)
    if scale == 1.0:
        return scale, ""
    return scale, f"intensities reach {largest:g}: taken as parts of {scale:g}; --intensity-scale says otherwise"


def _time_unit(samples: list[Columns]) -> tuple[float, str]:
    found = [_first({key.lower(): value for key, value in one.items()}, _TIME) for one in samples]
    spans = [float(values.max() - values.min()) for values in found if values is not None and values.size > 1]
    if not spans:
        return 0.0, ""
    span = float(np.median(spans))
    fitting = [unit for unit in _UNITS_S if _SWEEP_S[0] <= span * unit <= _SWEEP_S[1]]
    if fitting:
        return fitting[0], ""
    return 0.0, f"times of points span {span:g} a scan, no sweep in s, ms, µs or ns: not used"
