"""Unit and zero of the headings of a table, by the direction of travel."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cosim.traffic.trajectories.table_names import declared_unit
from cosim.traffic.trajectories.table_options import TableOptions
from cosim.traffic.trajectories.table_steps import TableColumns, TableSteps
from cosim.traffic.trajectories.tracks import TrajectoryError

_MOVES_M = 0.05  # a step that shows speed
_COURSE_M = 0.5  # a way that shows a direction
_FEWEST = 5  # comparisons that a verdict needs
_ALONG = 0.85  # mean cosine between heading and way of a reading that is right
_BETTER = 0.05  # of that, between two readings
_UNITS_RAD = {"degrees": np.pi / 180, "radians": 1.0, "gradians": np.pi / 200}
_FULL_TURN = {"radians": 2 * np.pi, "degrees": 360.0, "gradians": 400.0}
_RARE = 0.02  # by which gradians, which are rare, must fit better than degrees


def infer_heading(
    table: TableColumns,
    columns: Mapping[str, str],
    options: TableOptions,
    source: str,
    steps: TableSteps,
    notes: list[str],
) -> tuple[float, str, bool]:
    """Unit of the headings [rad], where they count from, and whether they are used."""
    if "heading" not in columns or options.heading == "unused":
        return 1.0, "east", False
    if options.heading is not None:
        unit, _, zero = options.heading.partition(" from ")
        return _UNITS_RAD[unit], zero, True
    name = columns["heading"]
    values = table.values[name]
    finite = np.abs(values[np.isfinite(values)])
    if not len(finite):
        return 1.0, "east", False
    if len(finite) >= _FEWEST and not np.any(finite) and _ways_differ(steps):
        notes.append(f"{name} is 0 whatever the direction of travel: not used, headings come from the way")
        return 1.0, "east", False
    declared = declared_unit("heading", name)
    widest = float(np.quantile(finite, 0.98))
    scores = _heading_scores(table.user, values, steps)
    if not scores:  # no road user moves far enough
        unit = declared or (1.0 if widest <= 2 * np.pi + 0.1 else np.pi / 180)
        notes.append(
            f"{name} is in {_angle(unit)} by its name and size; no road user moves, so the motion cannot confirm it"
        )
        return unit, "east", True
    fitting = {reading: score for reading, score in scores.items() if widest <= _FULL_TURN[_angle(reading[0])] * 1.02}
    best = max(fitting, key=lambda reading: _preference(reading, fitting)) if fitting else (1.0, "east")
    report = ", ".join(f"{_angle(unit)} from {zero} {score:.2f}" for (unit, zero), score in scores.items())
    if not fitting or fitting[best] < _ALONG:
        raise TrajectoryError(
            f"{source}: {name} is the direction of travel in no reading (mean cosine with the way: {report}); state it "
            f"in {source}.yaml, as `heading: degrees from east`, or `heading: unused`"
        )
    usual = (declared or best[0], "east")
    if usual in fitting and fitting[usual] > fitting[best] - _BETTER and (declared or fitting[usual] == fitting[best]):
        best = usual
    if declared is not None and best[0] != declared:
        raise TrajectoryError(
            f"{source}: {name} is in {_angle(declared)} by its name, but along the way in {_angle(best[0])} (mean "
            f"cosine with the way: {report}); state it in {source}.yaml, as `heading: {_angle(best[0])} from {best[1]}`"
        )
    notes.append(f"{name} is in {_angle(best[0])} from {best[1]}: along the way (mean cosine {fitting[best]:.3f})")
    return best[0], best[1], True


def _ways_differ(steps: TableSteps) -> bool:
    """Whether road users move in directions that differ, so that one heading cannot be that of all."""
    moved = steps.way > _COURSE_M if (steps.way > _COURSE_M).sum() >= _FEWEST else steps.way > _MOVES_M
    if moved.sum() < _FEWEST:
        return False
    east = steps.dx[moved] / steps.way[moved]
    return float(np.quantile(east, 0.05)) < _ALONG


def _heading_scores(user: np.ndarray, values: np.ndarray, steps: TableSteps) -> dict[tuple[float, str], float]:
    """Mean cosine between direction of motion and heading for each reading; empty if no road user moves.

    Road users have equal weight, whatever their number of samples.
    """
    moved = (steps.way > min(_COURSE_M, 0.5 * float(np.quantile(steps.way, 0.9)))) if len(steps) else np.zeros(0, bool)
    moved &= steps.way > _MOVES_M
    moved &= np.isfinite(values[steps.row]) & np.isfinite(values[steps.after])
    if moved.sum() < _FEWEST:
        return {}
    course = np.arctan2(steps.dy, steps.dx)[moved]
    _, who = np.unique(user[steps.row[moved]], return_inverse=True)
    count = np.bincount(who)
    given = (values[steps.row], values[steps.after])
    scores = {}
    for unit in _UNITS_RAD.values():
        for zero in ("east", "north"):
            found = [turned(value[moved] * unit, zero) for value in given]
            middle = np.arctan2(sum(np.sin(a) for a in found), sum(np.cos(a) for a in found))
            scores[unit, zero] = float(np.mean(np.bincount(who, np.cos(middle - course)) / count))
    return scores


def turned(angle_rad: np.ndarray, zero: str) -> np.ndarray:
    """Angles counted from a zero as angles counter-clockwise from east [rad]."""
    return np.pi / 2 - angle_rad if zero == "north" else angle_rad


def _preference(reading: tuple[float, str], scores: Mapping[tuple[float, str], float]) -> float:
    return scores[reading] - (_RARE if _angle(reading[0]) == "gradians" else 0.0)


def _angle(unit_rad: float) -> str:
    """Name of a unit of angles."""
    return next(name for name, value in _UNITS_RAD.items() if value == unit_rad)
