"""`cosim compare`, `diagnose` and `add` as users call them: what they write, say, and refuse."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from cosim.cli import main
from sensors.sensor_model import load_sensor
from tests.cosim.discrepancy.small_drive import Yard, make_yard

_OWN_EFFECT = '''
from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import PointEffect, number
from sensors.returns import Returns
from sensors.shot import Shot


class Stretch(PointEffect):
    """Ranges a share too long."""

    name: ClassVar = "stretch"
    channel: ClassVar = "range"
    equation: ClassVar = "R·(1 + s)"
    example: ClassVar = {"share": 0.01}
    neutral: ClassVar = {"share": 0.0}

    share: float = number("share", ge=-0.1, le=0.1)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Longer ranges."""
        return replace(returns, range_m=returns.range_m * np.float32(1 + self.share))
'''


def run(*arguments: object) -> int:
    """Exit code of a command in this process."""
    try:
        return main([str(argument) for argument in arguments])
    except SystemExit as end:
        return int(end.code or 0)


def read(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text())


def test_compare_writes_its_json_and_page_and_says_a_line(
    biased_yard: Yard, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, file = tmp_path / "page", tmp_path / "c.json"
    code = run(
        "compare", biased_yard.drive, "--sensor", biased_yard.sensor, "--frames", 3, "--out", out, "--json", file
    )
    assert code == 0
    message = capsys.readouterr().out.strip().splitlines()
    assert len(message) == 1
    assert message[0].startswith("error ")
    found = read(file)
    assert set(found) == {
        "frames", "points", "channels", "error", "error_aligned", "budget", "noise_floor", "slices", "notes",
    }  # fmt: skip
    assert set(found["budget"]) == {"noise", "poses", "objects", "map", "missing", "unexplained"}
    assert sum(found["budget"].values()) == pytest.approx(found["error"])
    assert found["frames"] == 3
    assert {name: set(values) for name, values in found["channels"].items()} == {
        "range": {"rmse_m", "mae_m", "bias_m"},
        "intensity": {"rmse", "bias"},
        "drop": {"precision", "recall", "f1"},
        "spurious": {"per_frame"},
    }
    assert found["channels"]["range"]["bias_m"] == pytest.approx(0.04, abs=0.002)
    assert found["error"] > found["noise_floor"] > 0
    assert (out / "index.html").is_file()


def test_add_fits_and_the_error_falls_to_the_floor(
    biased_yard: Yard, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    better, file = tmp_path / "deep" / "better.yaml", tmp_path / "a.json"
    sensor = ("--sensor", biased_yard.sensor, "--drive", biased_yard.drive)
    assert run("add", "range_bias", *sensor, "--out", better, "--json", file) == 0
    assert re.search(r"^range_bias \(offset (3\.9|4\.0)\d* cm ± 0\.\d+\): held-out error", capsys.readouterr().out)
    added = read(file)
    assert set(added) == {"effect", "params", "ci95", "error_before", "error_after", "sensor_out"}
    low, high = added["ci95"]["offset_m"]
    assert low - 0.002 <= 0.04 <= high + 0.002
    assert added["error_after"] < added["error_before"]
    assert load_sensor(better).pattern == load_sensor(biased_yard.sensor).pattern
    page = tmp_path / "page"
    assert run("compare", biased_yard.drive, "--sensor", better, "--out", page, "--json", file, "--quiet") == 0
    assert read(file)["error"] <= 1.05 * read(file)["noise_floor"]
    assert capsys.readouterr().out == ""


def test_add_keeps_fixed_parameters(biased_yard: Yard, tmp_path: Path) -> None:
    better = tmp_path / "better.yaml"
    arguments = ("--sensor", biased_yard.sensor, "--drive", biased_yard.drive, "--out", better, "--quiet")
    assert run("add", "range_bias", "--param", "offset_m=0.031", *arguments) == 0
    effects = {effect.name: effect for effect in load_sensor(better).effects}
    assert effects["range_bias"].model_dump()["offset_m"] == 0.031
    # The same of an effect that the sensor has already.
    assert run("add", "range_noise", "--param", "sigma_m=0.05", *arguments) == 0
    effects = {effect.name: effect for effect in load_sensor(better).effects}
    assert effects["range_noise"].model_dump()["sigma_m"] == 0.05


def test_add_fits_one_of_several_effects_with_the_same_name(
    biased_yard: Yard, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    two, better = tmp_path / "two.yaml", tmp_path / "better.yaml"
    fields = [{"surfaces": "road", "sigma": 0.2, "cell_m": cell_m} for cell_m in (0.1, 1.0)]
    noise = [{"effect": "range_noise", "sigma_m": 0.05}, {"effect": "intensity_noise", "sigma_rel": 0.3}]
    effects = [*noise, *({"effect": "reflectance_field", **field} for field in fields)]
    pattern = str(biased_yard.sensor.parent / "pattern.yaml")
    two.write_text(yaml.safe_dump({"pattern": pattern, "effects": effects}))
    arguments = ("--sensor", two, "--drive", biased_yard.drive, "--out", better, "--quiet")

    def fields_of(sensor: Path) -> list[dict[str, Any]]:
        return [effect.model_dump() for effect in load_sensor(sensor).effects if effect.name == "reflectance_field"]

    assert run("add", "reflectance_field", *arguments) == 2
    assert "the sensor has 2 effects reflectance_field: name one with --param" in capsys.readouterr().err
    own = ("--param", "surfaces=road", "--param", "cell_m=0.1")
    assert run("add", "reflectance_field", *own, *arguments) == 0
    found = fields_of(better)
    assert len(found) == 2 and found[0]["cell_m"] == 0.1 and found[1] == {**fields[1], "skew": 0.0}
    other = ("--param", "surfaces=vehicle", "--param", "cell_m=0.1")
    assert run("add", "reflectance_field", *other, *arguments) == 0
    assert [one["surfaces"] for one in fields_of(better)] == ["road", "road", "vehicle"]


def test_an_effect_of_ones_own_is_named_relative_to_the_sensor_file(biased_yard: Yard, tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(_OWN_EFFECT)
    better = tmp_path / "sensors" / "better.yaml"
    arguments = ("--sensor", biased_yard.sensor, "--drive", biased_yard.drive, "--out", better, "--quiet")
    assert run("add", f"{tmp_path / 'own.py'}:Stretch", *arguments) == 0
    assert "../own.py:Stretch" in better.read_text()
    moved = tmp_path / "elsewhere"
    (tmp_path / "sensors").rename(moved)
    assert [effect.name for effect in load_sensor(moved / "better.yaml").effects][-1] == "stretch"


def test_notes_for_one_frame_list_what_is_not_observable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    yard = make_yard(tmp_path, frames=1, columns=3)
    assert run("diagnose", yard.drive, "--sensor", yard.sensor, "--out", "d", "--json", "d.json") == 0
    message = capsys.readouterr().err
    page, found = (tmp_path / "d/index.html").read_text(), read(tmp_path / "d.json")
    for words in ("only one frame", "mount_rotation, mount_translation", "no frame was left", "no intensities"):
        assert words in message
        assert words in page
        assert any(words in note for note in found["notes"])
    assert not {"mount_rotation", "mount_translation", "suspension_pitch"} & set(found["smallest_detectable"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("compare", "nowhere", "--sensor", "SENSOR"), "nowhere"),
        (("compare", "EMPTY", "--sensor", "SENSOR"), "EMPTY"),
        (("compare", "DRIVE", "--sensor", "none.yaml"), "does not exist"),
        (("compare", "DRIVE", "--sensor", "UNKNOWN"), "did you mean range_walk"),
        (("compare", "DRIVE", "--sensor", "BOUNDS"), "sigma_m"),
        (("compare", "DRIVE", "--sensor", "SENSOR", "--frames", "000077"), "no frame"),
        (("compare", "DRIVE", "--sensor", "SENSOR", "--out", "FILE"), "cannot write"),
        (("compare", "NOTWIN", "--sensor", "SENSOR"), "no twin"),
        (("compare", "DRIVE"), "--sensor"),
        (("diagnose", "DRIVE", "--sensor", "SENSOR", "--effect", "nothing.py:Nothing"), "nothing.py"),
        (("diagnose", "DRIVE", "--sensor", "SENSOR", "--out", "FILE"), "cannot write"),
        (("add", "range_wlak", "--sensor", "SENSOR", "--drive", "DRIVE", "--out", "o.yaml"), "did you mean range_walk"),
        (
            ("add", "range_bias", "--param", "offset=1", "--sensor", "SENSOR", "--drive", "DRIVE", "--out", "o.yaml"),
            "offset_m",
        ),
        (
            (
                "add",
                "range_bias",
                "--param",
                "offset_m=1e9",
                "--sensor",
                "SENSOR",
                "--drive",
                "DRIVE",
                "--out",
                "o.yaml",
            ),
            "offset_m",
        ),
        (
            ("add", "range_bias", "--param", "1", "--sensor", "SENSOR", "--drive", "DRIVE", "--out", "o.yaml"),
            "NAME=VALUE",
        ),
        (("add", "box_shrink", "--sensor", "SENSOR", "--drive", "DRIVE", "--out", "o.yaml"), "labels"),
        (("add", "range_bias", "--sensor", "SENSOR", "--drive", "DRIVE", "--out", "FILE/o.yaml"), "cannot write"),
    ],
)
def test_a_users_mistake_ends_in_one_line_and_exit_code_2(
    arguments: tuple[str, ...], words: str, biased_yard: Yard, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "EMPTY").mkdir()
    (tmp_path / "FILE").write_text("in the way")
    pattern = f"pattern: {biased_yard.sensor.parent / 'pattern.yaml'}\n"
    (tmp_path / "UNKNOWN").write_text(pattern + "effects: [{effect: range_wlak}]\n")
    (tmp_path / "BOUNDS").write_text(pattern + "effects: [{effect: range_noise, sigma_m: -1}]\n")
    untwinned = tmp_path / "NOTWIN"
    untwinned.mkdir()
    for part in ("velodyne", "rays", "calib", "pattern.yaml"):
        (untwinned / part).symlink_to(biased_yard.drive / part)
    known = {"DRIVE": biased_yard.drive, "SENSOR": biased_yard.sensor}

    def filled(word: str) -> str:
        head, _, tail = word.partition("/")
        if head in known:
            return str(known[head])
        return str(tmp_path / head / tail) if (tmp_path / head).exists() else word

    assert run(*(filled(word) for word in arguments)) == 2
    message = capsys.readouterr().err.strip()
    assert words in message
    assert len(message.splitlines()) == 1
    assert "Traceback" not in message
