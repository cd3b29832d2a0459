"""Stacked bar of the parts of a total."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

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
                f'<i data-part="{escape(piece.name)}" style="width:{100 * share:.2f}%;background:{piece.colour}" '
                f'title="{escape(piece.name)} {value}">{text}</i>'
            )
        why = f"<small>{escape(piece.why)}</small>" if piece.why else ""
        legend.append(
            f'<li><i style="background:{piece.colour}"></i><b>{value}</b> {escape(piece.name)}'
            f" <small>{piece.value / total:.0%}</small>{why}</li>"
        )
    summary = ", ".join(f"{piece.name} {_value(piece.value, digits)}" for piece in pieces)
    return (
        f'<div class="stack" role="img" aria-label="{escape(title)}: {escape(summary)}">{"".join(parts)}</div>'
        f'<ul class="stacked">{"".join(legend)}</ul>'
    )


def _value(value: float, digits: int) -> str:
    return f"{value:.{digits}f}".replace("-", "−") if round(value, digits) else f"{0:.{digits}f}"
