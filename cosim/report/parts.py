"""Parts that pages share, as HTML. Words that come from outside are escaped by who calls; headings are escaped here."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from html import escape


def section(title: str, *parts: str, text: str = "", anchor: str = "") -> str:
    """A part of a page under a heading; empty where it holds nothing.

    Args:
        title: plain text.
        parts: HTML.
        text: HTML of a paragraph beneath the heading.
        anchor: its id, for links.
    """
    body = "".join(parts)
    if not body:
        return ""
    name = f' id="{escape(anchor)}"' if anchor else ""
    said = f"<p>{text}</p>" if text else ""
    return f"<section{name}><h2>{escape(title)}</h2>{said}{body}</section>"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], words: Collection[int] = ()) -> str:
    """A table whose first column names the rows; empty without rows.

    Args:
        heads: plain text over the columns.
        rows: cells as HTML.
        words: numbers of columns that hold words, which stand to the left and may break.
    """
    body = "".join(f"<tr>{_cells(row, words)}</tr>" for row in rows)
    if not body:
        return ""
    over = "".join(f"<th{_kind(place, words)}>{escape(head)}</th>" for place, head in enumerate(heads))
    return f"<table><thead><tr>{over}</tr></thead><tbody>{body}</tbody></table>"


def facts(items: Iterable[tuple[str, str]]) -> str:
    """Figures side by side, each under its name: plain name and HTML."""
    cells = "".join(f"<div><dt>{escape(name)}</dt><dd>{value}</dd></div>" for name, value in items)
    return f"<dl>{cells}</dl>" if cells else ""


def signed(value: float, digits: int = 1) -> str:
    """A difference with its sign; what rounds to zero has none."""
    rounded = round(value, digits)
    return f"{rounded:+.{digits}f}".replace("-", "−") if rounded else f"{0:.{digits}f}"


def meter(share: float) -> str:
    """A bar that is filled by a share, 0 to 1."""
    return f'<span class="meter"><i style="width:{100 * min(max(share, 0.0), 1.0):.1f}%"></i></span>'


def figure(title: str, text: str, body: str, kind: str = "", width_px: int = 0) -> str:
    """A picture in a frame under a heading (plain) and a line of text (HTML)."""
    head = f"<h3>{escape(title)}</h3>" if title else ""
    head += f"<p>{text}</p>" if text else ""
    head = f"<figcaption>{head}</figcaption>" if head else ""
    style = f' style="max-width:{width_px}px"' if width_px else ""
    name = f' class="{kind}"' if kind else ""
    return f"<figure{name}{style}>{head}{body}</figure>"


def legend(items: Iterable[tuple[str, str]]) -> str:
    """Colours (of CSS) with what they mean (HTML)."""
    said = "".join(f'<span><i style="background:{colour}"></i> {words}</span>' for colour, words in items)
    return f'<div class="legend">{said}</div>'


def button(words: str, pressed: bool | None = None, **data: str) -> str:
    """A button with plain words; `data` become its data-attributes; `pressed` makes it one that stays."""
    held = "" if pressed is None else f' aria-pressed="{str(pressed).lower()}"'
    told = "".join(f' data-{name}="{escape(value)}"' for name, value in data.items())
    return f'<button type="button"{told}{held}>{escape(words)}</button>'


def notes_section(notes: Sequence[str], title: str = "What could not be known") -> str:
    """Sentences in a list (plain text); empty without any."""
    items = "".join(f"<li>{escape(note)}</li>" for note in notes)
    return section(title, f'<ul class="notes">{items}</ul>' if items else "")


def _cells(row: Sequence[str], words: Collection[int]) -> str:
    head = f"<th>{row[0]}</th>" if row else ""
    return head + "".join(f"<td{_kind(place, words)}>{cell}</td>" for place, cell in enumerate(row) if place)


def _kind(place: int, words: Collection[int]) -> str:
    return ' class="words"' if place in words else ""
