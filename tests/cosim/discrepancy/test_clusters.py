"""Errors of a map reach over many of its cells: sums over cells scatter more than if each had an error of its own."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.discrepancy.inference.clusters import nearness, widened

SIDE_M, CELL_M = 200.0, 5.0


def _cells() -> np.ndarray:
    middles = np.arange(0, SIDE_M, CELL_M)
    x, y = np.meshgrid(middles, middles)
    return np.column_stack([np.zeros(x.size), x.ravel(), y.ravel()])


def _errors(reach_m: float, rng: np.random.Generator) -> np.ndarray:
    """(cells,) of unit variance, alike within about a reach."""
    white = rng.standard_normal((int(SIDE_M / CELL_M),) * 2)
    freq = np.fft.fftfreq(white.shape[0], CELL_M)
    low = np.exp(-2 * (np.pi * reach_m) ** 2 * (freq[:, None] ** 2 + freq**2))
    smooth = np.fft.ifft2(np.fft.fft2(white) * low).real.ravel()
    return smooth / smooth.std()


def test_cells_that_are_near_share_most_and_far_ones_nothing():
    near = nearness(np.array([[0.0, 0, 0], [0, 6, 0], [0, 90, 0], [1, 6, 0], [np.nan] * 3])).toarray()
    assert near[0, 1] == near[1, 0] == pytest.approx(0.8)
    assert np.count_nonzero(near) == 2


@pytest.mark.parametrize("reach_m", [4.0, 8.0])
def test_sums_of_smooth_errors_are_as_wide_as_they_are_said(reach_m):
    rng, near, every = np.random.default_rng(3), nearness(_cells()), np.ones(len(_cells()))
    drawn = [_errors(reach_m, rng) * rng.choice([-1, 1]) + 0.0 for _ in range(60)]
    # The mean of a whole field is taken out by its making; a quarter of it keeps its own.
    quarter = (_cells()[:, 1:] < SIDE_M / 2).all(1)
    inside = near[quarter][:, quarter]
    sums = np.array([one[quarter].sum() for one in drawn])
    said = np.array([widened(one[quarter, None], every[quarter], inside) for one in drawn])
    alone = np.array([np.linalg.norm(one[quarter]) for one in drawn])
    assert np.std(sums / alone) > 2.0
    assert 0.6 < np.std(sums / (said * alone)) < 1.6


def test_errors_of_cells_of_their_own_widen_little():
    rng, near = np.random.default_rng(4), nearness(_cells())
    found = [widened(rng.standard_normal((len(_cells()), 1)), np.ones(len(_cells())), near) for _ in range(30)]
    assert np.mean(found) < 1.25
