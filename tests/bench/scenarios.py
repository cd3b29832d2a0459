"""What becomes of the scenarios of SUMO's own package: `python -m tests.bench.scenarios [NAME …]`.

Three frames of each, with a scanner of 16 lasers and without images, each in a process of its own. Prints a table:
what was recorded, or the line that says why not.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from cosim.drives.kitti import Drive
from sumo_nets.tools import sumo_home

_FRAMES, _LIMIT_S = 3, 900
_ON_DEMAND = frozenset({"DRT", "DRT2"})  # the player of the game sends the buses; here SUMO does
_COSIM = (sys.executable, "-c", "import sys; from cosim.cli import main; sys.exit(main())")


def found() -> list[Path]:
    """Every configuration of the installed package."""
    return sorted(sumo_home().rglob("*.sumocfg"))


def row(config: Path, folder: Path) -> str:
    """One line of the table.

    Args:
        config: the scenario.
        folder: where its drive is written.
    """
    (folder / "small.yaml").write_text("pattern: vlp16\neffects: []\n")
    out = folder / "drive"
    dispatch = "taxi_dispatch: greedy\n" if config.stem in _ON_DEMAND else ""
    (folder / "run.yaml").write_text(f"images: []\nsensor: small.yaml\n{dispatch}")
    options = ("--town", str(config), "--frames", str(_FRAMES), "--seed", "1", "--out", str(out), "--quiet")
    try:
        run = subprocess.run(
            [*_COSIM, "run", "run.yaml", *options], cwd=folder, capture_output=True, text=True, timeout=_LIMIT_S
        )
    except subprocess.TimeoutExpired:
        return f"| `{config.name}` | no end after {_LIMIT_S} s | |"
    message = [line for line in run.stderr.splitlines() if line.strip()]
    notes = "; ".join(_short(line, config) for line in message)
    if run.returncode:
        return f"| `{config.name}` | refused ({run.returncode}) | {notes} |"
    frames = list(Drive(out))
    points = sum(len(frame.points) for frame in frames) // len(frames)
    others = sum(len(frame.twin.instances) for frame in frames if frame.twin) // len(frames)
    return f"| `{config.name}` | {len(frames)} frames of {points} points, {others} others about | {notes} |"


def _short(line: str, config: Path) -> str:
    """A message without the paths of this machine."""
    line = re.sub(r"^(WARNING: |cosim run: )", "", line).replace(f"{config}: ", "")
    return line.replace(f"{config.parent}/", "").replace("|", "/")


def rows(names: list[str]) -> Iterator[str]:
    """All lines, or those of scenarios that are named."""
    for config in found():
        if not names or config.stem in names:
            with tempfile.TemporaryDirectory(prefix="cosim-") as folder:
                yield row(config, Path(folder))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="stems of scenarios; all by default")
    print("| scenario | recorded | said |\n|---|---|---|", flush=True)
    for line in rows(parser.parse_args().names):
        print(line, flush=True)


if __name__ == "__main__":
    main()
