"""Returns of nothing: how many, where, and what they hide."""

import numpy as np
import pytest
from scipy import stats

from sensors.hits import NOTHING
from tests.sensors.effects.scenes import NOBODY, cars, effect, of_hits, room, sensor, street

BEAMS = 64 * 2083
NEAR_M, FAR_M = 0.9, 120.0


def test_drops_follow_their_hazard_and_hide_what_is_behind():
    density, mean = 0.02, 8.0
    returns, _ = of_hits(sensor(effect("backscatter", density_per_m=density, mean_range_m=mean)), room(200.0))
    drops = returns.take(returns.instance == NOTHING)
    total = density * mean * (np.exp(-NEAR_M / mean) - np.exp(-19 / mean))
    near = drops.range_m < 19  # no other surface is nearer than the ground
    share = 1 - np.exp(-total)
    assert drops.range_m.min() >= NEAR_M
    up = np.count_nonzero(near) / BEAMS
    assert up == pytest.approx(share, rel=0.25)
    assert drops.intensity.mean() == pytest.approx(0.02, rel=0.05)
    assert len(np.unique(returns.beam)) == len(returns)


def test_drops_answer_where_nothing_is_hit():
    from sensors.scene import Scene
    from tests.sensors.effects.scenes import no_model
    from tests.sensors.worlds import plane

    empty = Scene(plane(-500.0), no_model)
    density, mean = 0.05, 5.0
    returns, _ = of_hits(sensor(effect("backscatter", density_per_m=density, mean_range_m=mean)), empty)
    expected = 1 - np.exp(-density * mean * (np.exp(-NEAR_M / mean) - np.exp(-FAR_M / mean)))
    assert stats.binomtest(len(returns), BEAMS, expected).pvalue > 1e-3

    def cdf(r):
        cumulated = density * mean * (np.exp(-NEAR_M / mean) - np.exp(-r / mean))
        return (1 - np.exp(-cumulated)) / expected

    assert stats.kstest(returns.range_m, cdf).pvalue > 1e-3


def test_false_alarms_are_poisson_in_their_sector():
    alarms = effect("false_alarms", rate_per_frame=50.0, azimuth_deg=90.0, width_deg=30.0)
    counts = []
    for seed in range(40):
        returns, shot = of_hits(sensor(alarms), room(), placed=NOBODY, seed=seed)
        false = returns.take(returns.instance == NOTHING)
        counts.append(len(false))
        assert np.abs(np.degrees(shot.rays.azimuth[false.beam]) - 90).max() <= 15.001
        assert false.intensity.max() <= 0.1 and len(returns) == BEAMS
        assert false.range_m.min() >= NEAR_M and false.range_m.max() <= FAR_M
    assert np.mean(counts) == pytest.approx(50, abs=4)
    assert 0.4 < np.var(counts) / np.mean(counts) < 1.8


def test_false_alarms_may_come_from_two_directions():
    sun = effect("false_alarms", rate_per_frame=200.0, azimuth_deg=90.0, width_deg=10.0)
    radar = effect("false_alarms", rate_per_frame=200.0, azimuth_deg=-90.0, width_deg=10.0)
    returns, shot = of_hits(sensor(sun, radar), room())
    azimuth = shot.rays.azimuth[returns.beam[returns.instance == NOTHING]]
    assert (azimuth > 0).sum() > 100 and (azimuth < 0).sum() > 100


def test_a_bright_sign_blooms_onto_what_is_farther():
    bloom = effect("blooming", radius_deg=1.0, threshold=0.7)
    returns, shot = of_hits(sensor(bloom), street(), placed=cars())
    halo = np.flatnonzero(returns.instance == NOTHING)
    sign = np.flatnonzero(shot.is_material("retro", returns))
    assert len(halo) > 10 and len(sign) > 5
    direction = shot.rays.direction
    cos = (direction[returns.beam[halo]] @ direction[returns.beam[sign]].T).max(1)
    assert np.degrees(np.arccos(np.minimum(cos, 1))).max() <= 1.01
    assert returns.intensity[halo] == pytest.approx(0.3 * 0.8, abs=1e-5)
    assert np.isin(returns.range_m[halo], returns.range_m[sign]).all()
