"""Errors that the beams of a unit share."""

import numpy as np
import pytest

from sensors.effects.shared_errors import UNITS, SharedRange
from sensors.scene import Scene
from tests.sensors.effects.scenes import no_model, of_hits, sensor
from tests.sensors.worlds import wall

SIGMA_M = 0.1


@pytest.fixture(scope="module")
def plain():
    return of_hits(sensor(), Scene(wall(20.0, half_m=300), no_model))


@pytest.mark.parametrize("unit", UNITS)
def test_beams_of_a_unit_share_one_error(plain, unit):
    returns, shot = plain
    size = {"packet": 6, "sector": 36}.get(unit, 1)
    kind = type("Shared", (SharedRange,), {"shared_by": unit, "unit_size": size, "name": f"shared_by_{unit}"})
    effect = kind(sigma=SIGMA_M)
    group, drawn = effect.group(returns, shot), effect.draw(returns, shot, np.random.default_rng(1))
    values = [np.unique(drawn[group == number]) for number in np.unique(group)]
    assert all(len(value) == 1 for value in values)
    assert len(np.unique(values)) == len(values)
    rings, firings = shot.rays.ring[returns.beam], returns.beam % shot.pattern.firings
    expected = {
        "firing": firings,
        "packet": firings // 6,
        "sector": firings * 36 // shot.pattern.firings,
        "scan": np.zeros(len(returns), int),
        "block": np.array(shot.pattern.block)[rings],
        "ring": rings,
    }[unit]
    np.testing.assert_array_equal(group, expected)


def test_an_unknown_unit_is_refused(plain):
    kind = type("Shared", (SharedRange,), {"shared_by": "tower", "name": "shared_by_tower"})
    with pytest.raises(ValueError, match="choose one of firing, packet"):
        kind(sigma=SIGMA_M).group(*plain)
