"""The frame of the pages that commands write: one self-contained HTML document."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from cosim.report.style import STYLE


def document(title: str, parts: Iterable[str], *, generator: str, style: str = "") -> str:
    """A whole document.

    Args:
        title: plain text.
        parts: HTML of the body; empty parts are left out.
        generator: the command that wrote it.
        style: CSS on top of the common one.
    """
    body = "\n".join(part for part in parts if part)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta name="generator" content="{escape(generator)}">\n<title>{escape(title)}</title>\n'
        f"<style>{STYLE}{style}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )
