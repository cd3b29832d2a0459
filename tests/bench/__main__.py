"""Prints all benchmarks in one table: `python -m tests.bench [SECTION …]`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator, Sequence

from rich.console import Console

from tests.bench import effects, floor, frames, growth, lidar, loop, memory, rates
from tests.bench.rows import Row, one_table

_SECTIONS = {
    "lidar": ("LiDAR stage: from the posed scene to points, both hits, normals, incidence", lidar.rows),
    "growth": ("As things grow", growth.rows),
    "stages": ("A frame of the default drive, one process, its own time", frames.stage_rows),
    "floor": ("A frame against its floor: the libraries' own time for the same frames", floor.rows),
    "rates": ("Default settings, start included: LiDAR with hits, gray, depth, colour, labels, files", rates.rows),
    "sizes": ("What a frame takes on disk, and variants of it", frames.size_rows),
    "memory": ("A long drive by two workers", memory.rows),
    "loop": ("Comparing and diagnosing, one process, its own time", loop.rows),
}


def main() -> None:
    """Run and print every benchmark, or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    known = [*_SECTIONS, "effects"]
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=", ".join(known))
    chosen = parser.parse_args().sections or known
    unknown = sorted(set(chosen) - set(known))
    if unknown:
        parser.error(f"unknown section {unknown[0]!r}; give some of {', '.join(known)}")
    timed = [_SECTIONS[name] for name in chosen if name in _SECTIONS]
    if timed:
        Console().print(one_table(_measured(timed)))
    if "effects" in chosen:
        Console(width=170).print(effects.table())


def _measured(timed: Sequence[tuple[str, Callable[[], Iterable[Row]]]]) -> Iterator[tuple[str, Iterable[Row]]]:
    """Sections with their rows, each said before it starts: all take minutes."""
    message = Console(stderr=True, style="dim")
    for number, (title, rows) in enumerate(timed, start=1):
        message.print(f"{number}/{len(timed)} {title}")
        yield title, rows()


if __name__ == "__main__":
    main()
