"""Pages about driver behaviour: `cosim traffic-compare` and `cosim traffic-diagnose`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from cosim.driver_discrepancy.behaviours import BEHAVIOURS
from cosim.driver_discrepancy.channels import CHANNELS
from cosim.driver_discrepancy.comparison import StatisticRow, TrafficComparison
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
from cosim.report import document, facts, figure, section, table
from cosim.report.html import fill, part
from cosim.report.phrases import p_cell
from cosim.report.plot import Axis, Plot
from cosim.report.ranking_table import ranking_section

_AREAS = ".area { opacity: .22; } .area.a { fill: var(--a); }"
_CHARTS = {
    "speed": ("Speeds of moving vehicles", "speed [m/s]", SPEED_BINS, 2),
    "headway": ("Net time headways (time gaps) to the leader", "leader’s rear to own front [s]", HEADWAY_BINS, 2),
    "acceleration": ("Accelerations", "acceleration [m/s²]", ACCELERATION_BINS, 1),
    "lateral": ("Lateral positions in the lane", "to the left [m]", LATERAL_BINS, 2),
}
_MOST_CONDITIONS = 40
_LOWEST_SHOWN = 0.002  # share of a bin at which a chart's axis starts


def format_comparison(comparison: TrafficComparison, measured: str, config: str) -> str:
    """The HTML text of a comparison.

    Args:
        comparison: the comparison.
        measured, config: names of data and configuration for display.
    """
    command = f"cosim traffic-diagnose {measured} --config {config}"
    row = comparison.worst
    message = fill("The error is <b>{:.3f}</b>; the noise floor is {:.3f}. ", comparison.error, comparison.noise_floor)
    if row is None and comparison.vehicles_differ:
        words = "; ".join(other.difference for other in comparison.vehicles_differ)
        message += fill('<span class="bad">Single vehicles differ</span>: {}.', words)
    elif row is None:
        message += "No channel differs significantly from the model."
    else:
        message += fill(
            '<span class="bad">Largest difference</span>: {} is {}, the model has {}.',
            _words(row),
            _value(row, row.measured),
            _value(row, row.model),
        )
    sections = [
        fill(
            "<header><h1>{} against {}</h1><p class=verdict>{}</p><p class=next>To find the missing "
            "behaviour: <code>{}</code></p>{}</header>",
            config,
            measured,
            message,
            command,
            _facts(comparison),
        ),
        _charts(comparison.measured, [("model", comparison.runs)]),
        draw_diagrams(comparison.measured, [("model", comparison.runs)]),
        _groups(comparison, None),
        _statistics(comparison.statistics, None),
        _parts(comparison, None),
        _notes(comparison.notes),
    ]
    return document(f"{config} against {measured}", sections, style=_AREAS, generator="cosim traffic-compare")


def format_diagnosis(diagnosis: TrafficDiagnosis, measured: str, config: str) -> str:
    """The HTML text of a diagnosis.

    Args:
        diagnosis: the diagnosis.
        measured, config: names of data and configuration for display.
    """
    title = f"Behaviours that {config} is missing, compared with {measured}"
    models = [("model as given", diagnosis.before.runs)]
    models += [("improved", diagnosis.after.runs)] if diagnosis.effects else []
    sections = [
        fill("<header><h1>{}</h1>{}{}</header>", title, _verdict(diagnosis), _next(diagnosis, measured)),
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
    return document(title, sections, style=_AREAS, generator="cosim traffic-diagnose")


def _verdict(diagnosis: TrafficDiagnosis) -> str:
    floor = f"the noise floor is {diagnosis.noise_floor:.3f}"
    fall = f"{diagnosis.error_before:.3f} to {diagnosis.error_after:.3f}; {floor}"
    error = f"The held-out error is {diagnosis.error_before:.3f}; {floor}."
    if diagnosis.effects:
        names = [fill("<b>{}</b> ({})", one.behaviour, parameter_words(one)) for one in diagnosis.effects]
        parts: list[str] = [fill('<span class="bad">Missing</span>: {}.', Markup("; ").join(names))]
        parts.append(f"With {'it' if len(names) == 1 else 'them'} the error on held-out vehicles goes from {fall}.")
        for one in diagnosis.effects:
            if one.also_possible:
                others = " or ".join(one.also_possible)
                parts.append(
                    fill('<span class="warn">{} cannot be distinguished from {}.</span>', one.behaviour, others)
                )
            if one.worse:
                worse = ", ".join(f"{name.replace('_', ' ')} (+{rise:.3f})" for name, rise in one.worse.items())
                parts.append(fill('<span class="warn">{} makes worse: {}.</span>', one.behaviour, worse))
    elif diagnosis.unexplained:
        words = unexplained_words(diagnosis)
        parts = [
            fill('<span class="warn">Unknown:</span> {} differ; no behaviour of the catalogue explains it.', words),
            error,
        ]
    else:
        parts = ["No missing behaviour is significant.", error]
        parts.append(f"A change would have been detected with 80 % power: {smallest_words(diagnosis)}.")
    if diagnosis.effects and diagnosis.unexplained:
        parts.append(fill('<span class="warn">Left unexplained:</span> {}.', unexplained_words(diagnosis)))
    return fill('<p class="verdict">{}</p>', Markup(" ").join(parts))


def _next(diagnosis: TrafficDiagnosis, measured: str) -> str:
    if not diagnosis.config_out or not diagnosis.effects:
        return ""
    command = f"cosim traffic-compare {measured} --config {diagnosis.config_out}"
    return fill(
        '<p class="next">The improved configuration is <code>{}</code>; look at it with <code>{}</code></p>',
        diagnosis.config_out,
        command,
    )


def _facts(comparison: TrafficComparison) -> str:
    items = [("Vehicles", f"{len(comparison.measured.ids):,}"), ("Seconds", f"{comparison.measured.seconds:.0f}")]
    items.append(("Simulations", f"{len(comparison.runs)}"))
    how = (
        "The error is the mean over channels of the continuous ranked probability score of single vehicles, each "
        "compared with itself in the simulations and divided by the channel’s scale."
    )
    return fill("{}<p>{}</p>", facts(items), how)


def _groups(before: TrafficComparison, after: TrafficComparison | None) -> str:
    """Errors of all channels, before and after."""
    first, last = before.channels, after.channels if after is not None else {}
    shown = before if after is None else after
    rows = []
    for group, value in first.items():
        then = last.get(group, float("nan"))
        is_larger = np.isfinite(then) and then > 1.1 * value + 0.02
        cells = [fill('<span class="bad">{:.3f}</span>', then) if is_larger else f"{then:.3f}"] if after else []
        rows.append([group.replace("_", " "), f"{value:.3f}", *cells, f"{shown.floors.get(group, float('nan')):.3f}"])
    of_all = [f"{after.error:.3f}"] if after else []
    rows.append(["all channels", f"{before.error:.3f}", *of_all, f"{shown.noise_floor:.3f}"])
    how = Markup(
        "<p>All vehicles. The noise floor is the error of the model against itself with another seed. Coloured: larger "
        "than before.</p>"
    )
    return section("Error by channel", table(["", *_models(after), "noise floor"], rows), how)


def _models(after: object | None) -> list[str]:
    """Column headings of the models."""
    return ["model"] if after is None else ["model as given", "improved"]


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
    return fill(
        "<section><h2>Error on held-out vehicles</h2><p>Every third vehicle, none of which took part in "
        "a fit. Rare acts such as U-turns change this number little; the statistics below show them.</p>"
        '<figure style="max-width:{}px;margin-top:12px">{}</figure></section>',
        max(620, 190 * len(names)),
        plot.svg(),
    )


def _findings(diagnosis: TrafficDiagnosis) -> str:
    if not diagnosis.effects:
        return ""
    rows = Markup().join(_finding(one) for one in diagnosis.effects)
    return fill(
        "<section><h2>What was missing</h2><table><thead><tr><th></th><th>parameter</th><th>was</th><th>"
        "is</th><th>95 % interval</th><th>p</th><th>error</th><th>fall, 95 % interval</th><th "
        "class=words>equation</th><th class=words>SUMO parameter</th></tr></thead><tbody>{}</tbody>"
        "</table><p>p is family-wise: the chance that any column of the dictionary would differ so much "
        "if nothing were missing. Vehicles are the independent units: their signs are flipped. The fall "
        "of the error on held-out vehicles: over vehicles and seeds; coloured where it includes zero. Errors of a "
        "behaviour are over what vehicles show both without and with it, so that they may differ from those above.</p>"
        "</section>",
        rows,
    )


def _finding(one: TrafficFinding) -> str:
    cells, span = [], fill('rowspan="{}"', len(one.params))
    behaviour = BEHAVIOURS[one.behaviour]
    for row, name in enumerate(one.params):
        head = fill("<th {}>{}</th>", span, one.behaviour) if row == 0 else ""
        tail = ""
        if row == 0:
            tail = fill(
                '<td {}>{}</td><td {}>{:.3f} → {:.3f}</td><td {}>{}</td><td {} class="words">{}</td><td {} '
                'class="words">{}</td>',
                span,
                p_cell(one.p_value),
                span,
                one.error_before,
                one.error_after,
                span,
                _fall(one),
                span,
                behaviour.equation,
                span,
                behaviour.vtype,
            )
        ends = one.ci95.get(name)
        between = f"{ends[0]:.3g} to {quantity(one.behaviour, name, ends[1])}" if ends else ""
        was = quantity(one.behaviour, name, one.before[name])
        shown, _ = fitted_words(one, name)
        cells.append(
            fill("<tr>{}<td>{}</td><td>{}</td><td>{}</td><td>{}</td>{}</tr>", head, name, was, shown, between, tail)
        )
    return Markup().join(cells)


def _fall(one: TrafficFinding) -> str:
    """Interval of the fall of the held-out error; coloured where it includes none."""
    low, high = one.fall_ci95
    text = f"{low:.3f} to {high:.3f}"
    return text if low > 0 else fill('<span class="warn">{}</span>', text)


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
        if len(shown) < 2:  # all are the same
            continue
        low, high = max(shown.min() - 1, 0), min(shown.max() + 2, len(edges) - 1)
        top = 1.12 * max(float(curve.max()) for curve in drawn)
        plot = Plot(Axis(float(edges[low]), float(edges[high]), label), Axis(0, top, "share", percent=True), title)
        for style, curve in curves:
            plot.steps(edges[low : high + 1], curve[low:high], style, filled=style == "a")
        figures.append(figure(title, "", plot.svg()))
    names = ["measured", *(name for name, _ in models)]
    legend = Markup().join(
        fill('<span><i style="background:var(--{})"></i> {}</span>', style, name)
        for style, name in zip("abc", names, strict=False)
    )
    return fill(
        '<section><h2>Distributions</h2><div class="legend" style="padding-left:0">{}</div><div '
        'class="charts">{}</div></section>',
        legend,
        Markup().join(figures),
    )


def _density(counts: np.ndarray, coarse: int) -> np.ndarray:
    """Shares of bins `coarse` times as wide, without what lies outside the bins."""
    inside = counts[1:-1]
    inside = inside[: len(inside) // coarse * coarse].reshape(-1, coarse).sum(1)
    return inside / max(inside.sum(), 1)


def _statistics(before: Sequence[StatisticRow], after: Sequence[StatisticRow] | None) -> str:
    shows: dict[str, list[str]] = {}
    for behaviour in BEHAVIOURS.values():
        for name in behaviour.statistics:
            shows.setdefault(name, []).append(behaviour.name)
    rows = []
    for number, row in enumerate(before):
        then = after[number] if after is not None else None
        rows.append(
            [
                _words(row),
                _value(row, row.measured),
                *(_marked(one) for one in (row, then) if one is not None),
                _value(row, row.sigma),
                ", ".join(shows.get(row.name, [])),
            ]
        )
    heads = ["", "measured", *_models(after), "1 σ by chance", "shows"]
    how = Markup("<p>Coloured: differs significantly, 5 % family-wise.</p>")
    return section("Channels", table(heads, rows, words=(len(heads) - 1,)), how)


def _parts(before: TrafficComparison, after: TrafficComparison | None) -> str:
    """Channels under conditions that differ significantly."""
    then = {(row.name, row.condition, row.level): row for row in (after.parts if after is not None else ())}
    rows = []
    for row in sorted(before.parts, key=lambda one: one.p_value):
        later = then.get((row.name, row.condition, row.level))
        if row.p_value > 0.05 and (later is None or later.p_value > 0.05):
            continue
        cells = [_marked(one) for one in (row, later) if one is not None]
        cells += ["–"] if after is not None and later is None else []
        condition = f"{CHANNELS[row.name].words}; {row.condition}: {row.level}"
        rows.append([condition, _value(row, row.measured), *cells])
    return section(
        "Conditions under which channels differ", table(["", "measured", *_models(after)], rows[:_MOST_CONDITIONS])
    )


def _marked(row: StatisticRow) -> str:
    text = _value(row, row.model)
    return fill('<span class="bad">{}</span>', text) if row.p_value <= 0.05 else text


def _words(row: StatisticRow) -> str:
    return CHANNELS[row.name].words


def _value(row: StatisticRow, value: float) -> str:
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
    rows = [
        [name, knob, f"± {quantity(name, knob, value)}"]
        for name, values in diagnosis.smallest_detectable.items()
        for knob, value in values.items()
    ]
    text = "With 80 % power in this recording, for the current model."
    return section("Smallest detectable changes", table(["", "", "from"], rows), text=text)


def _notes(notes: Sequence[str]) -> str:
    if not notes:
        return ""
    return fill('<section class="plain">{}</section>', part("notes", notes))
