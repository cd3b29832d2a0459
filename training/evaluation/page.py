"""The page of an evaluation: tables, precision–recall curves, subsets of the objects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from cosim.report.html import document, fill
from cosim.report.plot import Axis, Plot
from training.evaluation.as_json import Intervals
from training.evaluation.evaluate import Evaluation, Result
from training.evaluation.pictures import CAPTION
from training.evaluation.rules import DIFFICULTIES, METRICS, MIN_OVERLAP
from training.evaluation.slices import ScoreSlice

_TITLES = {"3d": "3D", "bev": "Bird’s-eye view", "2d": "Image", "aos": "Orientation (AOS)"}
_WORDS = {"distance": "distance", "occlusion": "occlusion", "points": "points in the box"}
_STYLES = ("c", "a", "d")


def format_page(
    evaluation: Evaluation,
    title: str,
    intervals: Intervals,
    parts: dict[str, dict[str, list[ScoreSlice]]],
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
    head = fill("<header><h1>{}</h1><p>{:,} frames, by the rules of KITTI’s object benchmark.</p>", title, frames)
    if not evaluation.results:
        head += Markup("<p class=verdict>Nothing of Car, Pedestrian or Cyclist was detected.</p>")
    sections = [head + Markup("</header>")]
    for name, metrics in evaluation.results.items():
        curves = Markup().join(_curves(metrics[metric], metric) for metric in METRICS if metric in metrics)
        sections.append(
            fill(
                '<section><h2>{}, IoU over {:g}</h2>{}<div class="charts">{}{}</div></section>',
                name,
                MIN_OVERLAP[name],
                _table(evaluation, name, intervals),
                curves,
                _parts(parts.get(name, {})),
            )
        )
    if pictures:
        figures = Markup().join(
            fill('<figure><figcaption><h3>{}</h3></figcaption><img src="{}" alt="{}"></figure>', caption, data, caption)
            for caption, data in pictures
        )
        sections.append(
            fill(
                '<section><h2>Detections from above</h2><p>{}</p><div class="pictures">{}</div></section>',
                CAPTION,
                figures,
            )
        )
    return document(title, sections, style=_STYLE, generator="cosim evaluate")


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
    legend = Markup().join(
        fill(
            '<span><i style="background:var(--{})"></i> {}, {:,} objects</span>',
            style,
            level,
            result.task.object_counts.sum(),
        )
        for style, level, result in zip(_STYLES, DIFFICULTIES, levels, strict=True)
    )
    heading = fill("<figcaption><h3>{}</h3><p>Precision against recall</p></figcaption>", _TITLES[metric])
    return fill('<figure>{}{}<div class="legend">{}</div></figure>', heading, svg, legend)


def _table(evaluation: Evaluation, name: str, intervals: Intervals) -> str:
    rows = []
    metrics = evaluation.results[name]
    for metric in METRICS:
        levels = metrics.get(metric)
        if levels is None:
            rows.append(
                fill("<tr><th>{}</th><td class=words colspan=9>not scored: no such boxes</td></tr>", _TITLES[metric])
            )
            continue
        values = [[r.text(kind) for r in levels] for kind in ("r40", "r11", "continuous")]
        bounds = intervals.get((name, metric), [])
        for level, (low, high) in enumerate(bounds):
            values[0][level] += fill("<small>{:.1f} – {:.1f}</small>", low, high)
        rows.append(_row(_TITLES[metric], [word for parts in values for word in parts]))
    if "2d" in metrics and evaluation.oriented:
        aos = [[r.text(kind) for r in metrics["2d"]] for kind in ("aos40", "aos11")]
        rows.append(_row(_TITLES["aos"], [*aos[0], *aos[1], "", "", ""]))
    heads = Markup().join(fill("<th>{}</th>", level) for _ in range(3) for level in DIFFICULTIES)
    fewest_objects = min((int(r.task.object_counts.sum()) for levels in metrics.values() for r in levels), default=0)
    note = ""
    if fewest_objects < 41:
        note = Markup(
            "<p>With n objects, fewer than 41, R40 cannot exceed (n − 1)/40: one sample of the curve stays "
            "empty for each missing object. Use the continuous AP instead.</p>"
        )
    return fill(
        "{}<table><thead><tr><th></th><th colspan=3>R40</th><th colspan=3>R11</th><th colspan=3>"
        "continuous</th></tr><tr><th></th>{}</tr></thead><tbody>{}</tbody></table>{}",
        _rules(evaluation, name),
        heads,
        Markup().join(rows),
        note,
    )


def _rules(evaluation: Evaluation, name: str) -> str:
    """Note on the difficulty, if it was not determined by KITTI's rules."""
    return fill("<p>{}</p>", evaluation.notes[name]) if name in evaluation.notes else ""


def _row(title: str, words: Sequence[str]) -> str:
    return fill("<tr><th>{}</th>{}</tr>", title, Markup().join(fill("<td>{}</td>", word) for word in words))


def _parts(parts_by_kind: dict[str, list[ScoreSlice]]) -> str:
    figures = []
    for kind, parts in parts_by_kind.items():
        if not parts:
            continue
        names = [part.name for part in parts]
        plot = Plot(Axis(-0.6, len(parts) - 0.4, "", names=names), Axis(0, 112, "AP, 3D, hard (%)"), f"AP by {kind}")
        counts = [f"{part.objects:,}" for part in parts]
        plot.bars(np.arange(len(parts)), np.array([part.ap for part in parts]), 0.7, "b", counts)
        heading = fill(
            "<h3>By {}</h3><p>Number of objects on the bars; all false positives count in each</p>", _WORDS[kind]
        )
        figures.append(fill("<figure><figcaption>{}</figcaption>{}</figure>", heading, plot.svg()))
    return Markup().join(figures)


_STYLE = """
td small { display: block; color: var(--muted); font-size: 11.5px; } .bar.b { fill: var(--b); opacity: .85; }
thead th { text-align: right; } .pictures { display: grid; gap: 16px; margin-top: 12px;
  grid-template-columns: repeat(auto-fill, minmax(min(560px, 100%), 1fr)); }
.pictures img { width: 100%; display: block; }
"""
