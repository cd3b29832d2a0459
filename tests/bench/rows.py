"""What a benchmark says: a line of the one table, and how times are taken."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from rich.table import Table


@dataclass(frozen=True)
class Row:
    """A line.

    Attributes:
        what: is measured.
        figure: with its unit.
        target: what it should be; empty where there is none.
    """

    what: str
    figure: str
    target: str = ""


def one_table(sections: Iterable[tuple[str, Iterable[Row]]]) -> Table:
    """All sections under each other."""
    table = Table(title="Benchmarks")
    table.add_column("what")
    table.add_column("figure", justify="right")
    table.add_column("target", justify="right")
    for title, rows in sections:
        table.add_section()
        table.add_row(f"[bold]{title}[/bold]")
        for row in rows:
            table.add_row(f"  {row.what}", row.figure, row.target)
    return table


def best_s(call: Callable[[], object], repeats: int, clock: Callable[[], float] = time.thread_time) -> float:
    """The shortest of some calls [s]; by default in this thread's own time, which other processes do not lengthen."""
    times = []
    for _ in range(repeats):
        started = clock()
        call()
        times.append(clock() - started)
    return min(times)
