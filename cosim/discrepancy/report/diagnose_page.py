"""The page of `cosim diagnose`: the verdict, where the error comes from, what was found, and what is left."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
from scipy import stats

from cosim.discrepancy.diagnosis import Diagnosis, Finding, budget_words, floor_words, smallest_rows, smallest_words
from cosim.discrepancy.report.beams import LAYOUT
from cosim.discrepancy.report.bins import shown
from cosim.discrepancy.report.compare_page import budget_section
from cosim.discrepancy.report.unexplained_section import (
    Explored,
    explorer_section,
    explorer_style,
    unexplained_section,
    unknown_section,
)
from cosim.discrepancy.words import FEW, Vocabulary, channel_words, spread_words, unexplained_words, unknown_words
from cosim.report import document, figure, notes_section, section, table
from cosim.report.phrases import listed, p_cell
from cosim.report.plot import Axis, Plot
from cosim.report.ranking_table import ranking_section
from cosim.report.waterfall import waterfall
from cosim.variants.worth_section import worth_section
from sensors.effects.confusions import separations

_SIDES = ("the model as given", "with what was found")


def format_diagnosis(
    found: Diagnosis, words: Vocabulary, drive: str, sensor: str, explored: Explored | None = None
) -> str:
    """The HTML text.

    Args:
        found: the diagnosis.
        words: knows the units of parameters.
        drive, sensor: what was diagnosed, for people.
        explored: beams of the judging frames; gathered from the diagnosis by default.
    """
    title = f"What {sensor} lacks against {drive}"
    explored = explored or explored_of(found)
    text = (
        "On frames that judge, not on those that were fitted. " if found.split.is_held_out else "On the fitted frames. "
    ) + (
        "Errors of poses, objects and the map are taken out of residuals, before and after, as far as they are known. "
        f"Bands are {found.settings.covered} intervals of means of equally filled bins; "
        "what beams of a sector of a frame share is in them. <b>Click a bin to see its beams.</b>"
    )
    sections = [
        f"<header><h1>{escape(title)}</h1>{_verdict(found, words, explored)}{_next(found, drive, sensor)}</header>",
        _budget(found),
        _effects(found, words),
        worth_section(found.worth),
        _alternatives(found, words),
        unknown_section(found),
        unexplained_section(found.unexplained, explored),
        explorer_section(explored, _SIDES if found.effects or found.unknowns else _SIDES[:1], text=text),
        _waterfall(found),
        _ranking(found),
        _smallest(found, words),
        _how(found),
    ]
    return document(title, sections, style=explorer_style(), generator="cosim diagnose")


def explored_of(found: Diagnosis) -> Explored | None:
    """The beams of the judging frames, and charts of them, also by what findings and leftovers depend on; or None."""
    names = [name for one in found.unexplained for name in one.covariates]
    names += [name for one in found.unknowns for name in one.curve.covariates]
    return Explored.of(found.judged, LAYOUT.scans, names)


def _verdict(found: Diagnosis, words: Vocabulary, explored: Explored | None) -> str:
    said = [*_missing(found, words), *_unknown(found)]
    if found.labels is not None and found.labels.verdict == "missing":
        law = escape(str(found.labels).removeprefix("labels: "))
        said.append(f'<span class="bad">Labels are biased</span>: {law}.')
    left = _left(found, explored)
    if not said and not left:
        smallest = smallest_words(found, words, most=FEW)
        said.append('<span class="good">Nothing is missing that would show.</span>')
        said.append(f"It would have shown {escape(smallest)}, and so on below." if smallest else "")
    elif not said:
        said.append('<span class="warn">No effect was added, yet not all is explained.</span>')
    budget = budget_words(found, is_complete=found.verdict == "none" and not left)
    where = f'<p class="sources">{escape(budget[0].upper() + budget[1:])}.</p>'
    return f'<p class="verdict">{" ".join([*said, *left])}</p>{where}'


def _missing(found: Diagnosis, words: Vocabulary) -> list[str]:
    """The effects that were added, each with what explains the data as well."""
    if not found.effects:
        return []
    names = [f"{_either(one)} ({escape(words.parameters(one.effect, one.params, one.ci95))})" for one in found.effects]
    return [f'<span class="bad">Missing</span> {"is" if len(names) == 1 else "are"} {listed(names)}.']


def _either(one: Finding) -> str:
    """`range_walk`, or `either range_walk or incidence_bias` where these data cannot tell."""
    names = [f"<b>{escape(name)}</b>" for name in (one.effect, *one.also_possible)]
    return f'<span class="warn">either</span> {listed(names, "or")}' if one.also_possible else names[0]


def _unknown(found: Diagnosis) -> list[str]:
    if not found.unknowns:
        return []
    what = "Something unknown is missing, too:" if found.effects else "Something unknown is missing:"
    each = "; ".join(escape(unknown_words(one)) for one in found.unknowns)
    return [f'<span class="warn">{what}</span> {each}. No effect of the catalogue does that.']


def _left(found: Diagnosis, explored: Explored | None) -> list[str]:
    """What the screen still finds, and what charts show beside it."""
    if found.unexplained:
        names = [escape(unexplained_words(one)) for one in found.unexplained[:FEW]]
        more = len(found.unexplained) - len(names)
        names += [f"{more} more"] if more else []
        return [f'<span class="warn">Not explained</span>: <a href="#unexplained">{listed(names)}</a>.']
    names = left_words(explored)
    if not names:
        return []
    said = '<span class="warn">Judging frames show more than the screen does</span>: '
    return [f'{said}<a href="#residuals">{escape(listed(names[:FEW]))}</a>.']


def left_words(explored: Explored | None) -> list[str]:
    """Dependences that charts of judging frames show in the end, the surest first."""
    return [
        f"{channel_words(one.channel.name)} by {shown(one.bins.name).words.split(',')[0]} "
        f"(±{one.channel.said(one.after.size)})"
        for one in (explored.left if explored else ())
    ]


def _next(found: Diagnosis, drive: str, sensor: str) -> str:
    if (found.effects or found.unknowns) and found.sensor_out:
        return (
            f'<p class="next">The improved sensor is <code>{escape(found.sensor_out)}</code>; look at it with '
            f"<code>cosim compare {escape(drive)} --sensor {escape(found.sensor_out)}</code></p>"
        )
    return (
        f'<p class="next">Where residuals are: <code>cosim compare {escape(drive)} --sensor {escape(sensor)}</code></p>'
    )


def _budget(found: Diagnosis) -> str:
    frames = f"{len(found.split.test)} frames"
    held = f"Held-out error of the model as given, on {frames} that took no part in any fit, and what it is made of."
    text = held if found.split.is_held_out else f"Error of the model as given, on the {frames} that were fitted."
    where = floor_words(found)
    if where:
        text += f" With poses, objects and surfaces aligned it ends at {found.budget.error_aligned:.3f}: {where}."
    floor = found.noise_floor
    text += f" The noise floor is {floor:.3f}." if floor else " What noise alone would make is not known."
    spreads = spread_words(found.spreads)
    why = {"unexplained": "left once all is aligned; poses and objects are never known exactly"}
    if found.unexplained:
        why = {"unexplained": "left once all is aligned; listed below"}
    return budget_section(found.budget.parts, text=f"{text} {escape(spreads)}".strip(), why=why)


def _waterfall(found: Diagnosis) -> str:
    if not found.effects and not found.unknowns:
        return ""
    held = "frames that took no part in any fit" if found.split.is_held_out else "the fitted frames: there are too few"
    text = (
        f"On {held}, with poses, objects and surfaces aligned; whiskers are {found.settings.covered} intervals of the "
        "level, from frame to frame. A fall is surer than they show, as some frames are harder for every model: the "
        "table above has it."
    )
    wide = min(1100, 400 + 220 * (len(found.effects) + len(found.unknowns)))
    names = ["as given", *(f"+ {one.effect}" for one in found.effects), *("+ unknown" for _ in found.unknowns)]
    aligned = zip(names, found.budget.aligned_steps, strict=False)
    steps = [(name, one.error, one.standard_error) for name, one in aligned]
    svg = waterfall(steps, found.noise_floor, "aligned error, held-out frames", found.settings.coverage)
    return section("How the error falls", figure("", "", svg, "full", wide), text=text)


def _effects(found: Diagnosis, words: Vocabulary) -> str:
    if not found.effects:
        return ""
    rows = "".join(_rows(one, words, _change(found, one)) for one in found.effects)
    charts = "".join(_laser_charts(one, words) for one in found.effects)
    heads = (
        "<thead><tr><th></th><th>parameter</th><th>value</th>"
        f"<th>{found.settings.covered} interval</th><th>p</th><th>aligned error</th>"
        "<th class=words>law</th></tr></thead>"
    )
    text = (
        "p is family-wise: the chance that any candidate would look this missing if nothing were. Intervals allow "
        "for errors that the points of an object or of a scan share. An effect that was there already has its total. "
        "Errors are those with poses, objects and surfaces aligned."
    )
    return section("What was missing", f"<table>{heads}<tbody>{rows}</tbody></table>", charts, text=text)


def _rows(one: Finding, words: Vocabulary, change: str) -> str:
    kind = words.kind(one.effect)
    cells = []
    for row, (name, value) in enumerate(one.params.items()):
        interval = one.ci95.get(name)
        first = row == 0
        head = f'<th rowspan="{len(one.params)}">{escape(one.effect)}</th>' if first else ""
        tail = ""
        if first:
            span = f'rowspan="{len(one.params)}"'
            tail = (
                f"<td {span}>{escape(p_cell(one.p_value))}</td>"
                f"<td {span}>{change}</td>"
                f'<td {span} class="words">{escape(kind.equation if kind else "")}</td>'
            )
        shown = escape(words.quantity(one.effect, name, value))
        between = "" if interval is None or np.ndim(value) else _interval(one.effect, name, interval, words)
        cells.append(f"<tr>{head}<td>{escape(name)}</td><td>{shown}</td><td>{between}</td>{tail}</tr>")
    return "".join(cells)


def _change(found: Diagnosis, one: Finding) -> str:
    """The aligned errors and their difference, whose interval is that of differences frame by frame."""
    steps = {id(before): row for row, before in enumerate(found.budget.steps)}
    row = steps.get(id(one.error_before), -1)
    before, after = one.error_before, one.error_after
    if 0 <= row < len(found.budget.aligned_steps) - 1:
        before, after = found.budget.aligned_steps[row : row + 2]
    said = f"{before.error:.3f} → {after.error:.3f}"
    falls = after.by_frame - before.by_frame
    if len(falls) < 2:
        return said
    half = stats.t.ppf(0.975, len(falls) - 1) * np.std(falls, ddof=1) / np.sqrt(len(falls))
    return f"{said}<br><small>{falls.mean():+.3f} ± {half:.3f} a frame</small>"


def _interval(effect: str, name: str, interval: Any, words: Vocabulary) -> str:
    low, high = (words.quantity(effect, name, float(end)) for end in interval)
    return escape(f"{low} to {high}")


def _laser_charts(one: Finding, words: Vocabulary) -> str:
    figures = []
    for name, value in one.params.items():
        if not np.ndim(value) or words.parameter(one.effect, name).per_axis:
            continue
        level = np.asarray(value, float)
        pairs = np.asarray(one.ci95.get(name, np.stack([level, level], -1)), float)
        reach = 1.1 * max(float(np.abs(pairs).max()), 1e-9)
        low = -reach if level.min() < 0 else 0.0
        unit = words.parameter(one.effect, name).unit
        label = f"{name} ({unit})" if unit else name
        plot = Plot(Axis(0, max(len(level) - 1, 1), "ring, 0 on top"), Axis(low, reach, label), name, 1100, 280)
        ring = np.arange(len(level), dtype=float)
        plot.band(ring, pairs[:, 0], pairs[:, 1], "a")
        plot.line(ring, level, "a", dots=True)
        figures.append(figure(f"{one.effect}: {name} laser by laser", "", plot.svg()))
    return f'<div class="full" style="max-width:1100px">{"".join(figures)}</div>' if figures else ""


def _alternatives(found: Diagnosis, words: Vocabulary) -> str:
    rows = []
    asked, there = {one.effect for one in found.ranking}, {one.effect for one in found.effects}
    for one in found.effects:
        kind = words.kind(one.effect)
        declared = kind.confusable_with if kind else ()
        for other in dict.fromkeys((*one.also_possible, *declared)):
            if other in one.also_possible:
                verdict = '<span class="warn">not separable with these data</span>'
            elif other in there:
                verdict = '<span class="good">both are missing</span>: each explains what the other does not'
            elif other in asked:
                verdict = '<span class="good">told apart</span>: it explains these data worse'
            else:
                verdict = "not among the candidates that came near"
            rows.append([f"{escape(one.effect)} or {escape(other)}?", verdict, _remedy(one.effect, other, words)])
    return section("What else it could be", table(["", "here", "the drive that would tell"], rows, words=(1, 2)))


def _remedy(one: str, other: str, words: Vocabulary) -> str:
    known = separations(one, other)
    if known:
        return escape(" ".join(f"{item.why} {item.remedy}" for item in known))
    laws = [f"{name}: {kind.equation}" for name in (one, other) if (kind := words.kind(name)) and kind.equation]
    return escape("Vary what one law depends on and the other does not. " + "; ".join(laws))


def _ranking(found: Diagnosis) -> str:
    if not any(one.delta_bic > 0 for one in found.ranking):
        return ""
    note = "Beams count as what they stand for, so a few returns from nowhere weigh little: p tells of these."
    return ranking_section([(one.effect, one.delta_bic, one.p_value) for one in found.ranking], note=note)


def _smallest(found: Diagnosis, words: Vocabulary) -> str:
    rows = [
        [escape(effect), escape(name), escape(_amplitude(effect, name, value, words))]
        for effect, name, value in smallest_rows(found)
    ]
    text = "Amplitudes that would have been found with 80 % power in these data, beside what is in the model now."
    shown = table(["", "", "would show from"], rows)
    if shown and found.effects:
        shown = f"<details><summary>Show the table</summary>{shown}</details>"
    return section("Smallest amplitudes that would show", shown, text=text)


def _amplitude(effect: str, name: str, value: float, words: Vocabulary) -> str:
    return words.quantity(effect, name, value) if words.is_possible(effect, name, value) else "would not show"


def _how(found: Diagnosis) -> str:
    fitted, judged = len(found.split.fit), len(found.split.test)
    labels = f"<p>L{escape(str(found.labels)[1:])}.</p>" if found.labels is not None else ""
    said = f"{fitted} {'frame was' if fitted == 1 else 'frames were'} fitted, {judged} judged"
    said += "." if found.split.is_held_out else "; they are the same, for want of more."
    said += " Statistics are explained in docs/discrepancy.md."
    return section("How it was found", f"<p>{said}</p>{labels}") + notes_section(found.notes)
