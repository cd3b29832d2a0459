"""Returns from nowhere: in which sector they crowd, and how sure their law is."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from cosim.discrepancy.gate import compressed
from cosim.discrepancy.hard_limits import widening
from cosim.discrepancy.sector import crowded_sector
from sensors.effects.backscatter import Backscatter


def _strays(middle_deg: float, width_deg: float, rng: np.random.Generator) -> tuple[Any, Any]:
    azimuth = np.radians(np.linspace(-179.9, 179.9, 40_000))
    apart = np.abs((np.degrees(azimuth) - middle_deg + 180) % 360 - 180)
    chance = np.where(apart <= width_deg / 2, 0.08, 0.002)
    stray = rng.random(len(azimuth)) < chance
    every = np.ones(len(azimuth))
    sample = SimpleNamespace(azimuth=azimuth, returned=every > 0, compared=every > 0, weight=every)
    return cast(Any, sample), cast(Any, SimpleNamespace(matched=1.0 - stray))


@pytest.mark.parametrize(("middle", "width"), [(40.0, 50.0), (175.0, 30.0), (-90.0, 120.0)])
def test_the_sector_of_strays_is_found_also_across_the_seam(middle, width):
    found = crowded_sector(*_strays(middle, width, np.random.default_rng(5)))
    assert abs((found["azimuth_deg"] - middle + 180) % 360 - 180) < 1
    assert found["width_deg"] == pytest.approx(width, abs=1.5)


def test_one_large_gain_does_not_drown_many_small_ones():
    gain = np.append(np.full(14, 10.0), 4000.0)

    def deviates(sums: np.ndarray) -> float:
        return float(sums.sum() / np.sqrt((sums**2).sum()))

    assert deviates(gain) < 1.2
    assert deviates(compressed(gain)) > 3
    assert np.array_equal(compressed(-gain), -compressed(gain))


@pytest.mark.parametrize("coupling", [0.0, -0.6, 0.9])
def test_parameters_that_make_up_for_one_another_are_less_sure(coupling):
    """Of a paraboloid ½(x² + y² + 2ρxy), x is known to 1 with y held and to 1/√(1 − ρ²) with y free."""
    start = Backscatter(density_per_m=0.01, mean_range_m=10.0)
    unit = {"density_per_m": 1e-4, "mean_range_m": 0.1}

    def lost(effects):
        x, y = ((getattr(effects[0], name) - getattr(start, name)) / step for name, step in unit.items())
        return 0.5 * (x**2 + y**2 + 2 * coupling * x * y)

    held = {name: (getattr(start, name) - step, getattr(start, name) + step) for name, step in unit.items()}
    wider = widening((start,), 0, held, lost)
    for by in wider.values():
        assert by == pytest.approx(1 / np.sqrt(1 - coupling**2), rel=1e-3)
