"""Tables of differences: silent without a difference, clear with one; the score is proper."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.driver_discrepancy.comparison import compare_summaries
from cosim.driver_discrepancy.evidence import (
    cross_fitted_gain,
    departures,
    find_directions,
    find_significance,
    gather_evidence,
)
from cosim.driver_discrepancy.scores import compare_scores, find_excess, noise_floor, noise_floors, score_vehicles
from cosim.driver_discrepancy.summary import Summary, SummaryColumn
from cosim.driver_discrepancy.unexplained import find_unexplained

CHANNELS = ("speed", "acceleration", "headway", "lane_changes_other")
COLUMNS = (*(SummaryColumn(name) for name in CHANNELS), *(SummaryColumn("speed", "street", f"s{k}") for k in range(6)))


def summary(rng: np.random.Generator, shift: dict[int, float], count: int = 60) -> Summary:
    """Vehicles with equal exposure whose values are normal about 1, shifted in some columns."""
    mean = np.ones(len(COLUMNS))
    for column, by in shift.items():
        mean[column] += by
    values = mean + 0.1 * rng.standard_normal((count, len(COLUMNS)))
    ids = tuple(f"v{k:02d}" for k in range(count))
    nothing = np.zeros((0, 3))
    return Summary(ids, COLUMNS, values, np.ones_like(values), {}, nothing[:, :2], nothing, 90.0)


def drawn(seed: int, shift: dict[int, float]) -> tuple[Summary, list[Summary]]:
    rng = np.random.default_rng(seed)
    return summary(rng, shift), [summary(rng, {}) for _ in range(8)]


def test_nothing_is_significant_without_a_difference() -> None:
    alarms = 0
    for seed in range(20):
        evidence = gather_evidence(*drawn(seed, {}))
        alarms += find_significance(evidence, np.random.default_rng(seed)).smallest <= 0.05
    assert alarms <= 3


def test_a_difference_is_detected_in_its_column_only() -> None:
    evidence = gather_evidence(*drawn(1, {1: 0.3, 6: -0.2}))
    p_values = find_significance(evidence, np.random.default_rng(0)).p_values
    assert {evidence.columns[k] for k in np.flatnonzero(p_values <= 0.05)} == {COLUMNS[1], COLUMNS[6]}
    assert evidence.z[1] > 0 > evidence.z[6]


def test_small_differences_in_the_same_direction_are_clear_together() -> None:
    evidence = gather_evidence(*drawn(0, dict.fromkeys(range(4), 0.055)))
    similar, nothing = np.zeros((len(COLUMNS), 1)), np.zeros((len(COLUMNS), 2))
    similar[:4] = 1.0
    found = find_directions(evidence, {"alike": similar, "nothing": nothing}, np.random.default_rng(0), families=2)
    assert found["alike"] < 0.05 < find_significance(evidence, np.random.default_rng(0)).smallest
    assert found["nothing"] == 1.0


def test_directions_are_silent_without_a_difference() -> None:
    directions = {str(k): np.eye(len(COLUMNS))[:, [k]] for k in range(6)}
    alarms = 0
    for seed in range(20):
        evidence = gather_evidence(*drawn(seed, {}))
        alarms += min(find_directions(evidence, directions, np.random.default_rng(seed)).values()) <= 0.05
    assert alarms <= 3


def test_a_part_departs_only_if_it_differs_otherwise_than_the_whole() -> None:
    parts = np.arange(4, len(COLUMNS))
    same = departures(gather_evidence(*drawn(6, dict.fromkeys((0, *parts.tolist()), 0.2))), 0, parts)
    one = departures(gather_evidence(*drawn(6, {0: 0.2, 4: 0.5})), 0, parts)
    assert same.min() > 0.05 > one[0]


def test_clusters_sum_to_the_differences() -> None:
    evidence = gather_evidence(*drawn(2, {0: 0.2}))
    assert evidence.clusters.sum(0) == pytest.approx(evidence.z, abs=1e-6)


@pytest.mark.parametrize(("direction", "helps"), [(0, True), (2, False)])
def test_cross_fitted_gain_is_positive_for_the_true_direction(direction: int, helps: bool) -> None:
    evidence = gather_evidence(*drawn(3, {0: 0.3}))
    slopes = np.zeros((len(COLUMNS), 1))
    slopes[direction] = 1.0
    everything = np.ones(len(COLUMNS), bool)
    gains = cross_fitted_gain(evidence, everything, slopes, np.ones(1), np.zeros(len(COLUMNS)))
    assert (gains.sum() > 4.0) == helps


def test_the_true_model_has_the_smallest_error() -> None:
    measured, true = drawn(4, {})
    wrong = [summary(np.random.default_rng(seed), {1: 0.4}) for seed in range(8)]
    before, after = score_vehicles(measured, wrong), score_vehicles(measured, true)
    assert after.error < before.error
    assert after.error == pytest.approx(noise_floor(true), rel=0.2)
    fall = compare_scores(before, after)
    assert fall.interval[0] > 0
    assert fall.size == pytest.approx(before.error - after.error)
    assert not fall.worse
    assert set(compare_scores(after, before).worse) == {"acceleration"}


def test_a_model_of_too_little_spread_is_worse() -> None:
    measured, true = drawn(5, {})
    narrow = [summary(np.random.default_rng(1), {}, len(measured.ids)) for _ in range(8)]
    for run in narrow:
        run.sums[:] = 1.0
    assert score_vehicles(measured, narrow).error > score_vehicles(measured, true).error


def test_vehicles_that_are_missing_in_a_simulation_are_left_out() -> None:
    measured, runs = drawn(6, {})
    few = [run.of(frozenset(run.ids[:30])) for run in runs]
    scores = score_vehicles(measured, few)
    assert np.isfinite(scores.table[:30]).all() and not np.isfinite(scores.table[30:]).any()
    assert np.isfinite(scores.error)


@pytest.mark.parametrize("count", [4, 12, 60])
def test_few_vehicles_have_an_error_too(count: int) -> None:
    rng = np.random.default_rng(8)
    truth, runs = summary(rng, {0: 0.5}, count), [summary(rng, {}, count) for _ in range(4)]
    floors = noise_floors(runs)
    assert score_vehicles(truth, runs).by_group()["speed"] > 2 * floors["speed"] > 0
    assert np.mean(list(floors.values())) == pytest.approx(noise_floor(runs))


def test_two_simulations_have_no_noise_floor() -> None:
    assert np.isnan(noise_floor([summary(np.random.default_rng(seed), {}) for seed in range(2)]))


def test_single_vehicles_that_differ_are_detected_where_means_do_not() -> None:
    measured, runs = drawn(11, {})
    measured.sums[:, 2] += 0.5 * np.where(np.arange(len(measured.ids)) % 2, 1.0, -1.0)
    excess = find_excess(score_vehicles(measured, runs), runs)
    assert find_significance(gather_evidence(measured, runs), np.random.default_rng(0)).smallest > 0.05
    assert excess.p_value < 0.01
    assert excess.largest(0.05) == ["headway"]


def test_the_error_of_the_true_model_has_no_excess() -> None:
    recordings = [drawn(seed, {}) for seed in range(40)]
    p_values = [find_excess(score_vehicles(measured, runs), runs).p_value for measured, runs in recordings]
    assert sum(p_value <= 0.05 for p_value in p_values) <= 6
    assert 0.3 < np.mean(p_values) < 0.7


@pytest.mark.parametrize(("vehicles", "is_significant"), [(8, True), (2, False)])
def test_acts_of_few_drivers_count_if_no_simulation_has_them(vehicles: int, is_significant: bool) -> None:
    measured, runs = drawn(10, {})
    for one in (measured, *runs):
        one.sums[:, 3], one.weights[:, 3] = 0.0, 0.1
    measured.sums[:vehicles, 3] = 1.0
    runs[0].sums[0, 3] = 1.0
    significance = find_significance(gather_evidence(measured, runs), np.random.default_rng(0))
    assert (significance.p_values[3] < 0.05) == is_significant


def test_a_significant_behaviour_that_was_refused_is_listed_by_its_channel() -> None:
    comparison = compare_summaries(*drawn(0, {}), ())
    assert not find_unexplained(comparison, {"acceleration_ability": 0.2}, 0.05)
    listed = find_unexplained(comparison, {"acceleration_ability": 0.01}, 0.05)
    assert [row.name for row in listed] == ["acceleration"]


def test_a_channel_of_single_vehicles_is_named_with_its_error() -> None:
    measured, runs = drawn(11, {})
    measured.sums[:, 2] += 0.5 * np.where(np.arange(len(measured.ids)) % 2, 1.0, -1.0)
    comparison = compare_summaries(measured, runs, ())
    (row,) = find_unexplained(comparison, {}, 0.05)
    assert row.place == "headway of single vehicles"
    assert "noise floor" in row.difference
    assert str(comparison).endswith(row.difference)
