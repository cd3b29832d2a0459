"""HTML document of report pages, self-contained in one file."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from cosim.report.style import STYLE


def document(title: str, parts: Iterable[str], *, generator: str, style: str = "") -> str:
    """HTML text of a complete document.

    Args:
        title: title, plain text.
        parts: HTML parts of the body; empty parts are skipped.
        generator: command that wrote the page.
        style: CSS in addition to the common style.
    """
    body = "\n".join(part for part in parts if part)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta name="generator" content="{escape(generator)}">\n<title>{escape(title)}</title>\n'
        f"<style>{STYLE}{style}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )
