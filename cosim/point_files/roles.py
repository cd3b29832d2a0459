"""Roles of the columns of point files, by name, or by what the values of columns without names show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.point_files.cloud import Cloud, Columns, find_no_returns
from cosim.point_files.clues import (
    are_laser_numbers,
    core_times,
    grows_along_firing,
    repeated_geometry,
    separates_elevations,
)
from cosim.point_files.options import PointOptions
from cosim.point_files.scan import PointFileError

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
TIME_UNITS_S = {1.0: "s", 1e-3: "ms", 1e-6: "µs", 1e-9: "ns"}
_SWEEP_S = (0.015, 0.6)  # durations of a sweep of any spinning sensor; used to infer the unit of times
BYTE, WORD = 255.0, 65535.0
SIGNED_SHARE = 0.2  # share of negative intensities above which the column is no intensity


def find_roles(samples: Sequence[Columns], options: PointOptions, source: str, notes: list[str]) -> dict[str, str]:
    """Names of the columns by role.

    Args:
        samples: columns of some scans.
        options: statements of the user.
        source: name of the folder or file, for messages.
        notes: what was inferred is added.

    Raises:
        PointFileError: x, y or z is missing, or the statements do not match the columns.
    """
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
            "rename the fields, or state them with --columns"
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
    clouds = [Cloud.of(columns, {**found, **{key: key for key in keys[3:]}}, source) for columns in samples]
    no_return, _ = find_no_returns(clouds, [])
    clouds = [cloud.without(no_return) for cloud in clouds]
    spare = []
    for key in keys[3:]:
        copy = repeated_coordinate(clouds, key)
        if copy is not None:
            notes.append(f"{key} is the {copy} of the points: not used; --columns settles it")
            continue
        role = next((role for role in ("ring", "time") if role not in found and _proves(clouds, key, role)), None)
        if role is None:
            spare.append(key)
        else:
            found[role] = key
    spreads = {key: _spread(clouds, key) for key in spare}
    possible = [key for key, (_, high) in spreads.items() if high <= WORD * 1.001]  # stamps are larger
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
            "nor grow along the order of firing as times do; --columns settles it"
        )
    return found


def _proves(clouds: Sequence[Cloud], key: str, role: str) -> bool:
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
            verdicts.append(sweep_unit(span) > 0 and not are_laser_numbers(values) and grows_along_firing(xyz, values))
    return bool(verdicts) and 2 * sum(verdicts) > len(verdicts)


def repeated_coordinate(clouds: Sequence[Cloud], key: str) -> str | None:
    """The coordinate that a column repeats in most scans."""
    found = [repeated_geometry(cloud.xyz, cloud.columns[key][cloud.good].astype(np.float64)) for cloud in clouds]
    copies = [name for name in found if name is not None]
    return copies[0] if 2 * len(copies) > len(found) else None


def _may_be_intensity(clouds: Sequence[Cloud], key: str, source: str, keys: list[str]) -> bool:
    """Whether a column is not negative; raise where it is so by a large share, as coordinates are."""
    share = negative_share([cloud.columns[key][cloud.good] for cloud in clouds])
    if share > SIGNED_SHARE:
        raise PointFileError(
            f"{source}: {key} of {len(keys)} is an intensity by its place, but {share:.0%} of its values are negative, "
            "as those of a coordinate are; state the columns with --columns, as x,y,z,intensity (`columns:` in "
            "drive.yaml)"
        )
    return True


def negative_share(values: Sequence[np.ndarray]) -> float:
    """Share of finite values that are negative."""
    flat = np.concatenate([value.astype(np.float64) for value in values]) if values else np.zeros(0)
    finite = flat[np.isfinite(flat)]
    return float(np.mean(finite < 0)) if len(finite) else 0.0


def _spread(clouds: Sequence[Cloud], key: str) -> tuple[float, float]:
    flat = np.concatenate([cloud.columns[key][cloud.good].astype(np.float64) for cloud in clouds])
    finite = flat[np.isfinite(flat)]
    return (float(np.quantile(finite, 0.01)), float(np.quantile(finite, 0.99))) if len(finite) else (0.0, 0.0)


def sweep_unit(span: float) -> float:
    """Length of the unit in which a span of times is a sweep [s]; 0 where there is none."""
    return next((unit for unit in TIME_UNITS_S if _SWEEP_S[0] <= span * unit <= _SWEEP_S[1]), 0.0)
