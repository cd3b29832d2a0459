"""A table in the paper's layout, its own figures beside ours: page, Markdown, JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from cosim.discrepancy.pages.style import STYLE
from cosim.drive_writer import explained
from cosim.html import document
from cosim.kitti import Drive
from training.evaluation import evaluate, read_results
from training.evaluation.bootstrap import interval
from training.evaluation.page import pr_plot
from training.evaluation.pictures import detection_pictures
from training.evaluation.rules import DIFFICULTIES
from training.experiments.run import Row
from training.experiments.table import ExperimentTable

_HEADS = ("easy", "moderate", "hard")


def write_report(table: ExperimentTable, rows: Sequence[Row], folder: Path) -> Path:
    """Write `index.html`, `table.md` and `table.json` into a folder that holds the rows' detections."""
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "index.html").write_text(format_page(table, rows, folder), encoding="utf-8")
        (folder / "table.md").write_text(format_markdown(table, rows), encoding="utf-8")
        (folder / "table.json").write_text(json.dumps(as_json(table, rows), indent=2) + "\n", encoding="utf-8")
    return folder / "index.html"


def as_json(table: ExperimentTable, rows: Sequence[Row]) -> dict[str, Any]:
    """`{"title", "rows": [{"name", "3d", "bev", "ci95", "paper_3d", "reason"}]}`, R40 of cars in percent."""
    said = []
    for row in rows:
        entry: dict[str, Any] = {metric: _averages(row, metric) for metric in ("3d", "bev")}
        entry["ci95"] = row.scores["ci95"] if row.scores else None
        paper = table.paper.get(row.name)
        entry["paper_3d"] = list(paper) if paper else None
        said.append({"name": row.name, **entry, "reason": row.reason or None})
    return {"title": table.title, "rows": said}


def format_markdown(table: ExperimentTable, rows: Sequence[Row]) -> str:
    """The table as Markdown."""
    heads = [f"{kind} {level}" for kind in ("3D", "BEV", "paper 3D") for level in _HEADS]
    lines = [f"# {table.title}", "", "Cars, IoU over 0.7, AP R40 in percent.", ""]
    lines += ["| trained on | " + " | ".join(heads) + " |", "|---" * (len(heads) + 1) + "|"]
    for row in rows:
        words = [word for some in _words(table, row) for word in some]
        lines.append(f"| {row.name} | " + " | ".join(words) + " |")
    absent = [f"- {row.name}: not run; {row.reason}" for row in rows if row.reason]
    return "\n".join([*lines, "", *absent]).rstrip() + "\n"


def format_page(table: ExperimentTable, rows: Sequence[Row], folder: Path) -> str:
    """The page, with precision–recall curves and pictures of the rows that were run."""
    heads = "".join(f"<th>{level}</th>" for _ in range(3) for level in _HEADS)
    body = "".join(_html_row(table, row) for row in rows)
    result = (
        f"<header><h1>{escape(table.title)}</h1><p>Cars, IoU over 0.7, AP R40 in percent; small: 95 % interval over "
        "draws of the test frames.</p></header>"
        "<section class=plain><table><thead><tr><th></th><th colspan=3>3D</th><th colspan=3>from above</th>"
        f"<th colspan=3>paper, 3D</th></tr><tr><th></th>{heads}</tr></thead><tbody>{body}</tbody></table></section>"
    )
    sections = [result, _differences(rows), *(_details(row, folder) for row in rows if row.scores is not None)]
    return document(table.title, sections, style=STYLE + _STYLE, generator="cosim experiment")


def differences(rows: Sequence[Row]) -> list[tuple[str, float, float, float]]:
    """How far each row lies below the best, 3D moderate: name, difference, and its 95 % interval, draw by draw.

    Only rows tested on the frames that the best was tested on can be subtracted so; an interval that holds 0 means
    that the order of the two may be chance.
    """
    run = [row for row in rows if row.scores is not None and row.scores["draws_3d_moderate"]]
    if not run:
        return []
    best = max(run, key=_moderate)
    assert best.scores is not None
    said = []
    for row in run:
        if row is best or row.scores is None or row.scores["settings"]["test"] != best.scores["settings"]["test"]:
            continue
        gaps = np.subtract(row.scores["draws_3d_moderate"], best.scores["draws_3d_moderate"])
        said.append((row.name, _moderate(row) - _moderate(best), *interval(gaps)))
    return said


def _differences(rows: Sequence[Row]) -> str:
    lines = [
        f"<tr><th>{escape(name)}</th><td>{gap:+.1f}</td><td>{low:+.1f} … {high:+.1f}</td>"
        f"<td class=words>{'may be chance' if low <= 0 <= high else 'no chance'}</td></tr>"
        for name, gap, low, high in differences(rows)
    ]
    if not lines:
        return ""
    return (
        "<section><h2>Which differences mean something</h2><p>3D moderate, less that of the best row, over the "
        "same draws of test frames.</p>"
        "<table><thead><tr><th></th><th>difference</th><th>95 %</th><th></th></tr></thead>"
        f"<tbody>{''.join(lines)}</tbody></table></section>"
    )


def _moderate(row: Row) -> float:
    return (_averages(row, "3d") or [0.0] * 3)[1]


def _html_row(table: ExperimentTable, row: Row) -> str:
    if row.scores is None:
        paper = "".join(f"<td>{word}</td>" for word in _words(table, row)[2])
        return f"<tr><th>{escape(row.name)}</th><td class=words colspan=6>{escape(row.reason)}</td>{paper}</tr>"
    cells = []
    for number, words in enumerate(_words(table, row)):
        bounds = row.scores["ci95"].get(("3d", "bev", "")[number], []) if number < 2 else []
        for level, word in enumerate(words):
            small = f"<small>{bounds[level][0]:.0f} – {bounds[level][1]:.0f}</small>" if bounds else ""
            cells.append(f"<td>{word}{small}</td>")
    return f"<tr><th>{escape(row.name)}</th>{''.join(cells)}</tr>"


def _details(row: Row, folder: Path) -> str:
    """Curves and pictures of a row, from the detections that it left."""
    assert row.scores is not None
    drive = Drive(Path(row.scores["settings"]["test"]["drive"]))
    scored = read_results(folder / row.name, drive.root / "label_2", _frame_list(folder / row.name))
    results = evaluate(scored, classes=("Car",)).results.get("Car")
    if results is None:
        return f"<section><h2>{escape(row.name)}</h2><p>no car was detected</p></section>"
    figures = []
    for metric, title in (("3d", "3D"), ("bev", "From above")):
        if metric in results:
            styled = list(zip("cad", results[metric], strict=True))
            legend = "".join(
                f'<span><i style="background:var(--{style})"></i> {level} {result.r40:.1f}</span>'
                for (style, result), level in zip(styled, DIFFICULTIES, strict=True)
            )
            svg = pr_plot(styled, f"precision against recall, {row.name}, {title}")
            caption = f"<figcaption><h3>{title}</h3><p>Precision against recall</p></figcaption>"
            figures.append(f'<figure>{caption}{svg}<div class="legend">{legend}</div></figure>')
    for caption, data in detection_pictures(scored, drive, most=2):
        figures.append(
            f"<figure><figcaption><h3>{escape(caption)}</h3><p>Labels green, detections orange with their scores</p>"
            f'</figcaption><img src="{data}" alt=""></figure>'
        )
    return f'<section><h2>{escape(row.name)}</h2><div class="charts">{"".join(figures)}</div></section>'


def _frame_list(folder: Path) -> Path:
    path = folder.with_suffix(".frames")
    with explained(path):
        path.write_text("".join(f"{file.stem}\n" for file in sorted(folder.glob("*.txt"))), encoding="utf-8")
    return path


def _words(table: ExperimentTable, row: Row) -> list[list[str]]:
    paper = table.paper.get(row.name)
    ours = [[f"{value:.1f}" for value in _averages(row, metric) or []] or ["–"] * 3 for metric in ("3d", "bev")]
    return [*ours, [f"{value:.1f}" for value in paper] if paper else ["–"] * 3]


def _averages(row: Row, metric: str) -> list[float] | None:
    if row.scores is None:
        return None
    found = (row.scores.get("Car") or {}).get(metric)
    return found["R40"] if found else [0.0, 0.0, 0.0]


_STYLE = """
td small { display: block; color: var(--muted); font-size: 11.5px; } thead th { text-align: right; }
figure img { width: 100%; display: block; } .charts { grid-template-columns: repeat(2, minmax(0, 1fr)); }
"""
