"""Contracts of the diagnosis core on synthetic scores: calibration, projection, gains and either-or sets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from cosim.discrepancy.dictionary.shared_errors import shared_errors
from cosim.discrepancy.inference.projection import TRACK
from cosim.discrepancy.selection.gain import cross_fitted_gain, fold_sums, gain_difference
from cosim.discrepancy.selection.table import Entry, GroupTest, evaluate, score_groups, score_shared
from cosim.discrepancy.settings import Selection
from tests.hidden.statistics.checks import excess, lower_share, uniformity, upper_share
from tests.hidden.statistics.linearised import PRECISION, group_of, linearised
from tests.hidden.statistics.score_tables import (
    CHANNELS,
    COUNTS,
    MEANS,
    Beams,
    Scores,
    SparseMatrix,
    correlated_basis,
    draw_basis,
    draw_beams,
    draw_scores,
    quadratic_likelihood,
    track_effects,
)

_SETTINGS = Selection()
_NULLS, _FAMILIES, _SETS = 200, 400, 200
_BY = ("beam", "track", "azimuth", "scan")
_LEVEL = 1e-3  # at which a contract is broken: tests here are random


def _entries(rng: np.random.Generator, channels: tuple[str, ...], groups_each: int) -> list[Entry]:
    """Scores of groups of several channels without any effect."""
    beams = draw_beams(rng, 2500)
    scores = {name: draw_scores(rng, name, beams, track_error=name in MEANS) for name in channels}
    random = {name: track_effects(beams) for name in channels if name in MEANS}
    of = linearised(beams, scores, random)
    groups = [
        group_of(name, f"{by}{number}", draw_basis(rng, beams, int(rng.integers(2, 9)), by))
        for name in channels
        for number in range(groups_each)
        for by in (_BY[int(rng.integers(4))],)
    ]
    return score_groups(of, groups, of.projector(_SETTINGS.sectors), _SETTINGS)


@pytest.mark.slow
@pytest.mark.parametrize("channel", CHANNELS)
def test_p_values_of_nulls_are_not_too_small(channel: str) -> None:
    """The larger p of two clusterings is at least uniform; with one clustering it is uniform."""
    both, single = [], []
    for seed in range(_NULLS):
        rng = np.random.default_rng([seed, 1, CHANNELS.index(channel)])
        entries = _entries(rng, (channel,), 1)
        if not entries:
            continue
        both.append(evaluate(entries, _SETTINGS, rng)[0].p_value)
        one = [replace(entry, group=replace(entry.group, is_clustered_by_scan=False)) for entry in entries]
        single.append(evaluate(one, _SETTINGS, rng)[0].p_value)
    print(f"{channel}: KS p {uniformity(single):.3f}; share at 5 %: {np.mean(np.array(both) <= 0.05):.3f}")
    assert len(both) > 0.9 * _NULLS
    for level in (0.01, 0.05, 0.2):
        assert excess(both, level) > _LEVEL
    if channel not in COUNTS:  # counts of few events have few p-values
        assert uniformity(single) > _LEVEL


@pytest.mark.slow
@pytest.mark.parametrize("channel", [*MEANS, "drop"])
@pytest.mark.parametrize("unit", ["firing", "packet", "sector"])
def test_p_values_of_shared_errors_are_not_too_small(channel: str, unit: str) -> None:
    p_values = []
    for seed in range(_NULLS):
        rng = np.random.default_rng([seed, 6, CHANNELS.index(channel)])
        beams = draw_beams(rng, 2500)
        of = linearised(beams, {channel: draw_scores(rng, channel, beams)})
        shared = [one for one in shared_errors(of) if one.group.covariates == (unit,)]
        entries = score_shared(of, shared, [], of.projector(_SETTINGS.sectors).clusters, _SETTINGS.folds)
        p_values += [result.p_value for result in evaluate(entries, _SETTINGS, rng)]
    print(f"shared {channel} by {unit}: share at 5 %: {np.mean(np.array(p_values) <= 0.05):.3f}")
    assert len(p_values) > 0.9 * _NULLS
    for level in (0.01, 0.05, 0.2):
        assert excess(p_values, level) > _LEVEL


@pytest.mark.slow
@pytest.mark.parametrize("channel", COUNTS[:1])
def test_twice_as_many_events_are_noticed(channel: str) -> None:
    """Sixty events where thirty are expected, although one cluster may hold half of them and counts little more."""
    noticed = 0
    for seed in range(20):
        rng = np.random.default_rng([seed, 7])
        beams = draw_beams(rng, 30_000)
        basis = draw_basis(rng, beams, 4, "beam")
        scores = draw_scores(rng, channel, beams, basis @ np.array([1.0, 0.0, 0.0, 0.0]))
        of = linearised(beams, {channel: scores})
        entries = score_groups(of, [group_of(channel, "bin", basis)], of.projector(_SETTINGS.sectors), _SETTINGS)
        noticed += evaluate(entries, _SETTINGS, rng)[0].p_value <= 0.05
    assert noticed >= 12


@pytest.mark.slow
def test_family_wise_error_is_at_most_six_percent_at_five() -> None:
    smallest = []
    for seed in range(_FAMILIES):
        rng = np.random.default_rng([seed, 2])
        entries = _entries(rng, CHANNELS, 6)
        smallest.append(min(result.p_value for result in evaluate(entries, _SETTINGS, rng)))
    share, low = upper_share(int((np.array(smallest) <= 0.05).sum()), _FAMILIES)
    print(f"family-wise error {share:.3f}, at least {low:.3f}")
    assert low <= 0.06


@pytest.mark.parametrize("channel", MEANS)
def test_efficient_scores_and_gram_matrices_are_derivatives_of_the_profiled_likelihood(channel: str) -> None:
    rng = np.random.default_rng(5)
    beams = draw_beams(rng, 600, tracks=30)
    beams = beams.sampled(np.arange(600), 1.7)
    scores, z = draw_scores(rng, channel, beams, track_error=True), track_effects(beams)
    fitted = rng.normal(0, 0.1, z.shape[1])
    of = linearised(beams, {channel: scores}, {channel: z}, fitted)
    basis = draw_basis(rng, beams, 4, "azimuth")
    projected = of.projector(6).project({channel: basis})  # type: ignore[dict-item]
    x, precision, step = basis.toarray(), np.full(z.shape[1], PRECISION), 1e-3

    def value(theta: np.ndarray) -> float:
        return quadratic_likelihood(scores, x, theta, z.toarray(), precision, fitted)

    ways = step * np.eye(4)
    slope = [(value(way) - value(-way)) / (2 * step) for way in ways]
    curvature = [
        [(value(a + b) - value(a - b) - value(b - a) + value(-a - b)) / (4 * step**2) for b in ways] for a in ways
    ]
    for table in projected.tables:
        np.testing.assert_allclose(table.sum(0), slope, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(projected.information, -np.array(curvature), rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("rounding", [0.0, 3e-4])
@pytest.mark.parametrize("mean", [0.0, 0.5])
def test_a_mean_that_random_effects_absorbed_is_detected_despite_rounded_derivatives(
    mean: float, rounding: float
) -> None:
    rng = np.random.default_rng(8)
    beams = draw_beams(rng, 20_000, tracks=30)
    scores, z = draw_scores(rng, "range", beams, track_error=False), track_effects(beams)
    scores = replace(scores, information=1e4 * scores.information)
    fitted = rng.normal(mean, 0.05, z.shape[1])
    fitted *= np.sqrt(z.shape[1] / PRECISION / (fitted @ fitted))  # as large as their variance says
    count = np.asarray(z.sum(0)).ravel()
    scores = replace(scores, score=z @ (PRECISION * fitted / count))  # random effects are at their optimum
    of = linearised(beams, {"range": scores}, {"range": z}, fitted)
    column = sparse.csr_matrix((1 + rounding * rng.normal(size=len(beams)))[:, None])
    entry = score_groups(of, [group_of("range", "constant", column)], of.projector(6), _SETTINGS)[0]
    assert entry.coefficients[0] == pytest.approx(fitted.mean(), rel=0.03, abs=fitted.std() / np.sqrt(len(fitted)))
    gain = evaluate([entry], _SETTINGS, rng)[0].gain
    assert gain > 20 if mean else gain < 3


@pytest.mark.parametrize("channel", CHANNELS)
def test_gains_do_not_depend_on_the_number_of_sampled_beams(channel: str) -> None:
    """A share of the beams with more weight gains as much on average, up to the scatter of what was drawn."""
    gains: dict[int, list[float]] = {1: [], 2: [], 4: []}
    for seed in range(10):
        beams, basis, scores, _ = _strong(channel, seed)
        rng = np.random.default_rng(seed)
        for weight, found in gains.items():
            rows = np.flatnonzero(rng.random(len(beams)) < 1 / weight)
            part = Scores(scores.score[rows] * weight, scores.information[rows] * weight)
            found.append(_gain(channel, beams.sampled(rows, weight), basis[rows].tocsr(), part, seed))
    means = {weight: np.mean(values) for weight, values in gains.items()}
    errors = {weight: np.std(values, ddof=1) / np.sqrt(len(values)) for weight, values in gains.items()}
    print(channel, {weight: f"{means[weight]:.1f} ± {errors[weight]:.1f}" for weight in gains})
    for weight in (2, 4):
        assert abs(means[weight] - means[1]) < 4 * np.hypot(errors[weight], errors[1]) + 0.05 * means[1]


@pytest.mark.parametrize("channel", MEANS)
def test_the_gain_of_a_strong_effect_is_what_it_adds_to_the_likelihood(channel: str) -> None:
    """½ θᵀHθ, whatever the sizes of the clusters: a cross-fitted gain loses about one unit per column."""
    found, expected = [], []
    for seed in range(10):
        beams, basis, scores, effect = _strong(channel, seed)
        found.append(_gain(channel, beams, basis, scores, seed))
        expected.append(0.5 * float(scores.information @ effect**2))
    print(f"{channel}: gain {np.mean(found):.1f}, in truth {np.mean(expected):.1f}")
    assert np.mean(found) == pytest.approx(np.mean(expected), rel=0.1)


def _strong(channel: str, seed: int) -> tuple[Beams, SparseMatrix, Scores, np.ndarray]:
    """Beams, bins of a covariate, scores with a strong effect in one bin, and that effect (n,)."""
    rng = np.random.default_rng([seed, 3, CHANNELS.index(channel)])
    size = {"range": 0.3, "intensity": 0.3, "drop": 0.05}.get(channel, 3.0 if channel in COUNTS else 0.2)
    beams = draw_beams(rng, 20_000)
    basis = draw_basis(rng, beams, 4, "beam")
    effect = basis @ np.array([size, 0.0, 0.0, 0.0])
    return beams, basis, draw_scores(rng, channel, beams, effect), effect


def _gain(channel: str, beams: Beams, basis: SparseMatrix, scores: Scores, seed: int) -> float:
    """Cross-fitted gain of one group, in log-likelihood of the weighted beams."""
    of = linearised(beams, {channel: scores})
    entry = score_groups(of, [group_of(channel, "beam", basis)], of.projector(_SETTINGS.sectors), _SETTINGS)[0]
    fold = np.random.default_rng(seed).permutation(len(entry.tables[TRACK])) % _SETTINGS.folds
    sums, known = (
        fold_sums(tables[TRACK], fold, _SETTINGS.folds) for tables in (entry.tables, entry.cluster_information)
    )
    if entry.cell.fold_gains:
        return float(entry.cell.fold_gains[TRACK].sum())
    return float(cross_fitted_gain(sums, known, replace(entry.cell, dispersion=1.0)).sum())


@pytest.mark.slow
def test_either_or_sets_hold_the_truth() -> None:
    """The chosen group and all whose gain is within two standard errors, among covariates that nearly agree."""
    held = 0
    for seed in range(_SETS):
        rng = np.random.default_rng([seed, 4])
        beams = draw_beams(rng, 4000)
        true = draw_basis(rng, beams, 5, "beam")
        rivals = [correlated_basis(rng, true, kept) for kept in rng.uniform(0.5, 0.97, 4)]
        effect = true @ rng.normal(0, 0.12, 5)
        of = linearised(beams, {"range": draw_scores(rng, "range", beams, effect)})
        groups = [group_of("range", f"covariate{number}", basis) for number, basis in enumerate((true, *rivals))]
        results = evaluate(score_groups(of, groups, of.projector(6), _SETTINGS), _SETTINGS, rng)
        held += any(result.group.name == "range by covariate0" for result in _either_or(results))
    share, high = lower_share(held, _SETS)
    print(f"sets that hold the truth: {share:.3f}, at most {high:.3f}")
    assert high >= 0.95


def _either_or(results: list[GroupTest]) -> list[GroupTest]:
    """The first result, and the others whose gain is within two standard errors of it."""
    first = results[0]
    gaps = [gain_difference(first.fold_gains, other.fold_gains) for other in results[1:]]
    near = [other for other, (gap, error) in zip(results[1:], gaps, strict=True) if gap <= 2 * error]
    return [first, *near]
