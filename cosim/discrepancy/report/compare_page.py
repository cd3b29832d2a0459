"""The page of `cosim compare`: the error, its sources, where it is largest, and residuals beam by beam."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from markupsafe import Markup

from cosim.discrepancy.compare import Comparison, Slice
from cosim.discrepancy.report.beams import LAYOUT
from cosim.discrepancy.report.explorer_section import Explored, explorer_section, explorer_style
from cosim.discrepancy.scores import SCALES
from cosim.discrepancy.words import source_words, times
from cosim.report import Piece, document, facts, meter, notes_section, section, stacked_bar, table
from cosim.report.html import fill
from cosim.variants.detector_section import detector_section

_COLOURS = {
    "noise": "#6b7688", "poses": "#5aa9ff", "objects": "#56c8c0", "map": "#a58bf0", "missing": "#ffb23e",
    "unexplained": "#f0606a",
}  # fmt: skip
_NAMES = {"map": "the map", "missing": "missing effects"}
_REMEDIES = {
    "noise": "irreducible: a correct model has it, too",
    "poses": "improve the calibration and the poses of scans",
    "objects": "improve the positions of labelled objects",
    "map": "improve the map",
    "missing": "improve the sensor model: the improved one contains them",
    "unexplained": "the source is not known",
}


def budget_section(parts: Mapping[str, float], *, text: str, why: Mapping[str, str] = MappingProxyType({})) -> str:
    """HTML; empty without parts.

    Args:
        parts: noise, poses, objects, map, missing and unexplained; they add up to the error.
        text: HTML text below the heading.
        why: other remedies of some parts.
    """
    if not parts:
        return ""
    remedies = {**_REMEDIES, **why}
    pieces = [
        Piece(_NAMES.get(name, name), value, _COLOURS[name], remedies[name])
        for name, value in parts.items()
        if abs(value) >= LAYOUT.smallest_error or name in ("noise", "unexplained")
    ]
    bar = stacked_bar(pieces, "sources of the error")
    return section("Sources of the error", bar, text=text, anchor="budget")


_SIDES = ("initial poses", "poses, objects and map aligned")
_CHANNEL_WORDS = {"range": "ranges", "intensity": "intensities", "drop": "returns", "spurious": "spurious returns"}
_WHY = {
    "missing": "effects that the sensor model does not have; the command above identifies them",
    "unexplained": "remains with poses, objects and map aligned, which are never known exactly",
}


def format_comparison(comparison: Comparison, command: str, explored: Explored | None = None) -> str:
    """The HTML text.

    Args:
        comparison: comparison to show.
        command: what to run next, to be copied.
        explored: beams of the compared frames; gathered from the comparison by default.
    """
    explored = explored or Explored.of(comparison.frame_pairs, LAYOUT.scans)
    title = f"{comparison.sensor} against {comparison.drive}"
    text = Markup(
        "An illustration: residuals at the initial poses, and with fitted errors of poses, objects and "
        "map removed. It shows where residuals are, not what is significant; that is what <code>cosim "
        "diagnose</code> tests. Lines are means of equally filled bins, bands their scatter from one "
        "sector of a frame to another. <b>Click a bin to see its beams.</b>"
    )
    sections = [
        fill("<header><h1>{}</h1>{}{}</header>", title, _verdict(comparison, command), _figures(comparison)),
        _budget(comparison),
        _slices(comparison.slices),
        detector_section(comparison.worth),
        explorer_section(explored, _SIDES, text=text),
        _notes(comparison),
    ]
    return document(title, sections, style=explorer_style(), generator="cosim compare")


def _verdict(comparison: Comparison, command: str) -> str:
    run = fill('<p class="next">To identify what is missing: <code>{}</code></p>', command)
    if comparison.floor is None:
        return fill(
            '<p class="verdict">Error {:#.3g}; the noise floor cannot be determined.</p>{}', comparison.error, run
        )
    is_aligned = comparison.error_aligned is not None and comparison.error > 2 * comparison.error_aligned
    floor = comparison.budget.floor if comparison.budget and comparison.budget.floor else comparison.floor.error
    sources = source_words(comparison.parts, floor, is_complete=False) if comparison.parts else ""
    of_which = f", of which {sources}" if sources else ""
    if comparison.at_floor:
        error = comparison.error_aligned if is_aligned and comparison.error_aligned is not None else comparison.error
        subject = "With poses, objects and map aligned the error is" if is_aligned else "The error is"
        verdict = fill(
            '<span class="good">At the noise floor.</span> {} {:#.3g}, of a correct model {:#.3g}: these '
            "measurements cannot distinguish the model from a correct one by this number.",
            subject,
            error,
            floor,
        )
        verdict += f" At the initial poses the error is {comparison.error:#.3g}{of_which}." if is_aligned else ""
        small = fill('<p class="next">To test for small effects: <code>{}</code></p>', command)
        return fill('<p class="verdict">{}</p>{}', verdict, small)
    above = comparison.error / floor if floor > 0 else float("inf")
    verdict = Markup('<span class="bad">Above the noise floor.</span> ')
    verdict += f"The error {comparison.error:#.3g} is {times(above)} the noise floor ({floor:#.3g}){of_which}."
    if comparison.error_aligned is not None and comparison.budget and comparison.budget.floor:
        ratio = times(comparison.error_aligned / comparison.budget.floor)
        verdict += f" With poses, objects and map aligned it is {comparison.error_aligned:#.3g}, {ratio} its floor."
    more = fill('<p class="sources">{}</p>', _excess(comparison))
    if comparison.slices:
        run = fill('<p class="next">Largest residuals at the initial poses: {}.</p>{}', str(comparison.slices[0]), run)
    return fill('<p class="verdict">{}</p>{}{}', verdict, more, run)


def _excess(comparison: Comparison) -> str:
    """The channels in which the error is above the floor, with the mean residual of each."""
    excess = comparison.excess
    total = sum(excess.values())
    order = [name for name in excess if excess[name] > LAYOUT.excess * total]
    parts = [
        fill("<b>{}</b> ({:.0%}): {}", _CHANNEL_WORDS[name], excess[name] / total, _off(name, comparison))
        for name in order
    ]
    return fill("At the initial poses the excess is in {}.", Markup("; ").join(parts)) if parts else ""


def _off(name: str, comparison: Comparison) -> str:
    t = comparison.totals
    return {
        "range": f"on average {100 * t.signed / max(t.matched, 1):+.2f} cm",
        "intensity": f"on average {t.intensity_signed / max(t.lit, 1) + 0.0:+.3f}",
        "drop": f"{t.dropped / t.frames:,.0f} lost per frame, with the model {t.foreseen_drops / t.frames:,.0f}",
        "spurious": f"{t.spurious / t.frames:,.0f} points per frame, with the model {t.foreseen / t.frames:,.0f}",
    }[name]


def _budget(comparison: Comparison) -> str:
    if comparison.budget is None or comparison.frame_pairs is None:
        return ""
    frames = (
        f"{len(comparison.frame_pairs)} of {comparison.totals.frames} frames"
        if len(comparison.frame_pairs) < comparison.totals.frames
        else "all frames"
    )
    text = f"The error and its sources, in the shares of {frames}."
    return budget_section(comparison.parts, text=text, why=_WHY)


def _figures(comparison: Comparison) -> str:
    json, parts = comparison.to_json()["channels"], comparison.totals.parts()
    floor = comparison.floor.parts if comparison.floor else {}

    def score(name: str) -> str:
        own = f"{parts[name] / SCALES[name]:.2f}"
        return fill("{} <small>floor {:.2f}</small>", own, floor[name] / SCALES[name]) if name in floor else own

    items = [("Frames", f"{comparison.totals.frames:,}"), ("Points", f"{comparison.totals.points:,}")]
    items += [(f"{name} score", score(name)) for name in parts]
    ranges = json["range"]
    items += [
        ("Range bias", f"{100 * ranges['bias_m']:+.2f} cm"),
        ("Range RMSE", f"{100 * ranges['rmse_m']:.2f} cm"),
        ("Range MAE", f"{100 * ranges['mae_m']:.2f} cm"),
    ]
    if "intensity" in json:
        items += [
            ("Intensity bias", f"{round(json['intensity']['bias'], 4) + 0.0:+.4f}"),
            ("Intensity RMSE", f"{json['intensity']['rmse']:.4f}"),
        ]
    items += [
        (
            "Lost returns",
            fill("{:,.0f} <small>per frame</small>", comparison.totals.dropped / comparison.totals.frames),
        ),
        ("Spurious", fill("{:,.1f} <small>per frame</small>", json["spurious"]["per_frame"])),
    ]
    how = "The error is the mean of the scores; each score is a mean over beams, divided by its scale."
    return fill("{}<p>{}</p>", facts(((name[0].upper() + name[1:], value) for name, value in items)), how)


def _slices(slices: Sequence[Slice]) -> str:
    rows = [
        [
            one.where, one.channel, _residual(one), _spread(one), f"{one.beams:,}",
            fill("{:.1%} {}", one.share, meter(one.share)),
        ]
        for one in slices
    ]  # fmt: skip
    heads = ["", "", "mean residual", "spread", "beams", "share of the channel’s error"]
    return section(
        "Largest residuals",
        table(heads, rows, words=(1,)),
        text="At the initial poses, sorted by the share of the error that the mean residual causes." if rows else "",
    )


def _residual(one: Slice) -> str:
    sizes = {"range": f"{100 * one.bias:+.2f} cm", "drop": f"{one.bias:+.1%} returns"}
    return sizes.get(one.channel, f"{one.bias:+.4f}")


def _spread(one: Slice) -> str:
    return {"range": f"{100 * one.spread:.2f} cm", "drop": "", "intensity": f"{one.spread:.4f}"}[one.channel]


def _notes(comparison: Comparison) -> str:
    notes = [*comparison.notes]
    if comparison.floor is not None:
        notes.append(f"the noise floor is {comparison.floor.how}")
    return notes_section(notes)
