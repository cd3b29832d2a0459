"""Meaning of the columns of point files: roles, units and frame, each checked against independent evidence.

A guess from a column's name or place is kept where the numbers agree with it: laser numbers separate elevations, times
grow along the order of firing and span a sweep, the ground lies below the sensor. Where they do not, the column is not
used and a note says so, or, where a wrong reading would move points, an error states both readings and the option that
settles it. Scales come from quantiles, never from the largest value.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cosim.point_files.axes import check_axes, find_metres
from cosim.point_files.clues import (
    are_laser_numbers,
    core_times,
    grows_along_firing,
    repeated_geometry,
    separates_elevations,
)
from cosim.point_files.options import PointOptions
from cosim.point_files.scan import PointFileError, Scan

Columns = Mapping[str, np.ndarray]

_NAMES = {
    "intensity": ("intensity", "reflectivity", "reflectance", "remission", "intensities", "i", "signal"),
    "ring": ("ring", "line", "channel", "laser_id", "laser_number", "laser", "beam"),
    "time": (
        "t",
        "time",
        "timestamp",
        "offset_time",
        "time_stamp",
        "time_s",
        "offset_ns",
        "time_offset",
        "point_time",
        "gpstime",
        "gps_time",
    ),
}
_UNNAMED = "column "
_UNITS_S = {1.0: "s", 1e-3: "ms", 1e-6: "µs", 1e-9: "ns"}
_SWEEP_S = (0.015, 0.6)  # durations of a sweep of any spinning sensor; used to infer the unit of times
_BYTE, _WORD = 255.0, 65535.0
_BRIGHT = 0.999  # quantile of intensities that scales them
_SIGNED_SHARE = 0.2  # share of negative intensities above which the column is no intensity
_REPEATED = (20, 0.005)  # points at one place, count and share, that are no returns
_FAR, _FAR_M = 10.0, 600.0  # times the upper quartile of the ranges, and metres: beyond both is no return
_SPHERE_M, _SPHERE_SHARE, _SPHERE_DEG = 0.002, 0.01, 2.0  # points at the greatest range over several elevations
_WORLD_M = 60.0  # least range of points that are not measured from the sensor
_TINY = 1e-6


@dataclass(frozen=True)
class PointSchema:
    """Meaning of the columns of one sensor's files.

    Attributes:
        names: name of the column of each role.
        intensity_scale: intensities are divided by it to lie in 0–1.
        time_unit_s: length of one unit of the points' times [s]; 0 if they are not times within a sweep.
        metres: length of one unit of x, y, z [m].
        axes: rows of a (3, 3) signed permutation from stored axes to x forward, y left, z up.
        no_return: coordinates that encode "no return" [stored units].
        no_return_range: range that encodes "no return" [stored units]; None if there is none.
        is_frame_checked: whether ground and sense of rotation confirm the axes, or the user states them.
        notes: what was inferred, not used or left out, a sentence each.
    """

    names: Mapping[str, str] = field(default_factory=lambda: {axis: axis for axis in "xyz"})
    intensity_scale: float = 1.0
    time_unit_s: float = 0.0
    metres: float = 1.0
    axes: tuple[tuple[float, float, float], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    no_return: tuple[tuple[float, float, float], ...] = ()
    no_return_range: float | None = None
    is_frame_checked: bool = True
    notes: tuple[str, ...] = ()

    @property
    def in_place(self) -> bool:
        """Whether coordinates are metres in the sensor's axes as they are stored."""
        return self.metres == 1.0 and self.axes == PointSchema().axes

    def as_dict(self) -> dict[str, Any]:
        """For `inferred:` in `drive.yaml`."""
        message: dict[str, Any] = {"columns": dict(self.names), "intensity_scale": self.intensity_scale}
        if self.time_unit_s:
            message["time_unit_s"] = self.time_unit_s
        if not self.in_place:
            message |= {"metres": self.metres, "axes": [list(row) for row in self.axes]}
        if self.no_return:
            message["no_return"] = [list(position) for position in self.no_return]
        if self.no_return_range is not None:
            message["no_return_range"] = self.no_return_range
        return message | {"notes": list(self.notes)}


def find_schema(samples: Sequence[Columns], options: PointOptions | None = None, source: str = "scans") -> PointSchema:
    """The schema of a sensor's files from a few of its scans.

    Args:
        samples: columns of some scans, equal names in all.
        options: statements of the user, which are taken without a check.
        source: name of the folder or file, for messages.

    Raises:
        PointFileError: x, y or z is missing, or two clues contradict each other.
    """
    options = options or PointOptions()
    notes: list[str] = []
    names = _roles(samples, options, source, notes)
    clouds = [_Cloud.of(columns, names) for columns in samples]
    _demand_points(clouds, source)
    no_return, no_return_range = _no_returns(clouds, notes)
    clouds = [cloud.without(no_return) for cloud in clouds]
    metres = options.metres or find_metres([cloud.xyz for cloud in clouds], source, notes)
    _demand_sensor_frame(clouds, metres, source)
    clouds = [cloud.within_reach(metres) for cloud in clouds]
    names, unit_s = _times(clouds, names, notes, stated=options.columns is not None)
    times = [cloud.time if unit_s else None for cloud in clouds]
    axes, is_checked = options.axes_matrix, True
    if axes is None:
        is_checked = check_axes([cloud.xyz for cloud in clouds], times, metres, source)
        axes = np.eye(3)
    names, scale = _intensities(clouds, names, options, notes)
    return PointSchema(
        names=names,
        intensity_scale=scale,
        time_unit_s=unit_s,
        metres=metres,
        axes=tuple(tuple(float(value) for value in row) for row in axes),  # type: ignore[misc]
        no_return=no_return,
        no_return_range=no_return_range,
        is_frame_checked=is_checked,
        notes=tuple(notes),
    )


def make_scan(columns: Columns, name: str, schema: PointSchema, stamp_s: float | None = None) -> Scan:
    """A scan from a file's columns; rows that are no returns are left out.

    Args:
        columns: arrays (n,) by the names of the file.
        name: of the scan.
        schema: see `find_schema`.
        stamp_s: time of the scan.

    Raises:
        PointFileError: a column of the schema is missing.
    """
    return decode_scan(columns, name, schema, stamp_s)[0]


def decode_scan(
    columns: Columns, name: str, schema: PointSchema, stamp_s: float | None = None
) -> tuple[Scan, np.ndarray]:
    """A scan and the mask (m,) bool of the stored rows that it holds; see `make_scan`."""
    found = _Cloud.of(columns, schema.names, name)
    reasons = _unusable(found, schema)
    bad = np.zeros(len(found.stored), bool)
    left_out = {}
    for reason, rows in reasons.items():
        count = int((rows & ~bad).sum())
        bad |= rows
        if count:
            left_out[reason] = count
    good = ~bad
    xyz = found.stored[good]
    if not schema.in_place:
        xyz = xyz @ (np.array(schema.axes).T * schema.metres)
    intensity = found.values("intensity")
    if intensity is not None:
        finite = np.nan_to_num(intensity[good].astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0)
        intensity = np.clip(finite / schema.intensity_scale, 0, 1).astype(np.float32)
        intensity = intensity if intensity.any() else None
    time, time_s = found.values("time"), None
    if time is not None and schema.time_unit_s and good.any():
        used = time[good]
        time_s = (used - used.min()).astype(np.float64) * schema.time_unit_s
    ring = found.values("ring")
    if ring is not None:
        ring = np.nan_to_num(ring[good].astype(np.float64), nan=-1.0, posinf=-1.0, neginf=-1.0).astype(np.int64)
    scan = Scan(name, xyz, intensity, ring, time_s, stamp_s, int(bad.sum()), left_out)
    return scan, good


@dataclass(frozen=True, eq=False)
class _Cloud:
    """Columns of one file by role.

    Attributes:
        stored: (m, 3) float64 coordinates of all rows.
        good: (m,) bool: finite and not the origin.
        columns: (m,) each, by role.
    """

    stored: np.ndarray
    good: np.ndarray
    columns: Mapping[str, np.ndarray]

    @classmethod
    def of(cls, columns: Columns, names: Mapping[str, str], source: str = "scan") -> _Cloud:
        given = {key.lower(): np.asarray(values).reshape(-1) for key, values in columns.items()}
        absent = [name for name in names.values() if name.lower() not in given]
        if absent:
            raise PointFileError(f"{source}: no field {', '.join(absent)} among {', '.join(columns) or 'none'}")
        held = {role: given[name.lower()] for role, name in names.items()}
        odd = [names[role] for role, values in held.items() if values.dtype.kind not in "fiub"]
        if odd:
            raise PointFileError(f"{source}: field {', '.join(odd)} holds no numbers")
        if len({len(values) for values in held.values()}) > 1:
            lengths = ", ".join(f"{names[role]} {len(values)}" for role, values in held.items())
            raise PointFileError(f"{source}: fields of different lengths ({lengths}); give one value a point")
        stored = np.stack([held.pop(axis).astype(np.float64) for axis in "xyz"], 1)
        with np.errstate(invalid="ignore"):
            good = np.asarray(np.isfinite(stored).all(1) & (np.abs(stored) > _TINY).any(1))
        return cls(stored, good, held)

    @property
    def xyz(self) -> np.ndarray:
        """(n, 3) of the good rows."""
        return self.stored[self.good]

    @property
    def time(self) -> np.ndarray | None:
        """(n,) values of the valid rows, outliers replaced by the median."""
        if "time" not in self.columns:
            return None
        time = self.columns["time"][self.good].astype(np.float64)
        usual = core_times(time)
        return np.where(usual, time, np.median(time[usual])) if usual.any() else None

    def values(self, role: str) -> np.ndarray | None:
        """Column of a role, all rows."""
        return self.columns.get(role)

    def used(self, role: str) -> np.ndarray | None:
        """Column of a role, good rows."""
        return self.columns[role][self.good] if role in self.columns else None

    def within_reach(self, metres: float) -> _Cloud:
        """Rows beyond any range of a sensor are good no longer; `metres` is the length of one unit."""
        if self.good.sum() < 100:
            return self
        with np.errstate(invalid="ignore", over="ignore"):
            reach = np.linalg.norm(self.stored, axis=1)
            return _Cloud(self.stored, self.good & ~(reach > _farthest(reach[self.good], metres)), self.columns)

    def without(self, positions: Sequence[tuple[float, float, float]]) -> _Cloud:
        """Rows at these places are good no longer."""
        if not positions:
            return self
        return _Cloud(self.stored, self.good & ~_at(self.stored, positions), self.columns)


def _roles(samples: Sequence[Columns], options: PointOptions, source: str, notes: list[str]) -> dict[str, str]:
    keys = list(samples[0]) if samples else []
    unnamed = [key for key in keys if key.startswith(_UNNAMED)]
    if options.roles is not None:
        if unnamed and len(options.roles) != len(unnamed):
            raise PointFileError(f"{source}: --columns names {len(options.roles)} columns, a row has {len(unnamed)}")
        if len(options.roles) > len(keys):
            raise PointFileError(f"{source}: --columns names {len(options.roles)} columns of {len(keys)}")
        named = dict(zip(unnamed or keys, options.roles, strict=False))
        return {role: key for key, role in named.items() if role != "_"}
    if unnamed and "x" not in {key.lower() for key in keys}:
        return _roles_of_unnamed(samples, unnamed, source, notes) | _roles_by_name(
            [key for key in keys if key not in unnamed]
        )
    by_name = _roles_by_name(keys)
    absent = [axis for axis in "xyz" if axis not in by_name]
    if absent:
        raise PointFileError(
            f"{source}: no field {', '.join(absent)} among {', '.join(keys) or 'none'}; a scan needs x, y and z: "
            f"rename "
            "the fields, or state them with --columns"
        )
    return by_name


def _roles_by_name(keys: Sequence[str]) -> dict[str, str]:
    plain = {key.lower().removeprefix("scalar_"): key for key in keys}
    found = {axis: plain[axis] for axis in "xyz" if axis in plain}
    for role, names in _NAMES.items():
        name = next((plain[name] for name in names if name in plain), None)
        if name is not None:
            found[role] = name
    return found


def _roles_of_unnamed(samples: Sequence[Columns], keys: list[str], source: str, notes: list[str]) -> dict[str, str]:
    """x y z first, then what laser numbers, times and intensities the other columns prove to be."""
    found = dict(zip("xyz", keys, strict=False))
    clouds = [_Cloud.of(columns, {**found, **{key: key for key in keys[3:]}}, source) for columns in samples]
    no_return, _ = _no_returns(clouds, [])
    clouds = [cloud.without(no_return) for cloud in clouds]
    spare = []
    for key in keys[3:]:
        copy = _repeated(clouds, key)
        if copy is not None:
            notes.append(f"{key} is the {copy} of the points: not used; --columns settles it")
            continue
        role = next((role for role in ("ring", "time") if role not in found and _proves(clouds, key, role)), None)
        if role is None:
            spare.append(key)
        else:
            found[role] = key
    spreads = {key: _spread(clouds, key) for key in spare}
    possible = [key for key, (_, high) in spreads.items() if high <= _WORD * 1.001]  # stamps are larger
    varied = [key for key in possible if spreads[key][0] < spreads[key][1]]
    likely = next(iter([*varied, *possible]), None)
    if likely is not None and _may_be_intensity(clouds, likely, source, keys):
        found["intensity"] = likely
        spare.remove(likely)
    report = ", ".join(f"{key.removeprefix(_UNNAMED)} {role}" for role, key in found.items())
    if len(keys) != 4 or list(found) != ["x", "y", "z", "intensity"]:
        notes.append(f"{len(keys)} columns without names: {report}")
    for key in spare:
        low, high = spreads[key]
        notes.append(
            f"{key} ({low:.4g} to {high:.4g}) is not used: its values neither separate elevations as laser numbers do "
            f"nor "
            "grow along the order of firing as times do; --columns settles it"
        )
    return found


def _proves(clouds: Sequence[_Cloud], key: str, role: str) -> bool:
    verdicts = []
    for cloud in clouds:
        values = cloud.columns[key][cloud.good].astype(np.float64)
        usual = np.isfinite(values)
        if usual.sum() < 20:
            continue
        xyz, values = cloud.xyz[usual], values[usual]
        if role == "ring":
            verdicts.append(are_laser_numbers(values) and separates_elevations(xyz, values))
        else:
            usual = core_times(values)
            span = float(np.ptp(values[usual])) if usual.any() else 0.0
            verdicts.append(_sweep_unit(span) > 0 and not are_laser_numbers(values) and grows_along_firing(xyz, values))
    return bool(verdicts) and 2 * sum(verdicts) > len(verdicts)


def _repeated(clouds: Sequence[_Cloud], key: str) -> str | None:
    """The coordinate that a column repeats in most scans."""
    found = [repeated_geometry(cloud.xyz, cloud.columns[key][cloud.good].astype(np.float64)) for cloud in clouds]
    copies = [name for name in found if name is not None]
    return copies[0] if 2 * len(copies) > len(found) else None


def _may_be_intensity(clouds: Sequence[_Cloud], key: str, source: str, keys: list[str]) -> bool:
    """Whether a column is not negative; raise where it is so by a large share, as coordinates are."""
    share = _negative_share([cloud.columns[key][cloud.good] for cloud in clouds])
    if share > _SIGNED_SHARE:
        raise PointFileError(
            f"{source}: {key} of {len(keys)} is an intensity by its place, but {share:.0%} of its values are "
            f"negative, as "
            "those of a coordinate are; state the columns with --columns, as x,y,z,intensity (`columns:` in drive.yaml)"
        )
    return True


def _negative_share(values: Sequence[np.ndarray]) -> float:
    flat = np.concatenate([value.astype(np.float64) for value in values]) if values else np.zeros(0)
    finite = flat[np.isfinite(flat)]
    return float(np.mean(finite < 0)) if len(finite) else 0.0


def _spread(clouds: Sequence[_Cloud], key: str) -> tuple[float, float]:
    flat = np.concatenate([cloud.columns[key][cloud.good].astype(np.float64) for cloud in clouds])
    finite = flat[np.isfinite(flat)]
    return (float(np.quantile(finite, 0.01)), float(np.quantile(finite, 0.99))) if len(finite) else (0.0, 0.0)


def _demand_points(clouds: Sequence[_Cloud], source: str) -> None:
    rows = sum(len(cloud.stored) for cloud in clouds)
    good = sum(int(cloud.good.sum()) for cloud in clouds)
    if rows >= 100 and good < 0.02 * rows:
        raise PointFileError(
            f"{source}: {rows - good} of {rows} rows are not finite or at the origin, so nearly none is a return; "
            f"check the "
            "columns (--columns) and the export"
        )


def _demand_sensor_frame(clouds: Sequence[_Cloud], metres: float, source: str) -> None:
    """Raise where no point is near the sensor: coordinates of a map, or of a projection."""
    xyz = np.concatenate([cloud.xyz for cloud in clouds]) if clouds else np.zeros((0, 3))
    if len(xyz) < 100:
        return
    reach = np.linalg.norm(xyz, axis=1) * metres
    if float(np.quantile(reach, 0.02)) > _WORLD_M:
        middle = np.median(xyz, axis=0)
        raise PointFileError(
            f"{source}: points lie about ({middle[0]:.0f}, {middle[1]:.0f}, {middle[2]:.0f}) and 98 % of them farther "
            f"than "
            f"{_WORLD_M:g} m from (0, 0, 0), so they are georeferenced, not relative to the sensor; subtract the "
            f"sensor's "
            "pose T of each scan first: p_sensor = R(T)⁻¹ · (p − t(T)), and give the poses as poses.txt"
        )


def _no_returns(
    clouds: Sequence[_Cloud], notes: list[str]
) -> tuple[tuple[tuple[float, float, float], ...], float | None]:
    """Places, and the range, at which a file puts beams without a return."""
    places: dict[tuple[float, float, float], int] = {}
    for cloud in clouds:
        xyz = cloud.xyz
        if len(xyz) < _REPEATED[0]:
            continue
        key = xyz @ np.sqrt([2.0, 3.0, 5.0])
        _, first, count = np.unique(key, return_index=True, return_counts=True)
        for row in first[count >= max(_REPEATED[0], _REPEATED[1] * len(xyz))]:
            position = (float(xyz[row, 0]), float(xyz[row, 1]), float(xyz[row, 2]))
            places[position] = places.get(position, 0) + int(_at(xyz, [position]).sum())
    for position, count in places.items():
        at = " ".join(f"{value:g}" for value in position)
        notes.append(f"{count} points of {len(clouds)} scans are at {at}: taken as no return and left out")
    spheres = [_sphere(cloud.without(tuple(places)).xyz) for cloud in clouds]
    known = [value for value in spheres if value is not None]
    if known and 2 * len(known) > len(clouds):
        reach = float(np.median(known))
        notes.append(f"many points have the same greatest range {reach:g}: taken as no return and left out")
        return tuple(places), reach
    return tuple(places), None


def _sphere(xyz: np.ndarray) -> float | None:
    """The greatest range, where far more points have it than a surface could give."""
    if len(xyz) < 1000:
        return None
    reach = np.linalg.norm(xyz, axis=1)
    near = reach <= _FAR * float(np.quantile(reach, 0.99))
    xyz, reach = xyz[near], reach[near]
    farthest = float(np.quantile(reach, 1 - _SPHERE_SHARE / 4))
    same = np.abs(reach - farthest) < max(_SPHERE_M, 1e-6 * farthest)
    beyond = float(np.mean(reach > farthest + _SPHERE_M))
    if not same.any() or not _spans_elevations(xyz[same]):
        return None  # one laser on level ground
    return farthest if float(same.mean()) > _SPHERE_SHARE and beyond < 1e-3 and farthest > 20 else None


def _spans_elevations(xyz: np.ndarray) -> bool:
    elevation = np.degrees(np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1])))
    return float(np.ptp(np.quantile(elevation, [0.1, 0.9]))) > _SPHERE_DEG


def _farthest(reach: np.ndarray, metres: float) -> float:
    """Range beyond which a point is no return, in units of `metres`, from the ranges (n,) of all points."""
    return max(_FAR * float(np.quantile(reach, 0.75)), _FAR_M / metres)


def _at(xyz: np.ndarray, positions: Sequence[tuple[float, float, float]]) -> np.ndarray:
    found = np.zeros(len(xyz), bool)
    for position in positions:
        found |= (xyz == np.array(position)).all(1)
    return found


def _times(
    clouds: Sequence[_Cloud], names: dict[str, str], notes: list[str], *, stated: bool
) -> tuple[dict[str, str], float]:
    """The unit of the points' times, and the names without the time where it is none."""
    key = names.get("time")
    if key is None:
        return names, 0.0
    spans, grows, strays = [], [], 0
    for cloud in clouds:
        time = cloud.used("time")
        if time is None or len(time) < 2:
            continue
        usual = core_times(time)
        if usual.sum() < 2:
            continue
        strays += int((~usual).sum())
        spans.append(float(np.ptp(time[usual])))
        if usual.sum() >= 20:
            grows.append(grows_along_firing(cloud.xyz[usual], time[usual]))
    without = {role: name for role, name in names.items() if role != "time"}
    if not spans or max(spans) == 0:
        return without, 0.0
    span = float(np.median(spans))
    unit = _sweep_unit(span)
    if not unit:
        notes.append(f"times of points ({key}) span {span:g} a scan, no sweep in s, ms, µs or ns: not used")
        return without, 0.0
    if grows and 2 * sum(grows) < len(grows) and not stated:
        notes.append(
            f"{key} is not used: it spans {span:g}, a sweep in {_UNITS_S[unit]}, but does not grow along the order of "
            f"firing; "
            "--columns settles it"
        )
        return without, 0.0
    notes.append(f"times of points ({key}) are in {_UNITS_S[unit]}: a scan spans {span * unit:.3g} s")
    if strays:
        notes.append(f"{strays} points of {len(clouds)} scans have times outside the sweep: left out")
    return names, unit


def _sweep_unit(span: float) -> float:
    """Length of the unit in which a span of times is a sweep [s]; 0 where there is none."""
    return next((unit for unit in _UNITS_S if _SWEEP_S[0] <= span * unit <= _SWEEP_S[1]), 0.0)


def _intensities(
    clouds: Sequence[_Cloud], names: dict[str, str], options: PointOptions, notes: list[str]
) -> tuple[dict[str, str], float]:
    key = names.get("intensity")
    if key is None:
        return names, 1.0
    found = [values for cloud in clouds if (values := cloud.used("intensity")) is not None and len(values)]
    if not found:
        return names, options.intensity_scale or 1.0
    negative = _negative_share(found)
    if negative > _SIGNED_SHARE:
        notes.append(f"{key} is not used as intensity: {negative:.0%} of its values are negative; --columns settles it")
        return {role: name for role, name in names.items() if role != "intensity"}, 1.0
    copy = None if options.roles is not None else _repeated(clouds, "intensity")
    if copy is not None:
        notes.append(f"{key} is not used as intensity: it is the {copy} of the points; --columns settles it")
        return {role: name for role, name in names.items() if role != "intensity"}, 1.0
    if options.intensity_scale is not None:
        return names, options.intensity_scale
    kind = found[0].dtype
    flat = np.concatenate([values.astype(np.float64) for values in found])
    flat = flat[np.isfinite(flat) & (flat >= 0)]
    if kind == np.uint8:
        return names, _BYTE
    bright = float(np.quantile(flat, _BRIGHT)) if len(flat) else 0.0
    if kind.kind in "ui":
        scale = next((limit for limit in (_BYTE, _WORD) if bright <= limit), bright)
    else:
        scale = next((limit for limit in (1.0, _BYTE, _WORD) if bright <= limit * 1.001), bright)
    if scale > 1.0:
        above = int((flat > scale).sum())
        more = f" ({above} above count as full)" if above else ""
        notes.append(
            f"99.9 % of the intensities lie below {bright:g}: taken as parts of {scale:g}{more}; --intensity-scale "
            f"says "
            "otherwise"
        )
    return names, scale


def _unusable(cloud: _Cloud, schema: PointSchema) -> dict[str, np.ndarray]:
    """Masks (m,) of the rows that are no returns, by reason."""
    with np.errstate(invalid="ignore", over="ignore"):
        finite = np.isfinite(cloud.stored).all(1)
        reasons = {"not finite": ~finite, "at the origin": finite & ~cloud.good}
        if schema.no_return:
            reasons["no return by their place"] = _at(cloud.stored, schema.no_return)
        reach = np.where(cloud.good, np.linalg.norm(cloud.stored, axis=1), 0.0)
        if cloud.good.sum() >= 100:
            reasons["too far"] = reach > _farthest(reach[cloud.good], schema.metres)
        if schema.no_return_range is not None:
            same = np.abs(reach - schema.no_return_range) < max(_SPHERE_M, 1e-6 * schema.no_return_range)
            reasons["no return by their range"] = same
        intensity = cloud.values("intensity")
        if intensity is not None and intensity.dtype.kind == "f":
            reasons["intensity not finite"] = ~np.isfinite(intensity)
            reasons["negative intensity"] = intensity < 0
        time = cloud.values("time")
        if time is not None and schema.time_unit_s:
            usual = np.zeros(len(time), bool)
            usual[cloud.good] = core_times(time[cloud.good])
            reasons["time outside the sweep"] = ~usual
    return reasons
