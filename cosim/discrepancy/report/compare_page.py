"""The page of `cosim compare`: how far, where that comes from, where it is worst, and what it depends on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from types import MappingProxyType

from cosim.discrepancy.compare import Comparison, Slice
from cosim.discrepancy.report.beams import LAYOUT
from cosim.discrepancy.report.explorer_section import Explored, explorer_section, explorer_style
from cosim.discrepancy.scores import SCALES
from cosim.discrepancy.words import source_words, times
from cosim.report import Piece, document, facts, meter, notes_section, section, stacked_bar, table
from cosim.variants.worth_section import worth_section

_COLOURS = {
    "noise": "#6b7688", "poses": "#5aa9ff", "objects": "#56c8c0", "map": "#a58bf0", "missing": "#ffb23e",
    "unexplained": "#f0606a",
}  # fmt: skip
_NAMES = {"map": "the map", "missing": "missing effects"}
_REMEDIES = {
    "noise": "nothing to mend: a model that is right has it, too",
    "poses": "mend the calibration and the poses of scans",
    "objects": "mend the places of labelled objects",
    "map": "mend the map",
    "missing": "mend the sensor model: the improved one has them",
    "unexplained": "not known",
}


def budget_section(parts: Mapping[str, float], *, text: str, why: Mapping[str, str] = MappingProxyType({})) -> str:
    """HTML; empty without parts.

    Args:
        parts: noise, poses, objects, map, missing and unexplained; they add up to the error.
        text: what the error is of (HTML).
        why: other words on some parts.
    """
    if not parts:
        return ""
    told = {**_REMEDIES, **why}
    pieces = [
        Piece(_NAMES.get(name, name), value, _COLOURS[name], told[name])
        for name, value in parts.items()
        if abs(value) >= LAYOUT.told or name in ("noise", "unexplained")
    ]
    bar = stacked_bar(pieces, "where the error comes from")
    return section("Where the error comes from", bar, text=text, anchor="budget")


_SIDES = ("at the poses as given", "poses, objects and the map aligned")
_CHANNEL_WORDS = {"range": "ranges", "intensity": "intensities", "drop": "returns", "spurious": "stray points"}
_WHY = {"unexplained": "left once all is aligned: the sensor model’s, or of poses and objects not known well enough"}


def format_comparison(found: Comparison, command: str, explored: Explored | None = None) -> str:
    """The HTML text.

    Args:
        found: the comparison.
        command: what to run next, to be copied.
        explored: beams of the compared frames; gathered from the comparison by default.
    """
    explored = explored or Explored.of(found.judged, LAYOUT.scans)
    title = f"{found.sensor} against {found.drive}"
    text = (
        "Before: at the poses as given. After: with errors of poses, objects and the map taken out as far as a fit "
        "knows them; what is left then is the sensor’s. "
        f"Bands are {found.settings.covered} intervals of means of equally filled bins; what "
        "beams of a frame, or of a sector of it, share is in them. <b>Click a bin to see its beams.</b>"
    )
    sections = [
        f"<header><h1>{escape(title)}</h1>{_verdict(found, command)}{_figures(found)}</header>",
        _budget(found),
        _slices(found.slices),
        worth_section(found.worth),
        explorer_section(explored, _SIDES, text=text),
        _notes(found),
    ]
    return document(title, sections, style=explorer_style(), generator="cosim compare")


def _verdict(found: Comparison, command: str) -> str:
    run = f'<p class="next">What is missing: <code>{escape(command)}</code></p>'
    if found.floor is None:
        return f'<p class="verdict">Error {found.error:.3g}; what noise alone would make is not known.</p>{run}'
    aligned = found.budget is not None and found.error > 2 * found.budget.error_aligned
    floor = found.budget.floor if found.budget and found.budget.floor else found.floor.error
    sources = source_words(found.parts, floor, is_complete=False) if found.parts else ""
    made = f": {sources}" if sources else ""
    if found.at_floor:
        what = "Once poses, objects and the map are aligned the" if aligned else "The"
        error = found.budget.error_aligned if aligned and found.budget else found.error
        said = (
            f'<span class="good">At the noise floor.</span> {what} error {error:.3g} is what noise alone makes '
            f"({floor:.3g}): by this number the model is as good as these measurements can tell."
        )
        said += f" As poses are given it is {found.error:.3g}{made}." if aligned else ""
        small = (
            f'<p class="next">Small effects can hide in noise; this asks for them: <code>{escape(command)}</code></p>'
        )
        return f'<p class="verdict">{said}</p>{small}'
    above = found.error / floor if floor > 0 else float("inf")
    said = '<span class="bad">Above the noise floor.</span> '
    said += f"The error {found.error:.3g} is {times(above)} what noise alone makes ({floor:.3g}){made}."
    if found.error_aligned is not None and found.budget and found.budget.floor:
        ratio = times(found.error_aligned / found.budget.floor)
        said += f" Aligned it is {found.error_aligned:.3g}, {ratio} its floor."
    more = f'<p class="sources">{_excess(found)}</p>'
    if found.slices:
        run = f'<p class="next">Worst place, at the poses as given: {escape(str(found.slices[0]))}.</p>{run}'
    return f'<p class="verdict">{said}</p>{more}{run}'


def _excess(found: Comparison) -> str:
    """The channels in which the error lies above the floor, with what is off in each on average."""
    excess = found.excess
    total = sum(excess.values())
    order = [name for name in excess if excess[name] > LAYOUT.excess * total]
    said = [f"<b>{_CHANNEL_WORDS[name]}</b> ({excess[name] / total:.0%}): {_off(name, found)}" for name in order]
    return f"At the poses as given the excess lies in {'; '.join(said)}." if said else ""


def _off(name: str, found: Comparison) -> str:
    t = found.totals
    return {
        "range": f"on average {100 * t.signed / max(t.matched, 1):+.2f} cm",
        "intensity": f"on average {t.intensity_signed / max(t.lit, 1) + 0.0:+.3f}",
        "drop": f"{t.dropped / t.frames:,.0f} lost a frame where the model loses {t.foreseen_drops / t.frames:,.0f}",
        "spurious": f"{t.spurious / t.frames:,.0f} points a frame where the model has {t.foreseen / t.frames:,.0f}",
    }[name]


def _budget(found: Comparison) -> str:
    if found.budget is None or found.judged is None:
        return ""
    frames = (
        f"{len(found.judged)} of {found.totals.frames} frames"
        if len(found.judged) < found.totals.frames
        else "all frames"
    )
    text = f"The error, and what it is made of in the shares that {frames} tell."
    parts = {name: value for name, value in found.parts.items() if name != "missing"}
    return budget_section(parts, text=text, why=_WHY)


def _figures(found: Comparison) -> str:
    json, parts = found.to_json()["channels"], found.totals.parts()
    floor = found.floor.parts if found.floor else {}

    def score(name: str) -> str:
        own = f"{parts[name] / SCALES[name]:.2f}"
        return f"{own} <small>floor {floor[name] / SCALES[name]:.2f}</small>" if name in floor else own

    items = [("Frames", f"{found.totals.frames:,}"), ("Points", f"{found.totals.points:,}")]
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
        ("Lost returns", f"{found.totals.dropped / found.totals.frames:,.0f} <small>a frame</small>"),
        ("Spurious", f"{json['spurious']['per_frame']:,.1f} <small>a frame</small>"),
    ]
    how = "The error is the mean of the scores; each is a mean over beams in units of its scale."
    return f"{facts((name[0].upper() + name[1:], value) for name, value in items)}<p>{how}</p>"


def _slices(slices: Sequence[Slice]) -> str:
    rows = [
        [
            escape(one.where), one.channel, _residual(one), _spread(one), f"{one.beams:,}",
            f"{one.share:.1%} {meter(one.share)}",
        ]
        for one in slices
    ]  # fmt: skip
    heads = ["", "", "mean residual", "spread", "beams", "share of the channel’s error"]
    return section(
        "Where it is worst",
        table(heads, rows, words=(1,)),
        text="At the poses as given; where a mean residual costs most stands first." if rows else "",
    )


def _residual(one: Slice) -> str:
    said = {"range": f"{100 * one.bias:+.2f} cm", "drop": f"{one.bias:+.1%} returns"}
    return said.get(one.channel, f"{one.bias:+.4f}")


def _spread(one: Slice) -> str:
    return {"range": f"{100 * one.spread:.2f} cm", "drop": "", "intensity": f"{one.spread:.4f}"}[one.channel]


def _notes(found: Comparison) -> str:
    said = [*found.notes]
    if found.floor is not None:
        said.append(f"the noise floor is {found.floor.how}")
    return notes_section(said)
