"""Gauss–Newton steps of parameters that are nearly confounded."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize, sparse

from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.parameters import updated_prior_precisions
from cosim.discrepancy.inference.random_effects import Estimate
from cosim.discrepancy.inference.score import Evidence

LASERS = 32


def test_prior_of_per_laser_parameters_suppresses_only_the_direction_that_is_barely_observable() -> None:
    rng, slope = np.random.default_rng(0), np.linspace(-1, 1, LASERS) / np.linalg.norm(np.linspace(-1, 1, LASERS))
    true = rng.normal(0, 0.1, LASERS)
    true -= slope * (slope @ true)
    root = np.diag(np.full(LASERS, 1e3)) @ (np.eye(LASERS) - 0.9999 * np.outer(slope, slope))
    rows = sparse.csr_matrix(root)
    measured = root @ true + root @ slope * 5  # the measured slope is 5 ± 10
    evidence = Evidence({"range": measured}, {"range": np.ones(LASERS)})
    empty = np.zeros(0)
    none = empty.astype(int)
    model = LinearModel({"range": rows}, {}, none, empty, sparse.csr_matrix((0, 0)), none, None, evidence)
    estimate = Estimate(empty, empty)
    plain, _ = model.step(estimate)
    assert slope @ plain == pytest.approx(5, rel=0.2)
    lasers, step, precision = np.ones(LASERS, int), plain, np.zeros(LASERS)
    for _ in range(6):
        precision = updated_prior_precisions(lasers, step, model.fixed_information + np.diag(precision))
        step, _ = model.step(estimate, 0.0, (precision, np.zeros(LASERS)))
    assert abs(slope @ step) < 0.1
    aside = step - slope * (slope @ step)
    np.testing.assert_allclose(aside, true, atol=1e-3)


def test_a_step_that_a_bound_shortens_is_the_best_one_within_the_bounds() -> None:
    rows = np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.1], [0.0, 0.1, 1.0], [0.5, 0.5, 0.5]])
    measured = np.array([1.0, -2.0, 0.5, 0.3])
    evidence = Evidence({"range": measured}, {"range": np.ones(len(measured))})
    empty, none = np.zeros(0), np.zeros(0, int)
    model = LinearModel(
        {"range": sparse.csr_matrix(rows)}, {}, none, empty, sparse.csr_matrix((0, 0)), none, None, evidence
    )
    low, high = np.array([-np.inf, 0.0, -np.inf]), np.full(3, np.inf)
    free, _ = model.step(Estimate(empty, empty))
    assert free[1] < 0
    step, _ = model.step(Estimate(empty, empty), limits=(low, high))
    expected = optimize.lsq_linear(rows, measured, (low, high)).x
    np.testing.assert_allclose(step, expected, atol=1e-5)
    assert abs(step[0] - free[0]) > 1
