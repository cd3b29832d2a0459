"""Rounding steps are distinguished from values that cluster for other reasons."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.discrepancy.dictionary.lattices import _find_step


@pytest.mark.parametrize("step", [0.002, 0.0137, 0.15])
def test_rounding_step_of_ranges_is_detected(step):
    rng = np.random.default_rng(1)
    true = rng.gamma(3, 6, 20_000) + 1
    noisy = true + 0.02 * rng.standard_normal(len(true))
    stored = (np.rint(noisy / step) * step).astype(np.float32).astype(float)
    found = _find_step(stored, noisy, 0)
    assert found == pytest.approx(step, rel=1e-6)


def test_values_that_crowd_by_themselves_make_no_lattice():
    rng = np.random.default_rng(2)
    bright = rng.choice([0.25, 0.5, 0.75], 20_000) + 0.01 * rng.standard_normal(20_000)
    again = rng.choice([0.25, 0.5, 0.75], 20_000) + 0.01 * rng.standard_normal(20_000)
    assert _find_step(bright, again, 1) is None


def test_reflectances_of_two_decimals_are_no_lattice_where_the_model_has_them():
    rng = np.random.default_rng(2)
    bare = rng.choice([0.12, 0.25, 0.4, 0.55], 5000)
    assert _find_step(bare, bare, 1) is None
    assert _find_step(np.rint(bare / 0.1) * 0.1, bare, 1) == pytest.approx(0.1)


def test_too_few_values_say_nothing():
    assert _find_step(np.arange(100) * 0.1, np.linspace(0, 10, 100), 0) is None
