"""The page of `cosim diagnose`: the verdict, the falling error, what was found, and what else it could be."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
from scipy import stats

from cosim.discrepancy.diagnosis import Diagnosis, Finding
from cosim.discrepancy.report.confusions import separations
from cosim.discrepancy.report.notes_section import notes_section
from cosim.discrepancy.report.phrases import listed, p_cell
from cosim.discrepancy.report.ranking_table import ranking_section
from cosim.discrepancy.report.sentences import (
    Vocabulary,
    error_words,
    floor_words,
    map_words,
    smallest_rows,
    smallest_words,
    unexplained_words,
    unknown_words,
)
from cosim.discrepancy.report.style import STYLE
from cosim.discrepancy.report.unknown_section import unknown_section
from cosim.discrepancy.report.waterfall import waterfall
from cosim.report.html import document
from cosim.stats.plot import Axis, Plot


def format_diagnosis(found: Diagnosis, words: Vocabulary, drive: str, sensor: str) -> str:
    """The HTML text.

    Args:
        found: the diagnosis.
        words: knows the units of parameters.
        drive, sensor: what was diagnosed, for people.
    """
    title = f"What {sensor} lacks against {drive}"
    sections = [
        f"<header><h1>{escape(title)}</h1>{_verdict(found, words)}{_next(found, drive, sensor)}</header>",
        _waterfall(found),
        _effects(found, words),
        _alternatives(found, words),
        unknown_section(found),
        _ranking(found),
        _smallest(found, words),
        _how(found),
    ]
    return document(title, sections, style=STYLE, generator="cosim diagnose")


def _verdict(found: Diagnosis, words: Vocabulary) -> str:
    said = []
    if found.effects:
        names = [
            f"<b>{escape(one.effect)}</b> ({escape(words.parameters(one.effect, one.params, one.ci95))})"
            for one in found.effects
        ]
        verb = "is" if len(names) == 1 else "are"
        said.append(f'<span class="bad">Missing</span> {verb} {listed(names)}.')
        if found.unknown is None:
            said.append(_fall(found))
        unsure = [one for one in found.effects if one.also_possible]
        for one in unsure:
            others = listed([escape(name) for name in one.also_possible], "or")
            said.append(f'<span class="warn">It may as well be {others}</span> in place of {escape(one.effect)}.')
    if found.unknown is not None:
        what = "Something unknown is missing, too:" if found.effects else "Something unknown is missing:"
        said.append(
            f'<span class="warn">{what}</span> {escape(unknown_words(found.unknown))}; '
            "no effect of the catalogue does that."
        )
        said.append(_fall(found))
    if found.labels is not None and found.labels.verdict == "missing":
        law = escape(str(found.labels).removeprefix("labels: "))
        said.append(f'<span class="bad">Labels are biased</span>: {law}.')
    if not said:
        said.append('<span class="good">Nothing is missing that would show.</span>')
        said.append(_left(found))
        smallest = smallest_words(found, words, most=3)
        said.append(f"It would have shown {escape(smallest)}, and so on below." if smallest else "")
    if found.map_off_m > 0:
        said.append(
            f"Beside that {escape(map_words(found))}, spot by spot: small effects on ranges hide behind it, and the "
            "error keeps it."
        )
    return f'<p class="verdict">{" ".join(said)}</p>'


def _fall(found: Diagnosis) -> str:
    count = len(found.effects) + (found.unknown is not None)
    said = f"With {['it', 'it', 'both'][count] if count < 3 else 'all of them'} the "
    said += f"{error_words(found)} {'falls' if found.error_after < found.error_before else 'does not fall'}"
    said += f" from {found.error_before:.3f} to {found.error_after:.3f}"
    where = floor_words(found)
    return f"{said}, {where}." if where else f"{said}."


def _left(found: Diagnosis) -> str:
    """The error where nothing was found."""
    if above := unexplained_words(found):
        why = "the twin may be off, or more frames may tell what it is"
        return f'<span class="warn">{escape(above[0].upper() + above[1:])}</span>: {why}.'
    where = floor_words(found)
    return f"The {error_words(found)} is {found.error_after:.3f}{where and f', {where}'}."


def _next(found: Diagnosis, drive: str, sensor: str) -> str:
    if (found.effects or found.unknown) and found.sensor_out:
        return (
            f'<p class="next">The improved sensor is <code>{escape(found.sensor_out)}</code>; look at it with '
            f"<code>cosim compare {escape(drive)} --sensor {escape(found.sensor_out)}</code></p>"
        )
    return (
        f'<p class="next">Where residuals are: <code>cosim compare {escape(drive)} --sensor {escape(sensor)}</code></p>'
    )


def _waterfall(found: Diagnosis) -> str:
    if not found.effects and found.unknown is None:
        return ""
    held = "frames that took no part in any fit" if found.split.is_held_out else "the fitted frames: there are too few"
    return (
        f"<section><h2>How the error falls</h2><p>On {held}; whiskers are 95 % intervals of the level, from frame to "
        "frame. A fall is surer than they show, as some frames are harder for every model: the table has it.</p>"
        f'<figure style="max-width:{_wide(found)}px;margin-top:12px">{waterfall(found)}</figure></section>'
    )


def _wide(found: Diagnosis) -> int:
    return min(1100, 400 + 220 * (len(found.effects) + (found.unknown is not None)))


def _effects(found: Diagnosis, words: Vocabulary) -> str:
    if not found.effects:
        return ""
    rows = "".join(_rows(one, words) for one in found.effects)
    charts = "".join(_laser_charts(one, words) for one in found.effects)
    return (
        "<section><h2>What was missing</h2><table><thead><tr><th></th><th>parameter</th><th>value</th>"
        "<th>95 % interval</th><th>p</th><th>error</th><th class=words>law</th></tr></thead>"
        f"<tbody>{rows}</tbody></table>{charts}"
        "<p>p is family-wise: the chance that any candidate would look this missing if nothing were. Intervals allow "
        "for errors that the points of an object or of a scan share. An effect that was there already has its total."
        "</p></section>"
    )


def _rows(one: Finding, words: Vocabulary) -> str:
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
                f"<td {span}>{_change(one)}</td>"
                f'<td {span} class="words">{escape(kind.equation if kind else "")}</td>'
            )
        shown = escape(words.quantity(one.effect, name, value))
        between = "" if interval is None or np.ndim(value) else _interval(one.effect, name, interval, words)
        cells.append(f"<tr>{head}<td>{escape(name)}</td><td>{shown}</td><td>{between}</td>{tail}</tr>")
    return "".join(cells)


def _change(one: Finding) -> str:
    """The errors and their difference, whose interval is that of differences frame by frame."""
    said = f"{one.error_before.error:.3f} → {one.error_after.error:.3f}"
    falls = one.error_after.by_frame - one.error_before.by_frame
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
        figures.append(
            f"<figure><figcaption><h3>{escape(one.effect)}: {escape(name)} laser by laser</h3></figcaption>"
            f"{plot.svg()}</figure>"
        )
    return f'<div class="full" style="max-width:1100px">{"".join(figures)}</div>' if figures else ""


def _alternatives(found: Diagnosis, words: Vocabulary) -> str:
    rows, bic = [], {one.effect: one.delta_bic for one in found.ranking}
    there = {one.effect for one in found.effects}
    for one in found.effects:
        kind = words.kind(one.effect)
        declared = kind.confusable_with if kind else ()
        for other in dict.fromkeys((*one.also_possible, *declared)):
            open_case = other in one.also_possible
            if open_case:
                verdict = '<span class="warn">not separable with these data</span>'
            elif other in there:
                verdict = '<span class="good">both are missing</span>: each explains what the other does not'
            elif other in bic and one.effect in bic:
                verdict = f'<span class="good">told apart</span>: ΔBIC {bic[one.effect] - bic[other]:,.0f}'
            else:
                verdict = "not among the candidates that came near"
            rows.append(
                f'<tr><th>{escape(one.effect)} or {escape(other)}?</th><td class="words">{verdict}</td>'
                f'<td class="words">{_remedy(one.effect, other, words)}</td></tr>'
            )
    if not rows:
        return ""
    return (
        "<section><h2>What else it could be</h2><table><thead><tr><th></th><th class=words>here</th>"
        f"<th class=words>the drive that would tell</th></tr></thead><tbody>{''.join(rows)}</tbody></table></section>"
    )


def _remedy(one: str, other: str, words: Vocabulary) -> str:
    known = separations(one, other)
    if known:
        return escape(" ".join(f"{item.why} {item.remedy}" for item in known))
    laws = [f"{name}: {kind.equation}" for name in (one, other) if (kind := words.kind(name)) and kind.equation]
    return escape("Vary what one law depends on and the other does not. " + "; ".join(laws))


def _ranking(found: Diagnosis) -> str:
    note = "Beams count as what they stand for, so a few returns from nowhere weigh little: p tells of these."
    return ranking_section([(one.effect, one.delta_bic, one.p_value) for one in found.ranking], note=note)


def _smallest(found: Diagnosis, words: Vocabulary) -> str:
    rows = smallest_rows(found)
    if not rows:
        return ""
    body = "".join(
        f"<tr><th>{escape(effect)}</th><td>{escape(name)}</td>"
        f"<td>{escape(_amplitude(effect, name, value, words))}</td></tr>"
        for effect, name, value in rows
    )
    table = f"<table><thead><tr><th></th><th></th><th>would show from</th></tr></thead><tbody>{body}</tbody></table>"
    text = "Amplitudes that would have been found with 80 % power in these data, beside what is in the model now."
    if found.effects:
        folded = f"<summary>Smallest amplitudes that would show</summary><p>{text}</p>{table}"
        return f"<section><details>{folded}</details></section>"
    return f"<section><h2>Smallest amplitudes that would show</h2><p>{text}</p>{table}</section>"


def _amplitude(effect: str, name: str, value: float, words: Vocabulary) -> str:
    return words.quantity(effect, name, value) if words.is_possible(effect, name, value) else "would not show"


def _how(found: Diagnosis) -> str:
    fitted, judged = len(found.split.fit), len(found.split.test)
    labels = f"<p>L{escape(str(found.labels)[1:])}.</p>" if found.labels is not None else ""
    said = f"{fitted} {'frame was' if fitted == 1 else 'frames were'} fitted, {judged} judged"
    said += "." if found.split.is_held_out else "; they are the same, for want of more."
    said += " Statistics are explained in docs/discrepancy.md."
    return f"<section><h2>How it was found</h2><p>{said}</p>{labels}</section>{notes_section(found.notes)}"
