"""Family-wise p-values and either-or sets, which the loops for sensors and for drivers share."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from cosim.discrepancy.dictionary.groups import Group
from cosim.discrepancy.selection.calibration import Statistic, family_wise_p, min_p
from cosim.discrepancy.selection.gain import gain_difference, is_rival


def test_the_smallest_p_value_of_many_groups_is_uniform_without_a_difference() -> None:
    rng = np.random.default_rng(0)
    smallest = [min_p(rng.chisquare((1, 3, 8), (401, 3))).min() for _ in range(300)]
    assert 0.02 < np.mean(np.array(smallest) <= 0.05) < 0.09
    assert 0.4 < np.mean(smallest) < 0.6


def test_a_large_statistic_is_significant_whatever_its_scale() -> None:
    rng = np.random.default_rng(1)
    for group, scale in ((0, 1.0), (1, 1e4)):
        statistics = rng.chisquare(2, (2001, 2)) * (1.0, 1e4)
        statistics[0] = 1.0
        statistics[0, group] = 40.0 * scale
        p_values = min_p(statistics)
        assert p_values[group] < 0.01 < p_values[1 - group]


def test_a_statistic_that_never_varies_has_no_p_value() -> None:
    statistics = np.column_stack([np.zeros(101), np.random.default_rng(2).chisquare(1, 101)])
    assert np.isnan(min_p(statistics)[0])
    assert np.isfinite(min_p(statistics)[1])


def test_rivals_have_gains_within_the_error_over_folds() -> None:
    chosen = np.array([10.0, 12.0, 9.0, 11.0, 10.0])
    near, far = chosen + np.array([1.0, -2.0, 1.0, -1.0, 0.5]), 0.2 * chosen
    assert gain_difference(chosen, near)[0] < 2 * gain_difference(chosen, near)[1]
    assert is_rival(52.0, 51.0, chosen, near)
    assert not is_rival(52.0, 10.0, chosen, far)


def test_a_common_offset_is_a_special_case_of_one_offset_for_each_laser() -> None:
    """Not of offsets of half of the lasers, nor of a dependence on something else."""
    rng = np.random.default_rng(4)
    laser, slope = rng.integers(0, 8, 400), rng.normal(size=400)
    by_laser = sparse.csr_array(slope[:, None] * (laser[:, None] == np.arange(8)))
    common = Group("common", "range", (), 1, {"range": sparse.csr_array(slope[:, None])})
    for columns, is_special in ((by_laser, True), (by_laser[:, :4], False)):
        wider = Group("by laser", "range", ("laser",), columns.shape[1], {"range": columns})
        assert common.is_special_case_of(wider) is is_special
        assert not wider.is_special_case_of(common)
    returns = Group("returns", "drop", ("laser",), 8, {"drop": by_laser})
    assert not common.is_special_case_of(returns)


def test_one_column_of_many_is_significant_in_few_clusters() -> None:
    rng = np.random.default_rng(5)
    found = []
    for _ in range(20):
        table = rng.normal(size=(40, 64))
        table[:, 50] = np.abs(table[:, 50]) + 0.5  # a laser whose error is the same in every cluster
        group = Statistic(np.arange(64), np.eye(64), False)
        [p] = family_wise_p([table], (table**2).sum(0), [group], 400, rng)
        found.append(p)
    assert max(found) < 0.01


def test_the_two_statistics_of_a_group_cause_no_more_alarms() -> None:
    rng = np.random.default_rng(6)
    alarms = []
    for _ in range(200):
        table = rng.normal(size=(40, 24))
        groups = [Statistic(np.arange(start, start + 8), np.eye(8), start == 0) for start in (0, 8, 16)]
        alarms.append(family_wise_p([table], (table**2).sum(0), groups, 400, rng).min() <= 0.05)
    assert np.mean(alarms) < 0.1
