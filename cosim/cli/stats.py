"""`cosim stats`: what a data set holds, and how far it is from another."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from cosim.cli.options import add_common, write_json
from cosim.cli.progress import ProgressReport

if TYPE_CHECKING:
    from cosim.stats import Collected, FrameSet


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "stats", help="statistics of a data set and its distance from another", description=__doc__
    )
    parser.add_argument(
        "set", type=Path, metavar="DIR", help="a drive, simulated or in KITTI's layout, or a folder with label_2/ alone"
    )
    parser.add_argument("--against", type=Path, metavar="DIR2", help="a second set, the reference of the distances")
    parser.add_argument("--beside", type=Path, metavar="DIR3", help="a third set, shown and held against DIR2 as well")
    parser.add_argument("--out", type=Path, metavar="OUT", help="folder of the page (default: DIR-stats beside DIR)")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Read the sets, hold them against each other, and write the page."""
    import numpy as np

    from cosim.errors import CosimError
    from cosim.stats import FrameSet, as_json, compare_sets, write_stats

    if options.beside is not None and options.against is None:
        raise CosimError("--beside is held against a reference that is missing; give it with --against DIR2")
    sources = [FrameSet(path) for path in (options.set, options.against, options.beside) if path is not None]
    sets = [_read(source, console) for source in sources]
    with ProgressReport(console, "comparing"):
        distances = compare_sets(sets[0], sets[1], np.random.default_rng(0)) if len(sets) > 1 else []
        beside = compare_sets(sets[2], sets[1], np.random.default_rng(0)) if len(sets) > 2 else []
    given = options.set.resolve()
    page = write_stats(options.out or given.with_name(f"{given.name}-stats"), sets, distances, beside)
    for distance in distances:
        unit = "" if distance.unit == "1" else f" {distance.unit}"
        others = [item.wasserstein for item in beside if item.key == distance.key]
        other = f"; {sets[2].title}: {others[0]:.3g}{unit}" if others else ""
        interval = f"({distance.low:.3g} to {distance.high:.3g})"
        console.print(f"{distance.title}: {distance.wasserstein:.3g}{unit} {interval}{other}", soft_wrap=True)
    console.print(f"{' and '.join(f'{len(found.frames):,}' for found in sets)} frames on {page}", soft_wrap=True)
    write_json(options.json, as_json(sets, distances, beside))


def _read(source: FrameSet, console: Console) -> Collected:
    from cosim.stats import collect

    with ProgressReport(console, f"reading {source.title}", len(source)) as report:
        return collect(source, on_frame=lambda name: report.advance())
