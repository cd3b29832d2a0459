"""Page of losses: share of each error type, by subset of the objects, and box errors."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from cosim.report import Piece, document, facts, section, signed, stacked_bar, table
from cosim.report.html import fill
from cosim.report.phrases import listed
from training.evaluation.losses.box_errors import PARTS
from training.evaluation.losses.find import SPLIT, Losses, difference, intervals
from training.evaluation.losses.split import LossSplit, Part
from training.evaluation.rules import Metric

KINDS = {
    "position": ("position", "place seen from above"),
    "height": ("height", "of the centre above the ground"),
    "size": ("size", "length, width, height"),
    "heading": ("heading", ""),
    "misses": ("misses", "objects without detection"),
    "false_alarms": ("false alarms", "no object is labelled there"),
    "other_class": ("other classes", "boxes on trucks, people and other classes"),
    "duplicates": ("duplicates", "additional boxes on one object"),
}
_COLOURS = ("#ffb23e", "#f0606a", "#c792ea", "#5aa9ff", "#8692a6", "#6fd08c", "#4ec9b0", "#d7ba7d")
_TITLES: dict[Metric, str] = {"3d": "3D", "bev": "Bird’s-eye view"}
_SORTED = {"distance": "distance", "occlusion": "occlusion", "points": "points in the box"}
_BOX_HEADS = {
    "away_m": "along the line of sight (m)",
    "aside_m": "across it, left (m)",
    "height_m": "height of the centre (m)",
    "length_m": "length (m)",
    "width_m": "width (m)",
    "tallness_m": "height of the box (m)",
    "heading_deg": "heading (°)",
}
_MEANING = (
    "Shares add up to 100 − AP. A share is the mean gain of correcting an error type over all orders in which "
    "the types can be corrected (Shapley value); “alone” is the gain if only this type is corrected (TIDE). AP is "
    "the area under the whole curve, R40 the devkit’s average of 40 samples."
)


def format_losses(name: str, difficulty: str, sets: Sequence[Losses]) -> str:
    """The HTML text of one set of detections, or of two sets that are compared.

    Args:
        name: the class.
        difficulty: easy, moderate or hard.
        sets: one or two.
    """
    title = f"Losses of average precision: {name}, {difficulty}"
    parts = [fill("<header><h1>{}</h1>{}</header>", title, Markup().join(_format_headline(losses) for losses in sets))]
    for metric in SPLIT:
        bars = Markup().join(_format_bar(losses, metric) for losses in sets)
        parts.append(
            section(_TITLES[metric], bars, _format_table(sets, metric), text=_MEANING if metric == SPLIT[0] else "")
        )
    parts += [_format_parts(losses) for losses in sets] + [_format_box_errors(losses) for losses in sets]
    return document(title, parts, style=_STYLE, generator="cosim losses")


def _format_headline(losses: Losses) -> str:
    split = losses.splits["3d"]
    worst = sorted(split.share, key=lambda kind: -split.share[kind])[:3]
    summary = listed([f"{KINDS[kind][0]} {split.share[kind]:.1f}" for kind in worst if split.share[kind] >= 0.05])
    losses_text = f" Largest losses: {summary}." if summary else ""
    verdict = fill("<p class=verdict>{}: 3D AP {:.1f} of 100.{}</p>", losses.title, split.ap, losses_text)
    numbers = [("frames", f"{losses.frames:,}")]
    for metric in losses.splits:
        numbers.append((f"{_TITLES[metric]} R40", f"{losses.r40[metric]:.1f}"))
    faults = split.faults
    counted = faults.task.object_counts
    numbers += [
        ("objects", f"{int(counted.sum()):,}"),
        ("missed", f"{int(faults.missed.sum()):,}"),
        ("detected, overlap too small", f"{int((faults.misfits & counted).sum()):,}"),
    ]
    return verdict + facts(numbers)


def _format_bar(losses: Losses, metric: Metric) -> str:
    split = losses.splits[metric]
    pieces = [Piece("reached", split.ap, "#2f6d46")]
    for (kind, (label, explanation)), colour in zip(KINDS.items(), _COLOURS, strict=True):
        if kind in split.share:
            pieces.append(Piece(label, split.share[kind], colour, explanation))
    return fill("<h3 class=set>{}</h3>{}", losses.title, stacked_bar(pieces, f"{losses.title}, {metric}", 1))


def _format_table(sets: Sequence[Losses], metric: Metric) -> str:
    splits = [losses.splits[metric] for losses in sets]
    heads = ["", *(word for losses in sets for word in (f"{losses.title}: share", "alone"))]
    bounds = [intervals(split) for split in splits]
    rows = [
        [
            "AP reached",
            *(
                cell
                for split, items in zip(splits, bounds, strict=True)
                for cell in (_with_interval(split.ap, items["ap"]), "")
            ),
        ]
    ]
    error_types = [kind for kind in KINDS if kind in splits[0].share]
    for kind in error_types:
        row = [KINDS[kind][0]]
        for split, items in zip(splits, bounds, strict=True):
            row += [_with_interval(split.share[kind], items[kind]), f"{split.alone[kind]:.1f}"]
        rows.append(row)
    if len(splits) == 2:
        heads.append("first − second")
        between = difference(*splits)
        for row, key in zip(rows, ("ap", *error_types), strict=True):
            row.append(_with_interval(*between[key], of_two=True))
    return table(heads, rows)


def _with_interval(value: float, bounds: tuple[float, float] | None, of_two: bool = False) -> str:
    summary, *ends = (signed(number) if of_two else _minus(f"{number:z.1f}") for number in (value, *(bounds or ())))
    return fill("{}<small>{}</small>", summary, Markup(" – ").join(ends)) if ends else summary


def _format_parts(losses: Losses) -> str:
    tables = []
    for by in _SORTED:
        for metric in SPLIT:
            items = losses.parts[metric].get(by)
            if items:
                tables.append(
                    fill(
                        "<h3 class=set>{}, by {}</h3>{}",
                        _TITLES[metric],
                        _SORTED[by],
                        _part_table(items, losses.splits[metric]),
                    )
                )
    text = "Gain of AP if one type is corrected in this subset only. False alarms are assigned by their own position."
    return section(f"By subset: {losses.title}", *tables, text=text)


def _part_table(items: Sequence[Part], split: LossSplit) -> str:
    error_types = [kind for kind in KINDS if kind in split.share]
    most = max((part.gain.get(kind, 0.0) for part in items for kind in error_types), default=0.0)
    rows = [
        [part.name, f"{part.objects:,}", *(_shaded(part.gain.get(kind), most) for kind in error_types)]
        for part in items
    ]
    return table(["", "objects", *(KINDS[kind][0] for kind in error_types)], rows)


def _shaded(gain: float | None, most: float) -> str:
    if gain is None:
        return ""
    strength = 0.75 * min(max(gain / most, 0.0), 1.0) if most > 0 else 0.0
    label = _minus(f"{round(gain, 1) + 0.0:.1f}")
    return fill('<span class="heat" style="background:rgba(255,178,62,{:.2f})">{}</span>', strength, label)


def _format_box_errors(losses: Losses) -> str:
    rows = []
    for items in losses.errors:
        cells = [
            _minus(f"{items.median[part]:+.{1 if part.endswith('deg') else 2}f}")
            + fill("<small>± {}</small>", f"{items.spread[part]:.{(1 if part.endswith('deg') else 2)}f}")
            for part in PARTS
        ]
        rows.append([items.name, f"{items.objects:,}", *cells])
    text = (
        "Detected minus labelled, for objects that count and have a detection, hit or not: median, "
        "and half the distance from the 16th to the 84th percentile."
    )
    return section(f"Box errors: {losses.title}", table(["", "objects", *_BOX_HEADS.values()], rows), text=text)


def _minus(text: str) -> str:
    return text.replace("-", "−")


_STYLE = """
td small { display: block; color: var(--muted); font-size: 11.5px; } .set { margin-top: 18px; }
header .verdict { margin-top: 20px; }
.heat { display: inline-block; min-width: 52px; padding: 1px 8px; border-radius: 4px; text-align: right; }
"""
