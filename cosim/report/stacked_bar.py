"""Stacked bar of the parts of a total."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from cosim.report.html import fill

_MIN_SHARE_WITH_VALUE = 0.06  # the values of smaller parts are only shown in the legend


@dataclass(frozen=True)
class Piece:
    """A part of a total.

    Attributes:
        name: name, plain text.
        value: value in the unit of the total; a negative value is listed, but has no width.
        colour: CSS colour.
        why: explanation, plain text.
    """

    name: str
    value: float
    colour: str
    why: str = ""


def stacked_bar(pieces: Sequence[Piece], title: str, digits: int = 3) -> str:
    """HTML of the bar and of a legend with all values; widths are proportional to the values.

    Args:
        pieces: parts from left to right.
        title: title for screen readers.
        digits: number of decimals.
    """
    total = sum(max(piece.value, 0.0) for piece in pieces) or 1.0
    parts, legend = [], []
    for piece in pieces:
        share, value = max(piece.value, 0.0) / total, _value(piece.value, digits)
        text = value if share > _MIN_SHARE_WITH_VALUE else ""
        if share > 0:
            parts.append(
                fill(
                    '<i data-part="{}" style="width:{:.2f}%;background:{}" title="{} {}">{}</i>',
                    piece.name,
                    100 * share,
                    piece.colour,
                    piece.name,
                    value,
                    text,
                )
            )
        why = fill("<small>{}</small>", piece.why) if piece.why else ""
        legend.append(
            fill(
                '<li><i style="background:{}"></i><b>{}</b> {} <small>{:.0%}</small>{}</li>',
                piece.colour,
                value,
                piece.name,
                piece.value / total,
                why,
            )
        )
    summary = ", ".join(f"{piece.name} {_value(piece.value, digits)}" for piece in pieces)
    return fill(
        '<div class="stack" role="img" aria-label="{}: {}">{}</div><ul class="stacked">{}</ul>',
        title,
        summary,
        Markup().join(parts),
        Markup().join(legend),
    )


def _value(value: float, digits: int) -> str:
    return f"{value:.{digits}f}".replace("-", "−") if round(value, digits) else f"{0:.{digits}f}"
