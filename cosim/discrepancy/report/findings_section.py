"""Findings on the page of a diagnosis: parameters, fall of the error, alternatives, smallest detectable amplitudes."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from cosim.discrepancy.diagnosis import Diagnosis, ErrorChange, Finding, smallest_rows
from cosim.discrepancy.quantities import CHANNELS, group_words
from cosim.discrepancy.words import UNDETERMINED, Vocabulary
from cosim.report import figure, section, table
from cosim.report.html import fill
from cosim.report.phrases import p_cell
from cosim.report.plot import Axis, Plot
from cosim.report.ranking_table import ranking_section
from cosim.report.waterfall import waterfall
from sensors.effects.confusions import separations


def effects_section(diagnosis: Diagnosis, words: Vocabulary) -> str:
    """HTML: missing effects with parameters, intervals, p and the change of the error; empty without effects."""
    if not diagnosis.effects:
        return ""
    changes = {change.name: change for change in diagnosis.changes}
    rows = Markup().join(_rows(finding, words, changes.get(finding.effect)) for finding in diagnosis.effects)
    charts = Markup().join(_laser_charts(finding, words) for finding in diagnosis.effects)
    heads = fill(
        "<thead><tr><th></th><th>parameter</th><th>value</th><th>{} interval</th><th>p</th><th>aligned "
        "error</th><th class=words>equation</th></tr></thead>",
        diagnosis.settings.covered,
    )
    text = (
        "p is family-wise: the probability that any hypothesis would be this significant if nothing were missing. "
        "Intervals allow for errors that the points of an object or of a scan share. Parameters of an effect that the "
        "sensor had already are totals. Errors are those of held-out frames with poses, objects and map fitted."
    )
    return section("Missing effects", fill("<table>{}<tbody>{}</tbody></table>", heads, rows), charts, text=text)


def change_words(change: ErrorChange | None) -> str:
    """HTML: error before and after, mean change over frames, and a note if the error does not decrease."""
    if change is None:
        return ""
    numbers = f"{change.before:.3f} → {change.after:.3f}"
    if np.isfinite(change.half_interval):
        mean = f"{change.mean:+.3f}".replace("-", "−")
        numbers += fill("<br><small>{} ± {:.3f} per frame</small>", mean, change.half_interval)
    if not change.is_fall:
        return fill('{}<br><span class="warn">does not lower the error</span>', numbers)
    if np.isfinite(change.half_interval) and not change.is_significant:
        return fill("{}<br><small>the fall is within the scatter of the frames</small>", numbers)
    return numbers


def _rows(finding: Finding, words: Vocabulary, change: ErrorChange | None) -> str:
    kind = words.kind(finding.effect)
    cells = []
    for row, (name, value) in enumerate(finding.params.items()):
        interval = finding.ci95.get(name)
        head = tail = ""
        if row == 0:
            span = fill('rowspan="{}"', len(finding.params))
            head = fill("<th {}>{}</th>", span, finding.effect)
            tail = fill(
                '<td {}>{}</td><td {}>{}</td><td {} class="words">{}</td>',
                span,
                p_cell(finding.p_value),
                span,
                change_words(change),
                span,
                kind.equation if kind else "",
            )
        number, ends = _value(finding.effect, name, value, interval, words)
        cells.append(fill("<tr>{}<td>{}</td><td>{}</td><td>{}</td>{}</tr>", head, name, number, ends, tail))
    return Markup().join(cells)


def _value(effect: str, name: str, value: object, interval: object, words: Vocabulary) -> tuple[str, str]:
    """Value and interval of a parameter in words."""
    if interval is None:
        return words.quantity(effect, name, value), "not fitted"
    if np.ndim(value):  # type: ignore[arg-type]
        return words.quantity(effect, name, value, interval), "see the chart"
    if not words.is_determined(effect, name, interval):
        return UNDETERMINED, "as wide as the allowed range"
    low, high = (words.quantity(effect, name, float(end)) for end in interval)  # type: ignore[union-attr]
    return words.quantity(effect, name, value), f"{low} to {high}"


def _laser_charts(finding: Finding, words: Vocabulary) -> str:
    figures = []
    for name, value in finding.params.items():
        if not np.ndim(value) or words.parameter(finding.effect, name).per_axis:
            continue
        level = np.asarray(value, float)
        pairs = np.asarray(finding.ci95.get(name, np.stack([level, level], -1)), float)
        known = np.array([words.is_determined(finding.effect, name, pair) for pair in pairs])
        if not known.any():
            continue
        ring, level, pairs = np.flatnonzero(known).astype(float), level[known], pairs[known]
        reach = 1.1 * max(float(np.abs(pairs).max()), 1e-9)
        low = -reach if level.min() < 0 else 0.0
        unit = words.parameter(finding.effect, name).unit
        label = f"{name} ({unit})" if unit else name
        plot = Plot(Axis(0, max(len(known) - 1, 1), "ring, 0 on top"), Axis(low, reach, label), name, 1100, 280)
        plot.band(ring, pairs[:, 0], pairs[:, 1], "a")
        plot.line(ring, level, "a", dots=True)
        title = f"{finding.effect}: {name} of each laser"
        missing = "" if known.all() else f"{np.count_nonzero(~known)} of {len(known)} lasers {UNDETERMINED}."
        figures.append(figure(title, missing, plot.svg()))
    return fill('<div class="full" style="max-width:1100px">{}</div>', Markup().join(figures)) if figures else ""


def waterfall_section(diagnosis: Diagnosis) -> str:
    """HTML: the aligned error, finding by finding; empty without findings."""
    steps = diagnosis.budget.aligned_steps
    if len(steps) < 2:
        return ""
    frames = (
        "held-out frames" if diagnosis.split.is_held_out else "the fitted frames, because there are too few to hold out"
    )
    text = (
        f"On {frames}, with poses, objects and map fitted. Whiskers are {diagnosis.settings.covered} intervals of the "
        "level, from frame to frame; changes are more accurate than these, because frames differ in difficulty."
    )
    names = [
        "initial",
        *(f"+ {change.name.removeprefix('unknown_').replace('_', ' ')}" for change in diagnosis.changes),
    ]
    rows = [(name, step.error, step.standard_error) for name, step in zip(names, steps, strict=False)]
    svg = waterfall(rows, diagnosis.noise_floor, "aligned error", diagnosis.settings.coverage)
    return section("Fall of the error", figure("", "", svg, "full", min(1100, 400 + 220 * (len(steps) - 1))), text=text)


def alternatives_section(diagnosis: Diagnosis, words: Vocabulary) -> str:
    """HTML: either-or sets and declared confusions, each with the drive that would separate them."""
    rows = [_set_row(names, words) for names in _sets(diagnosis)]
    listed = {name for names in _sets(diagnosis) for name in map(_effect_of, names)}
    candidates, added = {row.effect for row in diagnosis.ranking}, {finding.effect for finding in diagnosis.effects}
    for finding in diagnosis.effects:
        kind = words.kind(finding.effect)
        for other in kind.confusable_with if kind else ():
            if finding.effect in listed and other in listed:
                continue
            if other in added:
                state = Markup('<span class="good">both are missing</span>: each explains what the other does not')
            elif other in candidates:
                state = Markup('<span class="good">separated</span>: less likely, given its number of parameters')
            else:
                state = "no candidate: these data do not depend on it, or it cannot be determined"
            remedy = _remedy(finding.effect, other, words)
            rows.append([f"{finding.effect} or {other}?", state, remedy])
    text = (
        "An alternative is not separable if the likelihood with it instead of the selected term is within two standard "
        "errors of the best."
        if any(diagnosis.either_or)
        else ""
    )
    return section(
        "Alternatives", table(["", "with these data", "drive that separates them"], rows, words=(0, 1, 2)),
        text=text if rows else "",
    )  # fmt: skip


def _sets(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Either-or sets, including those of findings with `also_possible` effects."""
    sets: dict[str, tuple[str, ...]] = {_effect_of(names[0]): names for names in diagnosis.either_or if len(names) > 1}
    for finding in diagnosis.effects:
        if finding.also_possible:
            others = sets.get(finding.effect, (finding.effect,))
            present = {_effect_of(name) for name in others}
            sets[finding.effect] = (*others, *(name for name in finding.also_possible if name not in present))
    return list(sets.values())


def _effect_of(name: str) -> str:
    """Name of the effect in a hypothesis' name; for dependences the name itself."""
    return name.partition(" [")[0]


def _set_row(names: tuple[str, ...], words: Vocabulary) -> list[str]:
    members = list(dict.fromkeys(_member_words(name) for name in names))
    either = Markup(" <b>or</b> ").join(name for name in members)
    effects = [name for name in names if words.kind(_effect_of(name))]
    reason = "each explains these data as well as the others; the first is used"
    if effects == [names[0]]:
        reason = "a free curve explains these data as well as the effect, which has fewer parameters"
    state = fill('<span class="warn">not separable</span>: {}', reason)
    remedies = [_remedy(names[0], other, words) for other in names[1:]]
    return [fill("<b>either</b> {}", either), state, Markup("<br>").join(dict.fromkeys(remedies))]


def _member_words(name: str) -> str:
    """The name of a set's member in words, also of a plug-in."""
    effect = _effect_of(name)
    if not effect.startswith("unknown_"):
        return group_words(name)
    channel, _, on = effect.removeprefix("unknown_").partition("_by_")
    return group_words(f"{channel} by {on.replace('_and_', ' x ')}" if on else channel)


def _remedy(first: str, second: str, words: Vocabulary) -> str:
    """HTML: the drive that separates two hypotheses."""
    pair = _effect_of(first), _effect_of(second)
    known = separations(*pair)
    if known:
        return " ".join(f"{row.why} {row.remedy}" for row in known)
    laws = [f"{name}: {kind.equation}" for name in pair if (kind := words.kind(name)) and kind.equation]
    if len(laws) == 2:
        return f"Vary what one equation depends on while the other stays constant. {'; '.join(laws)}"
    on = [name for name in map(_covariates, map(_member_words, pair)) if name]
    if laws:
        return (
            f"Vary the {on[0] if on else 'covariate'} while the quantities of {laws[0]} stay constant, and the "
            "reverse; where that is impossible both are one dependence."
        )
    return f"Vary {' and '.join(on)} independently of each other: each at several values of the other."


def _covariates(member: str) -> str:
    channel, by, on = member.partition(" by ")
    return on if by and channel in CHANNELS.values() else ""


def ranking_rows(diagnosis: Diagnosis) -> str:
    """HTML: the candidates of the first round; empty where none improves the model."""
    if not any(row.delta_bic > 0 for row in diagnosis.ranking):
        return ""
    note = "Linear predictions about the initial model; the selection refits the best candidates exactly."
    return ranking_section([(row.effect, row.delta_bic, row.p_value) for row in diagnosis.ranking], note=note)


def smallest_section(diagnosis: Diagnosis, words: Vocabulary) -> str:
    """HTML: amplitudes that would have been detected."""
    rows = [[effect, name, _amplitude(effect, name, value, words)] for effect, name, value in smallest_rows(diagnosis)]
    text = "Smallest amplitudes that are detected with 80 % power in these data, in addition to the final model."
    shown = table(["effect", "amplitude", "detected from"], rows)
    if shown and diagnosis.effects:
        shown = fill("<details><summary>Show the table</summary>{}</details>", shown)
    return section("Smallest detectable amplitudes", shown, text=text)


def _amplitude(effect: str, name: str, value: float, words: Vocabulary) -> str:
    return words.quantity(effect, name, value) if words.is_possible(effect, name, value) else UNDETERMINED
