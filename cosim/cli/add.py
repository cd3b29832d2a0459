"""`cosim add`: fit an effect to a drive and write a sensor file that contains it."""

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
    """Add the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "add", help="fit an effect to a drive and add it to a sensor file", description=__doc__
    )
    parser.add_argument(
        "effect", metavar="EFFECT", help="name of an effect in the catalogue, or my_effect.py:ClassName"
    )
    parser.add_argument(
        "--param",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="fixed value of a parameter, which is not fitted; may be repeated",
    )
    parser.add_argument(
        "--sensor",
        required=True,
        metavar="IN.yaml|NAME",
        help="sensor file, or the name of a built-in sensor or pattern",
    )
    parser.add_argument(
        "--drive", type=Path, required=True, metavar="DRIVE", help="folder of a measured drive with a twin"
    )
    add_lidar(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="OUT.yaml", help="sensor file to write")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Fit the effect, then write the sensor file."""
    from cosim.discrepancy import add
    from cosim.discrepancy.add import fixed_parameters
    from cosim.discrepancy.data.checks import opened
    from sensors.effects.registry import find_effect
    from sensors.sensor_model import load_sensor

    effect = find_effect(options.effect)
    fixed = fixed_parameters(effect, _parse_parameters(options.param))
    sensor, drive = load_sensor(options.sensor), opened(chosen_lidar(options.drive, options))
    with explained(options.out):
        options.out.parent.mkdir(parents=True, exist_ok=True)
        if options.out.is_dir():
            raise IsADirectoryError(21, "it is a folder", str(options.out))
    with ProgressReport(console, f"fitting {effect.name}"):
        result = add(effect, drive, sensor, fixed=fixed)
    result.write_sensor(options.out)
    if not options.quiet:
        print(result)
    console.print(f"{options.out}: the sensor with {result.effect}", soft_wrap=True, highlight=False)
    write_json(options.json, without_nan({**result.to_json(), "sensor_out": os.path.relpath(options.out)}))


def _parse_parameters(texts: list[str]) -> dict[str, Any]:
    """Parse NAME=VALUE texts; returns YAML values by name."""
    import yaml

    from sensors.errors import SensorError

    parameters: dict[str, Any] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        if not sign or not name.strip():
            raise SensorError(f"--param is {text!r}; write --param NAME=VALUE")
        try:
            parameters[name.strip()] = yaml.safe_load(value)
        except yaml.YAMLError as error:
            raise SensorError(f"--param {text!r} cannot be read; write --param NAME=VALUE") from error
    return parameters
