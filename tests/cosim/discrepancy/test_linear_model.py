"""Steps of parameters that the data hardly tell apart."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from cosim.discrepancy.inference.fit import _laws
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.random_effects import Estimate
from cosim.discrepancy.inference.score import Evidence

LASERS = 32


def test_numbers_of_lasers_are_told_but_for_a_slope_that_the_data_hardly_tell() -> None:
    rng, slope = np.random.default_rng(0), np.linspace(-1, 1, LASERS) / np.linalg.norm(np.linspace(-1, 1, LASERS))
    true = rng.normal(0, 0.1, LASERS)
    true -= slope * (slope @ true)
    root = np.diag(np.full(LASERS, 1e3)) @ (np.eye(LASERS) - 0.9999 * np.outer(slope, slope))
    rows = sparse.csr_matrix(root)
    measured = root @ true + root @ slope * 5  # of the slope, to ± 10, it says 5
    evidence = Evidence({"range": measured}, {"range": np.ones(LASERS)})
    nothing = np.zeros(0)
    model = LinearModel({"range": rows}, {}, nothing.astype(int), nothing, sparse.csr_matrix((0, 0)), None, evidence)
    begun = Estimate(nothing, nothing)
    plain, _ = model.step(begun)
    assert slope @ plain == pytest.approx(5, rel=0.2)
    lasers, found, precision = np.ones(LASERS, int), plain, np.zeros(LASERS)
    for _ in range(6):
        precision = _laws(lasers, found, model.fixed_information + np.diag(precision))
        found, _ = model.step(begun, 0.0, (precision, np.zeros(LASERS)))
    assert abs(slope @ found) < 0.1
    aside = found - slope * (slope @ found)
    np.testing.assert_allclose(aside, true, atol=1e-3)
