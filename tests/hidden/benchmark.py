"""How well hidden effects are found: `python -m tests.hidden.benchmark`.

Makes measured drives with hidden physics, has each diagnosed in a process of its own, and holds the answers against
the truth. Finished cases are kept in `out/hidden/results` and not run again.
"""

from __future__ import annotations

import argparse
import json
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.hidden import base_drives
from tests.hidden.cases import GROUPS, Case, all_cases
from tests.hidden.run_case import run_case
from tests.hidden.table import print_failures, print_table


def main() -> None:
    """Run what is not done yet, then print the table."""
    chosen = _options()
    cases = [case for case in all_cases(chosen.seeds, chosen.frames) if _wanted(case, chosen)]
    if chosen.list:
        print(*(case.name for case in cases), sep="\n")
        return
    for name in sorted({name for case in cases for name in (case.base, case.held_out)}):
        base_drives.base_drive(name, chosen.folder)
    results = chosen.folder / chosen.results
    results.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(chosen.workers) as pool:
        rows = list(pool.map(lambda case: _row(case, results, chosen), cases))
    rows = [row for row in rows if row]
    print_failures(rows)
    print_table(rows)
    if chosen.json:
        chosen.json.write_text(json.dumps(rows, indent=1))


def _row(case: Case, results: Path, chosen: argparse.Namespace) -> dict | None:
    path = results / f"{case.name}.json"
    done = json.loads(path.read_text()) if path.exists() else None
    if done and not chosen.again and (chosen.table or done["verdict"] != "failed"):
        return done
    if chosen.table:
        return None
    row = run_case(case, chosen.folder, chosen.limit, chosen.keep, chosen.broken_gate)
    path.write_text(json.dumps(row, indent=1))
    shape = row.get("unknown")
    unknown = f" unknown: {shape['channel']} by {', '.join(shape['covariates'])}, {shape['form']}" if shape else ""
    said = row["trouble"].splitlines()[-1] if row["trouble"] else f"{row.get('added')}{unknown}"
    print(f"{case.name:45s} {row['verdict']:10s} {said}", flush=True)
    return row


def _wanted(case: Case, chosen: argparse.Namespace) -> bool:
    if chosen.quick and not case.is_quick:
        return False
    return case.group in chosen.group and re.search(chosen.cases, case.name) is not None


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few cases of every kind")
    parser.add_argument("--cases", default="", help="regular expression of case names")
    parser.add_argument("--group", nargs="*", default=GROUPS, choices=GROUPS)
    parser.add_argument("--seeds", type=int, default=1, help="drives of each case")
    parser.add_argument("--frames", type=int, default=base_drives.FRAMES)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--limit", type=float, default=900, help="seconds a diagnosis may take")
    parser.add_argument("--folder", type=Path, default=base_drives.FOLDER)
    parser.add_argument("--results", default="results", help="folder of finished cases in --folder")
    parser.add_argument("--again", action="store_true", help="run finished cases, too; those that failed run anyway")
    parser.add_argument("--table", action="store_true", help="run nothing, print what is finished")
    parser.add_argument("--keep", action="store_true", help="keep drives and pages")
    parser.add_argument("--broken-gate", action="store_true", help="let every effect through: nulls must then alarm")
    parser.add_argument("--list", action="store_true", help="print the names of the cases")
    parser.add_argument("--json", type=Path)
    return parser.parse_args()


if __name__ == "__main__":
    main()
