"""Pages about driver behaviour: `cosim traffic-compare` and `cosim traffic-diagnose`."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from cosim.driver_discrepancy.behaviours import BEHAVIOURS
from cosim.driver_discrepancy.channels import CHANNELS
from cosim.driver_discrepancy.comparison import Row, TrafficComparison
from cosim.driver_discrepancy.diagnosis import TrafficDiagnosis, TrafficFinding
from cosim.driver_discrepancy.diagrams import draw_diagrams
from cosim.driver_discrepancy.sentences import (
    fitted_words,
    parameter_words,
    quantity,
    smallest_words,
    unexplained_words,
)
from cosim.driver_discrepancy.summary import ACCELERATION_BINS, HEADWAY_BINS, LATERAL_BINS, SPEED_BINS, Summary
from cosim.report.html import document
from cosim.report.phrases import p_cell
from cosim.report.plot import Axis, Plot
from cosim.report.ranking_table import ranking_section
from cosim.report.style import STYLE

_AREAS = ".area { opacity: .22; } .area.a { fill: var(--a); }"
_CHARTS = {
    "speed": ("Speeds of moving vehicles", "speed [m/s]", SPEED_BINS, 2),
    "headway": ("Time headways to the leader", "headway [s]", HEADWAY_BINS, 2),
    "acceleration": ("Accelerations", "acceleration [m/s²]", ACCELERATION_BINS, 1),
    "lateral": ("Lateral positions in the lane", "to the left [m]", LATERAL_BINS, 2),
}
_LOWEST_SHOWN = 0.002  # share of a bin at which a chart's axis starts


def format_comparison(comparison: TrafficComparison, measured: str, config: str) -> str:
    """The HTML text of a comparison.

    Args:
        comparison: the comparison.
        measured, config: names of data and configuration for display.
    """
    command = f"cosim traffic-diagnose {measured} --config {config}"
    row = comparison.worst
    said = f"The error is <b>{comparison.error:.3f}</b>; the noise floor is {comparison.noise_floor:.3f}. "
    if row is None:
        said += "No channel differs significantly from the model."
    else:
        said += (
            f'<span class="bad">Largest difference</span>: {escape(_words(row))} is {_value(row, row.measured)}, '
            f"the model has {_value(row, row.model)}."
        )
    sections = [
        f"<header><h1>{escape(config)} against {escape(measured)}</h1><p class=verdict>{said}</p>"
        f"<p class=next>To find the missing behaviour: <code>{escape(command)}</code></p>{_facts(comparison)}</header>",
        _charts(comparison.measured, [("model", comparison.runs)]),
        draw_diagrams(comparison.measured, [("model", comparison.runs)]),
        _groups(comparison, None),
        _statistics(comparison.statistics, None),
        _parts(comparison, None),
        _notes(comparison.notes),
    ]
    return document(f"{config} against {measured}", sections, style=STYLE + _AREAS, generator="cosim traffic-compare")


def format_diagnosis(diagnosis: TrafficDiagnosis, measured: str, config: str) -> str:
    """The HTML text of a diagnosis.

    Args:
        diagnosis: the diagnosis.
        measured, config: names of data and configuration for display.
    """
    title = f"Behaviours that {config} lacks against {measured}"
    models = [("model as given", diagnosis.before.runs)]
    models += [("improved", diagnosis.after.runs)] if diagnosis.effects else []
    sections = [
        f"<header><h1>{escape(title)}</h1>{_verdict(diagnosis)}{_next(diagnosis, measured)}</header>",
        _falls(diagnosis),
        _findings(diagnosis),
        _groups(diagnosis.before, diagnosis.after if diagnosis.effects else None),
        _charts(diagnosis.before.measured, models),
        draw_diagrams(diagnosis.before.measured, models),
        _statistics(diagnosis.before.statistics, diagnosis.after.statistics if diagnosis.effects else None),
        _parts(diagnosis.before, diagnosis.after if diagnosis.effects else None),
        _ranking(diagnosis),
        _smallest(diagnosis),
        _notes(
            (
                *diagnosis.before.notes,
                f"{diagnosis.simulations} simulations of {diagnosis.before.measured.seconds:.0f} s",
            )
        ),
    ]
    return document(title, sections, style=STYLE + _AREAS, generator="cosim traffic-diagnose")


def _verdict(diagnosis: TrafficDiagnosis) -> str:
    fall = (
        f"{diagnosis.error_before:.3f} to {diagnosis.error_after:.3f}; the noise floor is {diagnosis.noise_floor:.3f}"
    )
    if diagnosis.effects:
        names = [f"<b>{escape(one.behaviour)}</b> ({escape(parameter_words(one))})" for one in diagnosis.effects]
        parts = [f'<span class="bad">Missing</span>: {"; ".join(names)}.']
        parts.append(f"With {'it' if len(names) == 1 else 'them'} the error on held-out vehicles goes from {fall}.")
        for one in diagnosis.effects:
            if one.also_possible:
                others = escape(" or ".join(one.also_possible))
                parts.append(f'<span class="warn">{one.behaviour} cannot be distinguished from {others}.</span>')
            if one.worse:
                worse = ", ".join(f"{name.replace('_', ' ')} (+{rise:.3f})" for name, rise in one.worse.items())
                parts.append(f'<span class="warn">{one.behaviour} makes worse: {escape(worse)}.</span>')
    elif diagnosis.unexplained:
        words = escape(unexplained_words(diagnosis))
        parts = [f'<span class="warn">Unknown:</span> {words} differ; no behaviour of the catalogue explains it.']
    else:
        parts = ["No missing behaviour is significant."]
        parts.append(
            f"The held-out error is {diagnosis.error_before:.3f}; the noise floor is {diagnosis.noise_floor:.3f}."
        )
        parts.append(f"A change would have been detected with 80 % power: {escape(smallest_words(diagnosis))}.")
    if diagnosis.effects and diagnosis.unexplained:
        parts.append(f'<span class="warn">Left unexplained:</span> {escape(unexplained_words(diagnosis))}.')
    return f'<p class="verdict">{" ".join(parts)}</p>'


def _next(diagnosis: TrafficDiagnosis, measured: str) -> str:
    if not diagnosis.config_out or not diagnosis.effects:
        return ""
    command = f"cosim traffic-compare {measured} --config {diagnosis.config_out}"
    return (
        f'<p class="next">The improved configuration is <code>{escape(diagnosis.config_out)}</code>; look at it with '
        f"<code>{escape(command)}</code></p>"
    )


def _facts(comparison: TrafficComparison) -> str:
    items = [("Vehicles", f"{len(comparison.measured.ids):,}"), ("Seconds", f"{comparison.measured.seconds:.0f}")]
    items.append(("Simulations", f"{len(comparison.runs)}"))
    cells = "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in items)
    how = (
        "The error is the mean over channels of the continuous ranked probability score of single vehicles, each "
        "compared with itself in the simulations and divided by the channel’s scale."
    )
    return f"<dl>{cells}</dl><p>{how}</p>"


def _groups(before: TrafficComparison, after: TrafficComparison | None) -> str:
    """Errors of all channels, before and after."""
    first, last = before.channels, after.channels if after is not None else {}
    shown = before if after is None else after
    rows = []
    for group, value in first.items():
        then = last.get(group, float("nan"))
        style = ' class="bad"' if np.isfinite(then) and then > 1.1 * value + 0.02 else ""
        cell = f"<td><span{style}>{then:.3f}</span></td>" if after is not None else ""
        cell += f"<td>{shown.floors.get(group, float('nan')):.3f}</td>"
        rows.append(f"<tr><th>{escape(group.replace('_', ' '))}</th><td>{value:.3f}</td>{cell}</tr>")
    rows.append(
        f"<tr><th>all channels</th><td>{before.error:.3f}</td>"
        + (f"<td>{after.error:.3f}</td>" if after is not None else "")
        + f"<td>{shown.noise_floor:.3f}</td></tr>"
    )
    heads = "<th>model</th>" if after is None else "<th>model as given</th><th>improved</th>"
    return (
        f"<section><h2>Error by channel</h2><table><thead><tr><th></th>{heads}<th>noise floor</th></tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table><p>All vehicles. The noise floor is the error of the model against "
        "itself with another seed. Coloured: larger than before.</p></section>"
    )


def _falls(diagnosis: TrafficDiagnosis) -> str:
    if not diagnosis.effects:
        return ""
    levels = [diagnosis.effects[0].error_before, *(one.error_after for one in diagnosis.effects)]
    names = ["as given", *(f"+ {one.behaviour}" for one in diagnosis.effects)]
    top = 1.25 * max(*levels, diagnosis.noise_floor)
    plot = Plot(
        Axis(-0.5, len(names) - 0.5, names=names),
        Axis(0, top, "error on held-out vehicles"),
        "held-out error",
        max(620, 190 * len(names)),
        320,
    )
    for row in range(1, len(levels)):
        ends = np.array([row - 0.28, row + 0.28])
        style = "fall" if levels[row] <= levels[row - 1] else "rise"
        plot.band(ends, np.full(2, levels[row]), np.full(2, levels[row - 1]), style)
        plot.line(np.array([row - 1, row + 0.28]), np.full(2, levels[row - 1]), "link")
    plot.line(np.array([-0.5, len(names) - 0.5]), np.full(2, diagnosis.noise_floor), "floor")
    plot.note(-0.48, diagnosis.noise_floor + 0.02 * top, "noise floor", anchor="start")
    for row, value in enumerate(levels):
        plot.line(np.array([float(row)]), np.array([value]), "whisker", dots=True)
        plot.note(row + 0.05, value + 0.03 * top, f"{value:.3f}", anchor="start")
    return (
        "<section><h2>Error on held-out vehicles</h2><p>Every third vehicle, none of which took part in a fit. Rare "
        "acts such as U-turns change this number little; the statistics below show them.</p>"
        f'<figure style="max-width:{max(620, 190 * len(names))}px;margin-top:12px">{plot.svg()}</figure></section>'
    )


def _findings(diagnosis: TrafficDiagnosis) -> str:
    if not diagnosis.effects:
        return ""
    rows = "".join(_finding(one) for one in diagnosis.effects)
    return (
        "<section><h2>What was missing</h2><table><thead><tr><th></th><th>parameter</th><th>was</th><th>is</th>"
        "<th>95 % interval</th><th>p</th><th>error</th><th>fall, 95 % interval</th><th class=words>equation</th>"
        "<th class=words>SUMO parameter</th></tr>"
        f"</thead><tbody>{rows}</tbody></table><p>p is family-wise: the chance that any column of the dictionary would "
        "differ so much if nothing were missing. Vehicles are the independent units: their signs are flipped. The fall "
        "of the error on held-out vehicles: over vehicles and seeds; coloured where it includes zero.</p>"
        "</section>"
    )


def _finding(one: TrafficFinding) -> str:
    cells, span = [], f'rowspan="{len(one.params)}"'
    behaviour = BEHAVIOURS[one.behaviour]
    for row, name in enumerate(one.params):
        head = f"<th {span}>{escape(one.behaviour)}</th>" if row == 0 else ""
        tail = ""
        if row == 0:
            tail = (
                f"<td {span}>{escape(p_cell(one.p_value))}</td>"
                f"<td {span}>{one.error_before:.3f} → {one.error_after:.3f}</td>"
                f"<td {span}>{_fall(one)}</td>"
                f'<td {span} class="words">{escape(behaviour.equation)}</td>'
                f'<td {span} class="words">{escape(behaviour.vtype)}</td>'
            )
        ends = one.ci95.get(name)
        between = f"{ends[0]:.3g} to {quantity(one.behaviour, name, ends[1])}" if ends else ""
        was = quantity(one.behaviour, name, one.before[name])
        shown, _ = fitted_words(one, name)
        cells.append(f"<tr>{head}<td>{escape(name)}</td><td>{was}</td><td>{shown}</td><td>{between}</td>{tail}</tr>")
    return "".join(cells)


def _fall(one: TrafficFinding) -> str:
    """Interval of the fall of the held-out error; coloured where it includes none."""
    low, high = one.fall_ci95
    text = f"{low:.3f} to {high:.3f}"
    return text if low > 0 else f'<span class="warn">{text}</span>'


def _charts(measured: Summary, models: Sequence[tuple[str, Sequence[Summary]]]) -> str:
    figures = []
    for channel, (title, label, bins, coarse) in _CHARTS.items():
        edges = bins[::coarse]
        curves = [("a", _density(measured.histograms[channel], coarse))]
        for style, (_, runs) in zip("bc", models, strict=False):
            summed = np.sum([run.histograms[channel] for run in runs], axis=0)
            curves.append((style, _density(summed, coarse)))
        drawn = [curve for _, curve in curves if curve.sum() > 0]
        if not drawn:
            continue
        shown = np.flatnonzero(np.max([curve for _, curve in curves], axis=0) > _LOWEST_SHOWN)
        low, high = max(shown.min() - 1, 0), min(shown.max() + 2, len(edges) - 1)
        top = 1.12 * max(float(curve.max()) for curve in drawn)
        plot = Plot(Axis(float(edges[low]), float(edges[high]), label), Axis(0, top, "share", percent=True), title)
        for style, curve in curves:
            plot.steps(edges[low : high + 1], curve[low:high], style, filled=style == "a")
        figures.append(f"<figure><figcaption><h3>{title}</h3></figcaption>{plot.svg()}</figure>")
    names = ["measured", *(name for name, _ in models)]
    legend = "".join(
        f'<span><i style="background:var(--{style})"></i> {escape(name)}</span>'
        for style, name in zip("abc", names, strict=False)
    )
    return (
        f'<section><h2>Distributions</h2><div class="legend" style="padding-left:0">{legend}</div>'
        f'<div class="charts">{"".join(figures)}</div></section>'
    )


def _density(counts: np.ndarray, coarse: int) -> np.ndarray:
    """Shares of bins `coarse` times as wide, without what lies outside the bins."""
    inside = counts[1:-1]
    inside = inside[: len(inside) // coarse * coarse].reshape(-1, coarse).sum(1)
    return inside / max(inside.sum(), 1)


def _statistics(before: Sequence[Row], after: Sequence[Row] | None) -> str:
    shows: dict[str, list[str]] = {}
    for behaviour in BEHAVIOURS.values():
        for name in behaviour.statistics:
            shows.setdefault(name, []).append(behaviour.name)
    rows = []
    for number, row in enumerate(before):
        then = after[number] if after is not None else None
        cells = "".join(f"<td>{_marked(one)}</td>" for one in (row, then) if one is not None)
        rows.append(
            f"<tr><th>{escape(_words(row))}</th><td>{_value(row, row.measured)}</td>{cells}"
            f"<td>{_value(row, row.sigma)}</td><td class=words>{escape(', '.join(shows.get(row.name, [])))}</td></tr>"
        )
    heads = "<th>model</th>" if after is None else "<th>model as given</th><th>improved</th>"
    return (
        f"<section><h2>Channels</h2><table><thead><tr><th></th><th>measured</th>{heads}<th>1 σ by chance</th>"
        f"<th class=words>shows</th></tr></thead><tbody>{''.join(rows)}</tbody></table><p>Coloured: differs "
        "significantly, 5 % family-wise.</p></section>"
    )


def _parts(before: TrafficComparison, after: TrafficComparison | None) -> str:
    """Channels under conditions that differ significantly."""
    then = {(row.name, row.condition, row.level): row for row in (after.parts if after is not None else ())}
    rows = []
    for row in sorted(before.parts, key=lambda one: one.p_value):
        later = then.get((row.name, row.condition, row.level))
        if row.p_value > 0.05 and (later is None or later.p_value > 0.05):
            continue
        cells = "".join(f"<td>{_marked(one)}</td>" for one in (row, later) if one is not None)
        cells += "<td>–</td>" if after is not None and later is None else ""
        place = f"{CHANNELS[row.name].words}; {row.condition}: {row.level}"
        rows.append(f"<tr><th>{escape(place)}</th><td>{_value(row, row.measured)}</td>{cells}</tr>")
    if not rows:
        return ""
    heads = "<th>model</th>" if after is None else "<th>model as given</th><th>improved</th>"
    return (
        f"<section><h2>Conditions under which channels differ</h2><table><thead><tr><th></th><th>measured</th>{heads}"
        f"</tr></thead><tbody>{''.join(rows[:40])}</tbody></table></section>"
    )


def _marked(row: Row) -> str:
    text = _value(row, row.model)
    return f'<span class="bad">{text}</span>' if row.p_value <= 0.05 else text


def _words(row: Row) -> str:
    return CHANNELS[row.name].words


def _value(row: Row, value: float) -> str:
    if not np.isfinite(value):
        return "–"
    value = round(value, 4) + 0.0
    return f"{value:.3g}{f' {row.unit}' if row.unit else ''}"


def _ranking(diagnosis: TrafficDiagnosis) -> str:
    return ranking_section(
        [(one.behaviour, one.delta_bic, one.p_value) for one in diagnosis.ranking],
        ["fitted" if one.fitted else "from its slopes" for one in diagnosis.ranking],
    )


def _smallest(diagnosis: TrafficDiagnosis) -> str:
    if not diagnosis.smallest_detectable:
        return ""
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td>{escape(knob)}</td><td>± {escape(quantity(name, knob, value))}</td></tr>"
        for name, values in diagnosis.smallest_detectable.items()
        for knob, value in values.items()
    )
    return (
        "<section><h2>Smallest detectable changes</h2><p>With 80 % power in this recording, from the current model "
        f"now.</p><table><thead><tr><th></th><th></th><th>from</th></tr></thead><tbody>{rows}</tbody></table>"
        "</section>"
    )


def _notes(notes: Sequence[str]) -> str:
    if not notes:
        return ""
    items = "".join(f"<li>{escape(note)}</li>" for note in notes)
    return f'<section class="plain"><ul class="notes">{items}</ul></section>'
