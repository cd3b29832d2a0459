"""Find missing driver behaviour: test, rank, fit, accept by the held-out error, repeat."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from cosim.capture.config import RunConfig, load_config
from cosim.discrepancy.selection.gain import is_rival
from cosim.driver_discrepancy.behaviours import BEHAVIOURS, Behaviour, Signal
from cosim.driver_discrepancy.case import Case, open_case
from cosim.driver_discrepancy.comparison import TrafficComparison, compare_summaries
from cosim.driver_discrepancy.diagnosis import Candidate, TrafficDiagnosis, TrafficFinding
from cosim.driver_discrepancy.estimate import Estimator, Fit, intervals
from cosim.driver_discrepancy.evidence import (
    ChannelEvidence,
    find_directions,
    gather_evidence,
)
from cosim.driver_discrepancy.scores import Fall, compare_scores, noise_floor
from cosim.driver_discrepancy.settings import DEFAULT, TrafficSettings
from cosim.driver_discrepancy.summary import Summary, SummaryColumn
from cosim.driver_discrepancy.tracks import Tracks
from cosim.driver_discrepancy.unexplained import find_unexplained
from cosim.traffic.behaviour import BehaviourConfig

_LOG = logging.getLogger(__name__)
_FAMILIES = 4  # whole channels, channels under conditions, behaviours, and the error share the level


@dataclass(frozen=True, eq=False)
class _Look:
    """The current model, simulated with all seeds, and the evidence against it.

    Attributes:
        config: the model.
        comparison: with all vehicles.
        behaviours: family-wise p-value of each behaviour, by the direction in which it changes the columns.
        fitted: evidence of the vehicles that are fitted.
    """

    config: BehaviourConfig
    comparison: TrafficComparison
    behaviours: Mapping[str, float]
    fitted: ChannelEvidence

    @property
    def all(self) -> ChannelEvidence:
        """Evidence of all vehicles."""
        return self.comparison.evidence

    @property
    def smallest(self) -> float:
        """The smallest p-value."""
        return min(self.comparison.significance.smallest, min(self.behaviours.values(), default=1.0))

    def p_value(self, behaviour: Behaviour) -> float:
        """Family-wise, of a behaviour: of its direction, or of a column that shows it."""
        shown = [behaviour.shows(column.channel, column.condition) for column in self.all.columns]
        column = float(self.comparison.significance.p_values[shown].min(initial=1.0))
        return min(column, self.behaviours.get(behaviour.name, 1.0))


@dataclass(frozen=True, eq=False)
class _Try:
    """A behaviour fitted together with those found before.

    Attributes:
        behaviour: which.
        fit: of all of them together.
        gain: fall of chi² less its penalty.
        folds: (folds,) gain that its slopes promise, on each fold of vehicles.
    """

    behaviour: Behaviour
    fit: Fit
    gain: float
    folds: np.ndarray

    def is_confusable_with(self, other: Behaviour) -> bool:
        """Whether the catalogue names one of them as similar to the other."""
        return other.name in self.behaviour.confusable_with or self.behaviour.name in other.confusable_with


def traffic_diagnose(
    measured: Tracks | str | Path,
    config: RunConfig | str | Path,
    *,
    seeds: int = 10,
    workers: int | None = None,
    settings: TrafficSettings = DEFAULT,
    on_progress: Callable[[str], None] | None = None,
    vtypes: Sequence[Path] = (),
) -> TrafficDiagnosis:
    """Find the driver behaviours missing from a model, given measured trajectories.

    Args:
        measured: trajectories, or their file.
        config: the model: town and behaviour of a run's configuration, or its file.
        seeds: simulations that show the spread by chance.
        workers: processes; one a core by default.
        settings: numbers that decide.
        on_progress: called with a one-line status message.
        vtypes: SUMO files with further vehicle types.

    Raises:
        CosimError: the trajectories cannot be used, or are not of this town.
        TownError: the town cannot be used.
    """
    run_config = config if isinstance(config, RunConfig) else load_config(Path(config))
    with open_case(measured, run_config, workers, settings, vtypes) as case:
        return _Diagnosis(case, run_config, seeds, settings, on_progress or _LOG.debug).run()


class _Diagnosis:
    """One diagnosis."""

    def __init__(
        self, case: Case, config: RunConfig, seeds: int, by: TrafficSettings, say: Callable[[str], None]
    ) -> None:
        self._case, self._config, self._by, self._say = case, config, by, say
        self._seeds = tuple(range(seeds))
        self._simulations = case.simulations
        self._found: list[TrafficFinding] = []
        self._ranking: tuple[Candidate, ...] = ()
        self._refused: set[str] = set()
        self._fit: Fit | None = None

    def run(self) -> TrafficDiagnosis:
        """Add behaviours until none is accepted, then conclude."""
        first = look = self._look(self._case.behaviour)
        while len(self._found) < self._by.most_findings and look.smallest <= self._by.level:
            better = self._improve(look)
            if better is None:
                break
            look = better
        return self._conclude(first, look)

    def _look(self, config: BehaviourConfig) -> _Look:
        """Simulate the model with every seed, and gather the evidence."""
        self._say(f"simulating with {len(self._seeds)} seeds")
        runs = self._simulations.run([(config, seed) for seed in self._seeds])
        measured, ids = self._case.measured, self._case.fitted
        comparison = compare_summaries(measured, runs, self._case.notes, _FAMILIES)
        evidence = comparison.evidence
        rows = np.array([self._index[column] for column in evidence.columns], int)
        directions = {name: slopes[rows] for name, slopes in self._directions.items()}
        return _Look(
            config,
            comparison,
            find_directions(evidence, directions, np.random.default_rng(2), self._by, _FAMILIES),
            gather_evidence(measured.of(ids), [run.of(ids) for run in runs], self._by),
        )

    @cached_property
    def _directions(self) -> dict[str, np.ndarray]:
        """Change of all columns with the parameters of each behaviour, from the model as given."""
        self._say("simulating what each behaviour changes")
        estimator = self._estimator(self._by.fitting.direction_seeds)
        return estimator.slopes_together(self._case.behaviour, self._case.measured.columns)

    @cached_property
    def _index(self) -> dict[SummaryColumn, int]:
        return {column: number for number, column in enumerate(self._case.measured.columns)}

    def _improve(self, look: _Look) -> _Look | None:
        """Add the behaviour that explains most and lets the held-out error fall; None where none does."""
        options = self._options(look)
        if not options:
            return None
        self._say(f"estimating the effect of {', '.join(behaviour.name for behaviour, _ in options)}")
        tries, promise = self._fit_best(look, options)
        self._ranking = self._ranking or self._rank(options, promise, tries, look)
        for attempt in tries:
            better = self._add(attempt, tries, look) if attempt.gain > 0 else None
            if better is not None:
                return better
            self._refused.add(attempt.behaviour.name)
        return self._improve(look)

    def _options(self, look: _Look) -> list[tuple[Behaviour, BehaviourConfig]]:
        """Behaviours whose columns differ significantly, with the configurations from which they are fitted."""
        taken = {finding.behaviour for finding in self._found} | self._refused
        signals = _signals(look.all)
        options = []
        for behaviour in BEHAVIOURS.values():
            if behaviour.name in taken or look.p_value(behaviour) > self._by.level:
                continue
            config = look.config if behaviour.propose is None else behaviour.propose(look.config, signals)
            if config is not None:
                values = behaviour.read(config, self._case.background)
                options.append((behaviour, behaviour.write(config, behaviour.clipped(values))))
        return options

    def _fit_best(
        self, look: _Look, options: Sequence[tuple[Behaviour, BehaviourConfig]]
    ) -> tuple[list[_Try], dict[str, float]]:
        """Fit the behaviours with the largest cross-fitted gains and those similar to the best; the best first."""
        estimator = self._estimator(self._by.fitting.slope_seeds)
        slopes: dict[str, np.ndarray] = {}
        folds: dict[str, np.ndarray] = {}
        for behaviour, config in options:
            slopes |= estimator.slopes(config, [behaviour])
            folds[behaviour.name] = estimator.gain(look.fitted, behaviour, slopes[behaviour.name], look.config, config)
        promise = {one.name: 2 * float(folds[one.name].sum()) - self._penalty(one) for one, _ in options}
        order = sorted(options, key=lambda option: -promise[option[0].name])
        least = self._by.fitting.nearly * promise[order[0][0].name]
        chosen = ([option for option in order if promise[option[0].name] > least] or order)[: self._by.fitting.tried]
        scored = np.array(
            [
                column.is_whole or any(option.shows(column.channel, column.condition) for option, _ in options)
                for column in look.fitted.columns
            ],
            bool,
        )

        def attempt(behaviour: Behaviour, config: BehaviourConfig) -> _Try:
            self._say(f"fitting {behaviour.name}")
            before = [BEHAVIOURS[finding.behaviour] for finding in self._found]
            known = slopes | (estimator.slopes(config, before) if before else {})
            fit = self._estimator(self._by.fitting.seeds).fit(config, [*before, behaviour], look.fitted, known, scored)
            gain = float((look.fitted.z[scored] ** 2).sum()) - fit.chi2 - self._penalty(behaviour)
            return _Try(behaviour, fit, gain, folds[behaviour.name])

        tries = [attempt(*option) for option in chosen]
        best = max(tries, key=lambda one: one.gain)
        rivals = [option for option in order if option not in chosen and best.is_confusable_with(option[0])]
        tries += [attempt(*option) for option in rivals if promise[option[0].name] > 0]
        return sorted(tries, key=lambda one: -one.gain), promise

    def _held_out_fall(self, before: _Look, after: _Look) -> Fall:
        ids = self._case.held_out
        return compare_scores(before.comparison.scores.of(ids), after.comparison.scores.of(ids))

    def _add(self, attempt: _Try, tries: Sequence[_Try], look: _Look) -> _Look | None:
        """Refine the parameters of a behaviour and those found before; add it if the held-out error falls."""
        name, behaviour = attempt.behaviour.name, attempt.behaviour
        fitted = self._look(attempt.fit.config)
        if not _is_accepted(behaviour, self._held_out_fall(look, fitted)):
            return None
        known = [BEHAVIOURS[finding.behaviour] for finding in self._found]
        fit = self._refine(fitted, attempt.fit, [*known, behaviour])
        after = self._look(fit.config)
        fall = self._held_out_fall(look, after)
        if not _is_accepted(behaviour, fall):
            return None
        self._say(f"adding {name}")
        similar = tuple(
            other.behaviour.name
            for other in tries
            if other is not attempt
            and is_rival(attempt.gain / 2, other.gain / 2, attempt.folds, other.folds)
            and after.p_value(other.behaviour) > self._by.level
        )
        streets = after.config.street_speed
        self._found.append(
            TrafficFinding(
                behaviour=name,
                params=fit.values[name],
                before=behaviour.read(look.config, self._case.background),
                ci95={},
                p_value=look.p_value(behaviour),
                error_before=fall.before,
                error_after=fall.after,
                also_possible=similar,
                shown_by=_shown_by(behaviour, self._case.measured, look, after),
                fall_ci95=fall.interval,
                worse=fall.worse,
                streets=streets.edges if behaviour.condition == "street" and streets else (),
            )
        )
        self._fit = fit
        return after

    def _conclude(self, first: _Look, last: _Look) -> TrafficDiagnosis:
        findings = list(self._found)
        if self._fit is not None:
            behaviours = [BEHAVIOURS[finding.behaviour] for finding in findings]
            ends = intervals(self._fit, behaviours, last.fitted.freedom, self._by.coverage)
            values = self._fit.values
            findings = [replace(one, params=values[one.behaviour], ci95=ends[one.behaviour]) for one in findings]
        before, after = first.comparison, last.comparison
        left = find_unexplained(after, last.behaviours, self._by.level)
        ambiguous = any(finding.also_possible for finding in findings)
        ids = self._case.held_out
        return TrafficDiagnosis(
            verdict="ambiguous" if ambiguous else "missing" if findings else "unknown" if left else "none",
            effects=tuple(findings),
            ranking=self._ranking,
            smallest_detectable={} if findings else self._smallest(last),
            before=before,
            after=after,
            error_before=before.scores.of(ids).error,
            error_after=after.scores.of(ids).error,
            noise_floor=noise_floor(after.runs, ids),
            config=self._config.model_copy(update={"behaviour": last.config}) if findings else self._config,
            unexplained=left,
            simulations=self._simulations.count,
        )

    def _refine(self, look: _Look, start: Fit, behaviours: Sequence[Behaviour]) -> Fit:
        """Linearise about a fit that was simulated with all seeds, and take further steps unless they are small."""
        self._say("refining the parameters")
        estimator = self._estimator(self._by.fitting.seeds)
        slopes = estimator.slopes(look.config, behaviours, self._by.fitting.near)
        fit = estimator.fit(look.config, behaviours, look.fitted, slopes, is_near=True)
        fresh = np.concatenate([slopes[behaviour.name] for behaviour in behaviours], 1)
        fit = estimator.with_covariance(replace(fit, slopes=fresh), behaviours, look.fitted)
        moved = [
            abs(fit.values[one.name][knob.name] - start.values[one.name][knob.name])
            for one in behaviours
            for knob in one.knobs
        ]
        if (np.array(moved) < self._by.fitting.small * np.sqrt(np.diag(fit.covariance))).all():
            return replace(fit, config=look.config, values=start.values)
        return fit

    def _smallest(self, last: _Look) -> dict[str, dict[str, float]]:
        """Change of each parameter that 80 % of recordings like this one would show."""
        rows = np.array([self._index[column] for column in last.all.columns], int)
        found: dict[str, dict[str, float]] = {}
        for name, slope in self._directions.items():
            ratio = (
                np.abs(slope[rows])
                / (last.all.sigma * (last.comparison.significance.critical + self._by.power))[:, None]
            )
            steepest = ratio.max(0, initial=0.0)
            found[name] = {
                knob.name: float(1 / value)
                for knob, value in zip(BEHAVIOURS[name].knobs, steepest.tolist(), strict=True)
                if value > 0
            }
        return found

    def _rank(
        self,
        options: Sequence[tuple[Behaviour, BehaviourConfig]],
        promise: Mapping[str, float],
        tries: Sequence[_Try],
        look: _Look,
    ) -> tuple[Candidate, ...]:
        fitted = {attempt.behaviour.name: attempt for attempt in tries}
        rows = []
        for behaviour, _ in options:
            done = fitted.get(behaviour.name)
            gain = done.gain if done else promise[behaviour.name]
            rows.append(Candidate(behaviour.name, gain, look.p_value(behaviour), done is not None))
        return tuple(sorted(rows, key=lambda row: (not row.fitted, -row.delta_bic)))

    def _estimator(self, seeds: int) -> Estimator:
        case = self._case
        return Estimator(
            self._simulations, case.fitted, case.background, self._seeds[:seeds], case.measured.columns, self._by
        )

    def _penalty(self, behaviour: Behaviour) -> float:
        return len(behaviour.knobs) * float(np.log(max(len(self._case.fitted), 2)))


def _is_accepted(behaviour: Behaviour, fall: Fall) -> bool:
    """Whether the held-out error falls by more than its standard error; of a rare act, whether it does not rise.

    The rule of one standard error prefers the simpler model unless the other is clearly better (Breiman et al. 1984).
    """
    return fall.interval[1] > 0 if behaviour.is_incident else fall.size > fall.error


def _signals(evidence: ChannelEvidence) -> list[Signal]:
    ratio = evidence.measured / np.where(np.abs(evidence.model) > 1e-9, evidence.model, 1e-9)
    return [
        Signal(column.channel, column.condition, column.level, z, share)
        for column, z, share in zip(evidence.columns, evidence.z.tolist(), ratio.tolist(), strict=True)
    ]


def _shown_by(
    behaviour: Behaviour, measured: Summary, before: _Look, after: _Look
) -> dict[str, tuple[float, float, float]]:
    values = measured.statistics()
    rows = {}
    for name in behaviour.statistics:
        first, last = (
            next((at for at, c in enumerate(look.all.columns) if c.is_whole and c.channel == name), None)
            for look in (before, after)
        )
        if first is not None and last is not None:
            rows[name] = (values[name], float(before.all.model[first]), float(after.all.model[last]))
    return rows
