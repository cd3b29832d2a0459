"""Common HTML parts of pages. Headings are escaped here; other text must be escaped by the caller."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from html import escape


def section(title: str, *parts: str, text: str = "", anchor: str = "") -> str:
    """A section with a heading; empty without content.

    Args:
        title: heading, plain text.
        parts: HTML parts of the content.
        text: HTML of a paragraph below the heading.
        anchor: id of the section for links.
    """
    body = "".join(parts)
    if not body:
        return ""
    name = f' id="{escape(anchor)}"' if anchor else ""
    paragraph = f"<p>{text}</p>" if text else ""
    return f"<section{name}><h2>{escape(title)}</h2>{paragraph}{body}</section>"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], words: Collection[int] = ()) -> str:
    """A table with row headings in the first column; empty without rows.

    Args:
        heads: column headings, plain text.
        rows: cells, HTML.
        words: numbers of text columns, which are left-aligned and may wrap.
    """
    body = "".join(f"<tr>{_cells(row, words)}</tr>" for row in rows)
    if not body:
        return ""
    header = "".join(f"<th{_cell_class(column, words)}>{escape(head)}</th>" for column, head in enumerate(heads))
    return f"<table><thead><tr>{header}</tr></thead><tbody>{body}</tbody></table>"


def facts(items: Iterable[tuple[str, str]]) -> str:
    """A list of key figures side by side, from names (plain text) and values (HTML)."""
    cells = "".join(f"<div><dt>{escape(name)}</dt><dd>{value}</dd></div>" for name, value in items)
    return f"<dl>{cells}</dl>" if cells else ""


def signed(value: float, digits: int = 1) -> str:
    """Format a difference with its sign; a value that rounds to zero has no sign."""
    rounded = round(value, digits)
    return f"{rounded:+.{digits}f}".replace("-", "−") if rounded else f"{0:.{digits}f}"


def meter(share: float) -> str:
    """A bar filled to a share from 0 to 1."""
    return f'<span class="meter"><i style="width:{100 * min(max(share, 0.0), 1.0):.1f}%"></i></span>'


def figure(title: str, text: str, body: str, kind: str = "", width_px: int = 0) -> str:
    """A figure with a heading (plain text), a line of text (HTML) and a body (HTML)."""
    head = f"<h3>{escape(title)}</h3>" if title else ""
    head += f"<p>{text}</p>" if text else ""
    head = f"<figcaption>{head}</figcaption>" if head else ""
    style = f' style="max-width:{width_px}px"' if width_px else ""
    name = f' class="{kind}"' if kind else ""
    return f"<figure{name}{style}>{head}{body}</figure>"


def legend(items: Iterable[tuple[str, str]]) -> str:
    """A legend from CSS colours and their meanings (HTML)."""
    entries = "".join(f'<span><i style="background:{colour}"></i> {words}</span>' for colour, words in items)
    return f'<div class="legend">{entries}</div>'


def button(words: str, pressed: bool | None = None, **data: str) -> str:
    """A button with plain text; `data` are its data attributes; with `pressed` it is a toggle button."""
    state = "" if pressed is None else f' aria-pressed="{str(pressed).lower()}"'
    attributes = "".join(f' data-{name}="{escape(value)}"' for name, value in data.items())
    return f'<button type="button"{attributes}{state}>{escape(words)}</button>'


def notes_section(notes: Sequence[str], title: str = "Notes") -> str:
    """A section with a list of sentences (plain text); empty without sentences."""
    items = "".join(f"<li>{escape(note)}</li>" for note in notes)
    return section(title, f'<ul class="notes">{items}</ul>' if items else "")


def _cells(row: Sequence[str], words: Collection[int]) -> str:
    head = f"<th>{row[0]}</th>" if row else ""
    return head + "".join(f"<td{_cell_class(column, words)}>{cell}</td>" for column, cell in enumerate(row) if column)


def _cell_class(column: int, words: Collection[int]) -> str:
    return ' class="words"' if column in words else ""
