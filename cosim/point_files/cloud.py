"""The points of one file by role of their columns, and points that are no returns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.point_files.clues import core_times
from cosim.point_files.scan import PointFileError

Columns = Mapping[str, np.ndarray]

_REPEATED = (20, 0.005)  # points at one place, count and share, that are no returns
_FAR, _FAR_M = 10.0, 600.0  # times the upper quartile of the ranges, and metres: beyond both is no return
SPHERE_M, _SPHERE_SHARE, _SPHERE_DEG = 0.002, 0.01, 2.0  # points at the greatest range over several elevations
_TINY = 1e-6


@dataclass(frozen=True, eq=False)
class Cloud:
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
    def of(cls, columns: Columns, names: Mapping[str, str], source: str = "scan") -> Cloud:
        """Columns of a file under the names of their roles.

        Raises:
            PointFileError: a field is missing, holds no numbers, or has another length.
        """
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

    def within_reach(self, metres: float) -> Cloud:
        """Rows beyond any range of a sensor are good no longer; `metres` is the length of one unit."""
        if self.good.sum() < 100:
            return self
        with np.errstate(invalid="ignore", over="ignore"):
            reach = np.linalg.norm(self.stored, axis=1)
            return Cloud(self.stored, self.good & ~(reach > farthest_range(reach[self.good], metres)), self.columns)

    def without(self, positions: Sequence[tuple[float, float, float]]) -> Cloud:
        """Rows at these places are good no longer."""
        if not positions:
            return self
        return Cloud(self.stored, self.good & ~is_at(self.stored, positions), self.columns)


def find_no_returns(
    clouds: Sequence[Cloud], notes: list[str]
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
            places[position] = places.get(position, 0) + int(is_at(xyz, [position]).sum())
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
    same = np.abs(reach - farthest) < max(SPHERE_M, 1e-6 * farthest)
    beyond = float(np.mean(reach > farthest + SPHERE_M))
    if not same.any() or not _spans_elevations(xyz[same]):
        return None  # one laser on level ground
    return farthest if float(same.mean()) > _SPHERE_SHARE and beyond < 1e-3 and farthest > 20 else None


def _spans_elevations(xyz: np.ndarray) -> bool:
    elevation = np.degrees(np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1])))
    return float(np.ptp(np.quantile(elevation, [0.1, 0.9]))) > _SPHERE_DEG


def farthest_range(reach: np.ndarray, metres: float) -> float:
    """Range beyond which a point is no return, in units of `metres`, from the ranges (n,) of all points."""
    return max(_FAR * float(np.quantile(reach, 0.75)), _FAR_M / metres)


def is_at(xyz: np.ndarray, positions: Sequence[tuple[float, float, float]]) -> np.ndarray:
    """Mask (n,) bool of the points (n, 3) at any of these positions."""
    found = np.zeros(len(xyz), bool)
    for position in positions:
        found |= (xyz == np.array(position)).all(1)
    return found
