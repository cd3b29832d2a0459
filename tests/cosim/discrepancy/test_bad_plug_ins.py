"""Commands stop with one line and exit code 2 where a plug-in is faulty."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from cosim.cli.main import main
from sensors.effects.points.range_noise import RangeNoise
from tests.cosim.discrepancy.small_drive import Yard, make_yard

PLUG_IN = '''"""A plug-in."""

from typing import ClassVar

import numpy as np

from sensors.effects.base import number
from sensors.effects.channels import {base}


class Faulty({base}):
    """Faulty."""

    name: ClassVar = "faulty"
    example: ClassVar = {{"amplitude": 0.1}}
    neutral: ClassVar = {{"amplitude": 0.0}}
    covariates: ClassVar = ("{covariate}",)

    amplitude: float = number("size")

    def error(self, x):
        """Return the error."""
        return {value}
'''
FAULTS = {
    "syntax": ("RangeError", "range", "self.amplitude * (x", "return", "does not load: SyntaxError"),
    "raises": ("ElevationError", "range", "self.amplitude / 0", "return", "raised ZeroDivisionError"),
    "NaN": ("ReturnProbability", "range", "self.amplitude * x * np.nan", "def error", "NaN or infinity"),
    "shape": ("EarlyReturns", "azimuth", "x[:3]", "def error", "error has shape (3,)"),
    "covariate": ("RangeError", "colour", "x", "class Faulty", "covariate 'colour' is unknown"),
}


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Yard:
    known = ({"effect": "range_noise", "sigma_m": 0.01},)
    return make_yard(tmp_path_factory.mktemp("faulty"), (RangeNoise(sigma_m=0.01),), known=known, frames=4)


def faulty_file(fault: str, folder: Path) -> tuple[Path, int, str]:
    """A plug-in with a fault, the line where that is, and what is to be said of it."""
    base, covariate, value, text, complaint = FAULTS[fault]
    file = folder / "faulty.py"
    file.write_text(PLUG_IN.format(base=base, covariate=covariate, value=value))
    lines = file.read_text().splitlines()
    return file, max(row for row, line in enumerate(lines, 1) if line.strip().startswith(text)), complaint


def sensor_with(file: Path, pattern: str) -> str:
    sensor = file.with_name("sensor.yaml")
    sensor.write_text(f"pattern: {pattern}\neffects:\n  - {{effect: ./faulty.py:Faulty, amplitude: 0.1}}\n")
    return str(sensor)


def check_line(message: str, file: Path, line: int, complaint: str) -> None:
    assert message.count("\n") == 1
    assert complaint in message
    found = re.search(rf"{re.escape(str(file))}\S*, line (\d+)", message)
    assert found is not None
    assert abs(int(found[1]) - line) <= 1  # Python versions differ in where an open bracket is a fault


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("command", ["compare", "diagnose", "add"])
def test_a_faulty_plug_in_stops_commands_in_one_line(
    command: str, fault: str, yard: Yard, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, line, complaint = faulty_file(fault, tmp_path)
    sensor = sensor_with(file, str(yard.sensor.with_name("pattern.yaml")))
    arguments = {
        "compare": [str(yard.drive), "--sensor", sensor],
        "diagnose": [str(yard.drive), "--sensor", sensor, "--out", str(tmp_path / "out")],
        "add": [
            f"{file}:Faulty",
            "--sensor",
            str(yard.sensor),
            "--drive",
            str(yard.drive),
            "--out",
            str(tmp_path / "o"),
        ],
    }
    assert main([command, *arguments[command], "--quiet"]) == 2
    check_line(capsys.readouterr().err, file, line, complaint)


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_plug_in_stops_a_run_in_one_line(
    fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, line, complaint = faulty_file(fault, tmp_path)
    arguments = ["run", "--frames", "1", "--workers", "1", "--out", str(tmp_path / "drive"), "--quiet"]
    assert main([*arguments, "--sensor", sensor_with(file, "hdl64e")]) == 2
    check_line(capsys.readouterr().err, file, line, complaint)
