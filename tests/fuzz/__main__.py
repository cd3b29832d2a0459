"""`python -m tests.fuzz [--trials N] [--seed S] [--reader NAME] [--drive DIR]`: spoilt files for every reader."""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
from pathlib import Path

from cosim.capture.config import load_config
from cosim.capture.runner import run
from tests.fuzz.material import make_material
from tests.fuzz.readers import READERS
from tests.fuzz.trying import try_reader

_MEMORY = 6 << 30


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1_000_000)
    parser.add_argument("--reader")
    parser.add_argument("--drive", type=Path, help="a simulated drive to take files from; by default one is made")
    options = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    broken = 0
    with tempfile.TemporaryDirectory() as scratch:
        drive = options.drive or Path(scratch) / "made"
        if options.drive is None:
            run(load_config(None, town="town01", frames=2), drive)
        folder = Path(scratch) / "material"
        make_material(drive, folder)
        print(f"{'reader':<20}{'tried':>8}{'refused':>9}{'slowest':>10}  crashes")
        for reader in READERS:
            if options.reader in (None, reader.name):
                tally = try_reader(reader, folder, options.trials, options.seed)
                figures = f"{tally.tried:>8}{tally.refused:>9}{tally.slowest_s:>8.2f} s"
                print(f"{reader.name:<20}{figures}  {len(tally.crashes)}", flush=True)
                for crash, seed in tally.crashes.items():
                    print(f"    {crash}  (--reader '{reader.name}' --seed {seed} --trials 1)")
                broken += len(tally.crashes)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
