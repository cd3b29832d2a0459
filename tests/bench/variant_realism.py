"""Table of several sets and a real one: one line per quantity, one column per set, and the distance from reality."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from rich.table import Table

from cosim.errors import CosimError
from cosim.stats import FrameSet
from cosim.variants import PAPER
from tests.bench.realism import Gap, Row, rows
from tests.bench.scan_signature import Signature, measure

_FARTHEST = np.log(10)
_GROUPS = {
    "scan": "points; scatter of ranges",
    "share of firings lost": "share of firings lost, by range",
    "points a visible car, by its outline [1/msr]": "points over a car's outline, by range",
    "mean intensity by range, all": "mean intensity, by range",
    "zero share by range, all": "share of zeros, by range",
    "mean intensity by range, cars": "mean intensity on cars, by range",
    "zero share by range, cars": "share of zeros on cars, by range",
}
_SHOWN = ("scan", "points a visible car", *list(_GROUPS)[1:], "intensity of all", "intensity on cars")


def distances(result: Sequence[Row | Gap]) -> dict[str, float]:
    """Mean |ln(simulated/real)| of each known group, limited to a factor of ten.

    A quantity that is zero on one side only counts as that factor.
    """
    by_group = {
        name: [_apart(item) for item in result if isinstance(item, Row) and item.group == name] for name in _GROUPS
    }
    return {name: float(np.nanmean(values)) for name, values in by_group.items() if np.isfinite(values).any()}


def distance(result: Sequence[Row | Gap]) -> float:
    """Mean over the groups: 0 is equal, 0.1 means that a typical figure differs by a tenth."""
    return float(np.mean(list(distances(result).values())))


def side_by_side(
    folder: Path, real: Signature, measured: FrameSet, names: list[str] | None
) -> tuple[Table, dict[str, list[Row | Gap]]]:
    """The table of all sets in a folder, and what it was made of.

    Args:
        folder: of drives, as `cosim variants --out` leaves them.
        real: of the measured frames `names` (all, if None).
        measured: all measured frames; unnamed ones are another set, which shows the distance of real scans.

    Raises:
        CosimError: there is no drive in the folder.
    """
    drives = sorted(one for one in folder.glob("*/") if (one / "velodyne").is_dir())
    if not drives:
        raise CosimError(f"{folder} holds no drives; give what cosim variants --out wrote")
    drives.sort(key=lambda one: (*PAPER, one.name).index(one.name))
    sets = {one.name: measure(FrameSet(one)) for one in drives}
    found = {name: list(rows(signature, real)) for name, signature in sets.items()}
    others = [name for name in measured.names if name not in names] if names else []
    if others:
        found["other real"] = list(rows(measure(FrameSet(measured.root, others)), real))
    return _table(found, f"{folder} beside {measured.root}"), found


def _table(rows_by_set: Mapping[str, list[Row | Gap]], title: str) -> Table:
    far = {name: distance(items) for name, items in rows_by_set.items()}
    nearest = min((name for name in far if name != "other real"), key=far.__getitem__)
    result = Table(title=title, caption=f"nearest to the real scans: {nearest}")
    for name in ("quantity", "real", *rows_by_set):
        result.add_column(name, justify="left" if name == "quantity" else "right", no_wrap=True)
    for group in _SHOWN:
        result.add_section()
        result.add_row(f"[bold]{group}")
        lines = [[i for i in items if isinstance(i, Row) and i.group == group] for items in rows_by_set.values()]
        for line in zip(*lines, strict=True):
            result.add_row(
                f"  {line[0].name.split(' (')[0]}", _text(line[0].real), *(_text(item.ours) for item in line)
            )
    result.add_section()
    result.add_row("[bold]distance: mean |ln(ours/real)|, at most ln 10")
    for group, words in _GROUPS.items():
        values = (distances(items).get(group, float("nan")) for items in rows_by_set.values())
        result.add_row(f"  {words}", "", *(_text(value) for value in values))
    partial = {name for name, items in rows_by_set.items() if len(distances(items)) < len(_GROUPS)}
    marks = (f"[bold]{value:.2f}{'*' if name in partial else ''}" for name, value in far.items())
    result.add_row("[bold]  mean of these (* of known ones)", "", *marks)
    return result


def _apart(row: Row) -> float:
    if np.isnan(row.ours) or np.isnan(row.real) or row.ours == row.real:
        return 0.0 if row.ours == row.real else float("nan")
    if row.ours <= 0 or row.real <= 0:
        return float(_FARTHEST)
    return float(min(abs(np.log(row.ratio)), _FARTHEST))


def _text(value: float) -> str:
    if not np.isfinite(value):
        return "–"
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"
