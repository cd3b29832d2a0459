"""Significance of differences between rows, and between before and after fine-tuning.

Both sides are scored on the same draws of test frames and subtracted draw by draw (Efron & Tibshirani, An Introduction
to the Bootstrap, 1993, chapter 13).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from training.evaluation.bootstrap import interval
from training.experiments.run import ExperimentRow

_METRICS = {"3d": "3D", "bev": "from above"}


@dataclass(frozen=True)
class ResultComparison:
    """Difference of two figures, R40 at moderate [%], with its 95 % interval."""

    name: str
    gap: float
    low: float
    high: float

    @property
    def verdict(self) -> str:
        """Whether the interval excludes 0."""
        return "not significant" if self.low <= 0 <= self.high else "significant"

    @property
    def in_words(self) -> str:
        """One line."""
        return f"{self.name}: {self.gap:+.1f} ({self.low:+.1f} … {self.high:+.1f}), {self.verdict}"


def gains(rows: Sequence[ExperimentRow]) -> list[ResultComparison]:
    """Changes by fine-tuning, for the rows that were fine-tuned."""
    comparisons = []
    for row in rows:
        if row.scores is None or "before" not in row.scores:
            continue
        for metric, bounds in row.scores["gain_ci95"].items():
            gap = moderate(row.scores, metric) - moderate(row.scores["before"], metric)
            comparisons.append(ResultComparison(f"{row.name}, {_METRICS[metric]}", gap, *bounds))
    return comparisons


def differences(rows: Sequence[ExperimentRow]) -> list[ResultComparison]:
    """Difference of each row from the best in 3D, for rows tested on the same frames."""
    scored_rows = [row for row in rows if row.scores is not None and row.scores["draws_3d_moderate"]]
    if not scored_rows:
        return []
    best = max(scored_rows, key=lambda row: moderate(row.scores, "3d"))
    assert best.scores is not None
    comparisons = []
    for row in scored_rows:
        if row is best or row.scores is None or row.scores["settings"]["test"] != best.scores["settings"]["test"]:
            continue
        draws = np.subtract(row.scores["draws_3d_moderate"], best.scores["draws_3d_moderate"])
        gap = moderate(row.scores, "3d") - moderate(best.scores, "3d")
        comparisons.append(ResultComparison(f"{row.name} less {best.name}, 3D", gap, *interval(draws)))
    return comparisons


def averages(scores: dict[str, Any] | None, metric: str) -> list[float] | None:
    """R40 of cars, easy, moderate, hard [%]; zeros without detected cars, None without scores."""
    if scores is None:
        return None
    results = (scores.get("Car") or {}).get(metric)
    return results["R40"] if results else [0.0, 0.0, 0.0]


def moderate(scores: dict[str, Any] | None, metric: str) -> float:
    """R40 of cars at moderate [%]."""
    return (averages(scores, metric) or [0.0] * 3)[1]
