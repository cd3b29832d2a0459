"""Differences that remain: columns, channels of behaviours, and channels of single vehicles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from cosim.driver_discrepancy.behaviours import BEHAVIOURS
from cosim.driver_discrepancy.comparison import StatisticRow, TrafficComparison
from cosim.driver_discrepancy.evidence import departures

_MOST = 6


def find_unexplained(
    comparison: TrafficComparison, behaviours: Mapping[str, float], level: float
) -> tuple[StatisticRow, ...]:
    """Columns that differ significantly, one of each channel, the clearest first; then channels without such a column.

    A condition is named where the channel as a whole does not differ, or one of its levels differs otherwise than it.
    A channel without a significant column is listed if it belongs to a behaviour whose direction is significant, or
    if the error is above its floor and single vehicles differ in it.

    Args:
        comparison: with the model.
        behaviours: family-wise p-value of each behaviour.
        level: of significance.
    """
    rows = _of_columns(comparison, level)
    rows += _of_behaviours(comparison, behaviours, level, rows)
    rows += [row for row in comparison.vehicles_differ if row.name not in {other.name for other in rows}]
    return tuple(rows[:_MOST])


def _of_columns(comparison: TrafficComparison, level: float) -> list[StatisticRow]:
    evidence = comparison.evidence
    at = {(column.channel, column.condition, column.level): row for row, column in enumerate(evidence.columns)}
    rows = [row for row in (*comparison.statistics, *comparison.parts) if row.p_value <= level]
    best: dict[str, StatisticRow] = {}
    for row in rows:
        whole = next((other for other in rows if other.name == row.name and not other.condition), None)
        if row.condition and whole is not None:
            parts = np.array([position for key, position in at.items() if key[0] == row.name and key[1]])
            departs = departures(evidence, at[row.name, "", ""], parts)
            if departs[parts == at[row.name, row.condition, row.level]][0] > level:
                continue
        if row.name not in best or _size(row) > _size(best[row.name]):
            best[row.name] = row
    return sorted(best.values(), key=lambda row: -_size(row))


def _of_behaviours(
    comparison: TrafficComparison, behaviours: Mapping[str, float], level: float, listed: Sequence[StatisticRow]
) -> list[StatisticRow]:
    """The clearest channel of each behaviour whose direction is significant, unless one of its channels is listed."""
    rows: list[StatisticRow] = []
    for name, p_value in behaviours.items():
        shown = BEHAVIOURS[name].statistics
        own = [row for row in comparison.statistics if row.name in shown and np.isfinite(row.p_value)]
        if p_value <= level and own and not any(row.name in shown for row in (*listed, *rows)):
            rows.append(replace(max(own, key=_size), p_value=p_value))
    return rows


def _size(row: StatisticRow) -> float:
    return abs(row.measured - row.model) / row.sigma
