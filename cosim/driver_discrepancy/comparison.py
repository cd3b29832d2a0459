"""Distance of the model's traffic from measured traffic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.capture.config import RunConfig
from cosim.driver_discrepancy.case import open_case
from cosim.driver_discrepancy.channels import BASES, CHANNELS
from cosim.driver_discrepancy.evidence import ChannelEvidence, Significance, find_significance, gather_evidence
from cosim.driver_discrepancy.scores import Excess, Scores, find_excess, noise_floor, noise_floors, score_vehicles
from cosim.driver_discrepancy.settings import DEFAULT
from cosim.driver_discrepancy.summary import Summary, SummaryColumn
from cosim.driver_discrepancy.tracks import Tracks


@dataclass(frozen=True, eq=False)
class StatisticRow:
    """One column: measured, modelled, and the family-wise p-value of their difference (NaN without evidence).

    Attributes:
        name, condition, level: of the column.
        measured, model: means.
        sigma: standard deviation of their difference if the model is right.
        p_value: family-wise.
        errors: error of single vehicles and its noise floor, where these differ and the mean does not.
    """

    name: str
    condition: str
    level: str
    measured: float
    model: float
    sigma: float
    p_value: float
    errors: tuple[float, float] | None = None

    @property
    def unit(self) -> str:
        """Unit of its values."""
        return CHANNELS[self.name].unit

    @property
    def place(self) -> str:
        """Channel and condition in words."""
        condition = f" ({self.condition}: {self.level})" if self.condition else ""
        return self.name.replace("_", " ") + (" of single vehicles" if self.errors else condition)

    @property
    def difference(self) -> str:
        """Measured and modelled value in words."""
        if self.errors:
            return f"{self.place}: error {self.errors[0]:.3g}, noise floor {self.errors[1]:.3g}"
        unit = f" {self.unit}" if self.unit else ""
        measured, model = (f"{round(value, 4) + 0.0:.3g}{unit}" for value in (self.measured, self.model))
        return f"{self.place}: measured {measured}, model {model}"

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        values = {name: value for name, value in vars(self).items() if name != "errors"}
        return {**values, "unit": self.unit}


@dataclass(frozen=True, eq=False)
class TrafficComparison:
    """A model's traffic compared with measured traffic.

    Attributes:
        measured, runs: summaries of the trajectories, and of the model with several seeds.
        scores: error of every vehicle in every channel.
        error: mean over the groups of channels; lower is better.
        noise_floor: the error of the model against itself with other seeds.
        floors: the same of each group of channels.
        statistics: whole channels.
        parts: channels under conditions that both show.
        evidence: table of differences.
        significance: of its columns.
        excess: test of the error against those of the model's own seeds; `families` tests share the level.
        families: of tests that share the level.
        notes: limits of the data, a sentence each.
    """

    measured: Summary
    runs: tuple[Summary, ...]
    scores: Scores
    error: float
    noise_floor: float
    floors: Mapping[str, float]
    statistics: tuple[StatisticRow, ...]
    parts: tuple[StatisticRow, ...]
    evidence: ChannelEvidence
    significance: Significance
    excess: Excess
    families: int
    notes: tuple[str, ...]

    @property
    def is_above_floor(self) -> bool:
        """Whether the error is larger than those of the model's own seeds by more than chance explains."""
        return self.excess.p_value * self.families <= DEFAULT.level

    @property
    def vehicles_differ(self) -> tuple[StatisticRow, ...]:
        """Channels in which single vehicles are predicted worse than by chance, if the error is above its floor."""
        if not self.is_above_floor:
            return ()
        rows = {row.name: row for row in self.statistics}
        return tuple(
            replace(rows[name], p_value=max(self.excess.p_value * self.families, errors[2]), errors=errors[:2])
            for name in self.excess.largest(DEFAULT.level)
            for errors in [self.excess.channels[name]]
        )

    @property
    def channels(self) -> Mapping[str, float]:
        """Error of each group of channels."""
        return self.scores.by_group()

    @property
    def worst(self) -> StatisticRow | None:
        """The whole channel that differs most, if chance does not explain it.

        Differences between drivers are counted about the measured mean, so that they follow from a different mean.
        """
        significant = {row.name: row for row in self.statistics if row.p_value <= DEFAULT.level}
        own = [row for name, row in significant.items() if BASES.get(name) not in significant]
        return max(own, key=lambda row: abs(row.measured - row.model) / row.sigma, default=None)

    def to_json(self) -> dict[str, Any]:
        """Contents of the file of `cosim traffic-compare --json`."""
        by_channel = self.scores.by_channel()
        return {
            "vehicles": len(self.measured.ids),
            "seconds": self.measured.seconds,
            "simulations": len(self.runs),
            "channels": {
                name: {
                    "distance": value * CHANNELS[name].scale,
                    "unit": CHANNELS[name].unit,
                    "scale": CHANNELS[name].scale,
                    "group": CHANNELS[name].group,
                }
                for name, value in by_channel.items()
            },
            "groups": dict(self.channels),
            "error": self.error,
            "noise_floor": self.noise_floor,
            "statistics": [row.to_json() for row in self.statistics],
            "evidence": [row.to_json() for row in self.parts if row.p_value <= DEFAULT.level],
            "notes": list(self.notes),
        }

    def __str__(self) -> str:
        at = f"error {self.error:.3f}, noise floor {self.noise_floor:.3f}"
        if self.worst is None:
            if self.vehicles_differ:
                return f"{at}; worst: {self.vehicles_differ[0].difference}"
            at_floor = self.error <= (1 + DEFAULT.at_floor) * self.noise_floor
            return at + ("; at the floor" if at_floor else "; no channel differs significantly")
        return f"{at}; worst: {self.worst.difference}"


def traffic_compare(
    measured: Tracks | str | Path,
    config: RunConfig | str | Path,
    *,
    seeds: int = 8,
    workers: int | None = None,
    vtypes: Sequence[Path] = (),
) -> TrafficComparison:
    """Compare a model's traffic with measured trajectories.

    The model drives the measured demand: the same vehicles enter when, where and as fast as they were measured.

    Args:
        measured: trajectories, or their file.
        config: the model: town and behaviour of a run's configuration, or its file.
        seeds: how many simulations.
        workers: processes; one a core by default.
        vtypes: SUMO files with further vehicle types.

    Raises:
        CosimError: the trajectories cannot be used, or are not of this town.
        TownError: the town cannot be used.
    """
    with open_case(measured, config, workers, vtypes=vtypes) as case:
        runs = case.simulations.run([(case.behaviour, seed) for seed in range(seeds)])
        return compare_summaries(case.measured, runs, case.notes)


def compare_summaries(
    measured: Summary, runs: Sequence[Summary], notes: tuple[str, ...], families: int = 3
) -> TrafficComparison:
    """A comparison from summaries; `families` of tests share the level."""
    evidence = gather_evidence(measured, runs)
    significance = find_significance(evidence, np.random.default_rng(0), families=families)
    scores = score_vehicles(measured, runs)
    rows = _rows(measured, runs, evidence, significance)
    return TrafficComparison(
        measured=measured,
        runs=tuple(runs),
        scores=scores,
        error=scores.error,
        noise_floor=noise_floor(runs),
        floors=noise_floors(runs),
        statistics=tuple(row for row in rows if not row.condition),
        parts=tuple(row for row in rows if row.condition and np.isfinite(row.p_value)),
        evidence=evidence,
        significance=significance,
        excess=find_excess(scores, runs),
        families=families,
        notes=notes,
    )


def _rows(
    measured: Summary, runs: Sequence[Summary], evidence: ChannelEvidence, significance: Significance
) -> list[StatisticRow]:
    own = measured.ratios()
    model = np.array([run.ratios() for run in runs])
    known = np.isfinite(model)
    mean = np.where(known, model, 0).sum(0) / np.maximum(known.sum(0), 1)
    mean = np.where(known.any(0), mean, np.nan)
    at: dict[SummaryColumn, int] = {column: number for number, column in enumerate(evidence.columns)}
    rows = []
    for number, column in enumerate(measured.columns):
        index = at.get(column)
        sigma = CHANNELS[column.channel].scale if index is None else float(evidence.sigma[index])
        p_value = float("nan") if index is None else float(significance.p_values[index])
        values = float(own[number]), float(mean[number])
        rows.append(StatisticRow(column.channel, column.condition, column.level, *values, sigma, p_value))
    return rows
