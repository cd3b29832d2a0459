"""Common parts of pages. Plain text is escaped; `Markup` is inserted unchanged."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from markupsafe import Markup

from cosim.report.html import fill, part


def section(title: str, *parts: str, text: str = "", anchor: str = "") -> Markup:
    """A section with a heading; empty without content.

    Args:
        title: heading.
        parts: parts of the content.
        text: text of a paragraph below the heading.
        anchor: id of the section for links.
    """
    body = Markup().join(parts)
    return part("section", title, body, text, anchor) if body else body


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], words: Collection[int] = ()) -> Markup:
    """A table with row headings in the first column; empty without rows.

    Args:
        heads: column headings.
        rows: cells.
        words: numbers of text columns, which are left-aligned and may wrap.
    """
    rows = list(rows)
    return part("table", heads, rows, words) if rows else Markup()


def facts(items: Iterable[tuple[str, str]]) -> Markup:
    """A list of key figures side by side, from names and values."""
    items = list(items)
    return part("facts", items) if items else Markup()


def signed(value: float, digits: int = 1) -> str:
    """Format a difference with its sign; a value that rounds to zero has no sign."""
    rounded = round(value, digits)
    return f"{rounded:+.{digits}f}".replace("-", "−") if rounded else f"{0:.{digits}f}"


def meter(share: float) -> Markup:
    """A bar filled to a share from 0 to 1."""
    return fill('<span class="meter"><i style="width:{:.1f}%"></i></span>', 100 * min(max(share, 0.0), 1.0))


def figure(title: str, text: str, body: str, kind: str = "", width_px: int = 0) -> Markup:
    """A figure with a heading, a line of text and a body."""
    return part("figure", title, text, body, kind, width_px)


def legend(items: Iterable[tuple[str, str]]) -> Markup:
    """A legend from CSS colours and their meanings."""
    return part("legend", list(items))


def button(words: str, pressed: bool | None = None, **data: str) -> Markup:
    """A button; `data` are its data attributes; with `pressed` it is a toggle button."""
    return part("button", words, pressed, data)


def notes_section(notes: Sequence[str], title: str = "Notes") -> Markup:
    """A section with a list of sentences; empty without sentences."""
    return section(title, part("notes", notes) if notes else "")
