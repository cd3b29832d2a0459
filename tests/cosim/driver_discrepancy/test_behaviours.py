"""What every behaviour of the catalogue must do."""

from __future__ import annotations

import pytest

from cosim.driver_discrepancy.behaviours import BEHAVIOURS, TOGETHER, Background, Behaviour, Signal
from cosim.driver_discrepancy.behaviours.street_speed import STREET_SPEED
from cosim.driver_discrepancy.channels import CHANNELS
from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.behaviour.habits import draw_habits

PLAIN = {"edges": ["e"], "factor": 0.9}


@pytest.mark.parametrize("behaviour", BEHAVIOURS.values(), ids=lambda one: one.name)
@pytest.mark.parametrize("preset", ["sumo", "calm"])
def test_values_that_are_written_are_read_again(behaviour: Behaviour, preset: str) -> None:
    config = BehaviourConfig.model_validate({"preset": preset, "street_speed": PLAIN})
    values = {knob.name: knob.low + 0.4 * (knob.high - knob.low) for knob in behaviour.knobs}
    if behaviour.name in ("speeding", "lane_offset"):
        values = {"speed_factor": 1.1, "speed_dev": 0.1, "lat_alignment_m": 0.1, "lat_dev_m": 0.05}
        values = {knob.name: values[knob.name] for knob in behaviour.knobs}
    written = behaviour.write(config, values)
    assert behaviour.read(written, Background()) == pytest.approx(values, rel=1e-4)
    assert BehaviourConfig.model_validate(written.model_dump(mode="json")) == written


@pytest.mark.parametrize("behaviour", BEHAVIOURS.values(), ids=lambda one: one.name)
def test_channels_and_confusions_exist(behaviour: Behaviour) -> None:
    assert set(behaviour.statistics) <= CHANNELS.keys()
    assert set(behaviour.confusable_with) <= BEHAVIOURS.keys()
    assert all(knob.low < knob.high and knob.step for knob in behaviour.knobs)


def test_parameters_that_are_changed_together_share_no_channel() -> None:
    for group in TOGETHER:
        shown = [channel for name, _ in group for channel in BEHAVIOURS[name].statistics]
        assert len(shown) == len(set(shown))


def test_a_habit_of_the_vehicle_type_takes_no_draw() -> None:
    habits = draw_habits(BehaviourConfig(preset="sumo"), 3, "veh")
    assert habits.gap_m is habits.headway_s is habits.over_share is habits.accel_mps2 is None
    assert habits.speed_factor(10.0, own=1.07) == 1.07


def test_two_classes_of_drivers_have_the_share_and_the_ratio() -> None:
    config = BehaviourConfig.model_validate({"preset": "sumo", "driver_classes": {"share": 0.3, "speed_ratio": 0.7}})
    ratios = [draw_habits(config, 1, f"v{k}").speed_ratio for k in range(400)]
    assert set(ratios) == {0.7, 1.0}
    assert sum(ratio == 0.7 for ratio in ratios) / 400 == pytest.approx(0.3, abs=0.07)


def test_streets_that_differ_equally_are_proposed_together() -> None:
    config = BehaviourConfig(preset="sumo")
    signals = [
        Signal("free_speed", "street", name, z, ratio)
        for name, z, ratio in (("a", -6.0, 0.6), ("b", -1.5, 0.62), ("c", -1.5, 0.97), ("d", 2.0, 1.1), ("f", 0.1, 1.0))
    ]
    assert STREET_SPEED.propose is not None
    found = STREET_SPEED.propose(config, signals)
    assert found is not None and found.street_speed is not None
    assert found.street_speed.edges == ("a", "b")
    assert STREET_SPEED.propose(config, [Signal("free_speed", "street", "a", -2.0, 0.9)]) is None
