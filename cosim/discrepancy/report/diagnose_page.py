"""The page of `cosim diagnose`: verdict, sources of the error, findings, alternatives, evidence, residuals."""

from __future__ import annotations

from markupsafe import Markup

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
from cosim.report.html import fill
from cosim.report.phrases import listed
from cosim.variants.detector_section import detector_section

_SIDES = ("initial model", "with all findings")


def format_diagnosis(
    diagnosis: Diagnosis, words: Vocabulary, drive: str, sensor: str, explored: Explored | None = None
) -> str:
    """The HTML text.

    Args:
        diagnosis: diagnosis to show.
        words: units and bounds of parameters.
        drive, sensor: names of what was diagnosed.
        explored: beams of the held-out frames; gathered from the diagnosis by default.
    """
    title = f"Effects that {sensor} is missing, compared with {drive}"
    explored = explored or explored_of(diagnosis)
    frames = "held-out frames" if diagnosis.split.is_held_out else "fitted frames"
    text = fill(
        "An illustration on {}, with fitted errors of poses, objects and map removed. It shows where "
        "residuals are, not what is significant: that is decided by the evidence above, which takes into "
        "account how uncertain poses, objects and map are. Lines are means of equally filled bins, bands "
        "their scatter from one sector of a frame to another. <b>Click a bin to see its beams.</b>",
        frames,
    )
    sections = [
        fill("<header><h1>{}</h1>{}{}</header>", title, _verdict(diagnosis, words), _next(diagnosis, drive, sensor)),
        _budget(diagnosis),
        effects_section(diagnosis, words),
        detector_section(diagnosis.worth),
        unknown_section(diagnosis),
        alternatives_section(diagnosis, words),
        unexplained_section(diagnosis),
        evidence_section(
            diagnosis.evidence, diagnosis.unexplained, diagnosis.settings, has_findings=bool(diagnosis.changes)
        ),
        waterfall_section(diagnosis),
        explorer_section(explored, _SIDES if diagnosis.effects or diagnosis.unknowns else _SIDES[:1], text=text),
        ranking_rows(diagnosis),
        smallest_section(diagnosis, words),
        _how(diagnosis),
    ]
    return document(title, sections, style=explorer_style() + evidence_style(), generator="cosim diagnose")


def explored_of(diagnosis: Diagnosis) -> Explored | None:
    """The beams of the held-out frames, and charts of them, also by the covariates of findings; or None."""
    names = [name for row in diagnosis.unexplained for name in row.covariates]
    names += [name for unknown in diagnosis.unknowns for name in unknown.curve.covariates]
    return Explored.of(diagnosis.frame_pairs, LAYOUT.scans, names)


def _verdict(diagnosis: Diagnosis, words: Vocabulary) -> str:
    sentences = [*_missing(diagnosis, words), *_unknown(diagnosis)]
    if diagnosis.labels is not None and diagnosis.labels.verdict == "missing":
        law = str(diagnosis.labels).removeprefix("labels: ")
        sentences.append(fill('<span class="bad">Labels are biased</span>: {}.', law))
    if diagnosis.unexplained:
        names = [unexplained_words(row) for row in diagnosis.unexplained[:FEW]]
        more = len(diagnosis.unexplained) - len(names)
        names += [f"{more} more"] if more else []
        sentences.append(fill('<span class="warn">Unexplained</span>: <a href="#unexplained">{}</a>.', listed(names)))
    if not sentences and diagnosis.is_above_floor:
        sentences.append(
            Markup(
                '<span class="warn">The error is above the noise floor</span>, and no hypothesis is significant: '
                "something is missing that these data, or the hypotheses, cannot identify."
            )
        )
    if not sentences:
        sentences.append(Markup('<span class="good">No effect is missing</span> that these data can detect.'))
        smallest = smallest_words(diagnosis, words, most=FEW)
        sentences.append(f"Smallest detectable amplitudes: {smallest}; more below." if smallest else "")
    if diagnosis.effects and not diagnosis.unexplained and diagnosis.is_above_floor:
        sentences.append(Markup('<span class="warn">The error remains above the noise floor.</span>'))
    budget = budget_words(diagnosis, is_complete=diagnosis.verdict == "none")
    where = fill('<p class="sources">{}.</p>', budget[0].upper() + budget[1:])
    return fill('<p class="verdict">{}</p>{}', Markup(" ").join(sentences), where)


def _missing(diagnosis: Diagnosis, words: Vocabulary) -> list[str]:
    """The missing effects, each with the effects that explain the data equally well."""
    if not diagnosis.effects:
        return []
    no_fall = _no_fall(diagnosis)
    names = [
        fill(
            "{} ({}{})",
            _either(finding),
            words.parameters(finding.effect, finding.params, finding.ci95),
            _useless(finding.effect in no_fall),
        )
        for finding in diagnosis.effects
    ]
    return [fill('<span class="bad">Missing</span>: {}.', listed(names))]


def _either(finding: Finding) -> str:
    """`range_walk`, or `either range_walk or incidence_bias` where these data cannot separate them."""
    names = [fill("<b>{}</b>", name) for name in (finding.effect, *finding.also_possible)]
    return fill('<span class="warn">either</span> {}', listed(names, "or")) if finding.also_possible else names[0]


def _unknown(diagnosis: Diagnosis) -> list[str]:
    if not diagnosis.unknowns:
        return []
    no_fall = _no_fall(diagnosis)
    each = Markup("; ").join(
        fill("{}{}", unknown_words(unknown), _useless(unknown.name in no_fall)) for unknown in diagnosis.unknowns
    )
    return [fill('<span class="warn">Unknown</span>: {}. No effect of the catalogue explains this.', each)]


def _no_fall(diagnosis: Diagnosis) -> set[str]:
    return {change.name for change in diagnosis.changes if not change.is_fall}


def _useless(is_useless: bool) -> str:
    return Markup('; <span class="warn">does not lower the error</span>') if is_useless else ""


def _next(diagnosis: Diagnosis, drive: str, sensor: str) -> str:
    if (diagnosis.effects or diagnosis.unknowns) and diagnosis.sensor_out:
        return fill(
            '<p class="next">The improved sensor is <code>{}</code>. To compare it with the drive: <code>'
            "cosim compare {} --sensor {}</code></p>",
            diagnosis.sensor_out,
            drive,
            diagnosis.sensor_out,
        )
    command = f"cosim compare {drive} --sensor {sensor}"
    return fill('<p class="next">To see where the residuals are: <code>{}</code></p>', command)


def _budget(diagnosis: Diagnosis) -> str:
    frames = f"{len(diagnosis.split.test)} frames"
    held = f"Held-out error of the initial model, on {frames} that were not used for fitting, and its sources."
    text = held if diagnosis.split.is_held_out else f"Error of the initial model on the {frames} that were fitted."
    where = floor_words(diagnosis)
    if where:
        aligned = f"{diagnosis.budget.error_aligned:.3f}"
        text += f" With all findings, and poses, objects and map aligned, it is {aligned}: {where}."
    floor = diagnosis.noise_floor
    text += f" The noise floor is {floor:.3f}." if floor else " The noise floor cannot be determined."
    why = {"unexplained": "remains with poses, objects and map aligned, which are never known exactly"}
    if diagnosis.unexplained:
        why = {"unexplained": "remains with poses, objects and map aligned; dependences are listed below"}
    text = f"{text} {spread_words(diagnosis.spreads)}".strip()
    for sentence in implausible_spreads(diagnosis.spreads):
        text += fill('<br><span class="warn">Implausible</span>: {}', sentence)
    return budget_section(diagnosis.budget.parts, text=text, why=why)


def _how(diagnosis: Diagnosis) -> str:
    fitted, held_out = len(diagnosis.split.fit), len(diagnosis.split.test)
    labels = fill("<p>L{}.</p>", str(diagnosis.labels)[1:]) if diagnosis.labels is not None else ""
    text = f"{fitted} {'frame' if fitted == 1 else 'frames'} fitted, {held_out} held out"
    if not diagnosis.split.is_held_out:
        text = (
            f"{fitted} {'frame' if fitted == 1 else 'frames'} fitted; errors are of the same frames, which are too few"
        )
    method = "The method is described in docs/discrepancy.md."
    return section("Data", fill("<p>{}. {}</p>{}", text, method, labels)) + notes_section(diagnosis.notes)
