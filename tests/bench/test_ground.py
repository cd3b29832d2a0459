"""The measure of unevenness on ground that is known."""

import numpy as np
import pytest

from tests.bench.ground import scatter_about_planes


@pytest.mark.parametrize("sigma_m", [0.0, 0.01])
def test_scatter_is_that_of_the_ground_whatever_its_slope(sigma_m):
    rng = np.random.default_rng(0)
    xy = rng.uniform(-14, 14, (60_000, 2))
    z = -1.73 + 0.03 * xy[:, 0] - 0.02 * xy[:, 1] + rng.normal(0, sigma_m, len(xy))
    distance, scatter = scatter_about_planes(np.column_stack([xy, z]), 1.0)
    assert len(scatter) > 500 and distance.max() < 20
    assert np.median(scatter) == pytest.approx(sigma_m, abs=4e-4)


def test_what_stands_on_the_ground_is_no_ground():
    rng = np.random.default_rng(0)
    xy = rng.uniform(6, 8, (4000, 2))
    z = np.where(rng.random(4000) < 0.5, -1.73, -0.9)
    assert len(scatter_about_planes(np.column_stack([xy, z]), 1.0)[0]) == 0
