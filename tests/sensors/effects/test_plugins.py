"""Users' effects from a file next to the sensor file, and their error messages."""

import importlib

import numpy as np
import pytest

from cosim.cli.main import main
from sensors.effects.expectation import expect
from sensors.effects.registry import effect_classes, find_effect
from sensors.errors import SensorError
from sensors.sensor_model import load_sensor
from tests.sensors.effects.scenes import of_hits, room

GOOD = '''
"""Streaks of rain."""
from __future__ import annotations
from dataclasses import replace
from typing import ClassVar
from sensors.effects import PointEffect, number


class RainStreaks(PointEffect):
    """R + shift."""

    name: ClassVar = "rain_streaks"
    channel: ClassVar = "range"
    equation: ClassVar = "R + s"
    example: ClassVar = {"shift_m": 0.5}

    shift_m: float = number("shift", unit="m", ge=0, le=1)

    def apply(self, returns, shot, rng):
        """Shifted."""
        return replace(returns, range_m=returns.range_m + self.shift_m)
'''


def written(folder, source, entry="{effect: ./my_effect.py:RainStreaks, shift_m: 0.25}"):
    (folder / "my_effect.py").write_text(source)
    file = folder / "sensor.yaml"
    file.write_text(f"pattern: hdl64e\neffects:\n  - {entry}\n")
    return file


def test_an_effect_of_a_file_acts_like_a_built_in_one(tmp_path):
    model = load_sensor(written(tmp_path, GOOD))
    returns, _ = of_hits(model, room())
    bare, _ = of_hits(load_sensor("hdl64e"), room())
    np.testing.assert_allclose(returns.range_m - bare.range_m, 0.25, atol=1e-5)


def test_its_sensor_file_can_be_written_and_read_elsewhere(tmp_path):
    model = load_sensor(written(tmp_path, GOOD))
    copy = tmp_path / "elsewhere" / "sensor.yaml"
    copy.parent.mkdir()
    copy.write_text(model.to_yaml())
    assert load_sensor(copy).effects[0].model_dump() == {"shift_m": 0.25}


def test_the_command_shows_and_draws_it(tmp_path, capsys):
    written(tmp_path, GOOD)
    picture = tmp_path / "before_after.png"
    assert main(["effects", f"{tmp_path}/my_effect.py:RainStreaks", "--out", str(picture)]) == 0
    assert "shift_m: shift [0 … 1 m]" in capsys.readouterr().out
    assert picture.read_bytes()[:4] == b"\x89PNG"


BODY = "return replace(returns, range_m=returns.range_m + self.shift_m)"


@pytest.mark.parametrize(
    ("source", "complaint"),
    [
        (GOOD.replace(BODY, "raise ValueError('no rain today')"), "no rain today"),
        (
            GOOD.replace(BODY, "return returns.take(np.arange(3))").replace(
                "from typing", "import numpy as np\nfrom typing"
            ),
            "returned 3 of",
        ),
        (GOOD.replace(BODY, "return replace(returns, range_m=returns.range_m[:5])"), r"gave range_m of shape \(5,\)"),
        (GOOD.replace(BODY, "return replace(returns, intensity=returns.intensity * float('nan'))"), "NaN"),
        (GOOD.replace(BODY, "return None"), "returned NoneType"),
        (GOOD.replace(BODY, "return replace(returns, range_m=returns.range_m.astype(str))"), "range_m of type"),
        (GOOD.replace(BODY, "return replace(returns, beam=returns.beam.astype(float))"), "beam of type float64"),
    ],
)
def test_a_broken_effect_is_named_with_its_file_and_remedy(tmp_path, source, complaint):
    model = load_sensor(written(tmp_path, source))
    with pytest.raises(SensorError, match=complaint) as caught:
        of_hits(model, room())
    message = str(caught.value)
    assert "\n" not in message and "my_effect.py" in message and "rain_streaks" in message
    first = next(row for row, text in enumerate(source.splitlines(), 1) if "def apply" in text)
    line = int(message.partition(", line ")[2].partition(")")[0])
    assert first <= line <= len(source.splitlines())


EXPECTED = '''
"""Losses."""
from __future__ import annotations
from typing import ClassVar
import numpy as np
from sensors.effects import {base}


class RainStreaks({base}):
    """P."""

    name: ClassVar = "rain_streaks"
    channel: ClassVar = "drop"

    def apply(self, returns, shot, rng):
        """As they are."""
        return returns

    def {method}:
        """Wrong."""
        return {value}
'''


@pytest.mark.parametrize(
    ("base", "method", "value", "complaint"),
    [
        ("DetectionEffect", "kept(self, returns, shot)", "np.full(len(returns), np.nan)", "NaN or infinity in kept"),
        ("DetectionEffect", "kept(self, returns, shot)", "np.ones(3)", r"kept of shape \(3,\)"),
        ("DetectionEffect", "kept(self, returns, shot)", "1 / 0", "raised ZeroDivisionError"),
        ("NoiseEffect", "spread(self, returns, shot)", "-1.0, 0.0", "spread below 0"),
        ("NoiseScaleEffect", "factors(self, returns, shot)", "np.nan, 1.0", "NaN or infinity in factors"),
        ("ScanEffect", "survival(self, returns, shot)", "np.ones(2)", r"survival of shape \(2,\)"),
    ],
)
def test_wrong_predictions_of_an_effect_are_named_with_the_line(tmp_path, base, method, value, complaint):
    source = EXPECTED.format(base=base, method=method, value=value)
    model = load_sensor(written(tmp_path, source, "{effect: ./my_effect.py:RainStreaks}"))
    _, shot = of_hits(load_sensor("hdl64e"), room())
    with pytest.raises(SensorError, match=complaint) as caught:
        expect(model.effects, shot)
    lines = [
        row for row, text in enumerate(source.splitlines(), 1) if "def k" in text or "def s" in text or "def f" in text
    ]
    assert f"my_effect.py:RainStreaks, line {lines[0]}" in str(caught.value) or "raised" in complaint


@pytest.mark.parametrize(
    ("source", "entry", "complaint"),
    [
        (GOOD + "\n1/0\n", None, "my_effect.py, line 23, does not load: ZeroDivisionError"),
        (
            GOOD.replace("returns, shot, rng", "returns, shot rng"),
            None,
            "my_effect.py, line 19, does not load: SyntaxErr",
        ),
        ("import sys\nsys.exit(0)\n", None, "my_effect.py, line 2, does not load: SystemExit"),
        (GOOD, "{effect: ./my_effect.py:Hail, shift_m: 0}", "holds no 'Hail'"),
        (GOOD, "{effect: ./other.py:RainStreaks}", "does not exist"),
        (GOOD, "{effect: ./my_effect.py}", "names no class of that file; write `./my_effect.py:ClassName`"),
        (GOOD, "{effect: ./my_effect.py:RainStreaks, shift_m: 3}", "shift_m: .*less than or equal to 1"),
        (GOOD.replace("(PointEffect)", ""), None, "is no sensor effect"),
        (GOOD.replace("    example", "    stage: ClassVar = 'scan'\n    example"), None, "derived from PointEffect"),
        (GOOD.replace("def apply", "def act"), None, "has no `apply`"),
        (GOOD.replace('    channel: ClassVar = "range"\n', ""), None, "`name` or `channel` is missing"),
    ],
)
def test_a_file_that_breaks_the_rules_is_refused_in_one_line(tmp_path, source, entry, complaint):
    file = written(tmp_path, source, *([entry] if entry else []))
    with pytest.raises(SensorError, match=complaint) as caught:
        load_sensor(file)
    assert "\n" not in str(caught.value) and "sensor.yaml" in str(caught.value)


def test_installed_effects_are_detected_by_name(tmp_path, monkeypatch):
    (tmp_path / "rain_package.py").write_text(GOOD)
    info = tmp_path / "rain-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: rain\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[cosim.effects]\nrain_streaks = rain_package:RainStreaks\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert find_effect("rain_streaks").example == {"shift_m": 0.5}


def test_effects_are_importable_by_the_names_of_before_they_stood_in_rooms() -> None:
    with pytest.warns(DeprecationWarning, match="sensors.effects.points.range_scale now"):
        before = importlib.import_module("sensors.effects.range_scale")
    assert before.RangeScale is effect_classes()["range_scale"]
    assert before.__name__ == before.__spec__.name == "sensors.effects.points.range_scale"
    with pytest.raises(ModuleNotFoundError, match=r"effects\.nothing"):
        importlib.import_module("sensors.effects.nothing")
