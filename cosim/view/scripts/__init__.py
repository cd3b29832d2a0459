"""JavaScript that pages carry within them: plain files, one idea each, joined into one script."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.resources import files

from markupsafe import Markup

_SHARED = ("matrices", "orbit", "palettes", "canvas", "gl_program", "gl_points", "gl_lines", "scene")
_VIEWER = (
    "unpacking",
    "source",
    "frame",
    "material_colours",
    "modes",
    "boxes",
    "legend",
    "space_panel",
    "image_panel",
    "pane",
    "viewer",
)


def scene_script(*more: str) -> Markup:
    """A script element with what draws points in three dimensions, then further code, in a scope of its own."""
    return _element([*(_file(name) for name in _SHARED), *more])


def viewer_script() -> Markup:
    """A script element with the whole viewer of `cosim view`."""
    return _element(_file(name) for name in (*_SHARED, *_VIEWER))


def _file(name: str) -> str:
    return (files(__name__) / f"{name}.js").read_text(encoding="utf-8")


def _element(parts: Iterable[str]) -> Markup:
    code = "\n".join(parts)
    return Markup(f'<script>\n(() => {{\n"use strict";\n{code}\n}})();\n</script>')
