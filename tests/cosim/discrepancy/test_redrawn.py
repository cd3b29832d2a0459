"""Bootstrap intervals of non-differentiable parameters have their nominal coverage."""

import numpy as np
import pytest

from cosim.discrepancy.inference.intervals import bootstrap_interval

SCANS, EACH = 20, 50
BEAMS = np.repeat(np.arange(SCANS), EACH)
ALONE = np.arange(SCANS * EACH)
ANY = (-np.inf, np.inf)


def of_mean(noise):
    """Interval of a mean that is 0, of noise (n,) in scans."""
    return bootstrap_interval(lambda at: 0.5 * (noise - at) ** 2, float(noise.mean()), 1e-3, (BEAMS,), ANY)


def test_errors_common_to_a_scan_widen_the_interval():
    rng = np.random.default_rng(3)
    held, widths = 0, []
    for _ in range(60):
        found = of_mean(rng.standard_normal(SCANS)[BEAMS] + rng.standard_normal(len(BEAMS)))
        assert found.is_smooth
        held += found.low <= 0 <= found.high
        widths.append((found.high - found.low) / 2)
    assert held >= 52, "19 in 20"
    assert np.median(widths) == pytest.approx(2.09 / np.sqrt(SCANS), rel=0.2)


def test_widest_interval_over_types_of_clusters_is_returned():
    noise = np.random.default_rng(4).standard_normal(SCANS)[BEAMS]
    alone = bootstrap_interval(lambda at: 0.5 * (noise - at) ** 2, float(noise.mean()), 1e-3, (ALONE,), ANY)
    both = bootstrap_interval(lambda at: 0.5 * (noise - at) ** 2, float(noise.mean()), 1e-3, (ALONE, BEAMS), ANY)
    assert both.high - both.low > 3 * (alone.high - alone.low)


def test_grid_is_extended_beyond_jumps():
    """Some beams meet another surface beyond a value of their own, and the model is a little wrong about which."""
    rng = np.random.default_rng(5)
    held, switch = 0, rng.random(len(BEAMS)) < 0.2
    grid = np.linspace(-0.1, 0.1, 2001)
    for _ in range(40):
        noise, point = rng.standard_normal(len(BEAMS)), rng.uniform(-1, 1, len(BEAMS))
        above = point > rng.normal(0, 0.01, len(BEAMS))

        def losses(at, noise=noise, position=point, above=above):
            return 0.5 * (noise - 3 * at) ** 2 + switch * np.where((position > at) == above, 0.1, 8.0)

        sums = np.array([losses(at).sum() for at in grid])
        best = float(np.median(grid[sums == sums.min()]))
        found = bootstrap_interval(losses, best, 1e-6, (BEAMS,), (-1.0, 1.0))
        held += found.low <= 0 <= found.high
        assert 5e-3 < found.high - found.low < 0.1
    assert held >= 35, "19 in 20"


def test_interval_is_within_bounds():
    found = bootstrap_interval(lambda at: np.full(len(BEAMS), at), 0.0, 1e-3, (BEAMS,), (0.0, 1.0))
    assert (found.low, found.high) == (0.0, 0.0)
    level = bootstrap_interval(lambda at: np.zeros(len(BEAMS)), 0.4, 1e-3, (BEAMS,), (0.0, 1.0))
    assert level.low >= 0 and level.high <= 1 and not level.is_smooth
