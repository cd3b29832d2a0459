"""Distance and direction of the motion of a table's road users between samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

_MOVES_M = 0.05  # a step that shows speed
_FEWEST = 5  # comparisons that a verdict needs
_NO_SPEED, _NEARLY_ALL = 1e-6, 0.98  # a speed of none, and the share of rows that have it where none was measured
_MOVES_AWAY_M = 2.0  # extent of the positions of a moving road user
_ALONG = 0.85  # mean cosine between heading and way of a reading that is right


@dataclass(frozen=True, eq=False)
class TableColumns:
    """Columns of a table as numbers, and how its rows follow each other.

    Attributes:
        header: names of all columns.
        user: (n,) int number of the road user of each row.
        values: (n,) float64 by column name; NaN where a cell is empty.
    """

    header: tuple[str, ...]
    user: np.ndarray
    values: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class TableSteps:
    """From one sample of a road user to the next.

    Attributes:
        row: (m,) number of the first row of each step.
        after: (m,) number of its second row.
        dt: (m,) time between them.
        dx, dy: (m,) way [m].
    """

    row: np.ndarray
    after: np.ndarray
    dt: np.ndarray
    dx: np.ndarray
    dy: np.ndarray

    @classmethod
    def of(cls, user: np.ndarray, time: np.ndarray, x: np.ndarray, y: np.ndarray) -> TableSteps:
        """Steps of all road users, without those across a gap."""
        good = np.flatnonzero(np.isfinite(time) & np.isfinite(x) & np.isfinite(y))
        order = good[np.lexsort((time[good], user[good]))]
        before, after = order[:-1], order[1:]
        dt = time[after] - time[before]
        same = (user[before] == user[after]) & (dt > 0)
        if same.any():
            same &= dt <= 3 * np.median(dt[same])
        before, after = before[same], after[same]
        return cls(before, after, dt[same], x[after] - x[before], y[after] - y[before])

    def __len__(self) -> int:
        return len(self.row)

    @property
    def way(self) -> np.ndarray:
        """(m,) length of the way [m]."""
        return np.hypot(self.dx, self.dy)

    def speed_ratio(self, stated: np.ndarray) -> float | None:
        """Median of moved over stated speed; None where too few rows can be compared."""
        mean = (stated[self.row] + stated[self.after]) / 2
        with np.errstate(invalid="ignore"):
            usable = (mean > 1e-9) & (self.way > _MOVES_M) & np.isfinite(mean)
            moving = usable & (mean > 0.2 * np.quantile(mean[usable], 0.9)) if usable.any() else usable
        if moving.sum() < _FEWEST:
            return None
        return float(np.median(self.way[moving] / (self.dt[moving] * mean[moving])))


def stated_speed(table: TableColumns, columns: Mapping[str, str]) -> np.ndarray | None:
    """(n,) magnitude of the speeds in the table's own unit."""
    if "speed" in columns:
        return np.abs(table.values[columns["speed"]])
    if "vx" in columns and "vy" in columns:
        return np.hypot(table.values[columns["vx"]], table.values[columns["vy"]])
    return None


def drop_constant_speeds(
    table: TableColumns, columns: dict[str, str], x: np.ndarray, y: np.ndarray, notes: list[str]
) -> dict[str, str]:
    """The columns without speeds that are zero although road users change their places: they were not measured.

    Args:
        table: its numeric columns.
        columns: name of the column of each role.
        x: (n,) places [m].
        y: (n,) places [m].
        notes: a sentence is added where speeds are not used.
    """
    roles = [role for role in ("speed", "vx", "vy") if role in columns]
    speed = stated_speed(table, columns)
    if speed is None or not len(speed):
        return columns
    known = np.isfinite(speed)
    still = known & (speed <= _NO_SPEED)
    if not known.any() or still.sum() < _NEARLY_ALL * known.sum():
        return columns
    moved = np.zeros(len(x), bool)
    for user in np.unique(table.user):
        rows = table.user == user
        moved[rows] = np.hypot(_spread(x[rows]), _spread(y[rows])) > _MOVES_AWAY_M
    if moved.mean() < 0.5:
        return columns
    notes.append(
        f"{', '.join(columns[role] for role in roles)} is 0 although road users move: not used, speeds come from the "
        "places"
    )
    return {role: name for role, name in columns.items() if role not in roles}


def _spread(values: np.ndarray) -> float:
    """Distance between the 10 % and the 90 % quantile."""
    finite = values[np.isfinite(values)]
    return float(np.ptp(np.quantile(finite, [0.1, 0.9]))) if len(finite) else 0.0


def check_velocity_direction(table: TableColumns, columns: dict[str, str], steps: TableSteps, notes: list[str]) -> None:
    """Note where vx, vy do not point along the way: then only their size is used."""
    if "vx" not in columns or "vy" not in columns:
        return
    vx, vy = (table.values[columns[name]][steps.row] for name in ("vx", "vy"))
    size = np.hypot(vx, vy)
    moved = (steps.way > _MOVES_M) & (size > 0) & np.isfinite(size)
    if moved.sum() < _FEWEST:
        return
    cosine = (vx * steps.dx + vy * steps.dy)[moved] / (size * steps.way)[moved]
    if float(np.median(cosine)) < _ALONG:
        notes.append(
            f"{columns['vx']}, {columns['vy']} are not along the way of x, y (median cosine {np.median(cosine):.2f}): "
            "only their size is used"
        )
