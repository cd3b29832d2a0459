"""Which driver behaviour a model lacks: gate, rank, fit, add, until nothing more is there."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cosim.capture.config import ConfigError, RunConfig, load_config
from cosim.driver_discrepancy.behaviours import BEHAVIOURS, Behaviour
from cosim.driver_discrepancy.case import Case, opened
from cosim.driver_discrepancy.comparison import TrafficComparison, compared
from cosim.driver_discrepancy.diagnosis import Candidate, TrafficDiagnosis, TrafficFinding
from cosim.driver_discrepancy.distance import MANNERS, error, floor, mean_channels
from cosim.driver_discrepancy.estimate import Estimator, Fit, intervals
from cosim.driver_discrepancy.gate import Evidence, Verdict, run_gate, smallest
from cosim.driver_discrepancy.settings import DEFAULT, TrafficSettings
from cosim.driver_discrepancy.summary import STATISTICS, Summary
from cosim.driver_discrepancy.tracks import Tracks
from cosim.traffic.behaviour import BehaviourConfig

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class _Look:
    """The model as it stands, simulated with all seeds, and its gate."""

    config: BehaviourConfig
    runs: list[Summary]
    verdict: Verdict
    all: Evidence
    fitted: Evidence


@dataclass(frozen=True, eq=False)
class _Try:
    """A behaviour fitted beside those found before, and how much the BIC falls with it."""

    behaviour: Behaviour
    fit: Fit
    delta_bic: float


def traffic_diagnose(
    measured: Tracks | str | Path,
    config: RunConfig | str | Path,
    *,
    seeds: int = 10,
    workers: int | None = None,
    settings: TrafficSettings = DEFAULT,
    on_progress: Callable[[str], None] | None = None,
) -> TrafficDiagnosis:
    """Find the driver behaviours that a model lacks against measured trajectories.

    Args:
        measured: trajectories, or their CSV file.
        config: the model: town and behaviour of a run's configuration, or its file.
        seeds: simulations from which luck is known.
        workers: processes; one a core by default.
        settings: numbers that decide.
        on_progress: is told what is being done.

    Raises:
        CosimError: the trajectories cannot be used, or are not of this town.
        TownError: the town cannot be used.
    """
    run_config = config if isinstance(config, RunConfig) else load_config(Path(config))
    if run_config.behaviour.as_given:
        raise ConfigError(
            "behaviour sumo leaves drivers as the vTypes have them, so nothing could be fitted; take calm"
        )
    with opened(measured, run_config, workers, settings) as case:
        return _Detective(case, run_config, seeds, settings, on_progress or _LOG.debug).run()


class _Detective:
    """One diagnosis."""

    def __init__(
        self, case: Case, config: RunConfig, seeds: int, by: TrafficSettings, say: Callable[[str], None]
    ) -> None:
        self._case, self._config, self._by, self._say = case, config, by, say
        self._seeds = tuple(range(seeds))
        self._simulations = case.simulations
        self._slopes: dict[str, np.ndarray] = {}
        self._found: list[TrafficFinding] = []
        self._ranking: tuple[Candidate, ...] = ()
        self._refused: set[str] = set()
        self._fit: Fit | None = None

    def run(self) -> TrafficDiagnosis:
        """Everything in order."""
        first = look = self._look(self._case.behaviour)
        while len(self._found) < self._by.most_findings and look.verdict.p_value <= self._by.level:
            better = self._better(look)
            if better is None:
                break
            look = better
        return self._concluded(first, look)

    def _look(self, config: BehaviourConfig) -> _Look:
        """Simulate the model with every seed, and run the gate."""
        self._say(f"simulating with {len(self._seeds)} seeds")
        runs = self._simulations.run([(config, seed) for seed in self._seeds])
        evidence = Evidence.of(self._case.measured, runs, self._by)
        ids = self._case.fitted
        return _Look(
            config,
            runs,
            run_gate(evidence, np.random.default_rng(1), self._by),
            evidence,
            Evidence.of(self._case.measured.of(ids), [run.of(ids) for run in runs], self._by),
        )

    def _learn(self, look: _Look, behaviours: Sequence[Behaviour]) -> None:
        """How statistics change with the parameters of behaviours of which that is not known yet."""
        new = [one for one in behaviours if one.name not in self._slopes]
        if new:
            self._say(f"learning what {', '.join(one.name for one in new)} changes")
            self._slopes |= self._estimator(self._by.fitting.slope_seeds).slopes(look.config, new, STATISTICS)

    def _better(self, look: _Look) -> _Look | None:
        """Add the behaviour with which most is explained, and look again; None where none helps."""
        taken = {one.behaviour for one in self._found} | self._refused
        open_ = [one for one in BEHAVIOURS.values() if one.name not in taken]
        shown = [one for one in open_ if look.verdict.by_behaviour[one.name] <= self._by.level]
        if not shown:
            return None
        self._learn(look, shown)
        slopes = self._slopes_for(look.fitted.names)
        estimator = self._estimator(self._by.fitting.slope_seeds)
        promise = {
            one.name: estimator.promise(look.fitted, one, slopes[one.name], look.config) - self._penalty(one)
            for one in shown
        }
        shown.sort(key=lambda one: -promise[one.name])
        worth = [one for one in shown if promise[one.name] > self._by.fitting.nearly * promise[shown[0].name]] or shown
        tries = [self._try(one, look, slopes) for one in worth[: self._by.fitting.tried]]
        tries.sort(key=lambda one: -one.delta_bic)
        self._ranking = self._ranking or self._ranked(shown, promise, tries, look)
        for one in tries:
            after = self._look(one.fit.config) if one.delta_bic > 0 else None
            if after is not None and self._helps(one.behaviour, look, after):
                self._add(one, tries, look, after)
                return after
            self._refused.add(one.behaviour.name)
        return self._better(look) if any(one.name not in self._refused for one in shown) else None

    def _try(self, behaviour: Behaviour, look: _Look, slopes: Mapping[str, np.ndarray]) -> _Try:
        """Fit a behaviour together with those found before."""
        self._say(f"fitting {behaviour.name}")
        together = [*(BEHAVIOURS[one.behaviour] for one in self._found), behaviour]
        estimator = self._estimator(self._by.fitting.seeds)
        fit = estimator.fit(look.config, together, look.fitted, slopes)
        return _Try(behaviour, fit, fit.chi2_before - fit.chi2 - self._penalty(behaviour))

    def _helps(self, behaviour: Behaviour, look: _Look, with_it: _Look) -> bool:
        """Whether vehicles that took no part in the fit are told better, not worse, or as luck has it with it.

        Of a rare manner few vehicles may show nothing, though the model that has it drives as nearly often like them.
        """
        before, after = (self._apart(behaviour, one) for one in (look, with_it))
        told = np.isfinite(before).all(0) & np.isfinite(after).all(0)
        if not told.any():
            return True
        worse = (np.abs(after) - np.abs(before))[:, told].mean(1)
        error_of_mean = float(worse.std(ddof=1)) / np.sqrt(len(worse)) if len(worse) > 1 else 0.0
        as_luck_has_it = (after[:, told].min(0) <= 0) & (after[:, told].max(0) >= 0)
        return bool(worse.mean() < error_of_mean or as_luck_has_it.all())

    def _apart(self, behaviour: Behaviour, look: _Look) -> np.ndarray:
        """(seeds, statistics) how far held-out vehicles are off in what shows a behaviour, in units of its scale."""
        ids = self._case.judging
        mine, others = self._case.measured.of(ids).statistics(), [run.of(ids).statistics() for run in look.runs]
        return np.array([[(one[name] - mine[name]) / MANNERS[name] for name in behaviour.statistics] for one in others])

    def _add(self, one: _Try, tries: Sequence[_Try], look: _Look, after: _Look) -> None:
        self._say(f"adding {one.behaviour.name}")
        name = one.behaviour.name
        least = one.delta_bic - self._by.alike_bic
        alike = tuple(other.behaviour.name for other in tries if other is not one and other.delta_bic > least)
        before = one.behaviour.read(look.config, self._case.background)
        self._found.append(
            TrafficFinding(
                behaviour=name,
                params=one.fit.values[name],
                before=before,
                ci95={},
                p_value=look.verdict.by_behaviour[name],
                error_before=self._held_out(look),
                error_after=self._held_out(after),
                also_possible=alike,
                shown_by=_shown_by(one.behaviour, self._case.measured, look, after),
            )
        )
        self._fit = one.fit

    def _concluded(self, first: _Look, last: _Look) -> TrafficDiagnosis:
        behaviours = [BEHAVIOURS[one.behaviour] for one in self._found]
        config, findings = last.config, list(self._found)
        if self._fit is not None:
            rows = [STATISTICS.index(name) for name in last.fitted.names]
            aligned = replace(self._fit, slopes=self._fit.slopes[rows])
            fit = self._estimator(self._by.fitting.seeds).polished(aligned, behaviours, last.fitted)
            ends = intervals(fit, behaviours, last.fitted.freedom, self._by.coverage)
            config = fit.config
            findings = [_settled(one, fit.values[one.behaviour], ends[one.behaviour]) for one in findings]
        left = [name for name, p_value in last.verdict.by_statistic.items() if p_value <= self._by.level]
        ambiguous = any(one.also_possible for one in findings)
        return TrafficDiagnosis(
            verdict="ambiguous" if ambiguous else "missing" if findings else "unknown" if left else "none",
            effects=tuple(findings),
            ranking=self._ranking,
            smallest_detectable=self._smallest(last),
            before=self._compared(first),
            after=self._compared(last),
            error_before=self._held_out(first),
            error_after=self._held_out(last),
            noise_floor=floor([run.of(self._case.judging) for run in last.runs]),
            config=self._config.model_copy(update={"behaviour": config}) if findings else self._config,
            unexplained=tuple(left),
            simulations=self._simulations.count,
        )

    def _slopes_for(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Slopes in the order of some statistics."""
        rows = [STATISTICS.index(name) for name in names]
        return {name: slopes[rows] for name, slopes in self._slopes.items()}

    def _smallest(self, last: _Look) -> dict[str, dict[str, float]]:
        """Changes that would have been seen."""
        self._say("learning how small a change would have shown")
        slopes = self._estimator(self._by.fitting.slope_seeds).own_slopes(last.config, last.all.names)
        return {
            name: smallest(last.all, last.verdict, behaviour, slopes[name], self._by)
            for name, behaviour in BEHAVIOURS.items()
        }

    def _ranked(
        self, shown: Sequence[Behaviour], promise: Mapping[str, float], tries: Sequence[_Try], look: _Look
    ) -> tuple[Candidate, ...]:
        fitted = {one.behaviour.name: one for one in tries}
        rows = []
        for one in shown:
            done = fitted.get(one.name)
            gain = done.delta_bic if done else promise[one.name]
            rows.append(Candidate(one.name, gain, look.verdict.by_behaviour[one.name], done is not None))
        return tuple(sorted(rows, key=lambda row: -row.delta_bic))

    def _estimator(self, seeds: int) -> Estimator:
        return Estimator(self._simulations, self._case.fitted, self._case.background, self._seeds[:seeds], self._by)

    def _penalty(self, behaviour: Behaviour) -> float:
        return len(behaviour.knobs) * float(np.log(max(len(self._case.fitted), 2)))

    def _held_out(self, look: _Look) -> float:
        ids = self._case.judging
        return error(mean_channels(self._case.measured.of(ids), [run.of(ids) for run in look.runs]))

    def _compared(self, look: _Look) -> TrafficComparison:
        return compared(self._case.measured, look.runs, self._case.notes)


def _shown_by(
    behaviour: Behaviour, measured: Summary, before: _Look, after: _Look
) -> dict[str, tuple[float, float, float]]:
    mine = measured.statistics()
    rows = {}
    for name in behaviour.statistics:
        if name in before.all.names and name in after.all.names:
            one, other = before.all.names.index(name), after.all.names.index(name)
            rows[name] = (mine[name], float(before.all.model[one]), float(after.all.model[other]))
    return rows


def _settled(finding: TrafficFinding, values: Mapping[str, float], ends: Mapping[str, list[float]]) -> TrafficFinding:
    return replace(finding, params=values, ci95=ends)
