"""One table of all cases against what is aimed at, and a list of what went wrong."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_SINGLE = ("strong", "one", "half", "quarter")
_VISIBLE = ("strong", "one", "half")


def print_table(rows: list[dict]) -> None:
    """Figures against targets, by group."""
    judged = [row for row in rows if row["verdict"] != "failed"]
    print(f"\n{len(rows)} cases, {len(rows) - len(judged)} failed to run\n")
    print(f"{'item':46s} {'target':>10s} {'found':>9s} {'of':>5s}")

    def line(item: str, target: str, values: list, reduce: Callable = np.mean) -> None:
        values = [float(value) for value in values if value is not None and np.isfinite(value)]
        print(f"{item:46s} {target:>10s} {f'{reduce(values):9.3f}' if values else '        –'} {len(values):5d}")

    def of(groups: tuple[str, ...], key: str) -> list:
        return [row.get(key) for row in rows if row["group"] in groups and (key in row or row["verdict"] == "failed")]

    for group in _SINGLE:
        line(f"{group}: right effect first", "≥ 0.95" if group in _VISIBLE else "", _bools(of((group,), "first_right")))
        line(f"{group}: in the reported set", "≥ 0.99" if group in _VISIBLE else "", _bools(of((group,), "in_set")))
    found = [row for row in judged if row["group"] in ("strong", "one", "half", "several", "disturbed")]
    line("parameters: median relative error", "≤ 0.05", [e for r in found for e in r["parameter_errors"].values()],
         np.median)  # fmt: skip
    asked, held = sum(r["intervals"] for r in found), sum(r["intervals_held"] for r in found)
    line("95 % intervals that hold the truth", "0.90–0.98", [held / asked] if asked else [])
    by_case = [r["intervals_held"] / r["intervals"] for r in found if r["intervals"]]
    line("the same, each case one vote", "0.90–0.98", by_case)
    ratio = of(("strong", "one", "half", "several"), "held_out_ratio")
    line("held-out error / floor: median", "≤ 1.05", ratio, np.median)
    line("held-out error / floor: share ≤ 1.05", "", [r <= 1.05 for r in ratio if r is not None])
    line("nulls: false alarms", "≤ 0.05", of(("null",), "alarm"))
    line("nulls with a nuisance: false alarms", "≤ 0.05", of(("nuisance",), "alarm"))
    line("nulls: error / floor, median", "", of(("null",), "held_out_ratio"), np.median)
    line("two and three: exact set", "≥ 0.90", _bools(of(("several",), "exact_set")))
    line("two and three: false additions", "≤ 0.05", of(("several",), "false_additions"))
    line("strong with nuisances: right first", "", _bools(of(("disturbed",), "first_right")))
    for group in ("unnamed", "unnamed_half"):
        line(f"{group}: flagged unknown", "≥ 0.90", _bools(of((group,), "flagged")))
        line(f"{group}: right channel", "", _bools(of((group,), "right_channel")))
        line(f"{group}: right covariate", "≥ 0.90", _bools(of((group,), "right_covariate")))
        line(f"{group}: share with claimed R² ≥ 0.9", "≥ 0.80", [(r or 0) >= 0.9 for r in of((group,), "claimed_r2")])
        line(f"{group}: excess error explained, median", "≥ 0.90", of((group,), "explained"), np.median)
        line(f"{group}: held-out error / floor, median", "≤ 1.10", of((group,), "held_out_ratio"), np.median)
    line("wall time [s], median", "≤ 120", [r["wall_s"] for r in judged], np.median)
    line("wall time [s], longest", "≤ 120", [r["wall_s"] for r in judged], max)
    line("peak memory [GiB], largest", "≤ 2", [r["rss_gib"] for r in judged], max)


def print_failures(rows: list[dict]) -> None:
    """What was taken for what."""
    wrong = [row for row in rows if _is_wrong(row)]
    if wrong:
        print("\nwhat went wrong")
    for row in sorted(wrong, key=lambda row: row["case"]):
        if row["verdict"] == "failed":
            print(f"  {row['case']:44s} {(row['trouble'].splitlines() or [''])[-1][:110]}")
            continue
        added = ", ".join(row["added"]) or "nothing"
        print(f"  {row['case']:44s} {row['verdict']}: {added}; unknown: {_brief(row['unknown'])}")
        print(f"  {'':44s} ranking: {'; '.join(row['ranking'])}")


def _is_wrong(row: dict) -> bool:
    if row["verdict"] == "failed":
        return True
    group = row["group"]
    if group in ("null", "nuisance"):
        return row["alarm"]
    if group.startswith("unnamed"):
        return not row["right_covariate"] or not row["right_channel"] or row["false_additions"] > 0
    return not row["exact_set"] or row["unknown"] is not None


def _brief(unknown: dict | None) -> str:
    if unknown is None:
        return "–"
    return f"{unknown.get('channel')} of {unknown.get('covariates')}: {unknown.get('form')} (R² {unknown.get('r2')})"


def _bools(values: list) -> list[bool]:
    """A case that failed to run is not right."""
    return [bool(value) for value in values]
