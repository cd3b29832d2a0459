"""Write a table in the paper's layout, with the paper's figures: page, Markdown, JSON."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup

from cosim.drives.kitti import Drive
from cosim.drives.writer import explained
from cosim.report.html import document, fill
from training.evaluation import evaluate, read_results
from training.evaluation.page import pr_plot
from training.evaluation.pictures import CAPTION, detection_pictures
from training.evaluation.rules import DIFFICULTIES
from training.experiments.comparisons import ResultComparison, averages, differences, gains
from training.experiments.run import ExperimentRow
from training.experiments.table import REAL, ExperimentTable

_HEADS = ("easy", "moderate", "hard")
_GAINS = "Changes by fine-tuning"
_DIFFERENCES = "Significance of differences"


def write_report(table: ExperimentTable, rows: Sequence[ExperimentRow], folder: Path) -> Path:
    """Write `index.html`, `table.md` and `table.json` into the folder of the rows' detections."""
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "index.html").write_text(format_page(table, rows, folder), encoding="utf-8")
        (folder / "table.md").write_text(format_markdown(table, rows), encoding="utf-8")
        (folder / "table.json").write_text(json.dumps(as_json(table, rows), indent=2) + "\n", encoding="utf-8")
    return folder / "index.html"


def as_json(table: ExperimentTable, rows: Sequence[ExperimentRow]) -> dict[str, Any]:
    """`{"title", "rows": [{"name", "3d", "bev", "ci95", "before", "gain_ci95", "paper_3d", "reason"}]}`.

    R40 of cars in percent. `before`: 3d, bev and ci95 before fine-tuning; `gain_ci95`: of the differences at
    moderate. Both are null without fine-tuning.
    """
    entries = []
    for row in rows:
        entry = _summary_figures(row.scores)
        before = (row.scores or {}).get("before")
        entry["before"] = before and _summary_figures(before)
        entry["gain_ci95"] = (row.scores or {}).get("gain_ci95")
        paper = table.paper.get(row.name)
        entry["paper_3d"] = list(paper) if paper else None
        entries.append({"name": row.name, **entry, "reason": row.reason or None})
    return {"title": table.title, "rows": entries}


def format_markdown(table: ExperimentTable, rows: Sequence[ExperimentRow]) -> str:
    """The table as Markdown."""
    groups = _groups(table)
    heads = [f"{group.title} {level}" for group in groups for level in _HEADS]
    lines = [f"# {table.title}", "", f"Cars, IoU over 0.7, AP R40 in percent. {_tested_on(rows)}".rstrip(), ""]
    lines += [f"| {_row_head(table)} | " + " | ".join(heads) + " |", "|---" * (len(heads) + 1) + "|"]
    for row in rows:
        words = [text for group in groups for text in _format_values(group.values(row))]
        lines.append(f"| {_label(table, row)} | " + " | ".join(words) + " |")
    lines.append("")
    for title, compared in ((_GAINS, gains(rows)), (_DIFFERENCES, differences(rows))):
        if compared:
            lines += [f"{title}:", "", *(f"- {comparison.in_words}" for comparison in compared), ""]
    absent = [f"- {_label(table, row)}: not run; {row.reason}" for row in rows if row.reason]
    return "\n".join([*lines, *absent]).rstrip() + "\n"


def format_page(table: ExperimentTable, rows: Sequence[ExperimentRow], folder: Path) -> str:
    """The page, with precision–recall curves and pictures of the rows that were run."""
    groups = _groups(table)
    group_heads = Markup().join(fill("<th colspan=3>{}</th>", group.title) for group in groups)
    heads = Markup().join(fill("<th>{}</th>", level) for _ in groups for level in _HEADS)
    body = Markup().join(_html_row(table, row, groups) for row in rows)
    result = fill(
        "<header><h1>{}</h1><p>Cars, IoU over 0.7, AP R40 in percent; small: 95 % interval over draws of "
        "the test frames. {}</p></header><section class=plain><table><thead><tr><th></th>{}</tr><tr><th>"
        "{}</th>{}</tr></thead><tbody>{}</tbody></table></section>",
        table.title,
        _tested_on(rows),
        group_heads,
        _row_head(table),
        heads,
        body,
    )
    compared = [_format_comparisons(_GAINS, gains(rows)), _format_comparisons(_DIFFERENCES, differences(rows))]
    details = [_format_details(table, row, folder) for row in rows if row.scores is not None]
    return document(table.title, [result, *compared, *details], style=_STYLE, generator="cosim experiment")


def _tested_on(rows: Sequence[ExperimentRow]) -> str:
    """Numbers of test frames and objects, if they are equal for all rows."""
    sizes = {
        (row.scores["frames"], row.scores["Car"]["3d"]["objects"][1])
        for row in rows
        if row.scores is not None and row.scores.get("Car") and "frames" in row.scores
    }
    if len(sizes) != 1:
        return ""
    frames, cars = sizes.pop()
    return f"Tested on {frames} frames with {cars} cars at moderate."


def _row_head(table: ExperimentTable) -> str:
    """Heading of the row names."""
    return "tested on" if table.train_on == REAL else "trained on"


def _label(table: ExperimentTable, row: ExperimentRow) -> str:
    """Name of a row: that of the variant, or a description of the real frames."""
    if row.name != REAL:
        return row.name
    return "the few real frames only" if table.fine_tune == "few" else "real frames"


def _html_row(table: ExperimentTable, row: ExperimentRow, groups: Sequence[_Group]) -> str:
    cells = []
    for group in groups:
        bounds = group.intervals(row)
        for level, text in enumerate(_format_values(group.values(row))):
            small = fill("<small>{:.0f} – {:.0f}</small>", bounds[level][0], bounds[level][1]) if bounds else ""
            cells.append(fill("<td>{}{}</td>", text, small))
    if row.scores is None:  # the first two groups are measured values
        cells[:6] = [fill("<td class=words colspan=6>{}</td>", row.reason)]
    return fill("<tr><th>{}</th>{}</tr>", _label(table, row), Markup().join(cells))


def _format_comparisons(title: str, compared: Sequence[ResultComparison]) -> str:
    if not compared:
        return ""
    lines = [
        fill(
            "<tr><th>{}</th><td>{:+.1f}</td><td>{:+.1f} … {:+.1f}</td><td class=words>{}</td></tr>",
            comparison.name,
            comparison.gap,
            comparison.low,
            comparison.high,
            comparison.verdict,
        )
        for comparison in compared
    ]
    return fill(
        "<section><h2>{}</h2><p>At moderate, with 95 % bootstrap intervals, paired by test frame. Each "
        "detector was trained once: the intervals do not include the variation between seeds.</p><table>"
        "<thead><tr><th></th><th>difference</th><th>95 %</th><th></th></tr></thead><tbody>{}</tbody>"
        "</table></section>",
        title,
        Markup().join(lines),
    )


def _format_details(table: ExperimentTable, row: ExperimentRow, folder: Path) -> str:
    """Curves and pictures of a row, from its stored detections."""
    assert row.scores is not None
    drive = Drive(Path(row.scores["settings"]["test"]["drive"]))
    scored = read_results(folder / row.name, drive.root / "label_2", _frame_list(folder / row.name))
    results = evaluate(scored, classes=("Car",)).results.get("Car")
    if results is None:
        return fill("<section><h2>{}</h2><p>no car was detected</p></section>", _label(table, row))
    figures = []
    for metric, title in (("3d", "3D"), ("bev", "From above")):
        if metric in results:
            styled = list(zip("cad", results[metric], strict=True))
            legend = Markup().join(
                fill('<span><i style="background:var(--{})"></i> {} {:.1f}</span>', style, level, result.r40)
                for (style, result), level in zip(styled, DIFFICULTIES, strict=True)
            )
            svg = pr_plot(styled, f"precision against recall, {row.name}, {title}")
            caption = fill("<figcaption><h3>{}</h3><p>Precision against recall</p></figcaption>", title)
            figures.append(fill('<figure>{}{}<div class="legend">{}</div></figure>', caption, svg, legend))
    for caption, data in detection_pictures(scored, drive, most=2):
        figures.append(
            fill(
                '<figure><figcaption><h3>{}</h3><p>{}</p></figcaption><img src="{}" alt=""></figure>',
                caption,
                CAPTION,
                data,
            )
        )
    return fill(
        '<section><h2>{}</h2><div class="charts">{}</div></section>', _label(table, row), Markup().join(figures)
    )


def _frame_list(folder: Path) -> Path:
    path = folder.with_suffix(".frames")
    with explained(path):
        path.write_text(Markup().join(f"{file.stem}\n" for file in sorted(folder.glob("*.txt"))), encoding="utf-8")
    return path


@dataclass(frozen=True)
class _Group:
    """Three columns of the table: their title, and their values in a row."""

    title: str
    values: Callable[[ExperimentRow], Sequence[float] | None]
    intervals: Callable[[ExperimentRow], Sequence[Sequence[float]]] = lambda row: ()


def _groups(table: ExperimentTable) -> list[_Group]:
    groups = [_measured_group("3D", "3d"), _measured_group("from above", "bev")]
    if table.fine_tune != "none":
        groups += [_measured_group("before fine-tuning, 3D", "3d", "before")]
        groups += [_measured_group("before, from above", "bev", "before")]
    if table.paper:
        groups.append(_Group("paper, 3D", lambda row: table.paper.get(row.name)))
    return groups


def _measured_group(title: str, metric: str, when: str | None = None) -> _Group:
    def scores(row: ExperimentRow) -> dict[str, Any] | None:
        return row.scores if when is None else (row.scores or {}).get(when)

    def intervals(row: ExperimentRow) -> Sequence[Sequence[float]]:
        return (scores(row) or {"ci95": {}})["ci95"].get(metric, ())

    return _Group(title, lambda row: averages(scores(row), metric), intervals)


def _format_values(values: Sequence[float] | None) -> list[str]:
    return [f"{value:.1f}" for value in values] if values else ["–"] * 3


def _summary_figures(scores: dict[str, Any] | None) -> dict[str, Any]:
    return {**{metric: averages(scores, metric) for metric in ("3d", "bev")}, "ci95": scores and scores["ci95"]}


_STYLE = """
td small { display: block; color: var(--muted); font-size: 11.5px; } thead th { text-align: right; }
thead th:first-child { text-align: left; }
figure img { width: 100%; display: block; } .charts { grid-template-columns: repeat(2, minmax(0, 1fr)); }
"""
