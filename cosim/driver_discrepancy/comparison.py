"""How far the model's traffic is from measured traffic."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.capture.config import RunConfig
from cosim.driver_discrepancy.case import opened
from cosim.driver_discrepancy.distance import MANNERS, SCALES, UNITS, error, floor, mean_channels
from cosim.driver_discrepancy.gate import Evidence, run_gate
from cosim.driver_discrepancy.settings import DEFAULT
from cosim.driver_discrepancy.summary import STATISTICS, Summary
from cosim.driver_discrepancy.tracks import Tracks

UNIT_OF = {
    "free_speed": "of the limit",
    "free_speed_spread": "of the limit",
    "standing_gap": "m",
    "headway": "s",
    "lateral": "m",
    "lateral_spread": "m",
    "lane_changes": "/min",
    "u_turns": "/h",
    "pull_outs": "/h",
    "acceleration_noise": "m/s²",
    "acceleration_memory": "",
    "reaction_lag": "s",
    "startup_lag": "s",
}


@dataclass(frozen=True, eq=False)
class Row:
    """One statistic: measured, modelled, and the family-wise p-value of their difference (NaN where it is not told)."""

    name: str
    measured: float
    model: float
    sigma: float
    p_value: float

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {**vars(self), "unit": UNIT_OF[self.name]}


@dataclass(frozen=True, eq=False)
class TrafficComparison:
    """A model's traffic held against measured traffic.

    Attributes:
        measured, runs: summaries of the trajectories, and of the model with several seeds.
        channels: mean distance by channel, in its unit.
        error: the mean over channels of distance over scale; lower is better.
        noise_floor: the error of the model against itself with other luck.
        statistics: what shows how drivers drive.
        notes: what could not be known, a sentence each.
    """

    measured: Summary
    runs: tuple[Summary, ...]
    channels: Mapping[str, float]
    error: float
    noise_floor: float
    statistics: tuple[Row, ...]
    notes: tuple[str, ...]

    @property
    def worst(self) -> Row | None:
        """The statistic that differs most, if luck does not explain it."""
        told = [row for row in self.statistics if row.p_value <= DEFAULT.level]
        return max(told, key=lambda row: abs(row.measured - row.model) / row.sigma) if told else None

    def to_json(self) -> dict[str, Any]:
        """What `cosim traffic-compare --json` writes."""
        return {
            "vehicles": len(self.measured.ids),
            "seconds": self.measured.seconds,
            "simulations": len(self.runs),
            "channels": {
                name: {"distance": value, "unit": UNITS[name], "scale": SCALES[name]}
                for name, value in self.channels.items()
            },
            "error": self.error,
            "noise_floor": self.noise_floor,
            "statistics": [row.to_json() for row in self.statistics],
            "notes": list(self.notes),
        }

    def __str__(self) -> str:
        at = f"error {self.error:.3f}, noise floor {self.noise_floor:.3f}"
        if self.worst is None:
            at_floor = self.error <= (1 + DEFAULT.at_floor) * self.noise_floor
            return at + ("; at the floor" if at_floor else "; nothing beyond luck")
        row = self.worst
        unit = f" {UNIT_OF[row.name]}" if UNIT_OF[row.name] else ""
        return f"{at}; worst: {row.name.replace('_', ' ')} {row.measured:.3g}{unit}, model {row.model:.3g}"


def traffic_compare(
    measured: Tracks | str | Path, config: RunConfig | str | Path, *, seeds: int = 8, workers: int | None = None
) -> TrafficComparison:
    """Hold a model's traffic against measured trajectories.

    The model drives the measured demand: the same vehicles enter when, where and as fast as they were measured.

    Args:
        measured: trajectories, or their CSV file.
        config: the model: town and behaviour of a run's configuration, or its file.
        seeds: how many simulations.
        workers: processes; one a core by default.

    Raises:
        CosimError: the trajectories cannot be used, or are not of this town.
        TownError: the town cannot be used.
    """
    with opened(measured, config, workers) as case:
        runs = case.simulations.run([(case.behaviour, seed) for seed in range(seeds)])
        return compared(case.measured, runs, case.notes)


def compared(measured: Summary, runs: list[Summary], notes: tuple[str, ...]) -> TrafficComparison:
    """A comparison from summaries."""
    evidence = Evidence.of(measured, runs)
    verdict = run_gate(evidence, np.random.default_rng(0))
    parts = mean_channels(measured, runs)
    mine, rows = measured.statistics(), [run.statistics() for run in runs]
    sigma = dict(zip(evidence.names, evidence.sigma.tolist(), strict=True))
    return TrafficComparison(
        measured=measured,
        runs=tuple(runs),
        channels=parts,
        error=error(parts),
        noise_floor=floor(runs),
        statistics=tuple(
            Row(
                name,
                mine[name],
                _mean([row[name] for row in rows]),
                sigma.get(name, MANNERS[name]),
                verdict.by_statistic.get(name, float("nan")),
            )
            for name in STATISTICS
        ),
        notes=notes,
    )


def _mean(values: list[float]) -> float:
    told = [value for value in values if np.isfinite(value)]
    return float(np.mean(told)) if told else float("nan")
