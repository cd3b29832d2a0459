"""One table of all cases against what is aimed at, a column a version of the code, and a list of what went wrong."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tests.hidden.cases import LEVELS, NULLS, TWO, UNKNOWNS

_SINGLE = ("strong", "one", "half", "quarter")
_VISIBLE = ("strong", "one", "half")
_ADDED = (*_VISIBLE, "several", "disturbed")
_ELSEWHERE = ("KITTI's 60 frames: ≤ 8 CPU minutes", "KITTI: elevation error found blind, error ≤ 3.94")

Row = Mapping
Values = Callable[[Sequence[Row]], list]


@dataclass(frozen=True)
class _Line:
    """A figure of the table.

    Attributes:
        item, target: in words.
        values: rows → what is reduced; None and what is not finite count for nothing.
        reduce: values → the figure.
    """

    item: str
    target: str
    values: Values
    reduce: Callable = np.mean


def print_table(versions: Mapping[str, Sequence[Row]]) -> None:
    """Figures against targets; with several versions, of the cases that all of them have."""
    common = set.intersection(*({row["case"] for row in rows} for rows in versions.values()))
    columns = {name: [row for row in rows if row["case"] in common] for name, rows in versions.items()}
    for name, rows in columns.items():
        print(f"{name}: {len(rows)} cases, {sum(_failed(row) for row in rows)} failed to run")
    print(f"\n{'item':58s} {'target':>10s}" + "".join(f" {name[-14:]:>14s} {'of':>4s}" for name in columns))
    for line in _lines():
        told = f"{line.item:58s} {line.target:>10s}"
        for rows in columns.values():
            values = [float(value) for value in line.values(rows) if value is not None and np.isfinite(value)]
            told += f" {f'{line.reduce(values):.3f}' if values else '–':>14s} {len(values):4d}"
        print(told)
    for item in _ELSEWHERE:
        print(f"{item:58s} {'':>10s}  measured on real frames, not here")
    for name, rows in columns.items():
        _print_kinds(name, rows)


def _lines() -> list[_Line]:
    return [*_named(), *_parameters(), *_floor(), *_nulls(), *_several(), *_unknowns(), *_costs()]


def _named() -> list[_Line]:
    lines = []
    for groups, word in ((_VISIBLE, "strong, one, half"), *(((group,), group) for group in _SINGLE)):
        aim = word != "quarter"
        lines += [
            _Line(f"{word}: right effect first", "≥ 0.95" if aim else "", _of(groups, "first_right", missed=0)),
            _Line(f"{word}: in the reported set", "≥ 0.99" if aim else "", _of(groups, "in_set", missed=0)),
        ]
    disturbed = _of(("disturbed",), "first_right", missed=0)
    return [*lines, _Line("strong with other nuisances: right first", "≥ 0.95", disturbed)]


def _parameters() -> list[_Line]:
    lines = []
    for exact, word in ((True, "nuisances off"), (False, "nuisances on")):
        lines += [
            _Line(f"parameters, {word}: median relative error", "≤ 0.02", _parameter_errors(exact), np.median),
            _Line(f"parameters, {word}: 95 % intervals that hold", "0.90–0.98", _coverage(exact)),
        ]
    return lines


def _floor() -> list[_Line]:
    lines = []
    for exact, word in ((True, "nuisances off"), (False, "nuisances on")):
        aligned = _of((*_ADDED, *NULLS), "at_floor", exact=exact)
        lines += [
            _Line(f"error_aligned after adding / floor, {word}: median", "≤ 1.05", aligned, np.median),
            _Line(f"error_aligned after adding / floor, {word}: share ≤ 1.05", "", _at_most(aligned, 1.05)),
        ]
    given = _of((*_ADDED, *NULLS), "poses_as_given", exact=False)
    ratio = _of((*_VISIBLE, "several"), "held_out_ratio")
    return [
        *lines,
        _Line("error at the poses as given / floor, nuisances on: median", "", given, np.median),
        _Line("another drive, exact twin: error / floor, median", "≤ 1.05", ratio, np.median),
        _Line("another drive, exact twin: share ≤ 1.05", "", _at_most(ratio, 1.05)),
        _Line("budget adds up to the error within 2 %", "1", lambda rows: [row.get("budget_sums") for row in rows]),
    ]


def _nulls() -> list[_Line]:
    lines = [_Line("nothing hidden, all: false alarms", "≤ 0.05", _of(NULLS, "alarm"))]
    for group in NULLS:
        lines += [
            _Line(f"{group}: false alarms", "≤ 0.05", _of((group,), "alarm")),
            _Line(f"{group}: unexplained list empty", "≥ 0.90", _of((group,), "unexplained_empty")),
            _Line(f"{group}: the same, noise's shape aside", "", _of((group,), "unexplained_empty_but_shape")),
        ]
    return lines


def _several() -> list[_Line]:
    return [
        _Line("two and three: exact set", "≥ 0.90", _of(("several",), "exact_set", missed=0)),
        _Line("two and three: false additions a run", "≤ 0.05", _of(("several",), "false_additions")),
    ]


def _unknowns() -> list[_Line]:
    lines = []
    for level, word in (("", "in no catalogue"), *((level, f"in no catalogue, {level}") for level in LEVELS)):
        for item, target, values in _kind_columns(UNKNOWNS, level):
            lines.append(_Line(f"{word}: {item}", target, values))
    explained = _of(tuple(kind for kind in UNKNOWNS if kind != TWO), "explained")
    return [
        *lines,
        _Line("in no catalogue: unknowns told that are none, a case", "", _of(UNKNOWNS, "false_unknowns")),
        _Line("in no catalogue: excess error explained, median", "", explained, np.median),
    ]


def _kind_columns(groups: tuple[str, ...], level: str) -> list[tuple[str, str, Values]]:
    """What is asked of unknown effects: words, target, values."""
    return [
        ("told", "", _of(groups, "told", level, missed=0)),
        ("told or listed", "≥ 0.90", _of(groups, "told_or_listed", level, missed=0)),
        ("right channel", "", _of(groups, "right_channel", level, missed=0)),
        ("shape R² ≥ 0.9", "≥ 0.80", _at_least(_of(groups, "shape_r2", level), 0.9)),
        ("no false effect", "≥ 0.90", _of(groups, "no_false_effect", level)),
    ]


def _print_kinds(name: str, rows: Sequence[Row]) -> None:
    """A line a kind and level of unknown effects, for one version."""
    words = [f"{item} {target}".strip() for item, target, _ in _kind_columns(UNKNOWNS, "")]
    print(f"\n{name[-26:]:26s} {'cases':>5s}" + "".join(f" {word:>22s}" for word in words))
    for kind in UNKNOWNS:
        for level in LEVELS:
            count = sum(row["group"] == kind and row["level"] == level for row in rows)
            if not count:
                continue
            told = f"{kind + ', ' + level:26s} {count:5d}"
            for _, _, values in _kind_columns((kind,), level):
                known = [float(value) for value in values(rows) if value is not None]
                told += f" {f'{np.mean(known):.2f}' if known else '–':>22s}"
            print(told)


def _costs() -> list[_Line]:
    cpu = _of(None, "cpu_s")
    return [
        _Line("CPU seconds, median", "≤ 15", cpu, np.median),
        _Line("CPU seconds, largest", "≤ 60", cpu, max),
        _Line("wall seconds, median", "", _of(None, "wall_s"), np.median),
        _Line("peak memory [GiB], largest", "≤ 2", _of(None, "rss_gib"), max),
    ]


def _of(groups: tuple[str, ...] | None, key: str, level: str = "", exact: bool | None = None, missed=None) -> Values:
    """A column of the rows of some groups; `missed` stands for cases that failed to run."""

    def values(rows: Sequence[Row]) -> list:
        chosen = [row for row in rows if groups is None or row["group"] in groups]
        chosen = [row for row in chosen if level in ("", row["level"]) and exact in (None, row["exact"])]
        return [missed if _failed(row) and key not in row else row.get(key) for row in chosen]

    return values


def _at_most(values: Values, limit: float) -> Values:
    return lambda rows: [value <= limit for value in values(rows) if value is not None]


def _at_least(values: Values, limit: float) -> Values:
    return lambda rows: [value >= limit for value in values(rows) if value is not None]


def _judged(rows: Sequence[Row], exact: bool) -> list[Row]:
    return [row for row in rows if row["group"] in _ADDED and row["exact"] == exact and not _failed(row)]


def _parameter_errors(exact: bool) -> Values:
    return lambda rows: [error for row in _judged(rows, exact) for error in row["parameter_errors"].values()]


def _coverage(exact: bool) -> Values:
    """One value an interval: whether it holds the truth."""

    def values(rows: Sequence[Row]) -> list:
        chosen = _judged(rows, exact)
        held, asked = sum(row["intervals_held"] for row in chosen), sum(row["intervals"] for row in chosen)
        return [True] * held + [False] * (asked - held)

    return values


def _failed(row: Row) -> bool:
    return row["verdict"] == "failed"


def print_failures(rows: Sequence[Row]) -> None:
    """What was taken for what."""
    wrong = [row for row in rows if _is_wrong(row)]
    if wrong:
        print("\nwhat went wrong")
    for row in sorted(wrong, key=lambda row: row["case"]):
        if _failed(row):
            print(f"  {row['case']:44s} {(row['trouble'].splitlines() or [''])[-1][:110]}")
            continue
        if row["group"] in UNKNOWNS:
            print(f"  {row['case']:44s} hidden: {_truth(row['hidden'])}")
        unknowns = "; ".join(_brief(one) for one in row["unknowns"]) or "–"
        print(f"  {row['case']:44s} {row['verdict']}: {', '.join(row['added']) or 'nothing'}; unknown: {unknowns}")
        for one in row["unexplained"] or []:
            size = f"{one.get('size')} {one.get('unit')}, p = {one.get('p_value')}"
            print(f"  {'':44s} unexplained: {one.get('channel')} by {one.get('covariates')}: {size}")
        if row["ranking"]:
            print(f"  {'':44s} ranking: {'; '.join(row['ranking'])}")


def _is_wrong(row: Row) -> bool:
    if _failed(row):
        return True
    if row["group"] in NULLS:
        return row["alarm"] or row["unexplained_empty"] is False
    if row["group"] in UNKNOWNS:
        return not row["told_or_listed"] or not row["no_false_effect"]
    return not row["exact_set"]


def _truth(hidden: Mapping[str, Mapping]) -> str:
    return "; ".join(f"{name} ({', '.join(f'{k} {v}' for k, v in p.items())})" for name, p in hidden.items())


def _brief(unknown: Mapping) -> str:
    return f"{unknown.get('channel')} of {unknown.get('covariates')}: {unknown.get('form')} (R² {unknown.get('r2')})"
