"""Each single effect changes its own channel and no other."""

import numpy as np
import pytest

from sensors.effects.registry import built_in_effects
from tests.sensors.effects.alone import EGO, bare, change_by
from tests.sensors.effects.scenes import LIDAR, cars, effect, sensor, shoot, street


@pytest.mark.parametrize("name", built_in_effects())
def test_it_changes_its_own_channel_and_no_other(name):
    change = change_by(name)
    assert change.own in change.channels
    assert change.channels <= change.allowed


@pytest.mark.parametrize("name", [name for name, kind in built_in_effects().items() if kind.neutral is not None])
def test_its_neutral_parameters_change_nothing(name):
    after, _ = shoot(sensor(effect(name, **built_in_effects()[name].neutral)), street(), placed=cars(), ego=EGO)
    before, _ = bare("street")
    if name == "detection_threshold":
        return  # a threshold of zero still loses half of what is black
    if name == "glass_transmission":
        after = after.take(np.isin(after.beam, before.beam))
    np.testing.assert_array_equal(after.beam, before.beam)
    np.testing.assert_allclose(after.range_m, before.range_m, atol=2e-4)
    np.testing.assert_allclose(after.intensity, before.intensity, atol=1e-6)


@pytest.mark.parametrize("name", [name for name, kind in built_in_effects().items() if not kind.needs_new_rays])
def test_traced_anew_or_from_stored_hits_it_is_the_same(name):
    from tests.sensors.effects.scenes import of_hits

    model = sensor(effect(name))
    anew, _ = shoot(model, street(), placed=cars())
    stored, _ = of_hits(model, street(), placed=cars())
    np.testing.assert_array_equal(anew.beam, stored.beam)
    np.testing.assert_array_equal(anew.range_m, stored.range_m)
    np.testing.assert_array_equal(anew.intensity, stored.intensity)


def test_without_effects_the_bare_sensor_answers():
    from sensors.point_cloud import bare_returns
    from sensors.tracing import Tracer
    from tests.sensors.effects.scenes import PATTERN

    hits = Tracer(PATTERN.rays(), PATTERN.range_m).trace(street(), LIDAR, cars())
    expected = bare_returns(hits)
    for cloud in (
        sensor().measure(hits),
        sensor().trace_and_measure(street(), LIDAR, cars(), EGO),
    ):
        np.testing.assert_array_equal(cloud.kitti, expected.kitti)
        np.testing.assert_array_equal(cloud.instance, expected.instance)
