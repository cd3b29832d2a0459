"""Scanners that do not rotate: a table of beams, or the path of their mirrors or prisms."""

from __future__ import annotations

import base64
import binascii
import io
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from sensors.pattern import Pattern
from sensors.rays import Rays

_UNIT_TOLERANCE = 1e-3
_MOST_BEAMS = 4_000_000
_BY_VECTOR, _BY_ANGLE = ("time_s", "x", "y", "z"), ("time_s", "azimuth_deg", "elevation_deg")
_MOST_CHANNELS = 256  # files number rings with a byte
_KEPT = np.dtype([("time_s", "<f4"), ("azimuth", "<f4"), ("elevation", "<f4"), ("channel", "u1")])


class DirectionTable(Pattern):
    """Beams in any directions, each with its own time; the same in every scan.

    The pose time is the middle of the scan. A channel counts as a ring: beams are ordered by channel, then by time.
    `elevation_deg`, the channels' mean elevations, and `firings`, the most beams of a channel, follow from the table.
    """

    table: str = Field(description="the beams, packed: zlib and base 64 of time [s], azimuth, elevation [rad], channel")

    @model_validator(mode="before")
    @classmethod
    def _with_channels(cls, values: Any) -> Any:
        if not isinstance(values, dict) or not isinstance(values.get("table"), str):
            return values
        beams, sweep_s = unpacked(values["table"]), values.get("sweep_s")
        if isinstance(sweep_s, int | float) and len(beams) and beams["time_s"].max() > sweep_s:
            raise ValueError(
                f"the last beam fires at {beams['time_s'].max():g} s, after sweep_s = {sweep_s:g}; times run from 0"
            )
        channels = int(beams["channel"].max()) + 1 if len(beams) else 0
        count = np.bincount(beams["channel"], minlength=channels)
        if not len(beams) or not count.all():
            raise ValueError(f"channel {int(np.argmin(count)) if len(count) else 0} has no beam; number them from 0")
        mean = np.bincount(beams["channel"], np.degrees(beams["elevation"].astype(np.float64))) / count
        own = {"firings": int(count.max()), "elevation_deg": tuple(np.round(mean, 4).tolist())}
        return {**values, **own, "block": (), "azimuth_offset_deg": ()}

    def rays(self) -> Rays:
        """All beams of a scan, by channel and then by time."""
        beams = unpacked(self.table)
        beams = beams[np.lexsort((beams["time_s"], beams["channel"]))]
        azimuth, elevation = beams["azimuth"].astype(np.float64), beams["elevation"].astype(np.float64)
        flat = np.cos(elevation)
        direction = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], 1)
        return Rays(
            origin=np.zeros((len(beams), 3), np.float32),
            direction=direction.astype(np.float32),
            ring=beams["channel"].copy(),
            azimuth=beams["azimuth"].copy(),
            time_s=beams["time_s"] - np.float32(self.sweep_s / 2),
        )


def read_table(path: Path) -> str:
    """The beams of a CSV file, packed as `DirectionTable.table`.

    Columns are `time_s,x,y,z` (unit vectors in LiDAR axes) or `time_s,azimuth_deg,elevation_deg`, and `channel` if
    there are several; times run from 0 and never back.

    Raises:
        ValueError: the file cannot be read, a column is missing, times are out of order, a direction is not of unit
            length, or a value is out of bounds.
    """
    try:
        text = path.read_text(encoding="utf-8")
        header = [name.strip() for name in text.partition("\n")[0].split(",")]
        if not text.partition("\n")[2].strip():
            raise ValueError("it holds no row; the first line names the columns, the others are beams")
        rows = np.loadtxt(io.StringIO(text), delimiter=",", skiprows=1, ndmin=2)
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} cannot be read: {error}") from None
    except ValueError as error:
        raise ValueError(f"{path} is not a table of numbers: {' '.join(str(error).split())}") from None
    if rows.shape[1] != len(header) or not 1 <= len(rows) <= _MOST_BEAMS:
        raise ValueError(f"{path} has {rows.shape[1]} columns, {len(header)} names and {len(rows)} rows; give a table")
    column = dict(zip(header, rows.T, strict=True))
    if not any(set(wanted) <= set(header) for wanted in (_BY_VECTOR, _BY_ANGLE)):
        raise ValueError(
            f"{path} has columns {', '.join(header)}; give {','.join(_BY_VECTOR)} or {','.join(_BY_ANGLE)}"
        )
    _check_times(path, rows, column["time_s"])
    if set(_BY_VECTOR) <= set(header):
        vector = np.stack([column[axis] for axis in "xyz"], 1)
        length = np.linalg.norm(vector, axis=1)
        bad = np.flatnonzero(np.abs(length - 1) > _UNIT_TOLERANCE)
        if len(bad):
            raise ValueError(f"{path}, row {bad[0] + 2}: the direction is {length[bad[0]]:g} long; give unit vectors")
        azimuth, elevation = np.arctan2(vector[:, 1], vector[:, 0]), np.arcsin(np.clip(vector[:, 2], -1, 1))
    else:
        azimuth, elevation = (np.radians(column[f"{name}_deg"]) for name in ("azimuth", "elevation"))
    channel = column.get("channel", np.zeros(len(rows)))
    if (channel != np.round(channel)).any() or channel.min() < 0 or channel.max() >= _MOST_CHANNELS:
        raise ValueError(
            f"{path}: channels run from {channel.min():g} to {channel.max():g}; give whole numbers, 0 to 255"
        )
    return packed(column["time_s"], azimuth, elevation, channel)


def packed(time_s: np.ndarray, azimuth: np.ndarray, elevation: np.ndarray, channel: np.ndarray) -> str:
    """Beams as text: seconds, radians and whole numbers, all (n,)."""
    beams = np.zeros(len(time_s), _KEPT)
    beams["time_s"], beams["elevation"], beams["channel"] = time_s, elevation, channel
    beams["azimuth"] = np.pi - np.mod(np.pi - azimuth, 2 * np.pi)
    return base64.b64encode(zlib.compress(beams.tobytes(), 6)).decode("ascii")


def unpacked(text: str) -> np.ndarray:
    """The beams (n,) of a packed table.

    Raises:
        ValueError: the text is not a packed table.
    """
    try:
        data = zlib.decompressobj().decompress(base64.b64decode(text, validate=True), _MOST_BEAMS * _KEPT.itemsize)
        beams = np.frombuffer(data, _KEPT)
    except (binascii.Error, zlib.error, ValueError):
        raise ValueError("table is damaged; name the directions' file again") from None
    if not all(np.isfinite(beams[name]).all() for name in ("time_s", "azimuth", "elevation")):
        raise ValueError("table holds NaN or infinity; name the directions' file again")
    return beams


def rosette(prisms: Any, beams_per_s: Any, sweep_s: Any) -> str:
    """Packed beams of one laser behind rotating prisms, whose deflections add up.

    Small angles: y + i z = Σ δ_j·e^{2πi f_j t}, about the forward axis.

    Args:
        prisms: revolutions per second (negative: opposite direction) and deflection in degrees of each.
        beams_per_s: how often the laser fires.
        sweep_s: how long a scan lasts [s].

    Raises:
        ValueError: the numbers are invalid.
    """
    try:
        speeds, deflections = np.array(prisms, float).reshape(-1, 2).T
        count = round(float(beams_per_s) * float(sweep_s))
    except (TypeError, ValueError):
        raise ValueError("rosette wants prisms: [[turns a second, degrees], …] and beams_per_s") from None
    if not 1 <= count <= _MOST_BEAMS or not np.abs(deflections).sum() < 89:
        raise ValueError(
            f"rosette gives {count} beams and a deflection of {np.abs(deflections).sum():g}°; give fewer, below 89°"
        )
    time_s = (np.arange(count) + 0.5) / float(beams_per_s)
    aside = (np.radians(deflections) * np.exp(2j * np.pi * speeds * time_s[:, None])).sum(1)
    off = np.abs(aside)
    share = np.divide(np.sin(off), off, out=np.ones_like(off), where=off > 0)
    y, z = aside.real * share, aside.imag * share
    return packed(time_s, np.arctan2(y, np.cos(off)), np.arcsin(z), np.zeros(count))


def raster(span_deg: Any, columns: Any, elevation_deg: Any, sweep_s: Any) -> str:
    """Packed beams of lasers above each other that a mirror sweeps from left to right.

    Args:
        span_deg: azimuth at the left and the right end [degrees].
        columns: how many between.
        elevation_deg: one a laser, top first.
        sweep_s: how long a scan lasts [s].

    Raises:
        ValueError: the numbers are invalid.
    """
    try:
        left, right = map(float, span_deg)
        elevation, count = np.radians(np.array(elevation_deg, float).reshape(-1)), int(columns)
    except (TypeError, ValueError):
        raise ValueError("raster wants span_deg: [left, right], columns and elevation_deg") from None
    if not -180 <= right < left <= 180 or not 1 <= count * len(elevation) <= _MOST_BEAMS:
        raise ValueError(f"raster spans {left:g} to {right:g} degrees in {count} columns; give left > right within 180")
    share = (np.arange(count) + 0.5) / count
    azimuth = np.radians(left + (right - left) * share)
    channel = np.repeat(np.arange(len(elevation)), count)
    return packed(
        np.tile(share * float(sweep_s), len(elevation)), np.tile(azimuth, len(elevation)), elevation[channel], channel
    )


def tabulated(values: dict[str, Any], folder: Path | None) -> dict[str, Any]:
    """The values of a pattern file with its `directions`, `rosette` or `raster` as the packed `table`.

    Args:
        values: of the file.
        folder: where the file lies, for the file that `directions` names.

    Raises:
        ValueError: the table cannot be made.
    """
    values, sweep_s = dict(values), values.get("sweep_s", 0.1)
    if "directions" in values:
        name = Path(str(values.pop("directions")))
        values["table"] = read_table(name if name.is_absolute() or folder is None else folder / name)
    elif "rosette" in values:
        settings = values.pop("rosette")
        values["table"] = rosette(_of(settings, "prisms"), _of(settings, "beams_per_s"), sweep_s)
    elif "raster" in values:
        settings = values.pop("raster")
        values["table"] = raster(
            _of(settings, "span_deg"), _of(settings, "columns"), _of(settings, "elevation_deg"), sweep_s
        )
    return values


def is_tabulated(values: object) -> bool:
    """Whether a pattern file lists beams one by one."""
    return isinstance(values, dict) and bool({"directions", "rosette", "raster", "table"} & values.keys())


def _of(said: Any, key: str) -> Any:
    if not isinstance(said, dict) or key not in said:
        raise ValueError(f"{key} is missing; see the howto on sensors")
    return said[key]


def _check_times(path: Path, rows: np.ndarray, time_s: np.ndarray) -> None:
    bad = np.flatnonzero(~np.isfinite(rows).all(1))
    if len(bad):
        raise ValueError(f"{path}, row {bad[0] + 2}: holds NaN or infinity; every beam has a time and a direction")
    back = np.flatnonzero(np.diff(time_s) < 0)
    if len(back) or time_s[0] < 0:
        row = int(back[0]) + 1 if len(back) else 0
        raise ValueError(
            f"{path}, row {row + 2}: time {time_s[row]:g} s is out of order; times run from 0 and never back"
        )
