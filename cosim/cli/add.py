"""`cosim add`: an effect fitted to a drive, and the sensor file with it."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common, add_lidar, chosen_lidar, without_nan, write_json
from cosim.cli.progress import ProgressReport
from cosim.drives.writer import explained


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "add", help="fit an effect to a drive and write the sensor with it", description=__doc__
    )
    parser.add_argument("effect", metavar="EFFECT", help="name in the catalogue, or my_effect.py:ClassName")
    parser.add_argument(
        "--param", action="append", default=[], metavar="NAME=VALUE", help="a parameter that is known and stays"
    )
    parser.add_argument("--sensor", required=True, metavar="IN.yaml", help="sensor file, or the name of a built-in one")
    parser.add_argument("--drive", type=Path, required=True, metavar="DRIVE", help="measured points with a twin")
    add_lidar(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="OUT.yaml", help="the sensor file to write")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Fit, then write the sensor."""
    from cosim.discrepancy import add
    from cosim.discrepancy.add import known_parameters
    from cosim.discrepancy.data.checks import opened
    from sensors.effects.registry import find_effect
    from sensors.sensor_model import load_sensor

    kind = find_effect(options.effect)
    fixed = known_parameters(kind, _given(options.param))
    sensor, drive = load_sensor(options.sensor), opened(chosen_lidar(options.drive, options))
    with explained(options.out):
        options.out.parent.mkdir(parents=True, exist_ok=True)
        if options.out.is_dir():
            raise IsADirectoryError(21, "it is a folder", str(options.out))
    with ProgressReport(console, f"fitting {kind.name}"):
        found = add(kind, drive, sensor, fixed=fixed)
    found.write_sensor(options.out)
    if not options.quiet:
        print(found)
    console.print(f"{options.out}: the sensor with {found.effect}", soft_wrap=True, highlight=False)
    write_json(options.json, without_nan({**found.to_json(), "sensor_out": os.path.relpath(options.out)}))


def _given(texts: list[str]) -> dict[str, Any]:
    """Parameters by name, as they stand on the command line."""
    import yaml

    from sensors.errors import SensorError

    given: dict[str, Any] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        if not sign or not name.strip():
            raise SensorError(f"--param is {text!r}; write --param NAME=VALUE")
        try:
            given[name.strip()] = yaml.safe_load(value)
        except yaml.YAMLError as error:
            raise SensorError(f"--param {text!r} cannot be read; write --param NAME=VALUE") from error
    return given
