"""Pages about driver behaviour: `cosim traffic-compare` and `cosim traffic-diagnose`."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from cosim.driver_discrepancy.behaviours import BEHAVIOURS
from cosim.driver_discrepancy.comparison import UNIT_OF, Row, TrafficComparison
from cosim.driver_discrepancy.diagnosis import TrafficDiagnosis, TrafficFinding
from cosim.driver_discrepancy.distance import SCALES, UNITS
from cosim.driver_discrepancy.sentences import (
    fitted_words,
    parameter_words,
    quantity,
    smallest_words,
    unexplained_words,
)
from cosim.driver_discrepancy.summary import HEADWAY_BINS, LATERAL_BINS, SPEED_BINS, Summary
from cosim.report.html import document
from cosim.report.phrases import p_cell
from cosim.report.plot import Axis, Plot
from cosim.report.ranking_table import ranking_section
from cosim.report.style import STYLE

_AREAS = ".area { opacity: .22; } .area.a { fill: var(--a); }"
_CHARTS = {
    "speed": ("Speeds of who moves", "speed [m/s]", SPEED_BINS, 2),
    "headway": ("Time headways to the leader", "headway [s]", HEADWAY_BINS, 2),
    "lateral": ("Places beside the lane's middle", "to the left [m]", LATERAL_BINS, 2),
}
_WORDS = {
    "free_speed": "speed where nothing holds one up",
    "free_speed_spread": "spread of that speed between drivers",
    "standing_gap": "gap to the leader in a queue",
    "headway": "time headway when following",
    "lateral": "place beside the lane's middle, to the left",
    "lateral_spread": "spread of that place between drivers",
    "lane_changes": "lane changes on roads of several lanes",
    "u_turns": "U-turns, an hour of driving",
    "pull_outs": "pull-outs, an hour of a parked vehicle",
    "acceleration_noise": "unsteadiness of the acceleration when cruising",
    "acceleration_memory": "acceleration left after 0.4 s",
    "reaction_lag": "lag of the acceleration behind the leader's",
    "startup_lag": "lag of setting off behind the leader",
}


def format_comparison(found: TrafficComparison, measured: str, config: str) -> str:
    """The HTML text of a comparison.

    Args:
        found: the comparison.
        measured, config: what was compared, for people.
    """
    command = f"cosim traffic-diagnose {measured} --config {config}"
    row = found.worst
    said = f"The error is <b>{found.error:.3f}</b>, and luck alone makes {found.noise_floor:.3f}. "
    if row is None:
        said += '<span class="good">How drivers drive differs by no more than luck.</span>'
    else:
        said += (
            f'<span class="bad">Farthest off</span>: {escape(_WORDS[row.name])} is {_value(row.name, row.measured)}, '
            f"the model has {_value(row.name, row.model)}."
        )
    sections = [
        f"<header><h1>{escape(config)} against {escape(measured)}</h1><p class=verdict>{said}</p>"
        f"<p class=next>Which behaviour is missing: <code>{escape(command)}</code></p>{_facts(found)}</header>",
        _charts(found.measured, [("model", found.runs)]),
        _statistics(found.statistics, None),
        _notes(found.notes),
    ]
    return document(f"{config} against {measured}", sections, style=STYLE + _AREAS, generator="cosim traffic-compare")


def format_diagnosis(found: TrafficDiagnosis, measured: str, config: str) -> str:
    """The HTML text of a diagnosis.

    Args:
        found: the diagnosis.
        measured, config: what was diagnosed, for people.
    """
    title = f"What drivers of {config} lack against {measured}"
    models = [("model as given", found.before.runs)]
    models += [("improved", found.after.runs)] if found.effects else []
    sections = [
        f"<header><h1>{escape(title)}</h1>{_verdict(found)}{_next(found, measured)}</header>",
        _falls(found),
        _findings(found),
        _charts(found.before.measured, models),
        _statistics(found.before.statistics, found.after.statistics if found.effects else None),
        _ranking(found),
        _smallest(found),
        _notes((*found.before.notes, f"{found.simulations} simulations of {found.before.measured.seconds:.0f} s")),
    ]
    return document(title, sections, style=STYLE + _AREAS, generator="cosim traffic-diagnose")


def _verdict(found: TrafficDiagnosis) -> str:
    if found.effects:
        names = [f"<b>{escape(one.behaviour)}</b> ({escape(parameter_words(one))})" for one in found.effects]
        said = [f'<span class="bad">Missing</span>: {"; ".join(names)}.']
        said.append(
            f"With {'it' if len(names) == 1 else 'them'} the error on vehicles that took no part in any fit goes from "
            f"{found.error_before:.3f} to {found.error_after:.3f}; luck alone makes {found.noise_floor:.3f}."
        )
        for one in found.effects:
            if one.also_possible:
                others = " or ".join(one.also_possible)
                said.append(f'<span class="warn">It may as well be {escape(others)}</span> for {one.behaviour}.')
    elif found.unexplained:
        said = [f'<span class="warn">Something unknown:</span> {escape(unexplained_words(found))} differ.']
    else:
        said = ['<span class="good">Nothing is missing that would show.</span>']
        said.append(f"The held-out error is {found.error_before:.3f}; luck alone makes {found.noise_floor:.3f}.")
        said.append(f"It would have shown {escape(smallest_words(found))}.")
    if found.effects and found.unexplained:
        said.append(f'<span class="warn">Left unexplained:</span> {escape(unexplained_words(found))}.')
    return f'<p class="verdict">{" ".join(said)}</p>'


def _next(found: TrafficDiagnosis, measured: str) -> str:
    if not found.config_out or not found.effects:
        return ""
    command = f"cosim traffic-compare {measured} --config {found.config_out}"
    return (
        f'<p class="next">The improved configuration is <code>{escape(found.config_out)}</code>; look at it with '
        f"<code>{escape(command)}</code></p>"
    )


def _facts(found: TrafficComparison) -> str:
    items = [("Vehicles", f"{len(found.measured.ids):,}"), ("Seconds", f"{found.measured.seconds:.0f}")]
    for name, value in found.channels.items():
        unit = f" {UNITS[name]}" if UNITS[name] else ""
        shown = f"{value:.3g}{unit} <small>counts {value / SCALES[name]:.2f}</small>" if np.isfinite(value) else "–"
        items.append((name.capitalize(), shown))
    cells = "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in items)
    how = "The error is the mean of what the channels count; each is a distance in units of its scale."
    return f"<dl>{cells}</dl><p>{how}</p>"


def _falls(found: TrafficDiagnosis) -> str:
    if not found.effects:
        return ""
    levels = [found.effects[0].error_before, *(one.error_after for one in found.effects)]
    names = ["as given", *(f"+ {one.behaviour}" for one in found.effects)]
    top = 1.25 * max(*levels, found.noise_floor)
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
    plot.line(np.array([-0.5, len(names) - 0.5]), np.full(2, found.noise_floor), "floor")
    plot.note(-0.48, found.noise_floor + 0.02 * top, "luck alone", anchor="start")
    for row, value in enumerate(levels):
        plot.line(np.array([float(row)]), np.array([value]), "whisker", dots=True)
        plot.note(row + 0.05, value + 0.03 * top, f"{value:.3f}", anchor="start")
    return (
        "<section><h2>How the error falls</h2><p>On every third vehicle, none of which took part in a fit. Behaviour "
        "that few show, as a U-turn, moves this number little: the statistics below show it.</p>"
        f'<figure style="max-width:{max(620, 190 * len(names))}px;margin-top:12px">{plot.svg()}</figure></section>'
    )


def _findings(found: TrafficDiagnosis) -> str:
    if not found.effects:
        return ""
    rows = "".join(_finding(one) for one in found.effects)
    return (
        "<section><h2>What was missing</h2><table><thead><tr><th></th><th>parameter</th><th>was</th><th>is</th>"
        "<th>95 % interval</th><th>p</th><th>error</th><th class=words>law</th><th class=words>SUMO’s word</th></tr>"
        f"</thead><tbody>{rows}</tbody></table><p>p is family-wise: the chance that any statistic would differ so much "
        "if nothing were missing, with vehicles and simulations as the independent facts.</p></section>"
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
                f'<td {span} class="words">{escape(behaviour.equation)}</td>'
                f'<td {span} class="words">{escape(behaviour.vtype)}</td>'
            )
        ends = one.ci95.get(name)
        between = f"{ends[0]:.3g} to {quantity(one.behaviour, name, ends[1])}" if ends else ""
        was = quantity(one.behaviour, name, one.before[name])
        shown, _ = fitted_words(one, name)
        cells.append(f"<tr>{head}<td>{escape(name)}</td><td>{was}</td><td>{shown}</td><td>{between}</td>{tail}</tr>")
    return "".join(cells)


def _charts(measured: Summary, models: Sequence[tuple[str, Sequence[Summary]]]) -> str:
    figures = []
    for channel, (title, label, bins, coarse) in _CHARTS.items():
        edges = bins[::coarse]
        curves = [("a", _density(measured.histograms[channel].sum(0), coarse))]
        for style, (_, runs) in zip("bc", models, strict=False):
            summed = np.sum([run.histograms[channel].sum(0) for run in runs], axis=0)
            curves.append((style, _density(summed, coarse)))
        told = [curve for _, curve in curves if curve.sum() > 0]
        if not told:
            continue
        shown = np.flatnonzero(np.max([curve for _, curve in curves], axis=0) > 0.002)
        low, high = max(shown.min() - 1, 0), min(shown.max() + 2, len(edges) - 1)
        top = 1.12 * max(float(curve.max()) for curve in told)
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
        f'<section><h2>Measured and modelled</h2><div class="legend" style="padding-left:0">{legend}</div>'
        f'<div class="charts">{"".join(figures)}</div></section>'
    )


def _density(counts: np.ndarray, coarse: int) -> np.ndarray:
    """Shares of bins `coarse` times as wide, without what lies outside the bins."""
    inside = counts[1:-1]
    inside = inside[: len(inside) // coarse * coarse].reshape(-1, coarse).sum(1)
    return inside / max(inside.sum(), 1)


def _statistics(before: Sequence[Row], after: Sequence[Row] | None) -> str:
    shows = {name: one.name for one in BEHAVIOURS.values() for name in one.statistics}
    rows = []
    for number, row in enumerate(before):
        then = after[number] if after is not None else None
        marks = [_marked(one) for one in (row, then) if one is not None]
        cells = "".join(f"<td>{mark}</td>" for mark in marks)
        rows.append(
            f"<tr><th>{escape(_WORDS[row.name])}</th><td>{_value(row.name, row.measured)}</td>{cells}"
            f"<td>{_value(row.name, row.sigma)}</td><td class=words>{escape(shows[row.name])}</td></tr>"
        )
    heads = "<th>model</th>" if after is None else "<th>model as given</th><th>improved</th>"
    return (
        f"<section><h2>How they drive</h2><table><thead><tr><th></th><th>measured</th>{heads}<th>luck (1 σ)</th>"
        f"<th class=words>shows</th></tr></thead><tbody>{''.join(rows)}</tbody></table><p>Coloured: differs by more "
        "than luck, 5 % family-wise.</p></section>"
    )


def _marked(row: Row) -> str:
    text = _value(row.name, row.model)
    return f'<span class="bad">{text}</span>' if row.p_value <= 0.05 else text


def _value(name: str, value: float) -> str:
    if not np.isfinite(value):
        return "–"
    value = round(value, 3) + 0.0
    return f"{value:.3g}{f' {UNIT_OF[name]}' if UNIT_OF[name] else ''}"


def _ranking(found: TrafficDiagnosis) -> str:
    return ranking_section(
        [(one.behaviour, one.delta_bic, one.p_value) for one in found.ranking],
        ["fitted" if one.fitted else "by its slopes" for one in found.ranking],
    )


def _smallest(found: TrafficDiagnosis) -> str:
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td>{escape(knob)}</td><td>± {escape(quantity(name, knob, value))}</td></tr>"
        for name, values in found.smallest_detectable.items()
        for knob, value in values.items()
    )
    return (
        "<section><h2>Smallest changes that would show</h2><p>With 80 % power in this recording, beside what is in the "
        f"model now.</p><table><thead><tr><th></th><th></th><th>from</th></tr></thead><tbody>{rows}</tbody></table>"
        "</section>"
    )


def _notes(notes: Sequence[str]) -> str:
    if not notes:
        return ""
    items = "".join(f"<li>{escape(note)}</li>" for note in notes)
    return f'<section class="plain"><ul class="notes">{items}</ul></section>'
