"""Fits behaviours by simulation: Gauss–Newton with common random numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from cosim.driver_discrepancy.behaviours import BEHAVIOURS, TOGETHER, Background, Behaviour, Knob
from cosim.driver_discrepancy.evidence import ChannelEvidence, cross_fitted_gain
from cosim.driver_discrepancy.pool import Simulations
from cosim.driver_discrepancy.settings import TrafficSettings
from cosim.driver_discrepancy.summary import SummaryColumn
from cosim.traffic.behaviour import BehaviourConfig

Values = dict[str, dict[str, float]]


@dataclass(frozen=True, eq=False)
class Fit:
    """Behaviours fitted.

    Attributes:
        config: with them.
        values: behaviour → parameter → value.
        chi2: sum of squared standardised differences of the columns that are scored.
        slopes: (c, parameters) of all columns; zero for those without evidence.
        covariance: (parameters, parameters).
    """

    config: BehaviourConfig
    values: Values
    chi2: float
    slopes: np.ndarray
    covariance: np.ndarray


class Estimator:
    """Fits against the statistics of some vehicles.

    Args:
        simulations: of the model.
        ids: vehicles that are fitted.
        background: what configurations leave to the town.
        seeds: of the simulations of a fit.
        columns: of all tables.
        by: numbers that decide.
    """

    def __init__(
        self,
        simulations: Simulations,
        ids: frozenset[str],
        background: Background,
        seeds: Sequence[int],
        columns: Sequence[SummaryColumn],
        by: TrafficSettings,
    ) -> None:
        self._simulations = simulations
        self._ids = ids
        self._background = background
        self._seeds = tuple(seeds)
        self._columns = tuple(columns)
        self._by = by

    def slopes(
        self, config: BehaviourConfig, behaviours: Sequence[Behaviour], share: float = 1.0
    ) -> dict[str, np.ndarray]:
        """Change of all columns (c, parameters) with each behaviour's parameters, from the configuration on.

        Args:
            config: about which.
            behaviours: whose parameters.
            share: of a parameter's step.
        """
        jobs, steps = [], []
        for behaviour in behaviours:
            values = behaviour.read(config, self._background)
            for knob in behaviour.knobs:
                changed = _changed(behaviour, knob.name, values, share)
                steps.append(changed[knob.name] - values[knob.name])
                jobs.append(behaviour.write(config, changed))
        found = self._many([config, *jobs])
        columns = [(row - found[0]) / step for row, step in zip(found[1:], steps, strict=True)]
        sloped, at = {}, 0
        for behaviour in behaviours:
            sloped[behaviour.name] = np.nan_to_num(np.stack(columns[at : at + len(behaviour.knobs)], 1))
            at += len(behaviour.knobs)
        return sloped

    def slopes_together(self, config: BehaviourConfig, channels: Sequence[SummaryColumn]) -> dict[str, np.ndarray]:
        """Change of the columns that show each behaviour with its parameters; several are changed at a time."""
        jobs, steps = [config], {}
        for group in TOGETHER:
            changed = config
            for name, knob in group:
                behaviour = BEHAVIOURS[name]
                values = behaviour.read(changed, self._background)
                new = _changed(behaviour, knob, values)
                steps[name, knob] = (len(jobs), new[knob] - values[knob])
                changed = behaviour.write(changed, new)
            jobs.append(changed)
        found = self._many(jobs)
        sloped = {}
        for name in dict(key for key in steps):
            behaviour = BEHAVIOURS[name]
            rows = np.array([behaviour.shows(column.channel, column.condition) for column in channels])
            columns = [
                (found[job] - found[0]) / step for job, step in (steps[name, knob.name] for knob in behaviour.knobs)
            ]
            sloped[name] = np.nan_to_num(np.stack(columns, 1)) * rows[:, None]
        return sloped

    def gain(
        self,
        evidence: ChannelEvidence,
        behaviour: Behaviour,
        slopes: np.ndarray,
        config: BehaviourConfig,
        start: BehaviourConfig,
    ) -> np.ndarray:
        """Cross-fitted gain (folds,) that a behaviour's slopes promise in its own columns.

        Args:
            evidence: against the model.
            behaviour: whose parameters.
            slopes: (c, parameters) change of all columns with them.
            config: the model.
            start: about which the slopes were taken.
        """
        columns = np.array([behaviour.shows(one.channel, one.condition) for one in evidence.columns], bool)
        limits = np.array([knob.high - knob.low for knob in behaviour.knobs])
        rows = self._rows(evidence)
        model, begin = self._many([config, start])[:, rows]
        return cross_fitted_gain(evidence, columns, slopes[rows], limits, np.nan_to_num(begin - model))

    def fit(
        self,
        config: BehaviourConfig,
        behaviours: Sequence[Behaviour],
        evidence: ChannelEvidence,
        slopes: Mapping[str, np.ndarray],
        scored: np.ndarray | None = None,
        is_near: bool = False,
    ) -> Fit:
        """Fit all parameters of some behaviours together to the columns that show them.

        The slopes are corrected by what each simulation shows (Broyden, Math. Comp. 1965), so that a step costs one.

        Args:
            config: initial configuration of the fit.
            behaviours: whose parameters are fitted.
            evidence: against which the parameters are fitted.
            slopes: behaviour → change of all columns with its parameters.
            scored: (k,) columns over which chi² is summed; by default all.
            is_near: the evidence is that against the initial configuration, and the fit is a small change of it. The
                fit's few seeds then show only the change from there (control variates: Lavenberg and Welch 1981).
        """
        knobs = [(behaviour, knob) for behaviour in behaviours for knob in behaviour.knobs]
        start = {one.name: one.read(config, self._background) for one in behaviours}
        at = np.array([start[behaviour.name][knob.name] for behaviour, knob in knobs])
        plain = [knob for _, knob in knobs]
        rows = self._rows(evidence)
        jacobian = np.concatenate([slopes[one.name] for one in behaviours], 1)[rows] / evidence.sigma[:, None]
        own = np.array([any(one.shows(c.channel, c.condition) for one in behaviours) for c in evidence.columns])
        jacobian *= own[:, None]
        at = self._feasible(config, behaviours, at)
        whole = np.ones(len(evidence.columns), bool) if scored is None else scored
        rest = self._rest(config, behaviours, at, evidence)
        offset = np.nan_to_num(evidence.z) - rest if is_near else np.zeros(len(rest))
        rest = rest + offset
        for _ in range(self._by.fitting.rounds):
            step = self._feasible(config, behaviours, at + self._solve(jacobian, rest, plain)) - at
            foreseen = rest - jacobian @ step
            if own @ rest**2 - own @ foreseen**2 < self._by.fitting.enough:
                break
            new = self._rest(config, behaviours, at + step, evidence) + offset
            secant = np.outer(rest - new - jacobian @ step, step) / max(float(step @ step), 1e-12)
            jacobian += secant * own[:, None]
            if own @ new**2 < own @ rest**2:
                at, rest = at + step, new
            if own @ rest**2 < self._by.fitting.luck * own.sum():
                break
        values = _by_name(behaviours, at)
        full = np.zeros((len(self._columns), len(knobs)))
        full[rows] = jacobian * evidence.sigma[:, None]
        return Fit(
            config=_written(config, behaviours, values),
            values=values,
            chi2=float(rest[whole] @ rest[whole]),
            slopes=full,
            covariance=self._covariance(jacobian, plain),
        )

    def with_covariance(self, fit: Fit, behaviours: Sequence[Behaviour], evidence: ChannelEvidence) -> Fit:
        """Return the estimate with the covariance of its slopes, over the columns that show the behaviours."""
        knobs = [knob for behaviour in behaviours for knob in behaviour.knobs]
        return replace(fit, covariance=self._covariance(self._own_jacobian(fit, behaviours, evidence), knobs))

    def _own_jacobian(self, fit: Fit, behaviours: Sequence[Behaviour], evidence: ChannelEvidence) -> np.ndarray:
        own = np.array([any(one.shows(c.channel, c.condition) for one in behaviours) for c in evidence.columns])
        return fit.slopes[self._rows(evidence)] / evidence.sigma[:, None] * own[:, None]

    def _feasible(self, config: BehaviourConfig, behaviours: Sequence[Behaviour], at: np.ndarray) -> np.ndarray:
        """Parameters clipped to the bounds of the configuration, individually and jointly."""
        written = _written(config, behaviours, _by_name(behaviours, at))
        read = [one.read(written, self._background) for one in behaviours]
        return np.array([values[knob.name] for one, values in zip(behaviours, read, strict=True) for knob in one.knobs])

    def _rest(
        self, config: BehaviourConfig, behaviours: Sequence[Behaviour], at: np.ndarray, evidence: ChannelEvidence
    ) -> np.ndarray:
        written = _written(config, behaviours, _by_name(behaviours, at))
        found = self._many([written])[0][self._rows(evidence)]
        return np.nan_to_num((evidence.measured - found) / evidence.sigma)

    def _rows(self, evidence: ChannelEvidence) -> np.ndarray:
        """Indices of the evidence's columns."""
        at = {column: number for number, column in enumerate(self._columns)}
        return np.array([at[column] for column in evidence.columns], int)

    def _many(self, configs: Sequence[BehaviourConfig]) -> np.ndarray:
        """Means of all columns (configurations, c), each over the seeds."""
        runs = self._simulations.run([(config, seed) for config in configs for seed in self._seeds])
        rows = np.array([run.of(self._ids).ratios() for run in runs])
        return rows.reshape(len(configs), len(self._seeds), -1).mean(1)

    def _covariance(self, jacobian: np.ndarray, knobs: Sequence[Knob]) -> np.ndarray:
        """Covariance of parameters; weak priors fix what the data do not determine."""
        weak = np.array([1 / (self._by.fitting.weak_steps * knob.step) ** 2 for knob in knobs])
        return np.linalg.inv(jacobian.T @ jacobian + np.diag(weak))

    def _solve(self, jacobian: np.ndarray, rest: np.ndarray, knobs: Sequence[Knob]) -> np.ndarray:
        return self._covariance(jacobian, knobs) @ (jacobian.T @ rest)


def intervals(
    fit: Fit, behaviours: Sequence[Behaviour], freedom: float, coverage: float
) -> dict[str, dict[str, list[float]]]:
    """Intervals of all parameters, within their bounds, that hold them with the probability `coverage`."""
    half = float(stats.t.ppf((1 + coverage) / 2, freedom)) * np.sqrt(np.diag(fit.covariance))
    found: dict[str, dict[str, list[float]]] = {}
    knobs = [(behaviour, knob) for behaviour in behaviours for knob in behaviour.knobs]
    for (behaviour, knob), side in zip(knobs, half.tolist(), strict=True):
        value = fit.values[behaviour.name][knob.name]
        ends = [max(value - side, knob.low), min(value + side, knob.high)]
        found.setdefault(behaviour.name, {})[knob.name] = ends
    return found


def _changed(behaviour: Behaviour, name: str, values: Mapping[str, float], share: float = 1.0) -> dict[str, float]:
    """Values with one changed by its step, or the other way where a bound is near."""
    knob = next(one for one in behaviour.knobs if one.name == name)
    changed = behaviour.clipped({**values, name: values[name] + share * knob.step})
    if abs(changed[name] - values[name]) < abs(share * knob.step) / 3:
        changed = behaviour.clipped({**values, name: values[name] - share * knob.step})
    return changed


def _by_name(behaviours: Sequence[Behaviour], at: np.ndarray) -> Values:
    values, row = {}, 0
    for behaviour in behaviours:
        own = {knob.name: float(at[row + i]) for i, knob in enumerate(behaviour.knobs)}
        values[behaviour.name] = behaviour.clipped(own)
        row += len(behaviour.knobs)
    return values


def _written(config: BehaviourConfig, behaviours: Sequence[Behaviour], values: Values) -> BehaviourConfig:
    for behaviour in behaviours:
        config = behaviour.write(config, values[behaviour.name])
    return config
