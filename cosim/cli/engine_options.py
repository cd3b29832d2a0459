"""Options of commands that run several worker processes."""

from __future__ import annotations

import argparse

from cosim.engine import Engine, LocalEngine, WorkError
from cosim.engine.local import PATIENCE_S


def add_engine(parser: argparse.ArgumentParser, what: str) -> None:
    """Add `--workers`, `--engine`, `--address` and `--patience`; `what` names the work that is distributed."""
    parser.add_argument(
        "--workers", type=int, default=1, metavar="W", help=f"number of processes that work on {what} (default: 1)"
    )
    parser.add_argument(
        "--engine",
        choices=("local", "dask"),
        default="local",
        help="run the processes on this machine or on a Dask cluster (default: local)",
    )
    parser.add_argument("--address", metavar="tcp://HOST:PORT", help="address of the Dask scheduler")
    parser.add_argument(
        "--patience",
        type=float,
        default=PATIENCE_S,
        metavar="S",
        help=f"stop a process that reports no progress for this many seconds (default: {PATIENCE_S:g})",
    )


def engine_of(options: argparse.Namespace) -> Engine:
    """Create the engine from the options.

    Raises:
        WorkError: the options contradict each other.
    """
    if options.engine == "local":
        if options.address:
            raise WorkError("--address applies only to --engine dask; give both or neither")
        return LocalEngine(options.workers, options.patience)
    if not options.address:
        raise WorkError("--engine dask needs the address of its scheduler: --address tcp://HOST:PORT")
    from cosim.engine.cluster import DaskEngine

    return DaskEngine(options.address, options.patience)
