"""`cosim stats`: statistics of a data set, its distances to another one, and a classifier two-sample test."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from cosim.cli.options import add_common, write_json
from cosim.cli.progress import ProgressReport

if TYPE_CHECKING:
    from cosim.stats import Collected, FrameSet
    from cosim.stats.two_sample import TwoSample


def add_command(commands: Any) -> None:
    """Describe the command to the parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "stats", help="statistics of a data set and its distance from another", description=__doc__
    )
    parser.add_argument(
        "set", type=Path, metavar="DIR", help="a drive, simulated or in KITTI's layout, or a folder with only label_2/"
    )
    parser.add_argument("--against", type=Path, metavar="DIR2", help="second data set: the reference of the distances")
    parser.add_argument("--beside", type=Path, metavar="DIR3", help="third data set, also compared with DIR2")
    parser.add_argument(
        "--units",
        default="frame",
        metavar="U",
        help="what is independent in the two-sample test: frame (default); N, so many frames in a row; or drive, the "
        "part of a frame's name before its last _",
    )
    parser.add_argument(
        "--sector-deg",
        type=float,
        default=90.0,
        metavar="DEG",
        help="width of the forward sector that the two-sample test uses (default: 90, that of a camera)",
    )
    parser.add_argument("--out", type=Path, metavar="OUT", help="folder of the page (default: DIR-stats next to DIR)")
    add_common(parser, computes=True)
    parser.set_defaults(execute=execute)


def execute(options: argparse.Namespace, console: Console) -> None:
    """Read the sets, hold them against each other, and write the page."""
    import numpy as np

    from cosim.errors import CosimError
    from cosim.stats import FrameSet, as_json, compare_sets, write_stats
    from cosim.stats.two_sample import separate

    if options.beside is not None and options.against is None:
        raise CosimError("--beside needs a reference to compare with; give it with --against DIR2")
    sources = [FrameSet(path) for path in (options.set, options.against, options.beside) if path is not None]
    sets = [_read(source, console) for source in sources]
    with ProgressReport(console, "comparing"):
        distances = compare_sets(sets[0], sets[1], np.random.default_rng(0)) if len(sets) > 1 else []
        beside = compare_sets(sets[2], sets[1], np.random.default_rng(0)) if len(sets) > 2 else []
    separation = None
    if len(sets) > 1:
        with ProgressReport(console, "telling the sets apart") as report:
            separation = separate(sources[0], sources[1], options.units, options.sector_deg, on_frame=report.advance)
    given = options.set.resolve()
    page = write_stats(options.out or given.with_name(f"{given.name}-stats"), sets, distances, beside, separation)
    _print_separation(separation, console)
    for distance in distances:
        unit = "" if distance.unit == "1" else f" {distance.unit}"
        others = [item.wasserstein for item in beside if item.key == distance.key]
        other = f"; {sets[2].title}: {others[0]:.3g}{unit}" if others else ""
        interval = f"({distance.low:.3g} to {distance.high:.3g})"
        console.print(f"{distance.title}: {distance.wasserstein:.3g}{unit} {interval}{other}", soft_wrap=True)
    console.print(f"{' and '.join(f'{len(found.frames):,}' for found in sets)} frames on {page}", soft_wrap=True)
    write_json(options.json, as_json(sets, distances, beside, separation))


def _print_separation(separation: TwoSample | str | None, console: Console) -> None:
    if isinstance(separation, str):
        console.print(f"no two-sample test: {separation}", soft_wrap=True)
    elif separation is not None:
        for item in separation.channels:
            base = "" if item.baseline is None else f"; baseline {item.baseline.auc:.2f}"
            interval = f"({item.sets.low:.2f} to {item.sets.high:.2f}, p {item.sets.p_value:.3f})"
            console.print(f"two-sample test, {item.channel}: AUC {item.sets.auc:.2f} {interval}{base}", soft_wrap=True)


def _read(source: FrameSet, console: Console) -> Collected:
    from cosim.stats import collect

    with ProgressReport(console, f"reading {source.title}", len(source)) as report:
        return collect(source, on_frame=lambda name: report.advance())
