import numpy as np
import pytest
from pydantic import TypeAdapter
from scipy import stats

from cosim.capture.config import ConfigError, load_config
from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.behaviour.distributions import Distribution
from cosim.traffic.behaviour.habits import draw_habits

PARSE = TypeAdapter(Distribution).validate_python


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("gap_m: {kind: uniform, min: 3, max: 0.2}", "gap_m.*min 3 is above max 0.2"),
        ("gap_m: {kind: uniform, min: -1, max: 2}", "gap_m.*draws -1 to 2, but only 0 to 20"),
        ("gap_m: {kind: constant, value: .inf}", "gap_m.*finite"),
        ("speeding_kmh: {kind: normal, mean: 5, sigma: -1, min: 0, max: 9}", "sigma.*greater than or equal to 0"),
        ("speeding_kmh: {kind: normal, mean: 50, sigma: 1, min: 0, max: 9}", "over five sigma"),
        ("lane_offset_m: {kind: choice, values: []}", "values"),
        ("lane_offset_m: {kind: choice, values: [0.1], weights: [1, 2]}", "1 values have 2 weights"),
        ("lane_offset_m: {kind: constant, value: 2}", "only -0.3 to 0.3"),
        ("u_turns_per_min: -1", "u_turns_per_min.*greater than or equal to 0"),
        ("preset: wild", "preset.*'reference', 'calm' or 'sumo'"),
        ("tailgating: 3", "unknown key"),
    ],
)
def test_impossible_behaviour_is_one_line_with_the_value(tmp_path, text, complaint):
    path = tmp_path / "run.yaml"
    path.write_text(f"behaviour:\n  {text}\n")
    with pytest.raises(ConfigError, match=complaint) as caught:
        load_config(path)
    assert "\n" not in str(caught.value)


def test_a_preset_may_be_given_by_name_and_overridden(tmp_path):
    path = tmp_path / "run.yaml"
    path.write_text("behaviour: calm\n")
    assert load_config(path).behaviour.u_turns_per_min == 0
    path.write_text("behaviour: {preset: calm, u_turns_per_min: 2}\n")
    assert load_config(path).behaviour.u_turns_per_min == 2
    assert load_config(path).behaviour.speeding_kmh.bounds == (0, 0)


@pytest.mark.parametrize("preset", ["paper", "reference", "calm"])
def test_what_is_written_down_reads_back_the_same(preset):
    config = BehaviourConfig(preset=preset)
    assert BehaviourConfig.model_validate(config.model_dump(mode="json")) == config


@pytest.mark.parametrize(
    ("distribution", "law"),
    [
        ({"kind": "uniform", "min": 0.2, "max": 3.0}, stats.uniform(0.2, 2.8)),
        ({"kind": "normal", "mean": 1.2, "sigma": 0.5, "min": 0.7, "max": 2.0}, stats.truncnorm(-1, 1.6, 1.2, 0.5)),
    ],
)
def test_draws_follow_their_distribution(distribution, law):
    rng = np.random.default_rng(4)
    drawn = [PARSE(distribution).draw(rng) for _ in range(2000)]
    assert stats.kstest(drawn, law.cdf).pvalue > 0.01


def test_weights_of_a_choice_are_kept():
    rng = np.random.default_rng(4)
    choice = PARSE({"kind": "choice", "values": [0, 1], "weights": [3, 1]})
    assert np.mean([choice.draw(rng) for _ in range(4000)]) == pytest.approx(0.25, abs=0.03)


def test_habits_follow_the_seed_and_the_vehicle_alone():
    config = BehaviourConfig()
    assert draw_habits(config, 1, "veh7") == draw_habits(config, 1, "veh7")
    assert draw_habits(config, 1, "veh7") != draw_habits(config, 1, "veh8")
    assert draw_habits(config, 1, "veh7") != draw_habits(config, 2, "veh7")
