"""mkdocs hooks: reference pages from code, the changelog as a page, formulas as MathML."""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File, Files
from mkdocs.utils import get_relative_url
from reference_pages import commands_page, effects_page

_ROOT = Path(__file__).resolve().parents[1]
_FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)
_FETCHED = re.compile(r'<script src="https?://[^"]*"></script>')


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages."""
    from cosim.cli.main import make_parser
    from sensors.effects.registry import built_in_effects

    made = {
        "commands.md": commands_page(make_parser()),
        "effects.md": effects_page(built_in_effects().values()),
        "changelog.md": (_ROOT / "CHANGELOG.md").read_text(encoding="utf-8"),
    }
    for name, content in made.items():
        files.append(File.generated(config, name, content=content))
    return files


def on_page_content(content: str, **_: Any) -> str:
    """Formulas as MathML, which browsers draw without scripts or fonts of others."""
    return _FORMULA.sub(_mathml, content)


def on_post_page(output: str, *, page: Any, **_: Any) -> str:
    """Pages with `site.js` instead of scripts that the theme would load from other servers."""
    return _FETCHED.sub(f'<script src="{get_relative_url("site.js", page.url)}"></script>', output)


def on_post_template(output_content: str, **_: Any) -> str:
    """Adapt the page for addresses that do not exist."""
    return _FETCHED.sub("", output_content)


def _mathml(match: re.Match[str]) -> str:
    display = "block" if match[2] == "[" else "inline"
    return convert(html.unescape(match[3]), display=display)
