"""Options of the commands whose work several processes share."""

from __future__ import annotations

import argparse

from cosim.engine import Engine, LocalEngine, WorkError
from cosim.engine.local import PATIENCE_S


def add_engine(parser: argparse.ArgumentParser, what: str) -> None:
    """Whose processes share some work, and how many they are."""
    parser.add_argument("--workers", type=int, default=1, metavar="W", help=f"processes that share {what}")
    parser.add_argument(
        "--engine", choices=("local", "dask"), default="local", help="processes of this machine, or a Dask cluster's"
    )
    parser.add_argument("--address", metavar="tcp://HOST:PORT", help="the Dask cluster's scheduler")
    parser.add_argument(
        "--patience",
        type=float,
        default=PATIENCE_S,
        metavar="S",
        help="end a process that tells nothing for so long [s]",
    )


def engine_of(options: argparse.Namespace) -> Engine:
    """The engine that the options describe.

    Raises:
        WorkError: they contradict each other.
    """
    if options.engine == "local":
        if options.address:
            raise WorkError("--address is for --engine dask; give both or neither")
        return LocalEngine(options.workers, options.patience)
    if not options.address:
        raise WorkError("--engine dask needs --address tcp://HOST:PORT, that of its scheduler")
    from cosim.engine.cluster import DaskEngine

    return DaskEngine(options.address, options.patience)
