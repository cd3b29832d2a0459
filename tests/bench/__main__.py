"""Prints all benchmarks: `python -m tests.bench`."""

from __future__ import annotations

from rich.console import Console

from tests.bench import frames, lidar


def main() -> None:
    """Run and print every benchmark."""
    console = Console()
    console.print(lidar.table())
    console.print(frames.stage_table())
    console.print(frames.rate_table())


if __name__ == "__main__":
    main()
