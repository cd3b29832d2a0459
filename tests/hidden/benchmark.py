"""How well hidden effects are found: `python -m tests.hidden.benchmark`.

Makes measured drives with hidden physics, runs `cosim compare` and `cosim diagnose` on each in processes of their own,
and scores the answers against the truth. Finished cases are kept in a folder of the version that was run and not run
again. `--code` takes another version of the repository; `--beside` prints another version's figures of the same cases.
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
from tests.hidden.cases import GROUPS, Case, all_cases, sample_cases
from tests.hidden.process import Version
from tests.hidden.run_case import run_case
from tests.hidden.score import score
from tests.hidden.table import print_failures, print_table
from tests.hidden.unseen.kind import NotApplicableError

_ROOT = Path(__file__).resolve().parents[2]


def main() -> None:
    """Run what is not done yet, then print the table."""
    parser = _parser()
    options = parser.parse_args()
    if problem := _problem(options):
        parser.error(problem)
    cases = _selected(options)
    if options.list:
        print(*(case.name for case in cases), sep="\n")
        return
    version, name = Version(options.code.resolve()), options.results or _commit(options.code)
    results = options.folder / "results" / name
    if not options.table:
        _record_bases(cases, options.folder)
        results.mkdir(parents=True, exist_ok=True)
        with ThreadPoolExecutor(options.workers) as pool:
            list(pool.map(lambda case: _run(case, results, version, options), cases))
    versions = {version: _finished(cases, options.folder / "results" / version) for version in (name, *options.beside)}
    print_failures(versions[name])
    print_table(versions)
    if options.json:
        options.json.write_text(json.dumps(versions[name], indent=1))


def _selected(options: argparse.Namespace) -> list[Case]:
    cases = all_cases(options.seed_list, options.frames)
    cases = [case for case in cases if case.group in options.kinds and options.cases.search(case.name)]
    if options.sample:
        cases = sample_cases(cases, options.sample)
    shard, shards = options.shard
    return cases[shard - 1 :: shards]


def _record_bases(cases: list[Case], folder: Path) -> None:
    """Record the drives that cases try first, one after another: two workers must not record the same one."""
    for base in sorted({case.bases[0] for case in cases}, key=lambda base: base.name):
        base_drives.base_drive(base, folder)


def _run(case: Case, results: Path, version: Version, options: argparse.Namespace) -> None:
    """Run a case, unless it is finished, and keep its row."""
    path = results / f"{case.name}.json"
    if path.exists() and not options.again and json.loads(path.read_text())["verdict"] != "failed":
        return
    try:
        row = run_case(case, options.folder, options.limit, version, options.keep)
    except NotApplicableError as error:
        print(f"{case.name:50s} not made: {error}", flush=True)
        return
    path.write_text(json.dumps(row, indent=1))
    unknowns = "".join(f" {entry['channel']} by {', '.join(entry['covariates'])};" for entry in row.get("unknowns", []))
    answer = row["trouble"].splitlines()[-1] if row["trouble"] else f"{row['added']}{unknowns}"
    print(f"{case.name:50s} {row['verdict']:10s} {row['cpu_s_diagnose'] or 0:5.0f} s CPU  {answer}", flush=True)


def _finished(cases: list[Case], results: Path) -> list[dict]:
    """Rows of finished cases, scored again."""
    rows = []
    for case in cases:
        path = results / f"{case.name}.json"
        if path.exists():
            rows.append(score(case, json.loads(path.read_text())["result"]))
    return rows


def _commit(code: Path) -> str:
    """The commit of the code, and whether files differ from it."""
    git = ["git", "-C", str(code), "describe", "--always", "--dirty", "--exclude=*"]
    return subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()


def _problem(options: argparse.Namespace) -> str:
    """What is wrong with the options, or nothing."""
    if not (options.code / "cosim" / "__init__.py").exists():
        return f"--code {options.code}: no cosim in it; give the root of a repository of this project"
    for name in options.beside:
        if not (options.folder / "results" / name).is_dir():
            return f"--beside {name}: no such folder in {options.folder / 'results'}; run that version first"
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
    parser.add_argument("--cases", type=_pattern, default=re.compile(""), help="regular expression of case names")
    parser.add_argument("--kinds", nargs="+", default=GROUPS, choices=GROUPS, help="groups of cases")
    parser.add_argument("--seed-list", type=int, nargs="+", default=[0], metavar="SEED")
    parser.add_argument("--sample", type=int, default=0, metavar="N", help="N cases, spread over the groups")
    parser.add_argument("--shard", type=_shard, default=(1, 1), metavar="i/n", help="the i-th of n parts of the cases")
    parser.add_argument("--frames", type=int, default=base_drives.FRAMES)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--limit", type=float, default=900, help="CPU seconds a command may take")
    parser.add_argument("--code", type=Path, default=_ROOT, metavar="PATH", help="repository whose cosim is scored")
    parser.add_argument("--folder", type=Path, default=base_drives.FOLDER)
    parser.add_argument("--results", help="name of the folder in FOLDER/results (default: the code's commit)")
    parser.add_argument("--beside", nargs="+", default=[], metavar="RESULTS", help="also print these versions' figures")
    parser.add_argument("--again", action="store_true", help="run finished cases, too; those that failed run anyway")
    parser.add_argument("--table", action="store_true", help="run nothing, print what is finished")
    parser.add_argument("--keep", action="store_true", help="keep drives and pages")
    parser.add_argument("--list", action="store_true", help="print the names of the cases")
    parser.add_argument("--json", type=Path)
    return parser


if __name__ == "__main__":
    sys.exit(main())
