"""Write pages to disk."""

from __future__ import annotations

from pathlib import Path

from cosim.drives.writer import explained


def write_page(folder: Path, text: str) -> Path:
    """Write `folder/index.html`; returns its path.

    Raises:
        OutputError: the folder cannot be written.
    """
    index = folder / "index.html"
    with explained(index):
        folder.mkdir(parents=True, exist_ok=True)
        index.write_text(text, encoding="utf-8", newline="\n")
    return index
