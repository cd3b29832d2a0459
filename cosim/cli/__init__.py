"""The command line: the only place that prints."""

from cosim.cli.main import main

__all__ = ["main"]
