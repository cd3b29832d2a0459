"""`cosim export`: a drive in the layout or format of others."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common, add_lidar, chosen_lidar, write_json
from cosim.cli.progress import ProgressReport

_CALIBRATED = ("calibration", "corrected")  # of folders of `cosim calibrate`


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "export", help="write a drive in the layout or format of others", description=__doc__
    )
    from cosim.export import FORMATS

    parser.add_argument("format", choices=("openpcdet", *FORMATS, *_CALIBRATED), help="whose layout or format to write")
    parser.add_argument("drive", type=Path, metavar="DIR", help="a finished drive, simulated or real")
    parser.add_argument("--out", type=Path, metavar="DIR2", help="folder to write (default: DIR-FORMAT next to DIR)")
    parser.add_argument(
        "--template", type=Path, metavar="FILE", help="calibration: a driver's own file, whose laser numbers are kept"
    )
    add_lidar(parser)
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Write the layout."""
    from cosim.cli.options import beside
    from cosim.errors import CosimError

    if options.format in _CALIBRATED:
        _export_calibrated(options, console)
        return
    if options.template is not None:
        raise CosimError("--template belongs to `cosim export calibration`")
    from cosim.export import export
    from cosim.export.source import open_finished

    path, name = chosen_lidar(options.drive, options), options.format
    drive = open_finished(path)
    folder = options.out or beside(path, name)
    with ProgressReport(console, "exporting", len(drive)) as report:
        if name == "openpcdet":
            from training.openpcdet import export_openpcdet

            counts = export_openpcdet(drive, folder, on_frame=report.advance)
        else:
            counts = export(drive, name, folder, report.advance)
    values = ", ".join(f"{number} {what}" for what, number in counts.items())
    console.print(f"{folder}: {values}", soft_wrap=True, highlight=False)
    write_json(options.json, {"out": str(folder), "frames": counts})


def _export_calibrated(options: argparse.Namespace, console: Console) -> None:
    """Write the sensor of a calibration in the formats of drivers, or its corrected scans and poses."""
    from cosim.cli.options import beside
    from cosim.export.sensor_calibration import write_calibration
    from cosim.recordings.calibration.corrected import calibration_result, write_corrected
    from sensors.sensor_model import load_sensor

    folder = options.out or beside(options.drive, options.format)
    if options.format == "calibration":
        path = options.drive
        sensor = load_sensor(path if path.is_file() else path / calibration_result(path)["sensor_file"])
        counts = write_calibration(sensor, folder, options.template)
    else:
        with ProgressReport(console, "correcting", unit="scans") as report:
            counts = write_corrected(options.drive, folder, report.advance)
    values = ", ".join(f"{number} {what}" for what, number in counts.items())
    console.print(f"{folder}: {values}", soft_wrap=True, highlight=False)
    write_json(options.json, {"out": str(folder), "frames": counts})
