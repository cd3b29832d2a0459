"""Page of pictures: one HTML file without scripts, and picture files in the same folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import quote

from markupsafe import Markup

from cosim.report import document, facts
from cosim.report.html import fill
from cosim.view.captions import Caption

GENERATOR = "cosim view"


@dataclass(frozen=True)
class ShownPicture:
    """A picture on the page: file relative to the page, caption, size in pixels."""

    file: str
    caption: Caption
    width: int
    height: int


@dataclass(frozen=True)
class Missing:
    """A picture that could not be drawn, and the reason."""

    title: str
    reason: str


@dataclass(frozen=True)
class FrameSection:
    """One frame on the page.

    Attributes:
        name: name of the frame.
        facts: pairs of name and value.
        pictures: pictures in order.
        missing: pictures that could not be drawn.
    """

    name: str
    facts: Sequence[tuple[str, str]]
    pictures: Sequence[ShownPicture]
    missing: Sequence[Missing]


@dataclass(frozen=True)
class Thumbnail:
    """One frame of the overview: picture file, and whether the page has a section for the frame."""

    name: str
    file: str
    width: int
    height: int
    shown: bool


@dataclass(frozen=True)
class Page:
    """Content of the page; plain text, which is escaped when the page is written.

    Attributes:
        title: title of the drive.
        facts: pairs of name and value about the drive.
        notes: missing parts of the drive, one sentence each.
        overview: evenly spaced frames of the drive.
        frames: frames with a section.
    """

    title: str
    facts: Sequence[tuple[str, str]]
    notes: Sequence[str]
    overview: Sequence[Thumbnail]
    frames: Sequence[FrameSection]


def format_page(page: Page) -> str:
    """The HTML text of a page."""
    body = [
        fill("<header><h1>{}</h1>{}</header>", page.title, facts(page.facts)),
        _overview(page.overview),
        *(_section(frame) for frame in page.frames),
        _notes(page.notes),
    ]
    return document(page.title, body, style=_STYLE, generator=GENERATOR)


def _overview(thumbnails: Sequence[Thumbnail]) -> str:
    if not thumbnails:
        return ""
    cells = []
    for item in thumbnails:
        target = f"#{_anchor(item.name)}" if item.shown else quote(item.file)
        mark = Markup(' class="shown"') if item.shown else ""
        cells.append(
            fill(
                '<a{} href="{}"><img src="{}" width="{}" height="{}" alt="frame {}"><span>{}</span></a>',
                mark,
                target,
                quote(item.file),
                item.width,
                item.height,
                item.name,
                item.name,
            )
        )
    return fill('<nav aria-label="overview of the drive">{}</nav>', Markup().join(cells))


def _section(frame: FrameSection) -> str:
    figures = Markup("\n").join(_figure(frame.name, picture) for picture in frame.pictures)
    absent = ""
    if frame.missing:
        items = Markup().join(fill("<li>{}: {}</li>", gap.title, gap.reason) for gap in frame.missing)
        absent = fill('<div class="absent"><h3>Left out</h3><ul>{}</ul></div>', items)
    return fill(
        '<section id="{}"><h2>Frame {}</h2>{}<div class="pictures">\n{}\n</div>{}</section>',
        _anchor(frame.name),
        frame.name,
        facts(frame.facts),
        figures,
        absent,
    )


def _figure(frame: str, picture: ShownPicture) -> str:
    file, caption = quote(picture.file), picture.caption
    wide = Markup(' class="wide"') if caption.wide else ""
    return fill(
        '<figure{}><a href="{}"><img loading="lazy" src="{}" width="{}" height="{}" alt="{}, frame {}">'
        "</a><figcaption><h3>{}</h3><p>{}</p></figcaption></figure>",
        wide,
        file,
        file,
        picture.width,
        picture.height,
        caption.title,
        frame,
        caption.title,
        caption.text,
    )


def _notes(notes: Sequence[str]) -> str:
    if not notes:
        return ""
    items = Markup().join(fill("<li>{}</li>", note) for note in notes)
    return fill('<section class="absent"><h2>Absent from this drive</h2><ul>{}</ul></section>', items)


def _anchor(name: str) -> str:
    return quote(f"frame-{name}", safe="")


_STYLE = """
dl { display: flex; flex-wrap: wrap; gap: 8px 30px; margin: 0 0 18px; }
dt { color: var(--muted); font-size: 12px; }
dd { margin: 0; font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
header dd { font-size: 18px; font-weight: 600; }
nav { display: grid; grid-template-columns: repeat(auto-fill, minmax(180px, 1fr)); gap: 8px; margin: 4px 0 34px; }
nav a { position: relative; display: block; border: 2px solid var(--line); border-radius: 6px; overflow: hidden; }
nav a.shown { border-color: var(--accent); }
nav span { position: absolute; left: 6px; bottom: 6px; padding: 1px 7px; border-radius: 4px; background: #0d1016d0;
  color: var(--text); font-size: 12px; }
section { border-top: 1px solid var(--line); padding-top: 22px; margin-top: 26px; }
.pictures { display: grid; grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 18px; }
.wide { grid-column: 1 / -1; }
figure { margin: 0; border: 1px solid var(--line); border-radius: 8px; overflow: hidden; background: var(--panel); }
figcaption { padding: 10px 14px 13px; }
img { display: block; width: 100%; height: auto; }
a:focus-visible { outline: 2px solid var(--accent); outline-offset: 2px; }
.absent { margin-top: 18px; color: var(--muted); }
.absent ul { margin: 6px 0 0; padding-left: 20px; }
@media (max-width: 900px) { .pictures { grid-template-columns: minmax(0, 1fr); } }
"""
