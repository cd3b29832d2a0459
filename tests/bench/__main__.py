"""Prints all benchmarks in one table: `python -m tests.bench [lidar] [growth] [stages] [rates]`."""

from __future__ import annotations

import argparse

from rich.console import Console

from tests.bench import frames, growth, lidar
from tests.bench.rows import one_table

_SECTIONS = {
    "lidar": ("LiDAR stage: from the posed scene to points, both hits, normals, incidence", lidar.rows),
    "growth": ("First-hit trace as things grow", growth.rows),
    "stages": ("A frame of the default drive, one process, its own time", frames.stage_rows),
    "rates": ("The default drive: LiDAR with hits, gray, depth, colour, labels, files", frames.rate_rows),
}


def main() -> None:
    """Run and print every benchmark, or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=", ".join(_SECTIONS))
    chosen = parser.parse_args().sections or list(_SECTIONS)
    unknown = sorted(set(chosen) - set(_SECTIONS))
    if unknown:
        parser.error(f"unknown section {unknown[0]!r}; give some of {', '.join(_SECTIONS)}")
    console = Console()
    console.print(one_table((title, rows()) for title, rows in (_SECTIONS[name] for name in chosen)))


if __name__ == "__main__":
    main()
