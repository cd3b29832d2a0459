"""The page of an evaluation: tables, precision–recall curves, subsets of the objects."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from cosim.report.html import document
from cosim.report.plot import Axis, Plot
from cosim.report.style import STYLE
from training.evaluation.as_json import Intervals
from training.evaluation.evaluate import Evaluation, Result
from training.evaluation.pictures import CAPTION
from training.evaluation.rules import DIFFICULTIES, METRICS, MIN_OVERLAP
from training.evaluation.slices import Slice

_TITLES = {"3d": "3D", "bev": "Bird’s-eye view", "2d": "Image", "aos": "Orientation (AOS)"}
_WORDS = {"distance": "distance", "occlusion": "occlusion", "points": "points in the box"}
_STYLES = ("c", "a", "d")


def format_page(
    evaluation: Evaluation,
    title: str,
    intervals: Intervals,
    parts: dict[str, dict[str, list[Slice]]],
    pictures: Sequence[tuple[str, str]] = (),
) -> str:
    """The HTML text.

    Args:
        evaluation: the results.
        title: plain text.
        intervals: of R40, by class and metric.
        parts: slices by class and kind.
        pictures: captions with data URLs of pictures.
    """
    frames = len(evaluation.scored.names)
    head = f"<header><h1>{escape(title)}</h1><p>{frames:,} frames, by the rules of KITTI’s object benchmark.</p>"
    if not evaluation.results:
        head += "<p class=verdict>Nothing of Car, Pedestrian or Cyclist was detected.</p>"
    sections = [head + "</header>"]
    for name, metrics in evaluation.results.items():
        curves = "".join(_curves(metrics[metric], metric) for metric in METRICS if metric in metrics)
        sections.append(
            f"<section><h2>{name}, IoU over {MIN_OVERLAP[name]:g}</h2>{_table(evaluation, name, intervals)}"
            f'<div class="charts">{curves}{_parts(parts.get(name, {}))}</div></section>'
        )
    if pictures:
        figures = "".join(
            f'<figure><figcaption><h3>{escape(caption)}</h3></figcaption><img src="{data}" alt="{escape(caption)}">'
            "</figure>"
            for caption, data in pictures
        )
        sections.append(
            f'<section><h2>Detections from above</h2><p>{CAPTION}</p><div class="pictures">{figures}</div></section>'
        )
    return document(title, sections, style=STYLE + _STYLE, generator="cosim evaluate")


def pr_plot(results: Sequence[tuple[str, Result]], title: str) -> str:
    """Precision against recall of some results, each with the style of its line (`a` to `d`)."""
    plot = Plot(Axis(0, 1.03, "recall", percent=True), Axis(0, 1.03, "precision", percent=True), title)
    for style, result in results:
        if len(result.recall):
            order = np.argsort(result.recall, kind="stable")
            recall, precision = result.recall[order], result.precision[order]
            plot.line(np.r_[0.0, recall, recall[-1]], np.r_[precision[0], precision, 0.0], style)
    return plot.svg()


def _curves(levels: Sequence[Result], metric: str) -> str:
    svg = pr_plot(list(zip(_STYLES, levels, strict=True)), f"precision against recall, {metric}")
    legend = "".join(
        f'<span><i style="background:var(--{style})"></i> {level}, {result.task.object_counts.sum():,} objects</span>'
        for style, level, result in zip(_STYLES, DIFFICULTIES, levels, strict=True)
    )
    heading = f"<figcaption><h3>{_TITLES[metric]}</h3><p>Precision against recall</p></figcaption>"
    return f'<figure>{heading}{svg}<div class="legend">{legend}</div></figure>'


def _table(evaluation: Evaluation, name: str, intervals: Intervals) -> str:
    rows = []
    metrics = evaluation.results[name]
    for metric in METRICS:
        levels = metrics.get(metric)
        if levels is None:
            rows.append(f"<tr><th>{_TITLES[metric]}</th><td class=words colspan=9>not scored: no such boxes</td></tr>")
            continue
        values = [[f"{getattr(r, kind):.2f}" for r in levels] for kind in ("r40", "r11", "continuous")]
        bounds = intervals.get((name, metric), [])
        for level, (low, high) in enumerate(bounds):
            values[0][level] += f"<small>{low:.1f} – {high:.1f}</small>"
        rows.append(_row(_TITLES[metric], [word for parts in values for word in parts]))
    if "2d" in metrics and evaluation.oriented:
        aos = [[f"{getattr(r, kind):.2f}" for r in metrics["2d"]] for kind in ("aos40", "aos11")]
        rows.append(_row(_TITLES["aos"], [*aos[0], *aos[1], "", "", ""]))
    heads = "".join(f"<th>{level}</th>" for _ in range(3) for level in DIFFICULTIES)
    fewest_objects = min((int(r.task.object_counts.sum()) for levels in metrics.values() for r in levels), default=0)
    note = ""
    if fewest_objects < 41:
        note = (
            "<p>With n objects, fewer than 41, R40 cannot exceed (n − 1)/40: one sample of the curve stays empty "
            "for each missing object. Use the continuous AP instead.</p>"
        )
    return (
        f"{_rules(evaluation, name)}<table><thead><tr><th></th><th colspan=3>R40</th><th colspan=3>R11</th><th "
        f"colspan=3>continuous</th></tr>"
        f"<tr><th></th>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table>{note}"
    )


def _rules(evaluation: Evaluation, name: str) -> str:
    """Note on the difficulty, if it was not determined by KITTI's rules."""
    return f"<p>{escape(evaluation.notes[name])}</p>" if name in evaluation.notes else ""


def _row(title: str, words: Sequence[str]) -> str:
    return f"<tr><th>{title}</th>{''.join(f'<td>{word}</td>' for word in words)}</tr>"


def _parts(parts_by_kind: dict[str, list[Slice]]) -> str:
    figures = []
    for kind, parts in parts_by_kind.items():
        if not parts:
            continue
        names = [part.name for part in parts]
        plot = Plot(Axis(-0.6, len(parts) - 0.4, "", names=names), Axis(0, 112, "AP, 3D, hard (%)"), f"AP by {kind}")
        counts = [f"{part.objects:,}" for part in parts]
        plot.bars(np.arange(len(parts)), np.array([part.ap for part in parts]), 0.7, "b", counts)
        heading = f"<h3>By {_WORDS[kind]}</h3><p>Number of objects on the bars; all false positives count in each</p>"
        figures.append(f"<figure><figcaption>{heading}</figcaption>{plot.svg()}</figure>")
    return "".join(figures)


_STYLE = """
td small { display: block; color: var(--muted); font-size: 11.5px; } .bar.b { fill: var(--b); opacity: .85; }
thead th { text-align: right; } .pictures { display: grid; gap: 16px; margin-top: 12px;
  grid-template-columns: repeat(auto-fill, minmax(min(560px, 100%), 1fr)); }
.pictures img { width: 100%; display: block; }
"""
