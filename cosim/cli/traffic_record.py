"""`cosim traffic-record`: trajectories of the simulated traffic, as the commands about traffic read them."""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

from cosim.cli.options import add_common
from cosim.cli.progress import ProgressReport
from cosim.drives.writer import explained


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "traffic-record", help="write trajectories of simulated traffic", description=__doc__
    )
    parser.add_argument("--config", type=Path, required=True, metavar="FILE", help="`town` and `behaviour` of a run")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.csv", help="the trajectories")
    parser.add_argument("--seconds", type=float, default=120.0, metavar="S", help="how long (default: 120)")
    parser.add_argument("--seed", type=int, metavar="N", help="of traffic (default: the configuration's)")
    add_common(parser)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Simulate and write, without pedestrians, which are not recorded."""
    import numpy as np

    from cosim.capture.config import load_config
    from cosim.capture.episode_start import populated
    from cosim.driver_discrepancy.simulate import record
    from cosim.driver_discrepancy.tracks import TrackError, write_tracks
    from sumo_nets import read_town

    if not 1 <= options.seconds <= 3600:
        raise TrackError(f"--seconds is {options.seconds:g}; give 1 to 3600")
    config = load_config(options.config, seed=options.seed)
    town = read_town(next(iter(config.towns)))
    nobody = config.model_copy(update={"population": config.population.model_copy(update={"walking": (0, 0)})})
    with explained(options.out):
        options.out.parent.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory(prefix="cosim-") as folder,
        ProgressReport(console, f"simulating {options.seconds:g} s of traffic"),
    ):
        sumocfg, _ = populated(town, nobody, np.random.default_rng([config.seed, 0]), Path(folder))
        tracks = record(
            sumocfg,
            config.behaviour,
            seed=config.seed,
            step_s=config.step_s,
            warm_up_s=config.warm_up_s,
            seconds=options.seconds,
        )
    write_tracks(options.out, replace(tracks, place=tracks.place + np.array(town.streets.origin_m)[:2]))
    console.print(f"{options.out}: {len(tracks.ids)} vehicles, {tracks.seconds:.0f} s", soft_wrap=True, highlight=False)
