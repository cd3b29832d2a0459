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
from cosim.point_files.cloud import SPHERE_M, Cloud, Columns, farthest_range, find_no_returns, is_at
from cosim.point_files.clues import core_times, grows_along_firing
from cosim.point_files.options import PointOptions
from cosim.point_files.roles import (
    BYTE,
    SIGNED_SHARE,
    TIME_UNITS_S,
    WORD,
    find_roles,
    negative_share,
    repeated_coordinate,
    sweep_unit,
)
from cosim.point_files.scan import PointFileError, Scan

_BRIGHT = 0.999  # quantile of intensities that scales them
_WORLD_M = 60.0  # least range of points that are not measured from the sensor


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
    names = find_roles(samples, options, source, notes)
    clouds = [Cloud.of(columns, names) for columns in samples]
    _demand_points(clouds, source)
    no_return, no_return_range = find_no_returns(clouds, notes)
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
    found = Cloud.of(columns, schema.names, name)
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


def _demand_points(clouds: Sequence[Cloud], source: str) -> None:
    rows = sum(len(cloud.stored) for cloud in clouds)
    good = sum(int(cloud.good.sum()) for cloud in clouds)
    if rows >= 100 and good < 0.02 * rows:
        raise PointFileError(
            f"{source}: {rows - good} of {rows} rows are not finite or at the origin, so nearly none is a return; "
            "check the columns (--columns) and the export"
        )


def _demand_sensor_frame(clouds: Sequence[Cloud], metres: float, source: str) -> None:
    """Raise where no point is near the sensor: coordinates of a map, or of a projection."""
    xyz = np.concatenate([cloud.xyz for cloud in clouds]) if clouds else np.zeros((0, 3))
    if len(xyz) < 100:
        return
    reach = np.linalg.norm(xyz, axis=1) * metres
    if float(np.quantile(reach, 0.02)) > _WORLD_M:
        middle = np.median(xyz, axis=0)
        raise PointFileError(
            f"{source}: points lie about ({middle[0]:.0f}, {middle[1]:.0f}, {middle[2]:.0f}) and 98 % of them farther "
            f"than {_WORLD_M:g} m from (0, 0, 0), so they are georeferenced, not relative to the sensor; subtract the "
            "sensor's pose T of each scan first: p_sensor = R(T)⁻¹ · (p − t(T)), and give the poses as poses.txt"
        )


def _times(
    clouds: Sequence[Cloud], names: dict[str, str], notes: list[str], *, stated: bool
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
    unit = sweep_unit(span)
    if not unit:
        notes.append(f"times of points ({key}) span {span:g} a scan, no sweep in s, ms, µs or ns: not used")
        return without, 0.0
    if grows and 2 * sum(grows) < len(grows) and not stated:
        notes.append(
            f"{key} is not used: it spans {span:g}, a sweep in {TIME_UNITS_S[unit]}, but does not grow along the order "
            "of firing; --columns settles it"
        )
        return without, 0.0
    notes.append(f"times of points ({key}) are in {TIME_UNITS_S[unit]}: a scan spans {span * unit:.3g} s")
    if strays:
        notes.append(f"{strays} points of {len(clouds)} scans have times outside the sweep: left out")
    return names, unit


def _intensities(
    clouds: Sequence[Cloud], names: dict[str, str], options: PointOptions, notes: list[str]
) -> tuple[dict[str, str], float]:
    key = names.get("intensity")
    if key is None:
        return names, 1.0
    found = [values for cloud in clouds if (values := cloud.used("intensity")) is not None and len(values)]
    if not found:
        return names, options.intensity_scale or 1.0
    negative = negative_share(found)
    if negative > SIGNED_SHARE:
        notes.append(f"{key} is not used as intensity: {negative:.0%} of its values are negative; --columns settles it")
        return {role: name for role, name in names.items() if role != "intensity"}, 1.0
    copy = None if options.roles is not None else repeated_coordinate(clouds, "intensity")
    if copy is not None:
        notes.append(f"{key} is not used as intensity: it is the {copy} of the points; --columns settles it")
        return {role: name for role, name in names.items() if role != "intensity"}, 1.0
    if options.intensity_scale is not None:
        return names, options.intensity_scale
    kind = found[0].dtype
    flat = np.concatenate([values.astype(np.float64) for values in found])
    flat = flat[np.isfinite(flat) & (flat >= 0)]
    if kind == np.uint8:
        return names, BYTE
    bright = float(np.quantile(flat, _BRIGHT)) if len(flat) else 0.0
    if kind.kind in "ui":
        scale = next((limit for limit in (BYTE, WORD) if bright <= limit), bright)
    else:
        scale = next((limit for limit in (1.0, BYTE, WORD) if bright <= limit * 1.001), bright)
    if scale > 1.0:
        above = int((flat > scale).sum())
        more = f" ({above} above count as full)" if above else ""
        notes.append(
            f"99.9 % of the intensities lie below {bright:g}: taken as parts of {scale:g}{more}; --intensity-scale "
            "says otherwise"
        )
    return names, scale


def _unusable(cloud: Cloud, schema: PointSchema) -> dict[str, np.ndarray]:
    """Masks (m,) of the rows that are no returns, by reason."""
    with np.errstate(invalid="ignore", over="ignore"):
        finite = np.isfinite(cloud.stored).all(1)
        reasons = {"not finite": ~finite, "at the origin": finite & ~cloud.good}
        if schema.no_return:
            reasons["no return by their place"] = is_at(cloud.stored, schema.no_return)
        reach = np.where(cloud.good, np.linalg.norm(cloud.stored, axis=1), 0.0)
        if cloud.good.sum() >= 100:
            reasons["too far"] = reach > farthest_range(reach[cloud.good], schema.metres)
        if schema.no_return_range is not None:
            same = np.abs(reach - schema.no_return_range) < max(SPHERE_M, 1e-6 * schema.no_return_range)
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
