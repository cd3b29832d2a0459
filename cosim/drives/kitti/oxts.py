"""GPS/IMU records of KITTI's raw data: `oxts/NAME.txt`, 30 numbers in one line.

Angles are radians: roll positive with the left side up, pitch positive nose down, yaw 0 = east and
counter-clockwise; R = Rz(yaw)·Ry(pitch)·Rx(roll). Positions follow the development kit's Mercator map.
KITTI raw data development kit, readme.txt, dataformat.txt and latlonToMercator.m.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from cosim.drives.files import numbers, read_text
from cosim.errors import FormatError

EARTH_RADIUS_M = 6378137.0
GRAVITY_MPS2 = 9.81
REFERENCE_LATITUDE_DEG, REFERENCE_LONGITUDE_DEG = 49.0, 8.4  # Karlsruhe, where KITTI was driven
_WHOLE = ("navstat", "numsats", "posmode", "velmode", "orimode")


@dataclass(frozen=True)
class Oxts:
    """One record, in the order and with the names of KITTI's `dataformat.txt`.

    Attributes:
        lat, lon: degrees.
        alt: metres.
        roll, pitch, yaw: radians.
        vn, ve: velocity to north and east; vf, vl, vu: forward, left and up, level with the ground [m/s].
        ax, ay, az: acceleration in vehicle axes, gravity included as an accelerometer feels it [m/s²];
            af, al, au: the same, level with the ground.
        wx, wy, wz: turn rates about vehicle axes; wf, wl, wu: level with the ground [rad/s].
        pos_accuracy, vel_accuracy: metres, metres per second.
        navstat, numsats, posmode, velmode, orimode: state of the receiver, whole numbers.
    """

    lat: float
    lon: float
    alt: float
    roll: float
    pitch: float
    yaw: float
    vn: float
    ve: float
    vf: float
    vl: float
    vu: float
    ax: float
    ay: float
    az: float
    af: float
    al: float
    au: float
    wx: float
    wy: float
    wz: float
    wf: float
    wl: float
    wu: float
    pos_accuracy: float = 0.0
    vel_accuracy: float = 0.0
    navstat: int = 4
    numsats: int = 10
    posmode: int = 5
    velmode: int = 5
    orimode: int = 6

    @classmethod
    def from_motion(
        cls, pose: np.ndarray, velocity_mps: np.ndarray, yaw_rate_radps: float, acceleration_mps2: np.ndarray
    ) -> Oxts:
        """The record of a moving body.

        Args:
            pose: (4, 4) world pose, x east, y north, z up, world origin at 49° N, 8.4° E.
            velocity_mps: (3,) in world axes.
            yaw_rate_radps: about world z.
            acceleration_mps2: (3,) in world axes, without gravity.
        """
        pose = np.asarray(pose, np.float64)
        rotation = pose[:3, :3]
        yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
        level = np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        velocity, spin = np.asarray(velocity_mps, np.float64), np.array([0, 0, float(yaw_rate_radps)])
        felt = np.array([0, 0, GRAVITY_MPS2]) + acceleration_mps2
        lat, lon = _to_degrees(pose[0, 3], pose[1, 3])
        values = [
            *(lat, lon, pose[2, 3]),
            float(np.arctan2(rotation[2, 1], rotation[2, 2])),
            float(np.arcsin(np.clip(-rotation[2, 0], -1, 1))),
            yaw,
            *(velocity[1], velocity[0]),
            *(level @ velocity),
            *(rotation.T @ felt),
            *(level @ felt),
            *(rotation.T @ spin),
            *(level @ spin),
        ]
        measured: dict[str, Any] = dict(zip(_NAMES, map(float, values), strict=False))
        return cls(**measured)  # the state of the receiver keeps its defaults

    @property
    def pose(self) -> np.ndarray:
        """The (4, 4) pose, x east, y north, z up, from 49° N, 8.4° E."""
        matrix = np.eye(4)
        matrix[:3, :3] = _rotation(self.roll, self.pitch, self.yaw)
        matrix[:3, 3] = [*_to_metres(self.lat, self.lon), self.alt]
        return matrix

    @property
    def velocity_mps(self) -> np.ndarray:
        """Velocity (3,) to east, north and up."""
        return np.array([self.ve, self.vn, self.vu])


_NAMES = tuple(field.name for field in fields(Oxts))


def parse_oxts(text: str, source: str | Path = "oxts") -> Oxts:
    """The record in the text of a file.

    Raises:
        FormatError: not one line of 30 finite numbers.
    """
    words = text.split()
    if len(words) != len(_NAMES):
        raise FormatError(f"{source}: {len(words)} numbers; an oxts record has {len(_NAMES)}, in one line")
    values: dict[str, Any] = dict(zip(_NAMES, numbers(words, str(source)), strict=True))
    return Oxts(**values | {name: int(values[name]) for name in _WHOLE})


def format_oxts(record: Oxts) -> str:
    """The text of a file: 14 significant digits, as KITTI writes them.

    Raises:
        FormatError: a value is NaN or infinite.
    """
    values = astuple(record)
    if not np.isfinite(values).all():
        raise FormatError(f"oxts holds NaN or infinity: {record}")
    return " ".join(f"{value:d}" if isinstance(value, int) else f"{value + 0.0:.14g}" for value in values) + "\n"


def read_oxts(path: str | Path) -> Oxts:
    """Read a record; see `parse_oxts`."""
    return parse_oxts(read_text(path), path)


def write_oxts(path: str | Path, record: Oxts) -> None:
    """Write a record; see `format_oxts`."""
    Path(path).write_text(format_oxts(record), encoding="utf-8", newline="\n")


def _metres_per_degree() -> float:
    return float(np.cos(np.radians(REFERENCE_LATITUDE_DEG)) * EARTH_RADIUS_M * np.pi / 180)


def _mercator(latitude_deg: float) -> float:
    """Mercator ordinate in degrees of the equator."""
    return float(np.degrees(np.log(np.tan(np.radians(90 + latitude_deg) / 2))))


def _to_metres(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    unit = _metres_per_degree()
    x = (longitude_deg - REFERENCE_LONGITUDE_DEG) * unit
    return x, (_mercator(latitude_deg) - _mercator(REFERENCE_LATITUDE_DEG)) * unit


def _to_degrees(x_m: float, y_m: float) -> tuple[float, float]:
    unit = _metres_per_degree()
    ordinate = _mercator(REFERENCE_LATITUDE_DEG) + y_m / unit
    latitude = 2 * np.degrees(np.arctan(np.exp(np.radians(ordinate)))) - 90
    return float(latitude), float(REFERENCE_LONGITUDE_DEG + x_m / unit)


def _rotation(roll: float, pitch: float, yaw: float) -> np.ndarray:
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
