"""Evidence: a table of standardised differences, clusters × columns, and what follows from it.

Clusters are vehicles: each is compared with itself in the simulations of the same demand. Columns are channels under
conditions. The functions know neither channels nor behaviours: a table, groups of its columns, and directions in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from cosim.discrepancy.selection.calibration import min_p, random_signs
from cosim.discrepancy.selection.gain import fold_sums, folds_of_clusters
from cosim.driver_discrepancy.channels import CHANNELS
from cosim.driver_discrepancy.settings import DEFAULT, TrafficSettings
from cosim.driver_discrepancy.summary import Summary, SummaryColumn


@dataclass(frozen=True, eq=False)
class ChannelEvidence:
    """Measured against modelled, for the k columns that both show.

    Attributes:
        columns: of the table.
        measured, model: (k,) means; the model's is over seeds.
        sigma: (k,) standard deviation of their difference if the model is right.
        freedom: degrees of freedom of sigma.
        clusters: (v, k) standardised difference of each vehicle; columns sum to about `z`.
    """

    columns: tuple[SummaryColumn, ...]
    measured: np.ndarray
    model: np.ndarray
    sigma: np.ndarray
    freedom: float
    clusters: np.ndarray

    @property
    def z(self) -> np.ndarray:
        """Standardised differences (k,), measured less modelled."""
        return (self.measured - self.model) / self.sigma

    @property
    def correlation(self) -> np.ndarray:
        """Correlations of the columns (k, k), from the vehicles' differences and shrunk towards none."""
        size = np.sqrt(np.maximum((self.clusters**2).sum(0), 1e-12))
        scaled = self.clusters / size
        return 0.5 * scaled.T @ scaled + 0.5 * np.eye(len(self.columns))


@dataclass(frozen=True, eq=False)
class Significance:
    """Family-wise p-values.

    Attributes:
        p_values: (k,) of each column: the chance that any column of the dictionary would differ so much.
        critical: (k,) |z| that chance exceeds in any column of its family at the family's share of the level.
    """

    p_values: np.ndarray
    critical: np.ndarray

    @property
    def smallest(self) -> float:
        """The smallest p-value; 1 without columns."""
        return float(self.p_values.min()) if len(self.p_values) else 1.0


def gather_evidence(measured: Summary, runs: Sequence[Summary], by: TrafficSettings = DEFAULT) -> ChannelEvidence:
    """Compare a measurement with the model's seeds, column by column.

    The variance of a difference is pooled from that between seeds and that between the paired differences of vehicles;
    a small difference that is the simulator's own is added. The variance of numbers of events is at least Poisson's.
    """
    columns = measured.columns
    ids = measured.ids
    own_sums, own_weights = measured.rows(ids)
    sums, weights = (np.stack(parts) for parts in zip(*(run.rows(ids) for run in runs), strict=True))
    total, totals = own_weights.sum(0), weights.sum(1)
    shown = _shown(columns, own_sums, own_weights, sums, weights, by)
    at = np.flatnonzero(shown)
    value = own_sums.sum(0)[at] / total[at]
    values = sums.sum(1)[:, at] / totals[:, at]
    mean, count = values.mean(0), len(runs)
    own = (own_sums[:, at] - mean * own_weights[:, at]) / total[at]
    single = (sums[:, :, at] - mean * weights[:, :, at]) / totals[:, None, at]
    model = single.mean(0)
    differences = own - model
    between = values.var(0, ddof=1) if count > 1 else np.zeros(len(at))
    channels = [CHANNELS[columns[number].channel] for number in at.tolist()]
    events = np.array([channel.is_event for channel in channels], bool)
    vehicles = (differences**2).sum(0)
    # Few vehicles act, and their squares would limit the difference: its variance is that of all recordings.
    acts = np.array([channel.is_act for channel in channels], bool)
    simulated = ((single - model) ** 2).sum((0, 1)) * (count / max(count - 1, 1))
    vehicles = np.where(acts, (vehicles + simulated) / (1 + count), vehicles)
    freedom = by.gate.vehicle_freedom
    pooled = (freedom * vehicles + (count - 1) * between) / (freedom + count - 1)
    expected = np.maximum((own_sums.sum(0)[at] + sums.sum((0, 1))[at]) / (1 + count), 1.0)
    variance = np.maximum(pooled, np.where(events, expected / total[at] ** 2, 0.0)) * (1 + 1 / count)
    floor = np.array([channel.resolution for channel in channels])
    sigma = np.sqrt(variance + floor**2 + 1e-18)
    return ChannelEvidence(
        columns=tuple(columns[number] for number in at.tolist()),
        measured=value,
        model=mean,
        sigma=sigma,
        freedom=freedom + count - 1,
        clusters=differences / sigma,
    )


def find_significance(
    evidence: ChannelEvidence, rng: np.random.Generator, by: TrafficSettings = DEFAULT, families: int = 2
) -> Significance:
    """Family-wise p-values of all columns by flipping the signs of clusters.

    Whole channels and channels under conditions are two families, which share the level with others.

    Args:
        evidence: the table.
        rng: of the flips.
        by: numbers that decide.
        families: among which the level is divided in equal parts.
    """
    columns = len(evidence.columns)
    if not columns:
        return Significance(np.zeros(0), np.zeros(0))
    drawn = _draw_null(evidence, rng, by)
    p_values, critical = np.ones(columns), np.full(columns, np.inf)
    whole = np.array([column.is_whole for column in evidence.columns], bool)
    for family in (whole, ~whole):
        if not family.any():
            continue
        statistics = np.concatenate([evidence.z[None, family], drawn[:, family]]) ** 2
        p_values[family] = np.minimum(families * np.nan_to_num(min_p(statistics), nan=1.0), 1.0)
        critical[family] = np.quantile(np.sqrt(statistics[1:].max(1)), 1 - by.level / families)
    return Significance(p_values, critical)


def find_directions(
    evidence: ChannelEvidence,
    directions: Mapping[str, np.ndarray],
    rng: np.random.Generator,
    by: TrafficSettings = DEFAULT,
    families: int = 3,
) -> dict[str, float]:
    """Family-wise p-values of directions: several small differences that one behaviour makes are clear together.

    Two statistics of each direction are among the hypotheses: the score statistic sᵀH⁻¹s with s = JᵀC⁻¹z and
    H = JᵀC⁻¹J (Rao 1948), and zᵀC⁻¹z of the same columns, for slopes that a few simulations show badly. Their
    reference are the same with the signs of clusters flipped.

    Args:
        evidence: the table.
        directions: name → (k, parameters) change of columns; zero in columns that do not show it.
        rng: of the flips.
        by: numbers that decide.
        families: among which the level is divided in equal parts.
    """
    found = dict.fromkeys(directions, 1.0)
    statistics: dict[str, list[np.ndarray]] = {}
    z = np.concatenate([evidence.z[None], _draw_null(evidence, rng, by)])
    for name, slopes in directions.items():
        jacobian = slopes / evidence.sigma[:, None]
        at = np.flatnonzero(np.abs(jacobian).max(1, initial=0.0) > 0)
        jacobian = jacobian[at][:, np.abs(jacobian[at]).max(0, initial=0.0) > 0]
        if jacobian.size:
            precision = np.linalg.inv(evidence.correlation[np.ix_(at, at)])
            information = jacobian.T @ precision @ jacobian
            inverse = np.linalg.inv(information + 1e-6 * np.diag(np.diag(information)))
            along = precision @ jacobian @ inverse @ jacobian.T @ precision
            statistics[name] = [np.einsum("ni,ij,nj->n", z[:, at], form, z[:, at]) for form in (along, precision)]
    if statistics:
        p_values = (
            np.nan_to_num(min_p(np.stack([value for pair in statistics.values() for value in pair], 1)), nan=1.0)
            .reshape(-1, 2)
            .min(1)
        )
        found |= dict(zip(statistics, np.minimum(families * p_values, 1.0).tolist(), strict=True))
    return found


def _draw_null(evidence: ChannelEvidence, rng: np.random.Generator, by: TrafficSettings) -> np.ndarray:
    """Standardised differences (draws, k) by chance.

    Signs of whole vehicles are flipped, which keeps the correlations of columns; a share of independent draws and
    Student's tails are added.
    """
    columns, draws = len(evidence.columns), by.gate.draws
    size = np.sqrt(np.maximum((evidence.clusters**2).sum(0), 1e-12))
    signs = random_signs(len(evidence.clusters), draws, rng)[1:]
    drawn = np.sqrt(by.gate.correlated) * (signs @ (evidence.clusters / size))
    drawn += np.sqrt(1 - by.gate.correlated) * rng.standard_normal((draws, columns))
    return drawn / np.sqrt(rng.chisquare(evidence.freedom, (draws, 1)) / evidence.freedom)


def departures(evidence: ChannelEvidence, whole: int, parts: np.ndarray) -> np.ndarray:
    """Two-sided p-values (m,) that channels under conditions differ as the whole channel does, Bonferroni-corrected.

    A difference that is the same everywhere is clearer in one part or another by chance.

    Args:
        evidence: the table.
        whole: index of the whole channel.
        parts: (m,) indices of the same channel under conditions.
    """
    difference = evidence.measured - evidence.model
    clusters = evidence.clusters * evidence.sigma
    floor = CHANNELS[evidence.columns[whole].channel].resolution
    spread = np.sqrt(((clusters[:, parts] - clusters[:, [whole]]) ** 2).sum(0) + floor**2)
    ratio = np.abs(difference[parts] - difference[whole]) / np.maximum(spread, 1e-12)
    return np.minimum(2 * stats.t.sf(ratio, evidence.freedom) * len(parts), 1.0)


def cross_fitted_gain(
    evidence: ChannelEvidence,
    columns: np.ndarray,
    slopes: np.ndarray,
    limits: np.ndarray,
    shift: np.ndarray,
    folds: int = 5,
) -> np.ndarray:
    """Gain (folds,) of a direction on each fold of vehicles, fitted to the others.

    θ₋ₖᵀsₖ − ½ θ₋ₖᵀHₖθ₋ₖ with the score s = JᵀC⁻¹z and the information H = JᵀC⁻¹J of a fold k.

    Args:
        evidence: the table.
        columns: (k,) which take part.
        slopes: (k, parameters) change of columns with parameters.
        limits: (parameters,) by which a parameter is expected to change at most.
        shift: (k,) change of columns from the model to the point about which the slopes were taken.
        folds: of vehicles.
    """
    at = np.flatnonzero(columns)
    if not len(at):
        return np.zeros(folds)
    jacobian = slopes[at] / evidence.sigma[at, None]
    precision = np.linalg.inv(evidence.correlation[np.ix_(at, at)])
    weighted = jacobian.T @ precision
    information = weighted @ jacobian
    fold = folds_of_clusters(len(evidence.clusters), folds, 0)
    z = evidence.z[at] - shift[at] / evidence.sigma[at]
    share = fold_sums(evidence.clusters[:, at], fold, folds)
    share += (z - share.sum(0)) / folds
    before = evidence.z[at] @ precision @ evidence.z[at] - z @ precision @ z
    gains = np.full(folds, 0.5 * float(before) / folds)
    for k in range(folds):
        theta = np.linalg.solve(information * (folds - 1) / folds + np.diag(1 / limits**2), weighted @ (z - share[k]))
        theta = np.clip(theta, -limits, limits)
        gains[k] += float(theta @ weighted @ share[k] - 0.5 * theta @ information @ theta / folds)
    return gains


def _shown(
    columns: Sequence[SummaryColumn],
    own_sums: np.ndarray,
    own_weights: np.ndarray,
    sums: np.ndarray,
    weights: np.ndarray,
    by: TrafficSettings,
) -> np.ndarray:
    """Columns (c,) that enough vehicles show, measured and in every simulation."""
    events = np.array([CHANNELS[column.channel].is_event for column in columns], bool)
    whole = np.array([column.is_whole for column in columns], bool)
    fewest = np.where(whole, by.gate.fewest, by.gate.fewest_of_conditions)
    exposed = (own_weights > 0).sum(0) >= fewest
    exposed &= ((weights > 0).sum(1) >= fewest).all(0)
    happened = own_sums.sum(0) + sums.sum(1).mean(0) >= np.where(whole, 1.0, 4.0)
    return exposed & (~events | happened)
