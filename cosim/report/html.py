"""HTML of report pages: Jinja2 templates with automatic escaping.

Plain text is escaped wherever it is inserted; `Markup` is HTML already and is not escaped again.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib.resources import files
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

_ENVIRONMENT = Environment(
    loader=FileSystemLoader(str(files("cosim.report") / "templates")),
    autoescape=True,
    undefined=StrictUndefined,
    keep_trailing_newline=True,
)


def document(title: str, parts: Iterable[str], *, generator: str, style: str = "") -> str:
    """HTML text of a complete document.

    Args:
        title: title.
        parts: parts of the body; empty parts are skipped.
        generator: command that wrote the page.
        style: CSS in addition to the common style.
    """
    body = Markup("\n").join(part for part in parts if part)
    template = _ENVIRONMENT.get_template("document.html")
    common = (files("cosim.report") / "page.css").read_text(encoding="utf-8")
    return template.render(title=title, body=body, generator=generator, style=Markup("\n" + common + style))


def part(name: str, *values: Any) -> Markup:
    """HTML of a macro of `templates/parts.html`."""
    return Markup(getattr(_ENVIRONMENT.get_template("parts.html").module, name)(*values))


def fill(html: str, *values: Any) -> Markup:
    """Insert values into HTML with placeholders as of `str.format`; values that are not `Markup` are escaped."""
    return Markup(html).format(*values)
