"""One bar that shows what a whole is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

_LEAST_WITH_WORDS = 0.06  # share of the bar below which its value stands in the legend alone


@dataclass(frozen=True)
class Piece:
    """A part of a whole.

    Attributes:
        name: plain text.
        value: in the unit of the whole; below 0 it is told, and has no width.
        colour: of CSS.
        why: a word on it; plain text.
    """

    name: str
    value: float
    colour: str
    why: str = ""


def stacked_bar(pieces: Sequence[Piece], title: str, digits: int = 3) -> str:
    """HTML: the bar, and a legend with every value; a gap of a colour's width is its share of the sum.

    Args:
        pieces: from left to right.
        title: read out by screen readers.
        digits: behind the point of values.
    """
    total = sum(max(piece.value, 0.0) for piece in pieces) or 1.0
    parts, legend = [], []
    for piece in pieces:
        share, value = max(piece.value, 0.0) / total, _value(piece.value, digits)
        words = value if share > _LEAST_WITH_WORDS else ""
        if share > 0:
            parts.append(
                f'<i data-part="{escape(piece.name)}" style="width:{100 * share:.2f}%;background:{piece.colour}" '
                f'title="{escape(piece.name)} {value}">{words}</i>'
            )
        why = f"<small>{escape(piece.why)}</small>" if piece.why else ""
        legend.append(
            f'<li><i style="background:{piece.colour}"></i><b>{value}</b> {escape(piece.name)}'
            f" <small>{piece.value / total:.0%}</small>{why}</li>"
        )
    said = ", ".join(f"{piece.name} {_value(piece.value, digits)}" for piece in pieces)
    return (
        f'<div class="stack" role="img" aria-label="{escape(title)}: {escape(said)}">{"".join(parts)}</div>'
        f'<ul class="stacked">{"".join(legend)}</ul>'
    )


def _value(value: float, digits: int) -> str:
    return f"{value:.{digits}f}".replace("-", "−") if round(value, digits) else f"{0:.{digits}f}"
