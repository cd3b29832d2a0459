"""HTML of the interactive page: controls, style, script, and frames embedded in it or loaded from the server."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Mapping
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from cosim.report.html import fill
from cosim.view.scripts import viewer_script

GENERATOR = "cosim view"
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; connect-src "
_KEYS = (
    ("← →", "frame before, after"),
    ("Page ↑ ↓", "ten frames"),
    ("space", "play, stop"),
    ("1 – 6", "colours"),
    ("[ ]", "scale of the colours"),
    ("+ −", "size of the points"),
    ("b", "boxes: labels, all objects, none"),
    ("n", "names of the boxes"),
    ("p", "points in the image"),
    ("c", "next camera"),
    ("r", "view from behind the car"),
    ("t", "view from above"),
    ("drag", "turn; with shift or the right button, move; wheel: nearer; double click: back"),
    ("image", "wheel: nearer; drag: move; double click: whole"),
)


def page_parts(
    settings: Mapping[str, Any], absences: Iterable[tuple[str, tuple[str, ...]]], *, pictures: str | None = None
) -> tuple[str, str]:
    """HTML before and after the frames.

    Args:
        settings: settings of the script, JSON values.
        absences: title and missing parts of each drive.
        pictures: link to the page of pictures, if there is one.
    """
    absences = list(absences)
    title = " | ".join(drive for drive, _ in absences)
    source = "'self'" if settings["served"] else "'none'"
    head = fill(
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<meta '
        'http-equiv="Content-Security-Policy" content="{}{}">\n<meta name="viewport" '
        'content="width=device-width, initial-scale=1">\n<meta name="generator" content="{}">\n<title>'
        "{}</title>\n<style>{}</style>\n</head>\n<body>\n",
        Markup(_POLICY),
        Markup(source),
        GENERATOR,
        title,
        Markup("\n" + (files("cosim.view.interactive") / "page.css").read_text(encoding="utf-8")),
    )
    panes = Markup().join(_pane(drive, missing) for drive, missing in absences)
    link = fill('<a href="{}">pictures</a>', pictures) if pictures else ""
    data = Markup(json.dumps(settings, separators=(",", ":")).replace("<", "\\u003c"))
    head += fill(
        '<main>{}</main>\n{}\n<script type="application/json" id="settings">{}</script>\n', panes, _controls(link), data
    )
    return head, fill("{}\n</body>\n</html>\n", viewer_script())


def frame_element(kind: str, drive: int, name: str, data: bytes) -> str:
    """HTML element that contains a frame."""
    text = base64.b64encode(data).decode()
    return fill('<script type="text/plain" data-{}="{}" data-name="{}">{}</script>\n', kind, drive, name, text)


def _pane(title: str, missing: tuple[str, ...]) -> str:
    absent = ""
    if missing:
        items = Markup().join(fill("<li>{}</li>", note) for note in missing)
        absent = fill("<details><summary>{} absent</summary><ul>{}</ul></details>", len(missing), items)
    return fill(
        '<section class="pane"><header><h1>{}</h1><div class="facts"></div>{}</header><div class="space">'
        '<canvas class="points" aria-label="points in three dimensions"></canvas><canvas class="over">'
        '</canvas><div class="legend"></div><pre class="tip" hidden></pre><p class="fault" hidden>Points '
        'need WebGL, which is disabled or not available in this browser.</p></div><div class="image">'
        '<canvas aria-label="camera image"></canvas><p class="no-image" hidden>no camera images in this '
        "frame</p></div></section>",
        title,
        absent,
    )


def _controls(link: str) -> str:
    keys = Markup().join(fill("<dt>{}</dt><dd>{}</dd>", key, does) for key, does in _KEYS)
    return fill(
        '<footer><button id="play" title="space">▶</button><input id="slider" type="range" min="0" '
        'value="0" aria-label="frame"><output id="place"></output><div id="modes" role="group" '
        'aria-label="colours"></div><div role="group"><button id="boxes" title="key b"></button><button '
        'id="names" title="key n">names</button><button id="projected" title="key p">points in '
        'image</button><button id="camera" title="key c">next camera</button></div><div role="group">'
        '<button id="behind" title="key r">behind</button><button id="above" title="key t">above</button>'
        '<button id="help" title="key ?">keys</button></div>{}<span id="waiting" hidden>tracing the '
        'twin…</span><span id="fault"></span></footer><dl id="keys" hidden>{}</dl>',
        link,
        keys,
    )
