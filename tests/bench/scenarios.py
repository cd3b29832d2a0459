"""Record each scenario of SUMO's own package: `python -m tests.bench.scenarios [NAME …]`.

Three frames of each, with a scanner of 16 lasers and without images, each in a process of its own. A scenario that is
refused for lack of a dispatcher is run again with SUMO's dispatcher. Prints a table: frames or refusal, wall time and
messages of each run.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from cosim.drives.kitti import Drive
from sumo_nets.tools import sumo_home

_FRAMES, _LIMIT_S = 3, 300
_DISPATCHED = ("--taxi-dispatch", "greedy")
_COSIM = (sys.executable, "-c", "import sys; from cosim.cli import main; sys.exit(main())")


def found() -> list[Path]:
    """Return every configuration of the installed package."""
    return sorted(sumo_home().rglob("*.sumocfg"))


def rows(names: list[str]) -> Iterator[str]:
    """Yield the lines of the table, of all scenarios or of the named ones."""
    for config in found():
        if names and config.stem not in names:
            continue
        line, refusal = row(config)
        yield line
        if _DISPATCHED[0] in refusal:
            yield row(config, _DISPATCHED)[0]


def row(config: Path, options: tuple[str, ...] = ()) -> tuple[str, str]:
    """Record a scenario.

    Args:
        config: path of the `.sumocfg`.
        options: further options of `cosim run`.

    Returns:
        A line of the table, and the messages of a refused run (empty if it was recorded).
    """
    name = " ".join((f"`{config.relative_to(sumo_home())}`", *options))
    with tempfile.TemporaryDirectory(prefix="cosim-") as temporary:
        folder = Path(temporary)
        (folder / "small.yaml").write_text("pattern: vlp16\neffects: []\n")
        (folder / "run.yaml").write_text("images: []\nsensor: small.yaml\n")
        out = folder / "drive"
        what = ("--town", str(config), "--frames", str(_FRAMES), "--seed", "1", "--out", str(out), "--quiet")
        command = [*_COSIM, "run", "run.yaml", *what, *options]
        start = time.perf_counter()
        try:
            run = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=_LIMIT_S)
        except subprocess.TimeoutExpired:
            return f"| {name} | not finished | > {_LIMIT_S} s | |", ""
        wall_s = time.perf_counter() - start
        messages = "; ".join(_short(line, config) for line in run.stderr.splitlines() if line.strip())
        if run.returncode:
            return f"| {name} | refused ({run.returncode}) | {wall_s:.0f} s | {messages} |", messages
        return f"| {name} | {_recorded(out)} | {wall_s:.0f} s | {messages} |", ""


def _recorded(out: Path) -> str:
    """Describe a drive: frames, points and other road users per frame."""
    frames = list(Drive(out))
    points = sum(len(frame.points) for frame in frames) // len(frames)
    others = sum(len(frame.twin.instances) for frame in frames if frame.twin) // len(frames)
    return f"{len(frames)} frames of {points} points, {others} other road users"


def _short(line: str, config: Path) -> str:
    """Return a message without the paths of this machine."""
    line = re.sub(r"^(WARNING: |cosim run: )", "", line).replace(f"{config}: ", "")
    return line.replace(f"{config.parent}/", "").replace("|", "/")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="stems of scenarios; all by default")
    print("| scenario | result | wall time | messages |\n|---|---|---|---|", flush=True)
    for line in rows(parser.parse_args().names):
        print(line, flush=True)


if __name__ == "__main__":
    main()
