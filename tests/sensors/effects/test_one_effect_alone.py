"""Every effect, switched on alone, changes the channel it is about and no other."""

import numpy as np
import pytest

from sensors.effects.catalogue import BUILT_IN
from sensors.hits import NOTHING
from sensors.label_boxes import LabelBoxes
from sensors.motion import EgoMotion
from sensors.sensor_model import points_of
from tests.sensors.effects.scenes import LIDAR, cars, effect, room, sensor, shoot, street

EGO = EgoMotion(np.eye(4), np.array([10.0, 2.0, 0.0]), 0.3, np.array([2.0, 0.0, 0.0]))
ON_SCANS = [name for name, kind in BUILT_IN.items() if kind.stage != "label"]
ON_LABELS = [name for name, kind in BUILT_IN.items() if kind.stage == "label"]
SHOWS_AS = {"pose": "range", "range_variance": "range", "intensity_variance": "intensity"}


@pytest.fixture(scope="module")
def bare():
    return {
        "room": shoot(sensor(), room(), ego=EGO),
        "street": shoot(sensor(), street(), placed=cars(), ego=EGO),
    }


def changed_channels(before, after):
    _, old, new = np.intersect1d(before.beam, after.beam, return_indices=True)
    stands = after.instance[new] != NOTHING
    old, new = old[stands], new[stands]
    found = {
        "range": (np.abs(after.range_m[new] - before.range_m[old]) > 1e-4).any(),
        "intensity": (np.abs(after.intensity[new] - before.intensity[old]) > 1e-6).any(),
        # Whether a beam returns: also where its footprint now reaches a surface that its middle misses.
        "drop": not np.isin(before.beam, after.beam).all()
        or not np.isin(after.beam[after.instance != NOTHING], before.beam).all(),
        "spurious": (after.instance == NOTHING).any(),
    }
    return {channel for channel, changed in found.items() if changed}


@pytest.mark.parametrize("name", ON_SCANS)
def test_it_changes_its_own_channel_and_no_other(bare, name):
    kind = BUILT_IN[name]
    # Beams that turn meet other things: only where all is alike do they show in the range alone.
    where = "room" if kind.stage == "beam" else "street"
    scene, placed = (room(), None) if where == "room" else (street(), cars())
    arguments = {"ego": EGO} if placed is None else {"ego": EGO, "placed": placed}
    after, _ = shoot(sensor(effect(name)), scene, **arguments)
    changed = changed_channels(bare[where][0], after)
    assert SHOWS_AS.get(kind.channel, kind.channel) in changed
    assert changed <= {SHOWS_AS.get(channel, channel) for channel in (kind.channel, *kind.also)}


@pytest.mark.parametrize("name", ON_LABELS)
def test_an_effect_on_labels_changes_labels_and_no_point(bare, name):
    after, shot = shoot(sensor(effect(name)), street(), placed=cars(), ego=EGO)
    before = bare["street"][0]
    for column in ("beam", "range_m", "intensity", "return_no"):
        np.testing.assert_array_equal(getattr(after, column), getattr(before, column))
    placed = cars()
    boxes = LabelBoxes(
        kinds=("Car",) * len(placed),
        centre=(np.linalg.inv(LIDAR) @ placed.poses)[:, :3, 3]
        + [[0, 0, 0.75], [0, 0, 30]],  # one on a car, one in the sky
        size=np.tile([4.0, 1.7, 1.5], (len(placed), 1)),
        yaw=np.arctan2(placed.poses[:, 1, 0], placed.poses[:, 0, 0]),
        kept=np.ones(len(placed), bool),
        points=points_of(after, shot.rays).xyz,
    )
    changed = sensor(effect(name)).relabel(boxes)
    same = all(np.array_equal(getattr(boxes, part), getattr(changed, part)) for part in ("centre", "size", "kept"))
    assert not same


@pytest.mark.parametrize("name", [name for name, kind in BUILT_IN.items() if kind.neutral is not None])
def test_its_neutral_parameters_change_nothing(bare, name):
    after, _ = shoot(sensor(effect(name, **BUILT_IN[name].neutral)), street(), placed=cars(), ego=EGO)
    before = bare["street"][0]
    if name == "detection_threshold":
        return  # a threshold of zero still loses half of what is black
    if name == "glass_transmission":
        after = after.take(np.isin(after.beam, before.beam))
    np.testing.assert_array_equal(after.beam, before.beam)
    np.testing.assert_allclose(after.range_m, before.range_m, atol=2e-4)
    np.testing.assert_allclose(after.intensity, before.intensity, atol=1e-6)


@pytest.mark.parametrize("name", [name for name, kind in BUILT_IN.items() if not kind.needs_new_rays])
def test_traced_anew_or_from_stored_hits_it_is_the_same(name):
    from tests.sensors.effects.scenes import of_hits

    model = sensor(effect(name))
    anew, _ = shoot(model, street(), placed=cars())
    stored, _ = of_hits(model, street(), placed=cars())
    np.testing.assert_array_equal(anew.beam, stored.beam)
    np.testing.assert_array_equal(anew.range_m, stored.range_m)
    np.testing.assert_array_equal(anew.intensity, stored.intensity)


def test_without_effects_the_bare_sensor_answers(bare):
    from sensors.point_cloud import bare_returns
    from sensors.tracing import Tracer
    from tests.sensors.effects.scenes import LIDAR, PATTERN

    hits = Tracer(PATTERN.rays(), PATTERN.range_m).trace(street(), LIDAR, cars())
    expected = bare_returns(hits)
    for cloud in (
        sensor().measure(hits),
        sensor().trace_and_measure(street(), LIDAR, cars(), EGO),
    ):
        np.testing.assert_array_equal(cloud.kitti, expected.kitti)
        np.testing.assert_array_equal(cloud.instance, expected.instance)
