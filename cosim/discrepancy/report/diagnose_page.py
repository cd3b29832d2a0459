"""The page of `cosim diagnose`: verdict, sources of the error, findings, alternatives, evidence, residuals."""

from __future__ import annotations

from html import escape

from cosim.discrepancy.diagnosis import Diagnosis, Finding, budget_words, floor_words, smallest_words
from cosim.discrepancy.report.beams import LAYOUT
from cosim.discrepancy.report.compare_page import budget_section
from cosim.discrepancy.report.evidence_section import evidence_section, evidence_style
from cosim.discrepancy.report.explorer_section import Explored, explorer_section, explorer_style
from cosim.discrepancy.report.findings_section import (
    alternatives_section,
    effects_section,
    ranking_rows,
    smallest_section,
    waterfall_section,
)
from cosim.discrepancy.report.unexplained_section import unexplained_section, unknown_section
from cosim.discrepancy.words import FEW, Vocabulary, implausible_spreads, spread_words, unexplained_words, unknown_words
from cosim.report import document, notes_section, section
from cosim.report.phrases import listed
from cosim.variants.worth_section import worth_section

_SIDES = ("initial model", "with all findings")


def format_diagnosis(
    found: Diagnosis, words: Vocabulary, drive: str, sensor: str, explored: Explored | None = None
) -> str:
    """The HTML text.

    Args:
        found: the diagnosis.
        words: units and bounds of parameters.
        drive, sensor: names of what was diagnosed.
        explored: beams of the held-out frames; gathered from the diagnosis by default.
    """
    title = f"What {sensor} lacks compared with {drive}"
    explored = explored or explored_of(found)
    frames = "held-out frames" if found.split.is_held_out else "fitted frames"
    text = (
        f"An illustration on {frames}, with fitted errors of poses, objects and map removed. It shows where residuals "
        "are, not what is significant: that is decided by the evidence above, which takes into account how uncertain "
        "poses, objects and map are. Lines are means of equally filled bins, bands their scatter from one sector of a "
        "frame to another. <b>Click a bin to see its beams.</b>"
    )
    sections = [
        f"<header><h1>{escape(title)}</h1>{_verdict(found, words)}{_next(found, drive, sensor)}</header>",
        _budget(found),
        effects_section(found, words),
        worth_section(found.worth),
        unknown_section(found),
        alternatives_section(found, words),
        unexplained_section(found),
        evidence_section(found.evidence, found.unexplained, found.settings, has_findings=bool(found.changes)),
        waterfall_section(found),
        explorer_section(explored, _SIDES if found.effects or found.unknowns else _SIDES[:1], text=text),
        ranking_rows(found),
        smallest_section(found, words),
        _how(found),
    ]
    return document(title, sections, style=explorer_style() + evidence_style(), generator="cosim diagnose")


def explored_of(found: Diagnosis) -> Explored | None:
    """The beams of the held-out frames, and charts of them, also by the covariates of findings; or None."""
    names = [name for row in found.unexplained for name in row.covariates]
    names += [name for unknown in found.unknowns for name in unknown.curve.covariates]
    return Explored.of(found.judged, LAYOUT.scans, names)


def _verdict(found: Diagnosis, words: Vocabulary) -> str:
    sentences = [*_missing(found, words), *_unknown(found)]
    if found.labels is not None and found.labels.verdict == "missing":
        law = escape(str(found.labels).removeprefix("labels: "))
        sentences.append(f'<span class="bad">Labels are biased</span>: {law}.')
    if found.unexplained:
        names = [escape(unexplained_words(row)) for row in found.unexplained[:FEW]]
        more = len(found.unexplained) - len(names)
        names += [f"{more} more"] if more else []
        sentences.append(f'<span class="warn">Unexplained</span>: <a href="#unexplained">{listed(names)}</a>.')
    if not sentences and found.is_above_floor:
        sentences.append(
            '<span class="warn">The error is above the noise floor</span>, and no hypothesis is significant: something '
            "is missing that these data, or the hypotheses, cannot identify."
        )
    if not sentences:
        sentences.append('<span class="good">No effect is missing</span> that these data can detect.')
        smallest = smallest_words(found, words, most=FEW)
        sentences.append(f"Smallest detectable amplitudes: {escape(smallest)}; more below." if smallest else "")
    if found.effects and not found.unexplained and found.is_above_floor:
        sentences.append('<span class="warn">The error remains above the noise floor.</span>')
    budget = budget_words(found, is_complete=found.verdict == "none")
    where = f'<p class="sources">{escape(budget[0].upper() + budget[1:])}.</p>'
    return f'<p class="verdict">{" ".join(sentences)}</p>{where}'


def _missing(found: Diagnosis, words: Vocabulary) -> list[str]:
    """The missing effects, each with the effects that explain the data equally well."""
    if not found.effects:
        return []
    no_fall = _no_fall(found)
    names = [
        f"{_either(finding)} ({escape(words.parameters(finding.effect, finding.params, finding.ci95))}"
        f"{_useless(finding.effect in no_fall)})"
        for finding in found.effects
    ]
    return [f'<span class="bad">Missing</span>: {listed(names)}.']


def _either(finding: Finding) -> str:
    """`range_walk`, or `either range_walk or incidence_bias` where these data cannot separate them."""
    names = [f"<b>{escape(name)}</b>" for name in (finding.effect, *finding.also_possible)]
    return f'<span class="warn">either</span> {listed(names, "or")}' if finding.also_possible else names[0]


def _unknown(found: Diagnosis) -> list[str]:
    if not found.unknowns:
        return []
    no_fall = _no_fall(found)
    each = "; ".join(
        f"{escape(unknown_words(unknown))}{_useless(unknown.name in no_fall)}" for unknown in found.unknowns
    )
    return [f'<span class="warn">Unknown</span>: {each}. No effect of the catalogue explains this.']


def _no_fall(found: Diagnosis) -> set[str]:
    return {change.name for change in found.changes if not change.is_fall}


def _useless(is_useless: bool) -> str:
    return '; <span class="warn">does not lower the error</span>' if is_useless else ""


def _next(found: Diagnosis, drive: str, sensor: str) -> str:
    if (found.effects or found.unknowns) and found.sensor_out:
        return (
            f'<p class="next">The improved sensor is <code>{escape(found.sensor_out)}</code>. To compare it with the '
            f"drive: <code>cosim compare {escape(drive)} --sensor {escape(found.sensor_out)}</code></p>"
        )
    command = f"cosim compare {escape(drive)} --sensor {escape(sensor)}"
    return f'<p class="next">To see where the residuals are: <code>{command}</code></p>'


def _budget(found: Diagnosis) -> str:
    frames = f"{len(found.split.test)} frames"
    held = f"Held-out error of the initial model, on {frames} that took no part in any fit, and its sources."
    text = held if found.split.is_held_out else f"Error of the initial model on the {frames} that were fitted."
    where = floor_words(found)
    if where:
        text += (
            f" With all findings, and poses, objects and map aligned, it is {found.budget.error_aligned:.3f}: {where}."
        )
    floor = found.noise_floor
    text += f" The noise floor is {floor:.3f}." if floor else " The noise floor cannot be determined."
    why = {"unexplained": "remains with poses, objects and map aligned, which are never known exactly"}
    if found.unexplained:
        why = {"unexplained": "remains with poses, objects and map aligned; dependences are listed below"}
    text = f"{text} {escape(spread_words(found.spreads))}".strip()
    for sentence in implausible_spreads(found.spreads):
        text += f'<br><span class="warn">Implausible</span>: {escape(sentence)}'
    return budget_section(found.budget.parts, text=text, why=why)


def _how(found: Diagnosis) -> str:
    fitted, held_out = len(found.split.fit), len(found.split.test)
    labels = f"<p>L{escape(str(found.labels)[1:])}.</p>" if found.labels is not None else ""
    text = f"{fitted} {'frame' if fitted == 1 else 'frames'} fitted, {held_out} held out"
    if not found.split.is_held_out:
        text = (
            f"{fitted} {'frame' if fitted == 1 else 'frames'} fitted; errors are of the same frames, which are too few"
        )
    method = "The method is described in docs/discrepancy.md."
    return section("Data", f"<p>{text}. {method}</p>{labels}") + notes_section(found.notes)
