"""The frame of the pages that commands write: one self-contained HTML document."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

_BASE_STYLE = """
:root { color-scheme: dark; --ground: #0d1016; --panel: #151a23; --line: #262d39; --text: #e2e8f0; --muted: #8692a6;
  --accent: #ffb23e; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 1840px; padding: 28px clamp(12px, 2.5vw, 40px) 60px; background: var(--ground);
  color: var(--text); font: 15px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
h1 { margin: 0 0 14px; font-size: 27px; font-weight: 650; letter-spacing: -.01em; overflow-wrap: anywhere; }
h2 { margin: 0 0 10px; font-size: 20px; font-weight: 650; overflow-wrap: anywhere; }
h3 { margin: 0; font-size: 15px; font-weight: 600; }
p { margin: 3px 0 0; color: var(--muted); max-width: 105ch; }
"""


def document(title: str, parts: Iterable[str], *, style: str, generator: str) -> str:
    """A whole document.

    Args:
        title: plain text.
        parts: HTML of the body; empty parts are left out.
        style: CSS on top of the common one.
        generator: the command that wrote it.
    """
    body = "\n".join(part for part in parts if part)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta name="generator" content="{escape(generator)}">\n<title>{escape(title)}</title>\n'
        f"<style>{_BASE_STYLE}{style}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )
