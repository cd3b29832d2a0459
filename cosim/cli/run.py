"""`cosim run`: simulate traffic, scan it with the sensor rig and write a drive in KITTI's format."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from cosim.cli.engine_options import add_engine, engine_of
from cosim.cli.options import add_common, write_json

if TYPE_CHECKING:
    from assets.streets import Streets


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "run", help="simulate, scan and write a KITTI drive", description=__doc__
    )
    parser.add_argument(
        "config", nargs="?", type=Path, metavar="CONFIG.yaml", help="settings; the options below override them"
    )
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="folder of the drive to write; an unfinished run in it is resumed",
    )
    parser.add_argument("--town", metavar="T", help="built-in towns (town01,town02 or all) or a .sumocfg")
    parser.add_argument(
        "--trajectories",
        type=Path,
        metavar="FILE",
        help="trajectories of road users: FCD output, CommonRoad, OpenSCENARIO, or a table (CSV)",
    )
    parser.add_argument(
        "--taxi-dispatch",
        metavar="ALGORITHM",
        help="SUMO's algorithm for dispatching taxis, for example greedy (.sumocfg only)",
    )
    parser.add_argument("--frames", type=int, metavar="N", help="number of frames to record")
    parser.add_argument("--seed", type=int, metavar="S", help="seed of all random draws")
    parser.add_argument(
        "--sensor", metavar="FILE|NAME", help="sensor file, or the name of a built-in sensor or pattern"
    )
    parser.add_argument("--rig", metavar="FILE|NAME", help="rig file, or the name of a built-in rig")
    add_engine(parser, "the episodes")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Record the drive, with a progress bar."""
    from cosim.capture.config import load_config
    from cosim.capture.disk_estimate import estimate_bytes, in_words
    from cosim.capture.rig_sensors import rig_sensors
    from cosim.capture.runner import run
    from cosim.capture.time_estimate import TownSize, estimate_s, machine_slowness, time_in_words
    from cosim.cli.progress import FrameReport

    config = load_config(
        options.config,
        town=_towns(options.town),
        frames=options.frames,
        seed=options.seed,
        sensor=options.sensor,
        rig=options.rig,
        trajectories=options.trajectories,
        taxi_dispatch=options.taxi_dispatch,
    )
    engine = engine_of(options)
    started = time.monotonic()
    with FrameReport(console, starting="building the town", working="recording") as report:
        sizes: dict[str, TownSize] = {}

        def measure(towns: Mapping[str, Streets]) -> None:
            sizes.update({name: TownSize.of(streets) for name, streets in towns.items()})

        def start(done: int, total: int) -> None:
            if done < total and options.engine == "local":  # the number of a cluster's workers varies
                sensors, left, workers = list(rig_sensors(config).values()), 1 - done / total, options.workers
                size = in_words(estimate_bytes(config, sensors) * left)
                takes = time_in_words(estimate_s(config, sensors, workers, machine_slowness(), sizes) * left)
                with_whom = "1 worker" if workers == 1 else f"{workers} workers"
                console.print(f"{total - done} frames to record: about {size}, {takes} with {with_whom}")
            report.start(done, total)

        result = run(config, options.out, engine=engine, on_start=start, on_towns=measure, on_event=report.follow)
    seconds = time.monotonic() - started
    console.print(
        f"{result.frames} frames, {result.points:,} points in {result.folder} "
        f"({result.recorded} recorded in {seconds:.0f} s)"
    )
    if result.frames < config.frames:
        console.print(f"{config.frames - result.frames} frames are missing: their episodes jammed, see manifest.jsonl")
    write_json(
        options.json,
        {
            "out": str(result.folder),
            "frames": result.frames,
            "points": result.points,
            "recorded": result.recorded,
            "seconds": seconds,
            "frames_per_s": report.per_s,
        },
    )


def _towns(text: str | None) -> str | tuple[str, ...] | None:
    """One town, or several that are separated by commas."""
    return text if text is None or "," not in text else tuple(name for name in text.split(",") if name)
