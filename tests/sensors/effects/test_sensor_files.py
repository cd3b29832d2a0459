"""Sensor files: what is read, and what is refused in one clear line."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

import sensors.effects
from cosim.cli.main import main
from sensors.effects.registry import built_in_effects
from sensors.errors import SensorError
from sensors.sensor_file import model_names
from sensors.sensor_model import load_sensor

NUMBERS = [
    (name, parameter)
    for name, kind in built_in_effects().items()
    for parameter in kind.parameters()
    if not parameter.choices and not parameter.is_table
]


def sensor_file(tmp_path, effects):
    file = tmp_path / "my.yaml"
    file.write_text(f"pattern: hdl64e\neffects: {effects}\n")
    return file


@pytest.mark.parametrize(
    ("effects", "complaint"),
    [
        ("[{effect: range_nois}]", "unknown; did you mean range_noise"),
        ("[{effect: xyzzy}]", "lists all"),
        ("[{effect: box_shrink, a_m: [0.1, 0.2], b: 0}]", "box_shrink: a_m"),
        ("[{effect: box_shrink, a_m: -1, b: 0}]", "box_shrink: a_m"),
        ("[{effect: speeding}]", "traffic stage"),
        ("[{effect: range_bias, offset_m: 99}]", "range_bias: offset_m: .* less than or equal to 5"),
        ("[{effect: range_bias, offset_m: .nan}]", "range_bias: offset_m"),
        ("[{effect: range_bias}]", "range_bias: offset_m: Field required"),
        ("[{effect: range_bias, offset: 1, offset_m: 1}]", "unknown key 'offset'"),
        ("[{effect: ring_gain, gains: [1, 1]}]", "gains has 2 entries but pattern hdl64e has 64"),
        ("[{effect: range_bias, offset_m: 0.1}, {effect: range_bias, offset_m: 0.2}]", "listed twice"),
        ("[{effect: glass_transmission, transmission: 0.5, mode: best}]", "mode"),
        ("[3]", "names no effect"),
        ("3", "give a list"),
    ],
)
def test_a_mistake_is_named_in_one_line(tmp_path, effects, complaint):
    with pytest.raises(SensorError, match=complaint) as caught:
        load_sensor(sensor_file(tmp_path, effects))
    assert "\n" not in str(caught.value) and "my.yaml" in str(caught.value)


def test_effects_act_by_phase_whatever_their_order_in_the_file(tmp_path):
    text = ["{effect: intensity_quantization, step: 0.05}", "{effect: incidence_falloff, exponent: 1.5}"]
    one = load_sensor(sensor_file(tmp_path, f"[{', '.join(text)}]"))
    two = load_sensor(sensor_file(tmp_path, f"[{', '.join(reversed(text))}]"))
    assert one._ordered == two._ordered


@pytest.mark.parametrize("name", built_in_effects())
def test_effects_survive_their_file(tmp_path, name):
    kind = built_in_effects()[name]
    effect = kind.model_validate(kind.example)
    entry = {"effect": name, **effect.model_dump(mode="json")}
    assert load_sensor(sensor_file(tmp_path, [entry])).effects == (effect,)


@pytest.mark.parametrize("name", model_names())
def test_built_in_sensors_load_and_survive_their_file(tmp_path, name):
    model = load_sensor(name)
    copy = tmp_path / "copy.yaml"
    copy.write_text(model.to_yaml())
    assert load_sensor(copy).effects == model.effects


def test_a_sensor_that_was_renamed_keeps_its_old_name_and_says_so(caplog):
    old, new = load_sensor("hdl64e_dual"), load_sensor("hdl64e_two_blocks")
    assert old.effects == new.effects and old.pattern == new.pattern and old.origin == new.origin
    assert caplog.messages == ["sensor hdl64e_dual is called hdl64e_two_blocks now; write that"]
    assert "hdl64e_dual" not in model_names()


def test_every_file_that_defines_an_effect_is_in_the_catalogue():
    folder = Path(sensors.effects.__file__).parent
    named = {
        name
        for file in folder.rglob("*.py")
        for name in re.findall(
            r'^    name: ClassVar(?:\[str\])? = "(\w+)"', file.read_text(encoding="utf-8"), re.MULTILINE
        )
    }
    assert named == set(built_in_effects())
    phases = [kind.phase for kind in built_in_effects().values()]
    assert phases == sorted(phases)


def test_a_drive_s_own_pattern_is_next_to_its_sensor_file(tmp_path):
    pattern = load_sensor("vlp16").pattern.model_copy(update={"name": "mine"})
    (tmp_path / "pattern.yaml").write_text(pattern.to_yaml())
    (tmp_path / "sensor.yaml").write_text("pattern: mine\neffects: []\n")
    assert load_sensor(tmp_path / "sensor.yaml").pattern == pattern


@pytest.mark.parametrize("name", built_in_effects())
def test_every_effect_is_documented(name):
    kind = built_in_effects()[name]
    assert kind.name == name and kind.equation and kind.reference and kind.__doc__
    assert set(kind.confusable_with) <= set(built_in_effects()) - {name}
    assert all(p.description for p in kind.parameters())
    for parameter in kind.parameters():
        if parameter.name.endswith("_per_m"):
            assert parameter.unit.endswith("/m")
        elif parameter.name.endswith("_m"):
            assert parameter.unit == "m"
        if parameter.name.endswith("_deg"):
            assert parameter.unit == "°"


@settings(max_examples=60, deadline=None)
@given(which=st.sampled_from(NUMBERS), excess=st.floats(1e-6, 1e6), above=st.booleans())
def test_no_parameter_leaves_its_bounds(which, excess, above):
    name, parameter = which
    edge = parameter.high if above else parameter.low
    outside = edge + excess * (1 if above else -1) * max(1.0, abs(edge))
    good = dict(built_in_effects()[name].example)
    good[parameter.name] = (outside,) * 64 if parameter.per_ring else outside
    with pytest.raises(ValidationError):
        built_in_effects()[name].model_validate(good)


@settings(max_examples=60, deadline=None)
@given(which=st.sampled_from(NUMBERS), share=st.floats(0, 1))
def test_every_value_within_bounds_is_taken(which, share):
    name, parameter = which
    value = min(max(parameter.low + share * (parameter.high - parameter.low), parameter.low), parameter.high)
    good = dict(built_in_effects()[name].example)
    good[parameter.name] = (value,) * 64 if parameter.per_ring else value
    assert np.allclose(getattr(built_in_effects()[name].model_validate(good), parameter.name), value)


def test_the_command_lists_the_whole_catalogue(capsys, tmp_path):
    assert main(["effects", "--json", str(tmp_path / "all.json")]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in built_in_effects())
    assert main(["effects", "range_walc"]) == 2
    assert "did you mean range_walk" in capsys.readouterr().err
