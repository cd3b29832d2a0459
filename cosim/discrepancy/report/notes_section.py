"""What a page says could not be known."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape


def notes_section(notes: Sequence[str]) -> str:
    """HTML; empty without notes."""
    items = "".join(f"<li>{escape(note)}</li>" for note in notes)
    return f'<section><h2>What could not be known</h2><ul class="notes">{items}</ul></section>' if items else ""
