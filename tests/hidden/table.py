"""One table of all cases against the targets, a column per version of the code, and a list of what went wrong."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tests.hidden.cases import BESIDE, FORM, NULL, SEVERAL, SINGLE, TWO, UNSEEN, UNSEEN_GROUPS
from tests.hidden.unseen.kind import LEVELS

_MAIN = (UNSEEN, TWO, BESIDE)  # unseen kinds, one or two at once; simple forms are separate
_ELSEWHERE = ("KITTI, 60 + 44 frames: elevation error found blind, error on the test frames ≤ 3.94, ≤ 3 CPU minutes",)

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
        print(f"{name}: {len(rows)} cases, {sum(_has_failed(row) for row in rows)} failed to run")
    print(f"\n{'item':96s} {'target':>10s}" + "".join(f" {name[-14:]:>14s} {'of':>4s}" for name in columns))
    for line in _lines():
        text = f"{line.item:96s} {line.target:>10s}"
        for rows in columns.values():
            values = [float(value) for value in line.values(rows) if value is not None and np.isfinite(value)]
            text += f" {f'{line.reduce(values):.3f}' if values else '–':>14s} {len(values):4d}"
        print(text)
    for item in _ELSEWHERE:
        print(f"{item}: measured on real frames, not here")
    for name, rows in columns.items():
        _print_types(name, rows)


def _lines() -> list[_Line]:
    return [*_catalogue(), *_parameters(), *_unseen(), *_nulls(), *_several(), *_budgets(), *_costs()]


def _catalogue() -> list[_Line]:
    lines = []
    for level, word in (("", "strong and half"), *((level, level) for level in ("strong", "half"))):
        lines += [
            _Line(f"one catalogue effect, {word}: right effect first", "≥ 0.97", _of(SINGLE, "first_right", level, 0)),
            _Line(f"one catalogue effect, {word}: in the reported set", "≥ 0.99", _of(SINGLE, "in_set", level, 0)),
        ]
    right = _of(SINGLE, "first_right", "", 0)
    large = "one catalogue effect, at least as large as diagnose says that it detects: right effect first"
    return [
        *lines,
        _Line("one catalogue effect: exactly this one reported", "", _of(SINGLE, "exact_set", "", 0)),
        _Line(large, "", lambda rows: right([row for row in rows if row.get("detectable")])),
    ]


def _parameters() -> list[_Line]:
    def errors(rows: Sequence[Row]) -> list:
        return [
            e for row in rows if row["group"] in (SINGLE, SEVERAL) for e in row.get("parameter_errors", {}).values()
        ]

    def covered(rows: Sequence[Row]) -> list:
        return [held for row in rows if row["group"] in (SINGLE, SEVERAL, BESIDE) for held in row.get("covered", [])]

    return [
        _Line("parameters: median relative error", "≤ 0.02", errors, np.median),
        _Line("parameters: 95 % intervals that include the truth", "0.92–0.98", covered),
    ]


def _unseen() -> list[_Line]:
    lines = []
    visible = [("one or two at once", _MAIN, ""), *((f"one or two at once, {level}", _MAIN, level) for level in LEVELS)]
    for word, groups, level in (*visible, ("simple forms", (FORM,), "")):
        lines += [_Line(f"unseen, {word}: {item}", target, values) for item, target, values in _criteria(groups, level)]
    return lines


def _criteria(groups: tuple[str, ...], level: str) -> list[tuple[str, str, Values]]:
    """Criteria for unseen effects: words, target, values."""
    return [
        ("reported or listed", "≥ 0.95", _of(groups, "reported_or_listed", level, 0)),
        ("reported", "", _of(groups, "reported", level, 0)),
        ("right term first", "", _of(groups, "reported_first", level, 0)),
        ("right channel", "", _of(groups, "right_channel", level, 0)),
        ("with a false effect", "≤ 0.02", _of(groups, "has_false", level)),
        ("shape R² ≥ 0.9", "≥ 0.80", _at_least(_of(groups, "shape_r2", level), 0.9)),
    ]


def _nulls() -> list[_Line]:
    lines = []
    for word, name in (("usual and hard", ""), ("usual", "-usual-"), ("hard", "-harder-")):
        lines.append(_Line(f"nothing hidden, {word}: verdict none and empty list", "≥ 0.95", _null("null_right", name)))
    for sensor in ("bare", "physics", "detection"):
        right = _null("null_right", f"-{sensor}-")
        lines.append(_Line(f"nothing hidden, sensor file {sensor}: the same", "", right))
    floor = _of((NULL,), "at_floor")
    return [
        *lines,
        _Line("nothing hidden: verdict none", "", _of((NULL,), "silent", "", 0)),
        _Line("nothing hidden: error_aligned / floor, median", "≤ 1.05", floor, np.median),
        _Line("nothing hidden: error_aligned / floor, largest", "", floor, max),
    ]


def _null(key: str, part: str) -> Values:
    values = _of((NULL,), key, "", 0)
    return lambda rows: values([row for row in rows if part in row["case"]])


def _several() -> list[_Line]:
    floor = _of((SINGLE, SEVERAL), "at_floor")
    return [
        _Line("two or three catalogue effects: exact set", "≥ 0.95", _of((SEVERAL,), "exact_set", "", 0)),
        _Line("two or three catalogue effects: in the reported set", "", _of((SEVERAL,), "in_set", "", 0)),
        _Line("catalogue effects added: error_aligned / floor, median", "≤ 1.05", floor, np.median),
        _Line("catalogue effects added: error_aligned / floor, share ≤ 1.05", "", _at_most(floor, 1.05)),
    ]


def _budgets() -> list[_Line]:
    share = _of(None, "missing_share")
    return [
        _Line("compare and diagnose: budgets within 10 % of the error", "", _of(None, "budgets_agree")),
        _Line(
            "compare and diagnose: largest difference / error, median", "≤ 0.10", _of(None, "budgets_apart"), np.median
        ),
        _Line("compare: missing / what diagnose explains, median", "≥ 0.70", share, np.median),
        _Line("compare: missing ≥ 70 % of what diagnose explains", "", _at_least(share, 0.7)),
    ]


def _costs() -> list[_Line]:
    lines = []
    for command, targets in (("diagnose", ("≤ 12", "≤ 30", "≤ 1.2")), ("compare", ("≤ 6", "", ""))):
        cpu = _of(None, f"cpu_s_{command}")
        lines += [
            _Line(f"{command}: CPU seconds, median", targets[0], cpu, np.median),
            _Line(f"{command}: CPU seconds, largest", targets[1], cpu, max),
            _Line(f"{command}: peak memory [GiB], largest", targets[2], _of(None, f"rss_gib_{command}"), max),
        ]
    return lines


def _print_types(name: str, rows: Sequence[Row]) -> None:
    """A line per kind of unseen effect, for one version."""
    items = _criteria(UNSEEN_GROUPS, "")
    types = sorted({kind for row in rows if row["group"] in UNSEEN_GROUPS for kind in row["kinds"]})
    print(f"\n{name[-26:]:26s} {'cases':>5s}" + "".join(f" {item:>20s}" for item, _, _ in items))
    for kind in types:
        of_kind = [row for row in rows if row["group"] in UNSEEN_GROUPS and kind in row["kinds"]]
        text = f"{kind:26s} {len(of_kind):5d}"
        for _, _, values in items:
            numbers = [float(value) for value in values(of_kind) if value is not None]
            text += f" {f'{np.mean(numbers):.2f}' if numbers else '–':>20s}"
        print(text)


def _of(groups: tuple[str, ...] | str | None, key: str, level: str = "", missed: float | None = None) -> Values:
    """A column of the rows of some groups; `missed` is the value of cases that failed to run."""
    names = (groups,) if isinstance(groups, str) else groups

    def values(rows: Sequence[Row]) -> list:
        chosen = [row for row in rows if (names is None or row["group"] in names) and level in ("", row["level"])]
        return [missed if _has_failed(row) and key not in row else row.get(key) for row in chosen]

    return values


def _at_most(values: Values, limit: float) -> Values:
    return lambda rows: [value <= limit for value in values(rows) if value is not None]


def _at_least(values: Values, limit: float) -> Values:
    return lambda rows: [value >= limit for value in values(rows) if value is not None]


def _has_failed(row: Row) -> bool:
    return row["verdict"] == "failed"


def print_failures(rows: Sequence[Row]) -> None:
    """What was reported where something else is true."""
    wrong = [row for row in rows if _is_wrong(row)]
    if wrong:
        print("\nwhat went wrong")
    for row in sorted(wrong, key=lambda row: row["case"]):
        if _has_failed(row):
            print(f"  {row['case']:50s} {(row['trouble'].splitlines() or [''])[-1][:110]}")
            continue
        if row["group"] in UNSEEN_GROUPS:
            print(f"  {row['case']:50s} hidden: {_truth(row['hidden'])}")
        unknowns = "; ".join(_brief(entry) for entry in row["unknowns"]) or "–"
        print(f"  {row['case']:50s} {row['verdict']}: {', '.join(row['added']) or 'nothing'}; unknown: {unknowns}")
        for entry in row["unexplained"] or []:
            size = f"{entry.get('size')} {entry.get('unit')}, p = {entry.get('p_value')}"
            print(f"  {'':50s} unexplained: {entry.get('channel')} by {entry.get('covariates')}: {size}")
        if row["ranking"]:
            print(f"  {'':50s} ranking: {'; '.join(row['ranking'])}")


def _is_wrong(row: Row) -> bool:
    if _has_failed(row):
        return True
    if row["group"] == NULL:
        return not row["null_right"]
    if row["group"] in UNSEEN_GROUPS:
        return not row["reported_or_listed"] or row["has_false"]
    return not row["exact_set"]


def _truth(hidden: Mapping[str, Mapping]) -> str:
    text = "; ".join(f"{name} ({', '.join(f'{k} {v}' for k, v in p.items())})" for name, p in hidden.items())
    return text if len(text) < 300 else f"{text[:300]} …"


def _brief(unknown: Mapping) -> str:
    return f"{unknown.get('channel')} by {unknown.get('covariates')}: {unknown.get('form')} (R² {unknown.get('r2')})"
