"""`python -m tests.fuzz [--trials N] [--seed S] [--reader NAME] [--drive DIR]`: spoilt files for every reader.

`--reader "table variants"` and `--reader "point variants"` write files whose truth is known, and count silent errors.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
from pathlib import Path

from cosim.capture.config import load_config
from cosim.capture.runner import run
from cosim.user_errors import user_errors
from tests.fuzz.material import make_material
from tests.fuzz.point_variants import point_trial
from tests.fuzz.readers import READERS
from tests.fuzz.table_variants import table_trial
from tests.fuzz.trying import try_reader
from tests.fuzz.variants import try_variants

_MEMORY = 6 << 30
_VARIANTS = {"table variants": table_trial, "point variants": point_trial}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1_000_000)
    parser.add_argument("--reader")
    parser.add_argument("--drive", type=Path, help="a simulated drive to take files from; by default one is made")
    options = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    broken = _try_variants(options.reader, options.trials, options.seed)
    if options.reader not in _VARIANTS:
        broken += _try_readers(options.reader, options.trials, options.seed, options.drive)
    return 1 if broken else 0


def _try_variants(only: str | None, trials: int, seed: int) -> int:
    """Number of variants that were read wrongly or raised what is not the project's own."""
    broken = 0
    for name, make_trial in _VARIANTS.items():
        if only not in (None, name):
            continue
        with tempfile.TemporaryDirectory() as scratch:
            outcome = try_variants(make_trial(Path(scratch) / "variants"), user_errors(), trials, seed)
        print(
            f"{name}: {trials} tried, {outcome.read} read as they are, {len(outcome.refused)} refused, "
            f"{len(outcome.wrong)} silently wrong, {len(outcome.foreign)} foreign exceptions",
            flush=True,
        )
        for line in (*outcome.wrong, *outcome.foreign):
            print(f"    {line}")
        broken += len(outcome.wrong) + len(outcome.foreign)
    return broken


def _try_readers(only: str | None, trials: int, seed: int, given: Path | None) -> int:
    """Number of kinds of crashes."""
    broken = 0
    with tempfile.TemporaryDirectory() as scratch:
        drive = given or Path(scratch) / "made"
        if given is None:
            run(load_config(None, town="town01", frames=2), drive)
        folder = Path(scratch) / "material"
        make_material(drive, folder)
        print(f"{'reader':<20}{'tried':>8}{'refused':>9}{'slowest':>10}  crashes")
        for reader in READERS:
            if only in (None, reader.name):
                tally = try_reader(reader, folder, trials, seed)
                figures = f"{tally.tried:>8}{tally.refused:>9}{tally.slowest_s:>8.2f} s"
                print(f"{reader.name:<20}{figures}  {len(tally.crashes)}", flush=True)
                for crash, crashed in tally.crashes.items():
                    print(f"    {crash}  (--reader '{reader.name}' --seed {crashed} --trials 1)")
                broken += len(tally.crashes)
    return broken


if __name__ == "__main__":
    sys.exit(main())
