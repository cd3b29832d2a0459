"""How well hidden effects are found: `python -m tests.hidden.benchmark`.

Makes measured drives with hidden physics, has each diagnosed in a process of its own, and holds the answers against
the truth. Finished cases are kept in a folder of the version that diagnosed them and not run again. `--code` takes
another version of the repository; `--beside` prints another version's figures of the same cases.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.hidden import base_drives
from tests.hidden.cases import GROUPS, Case, all_cases, spread
from tests.hidden.process import Version
from tests.hidden.run_case import run_case
from tests.hidden.score import score
from tests.hidden.table import print_failures, print_table

_ROOT = Path(__file__).resolve().parents[2]


def main() -> None:
    """Run what is not done yet, then print the table."""
    parser = _parser()
    chosen = parser.parse_args()
    if trouble := _trouble(chosen):
        parser.error(trouble)
    cases = _chosen(chosen)
    if chosen.list:
        print(*(case.name for case in cases), sep="\n")
        return
    version, name = Version(chosen.code.resolve(), chosen.broken_gate), chosen.results or _name(chosen)
    results = chosen.folder / "results" / name
    if not chosen.table:
        for base in sorted({base for case in cases for base in (case.base, case.held_out)}):
            base_drives.base_drive(base, chosen.folder)
        results.mkdir(parents=True, exist_ok=True)
        with ThreadPoolExecutor(chosen.workers) as pool:
            list(pool.map(lambda case: _run(case, results, version, chosen), cases))
    versions = {one: _finished(cases, chosen.folder / "results" / one) for one in (name, *chosen.beside)}
    print_failures(versions[name])
    print_table(versions)
    if chosen.json:
        chosen.json.write_text(json.dumps(versions[name], indent=1))


def _chosen(chosen: argparse.Namespace) -> list[Case]:
    seeds = chosen.seed_list if chosen.seed_list is not None else range(chosen.seeds)
    cases = [case for case in all_cases(seeds, chosen.frames) if case.is_quick or not chosen.quick]
    cases = [case for case in cases if case.group in chosen.group and chosen.cases.search(case.name)]
    if chosen.sample:
        cases = spread(cases, chosen.sample)
    shard, shards = chosen.shard
    return cases[shard - 1 :: shards]


def _run(case: Case, results: Path, version: Version, chosen: argparse.Namespace) -> None:
    """Run a case, unless it is finished, and keep its row."""
    path = results / f"{case.name}.json"
    if path.exists() and not chosen.again and json.loads(path.read_text())["verdict"] != "failed":
        return
    row = run_case(case, chosen.folder, chosen.limit, version, chosen.keep)
    path.write_text(json.dumps(row, indent=1))
    unknowns = "".join(f" {one['channel']} by {', '.join(one['covariates'])};" for one in row.get("unknowns", []))
    said = row["trouble"].splitlines()[-1] if row["trouble"] else f"{row['added']}{unknowns}"
    print(f"{case.name:50s} {row['verdict']:10s} {row['cpu_s']:5.0f} s CPU  {said}", flush=True)


def _finished(cases: list[Case], results: Path) -> list[dict]:
    """Rows of the finished ones of some cases, scored anew."""
    rows = []
    for case in cases:
        path = results / f"{case.name}.json"
        if path.exists():
            row = json.loads(path.read_text())
            rows.append(row | score(case, row["result"]))
    return rows


def _name(chosen: argparse.Namespace) -> str:
    """The commit of the code, and whether files differ from it."""
    git = ["git", "-C", str(chosen.code), "describe", "--always", "--dirty", "--exclude=*"]
    commit = subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
    return f"{commit}-broken_gate" if chosen.broken_gate else commit


def _trouble(chosen: argparse.Namespace) -> str:
    """What is wrong with the options, or nothing."""
    if not (chosen.code / "cosim" / "__init__.py").exists():
        return f"--code {chosen.code}: no cosim in it; give the root of a repository of this project"
    for name in chosen.beside:
        if not (chosen.folder / "results" / name).is_dir():
            return f"--beside {name}: no such folder in {chosen.folder / 'results'}; run that version first"
    return ""


def _shard(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d+)/(\d+)", text)
    if not found or not 1 <= int(found[1]) <= int(found[2]):
        raise argparse.ArgumentTypeError(f"{text}: a shard is i/n with 1 ≤ i ≤ n, as 2/4")
    return int(found[1]), int(found[2])


def _pattern(text: str) -> re.Pattern[str]:
    try:
        return re.compile(text)
    except re.error as error:
        raise argparse.ArgumentTypeError(f"{text}: no regular expression ({error})") from None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few cases of every kind, of seed 0")
    parser.add_argument("--cases", type=_pattern, default=re.compile(""), help="regular expression of case names")
    parser.add_argument("--group", nargs="*", default=GROUPS, choices=GROUPS)
    parser.add_argument("--seeds", type=int, default=1, help="seeds 0 … N − 1")
    parser.add_argument("--seed-list", type=int, nargs="+", metavar="SEED", help="these seeds instead")
    parser.add_argument("--sample", type=int, default=0, metavar="N", help="N cases, spread over groups and levels")
    parser.add_argument("--shard", type=_shard, default=(1, 1), metavar="i/n", help="the i-th of n parts of the cases")
    parser.add_argument("--frames", type=int, default=base_drives.FRAMES)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--limit", type=float, default=900, help="CPU seconds a diagnosis may take")
    parser.add_argument("--code", type=Path, default=_ROOT, metavar="PATH", help="repository whose cosim diagnoses")
    parser.add_argument("--folder", type=Path, default=base_drives.FOLDER)
    parser.add_argument("--results", help="name of the folder in FOLDER/results (default: the code's commit)")
    parser.add_argument("--beside", nargs="+", default=[], metavar="RESULTS", help="also print these versions' figures")
    parser.add_argument("--again", action="store_true", help="run finished cases, too; those that failed run anyway")
    parser.add_argument("--table", action="store_true", help="run nothing, print what is finished")
    parser.add_argument("--keep", action="store_true", help="keep drives and pages")
    parser.add_argument("--broken-gate", action="store_true", help="let every effect through: nulls must then alarm")
    parser.add_argument("--list", action="store_true", help="print the names of the cases")
    parser.add_argument("--json", type=Path)
    return parser


if __name__ == "__main__":
    sys.exit(main())
