"""The page of towns: one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from cosim.report.html import document, fill
from cosim.town_map.drawing import COLOURS, town_svg
from cosim.town_map.facts import TownFacts, town_facts
from sumo_nets import Town

_STYLE = """
main { display: grid; grid-template-columns: repeat(auto-fill, minmax(440px, 1fr)); gap: 18px; margin-top: 16px; }
figure { margin: 0; background: #fbfaf7; color: #1d2127; border-radius: 8px; padding: 10px; }
svg { width: 100%; aspect-ratio: 1; display: block; }
figcaption { font-size: 13px; color: #444; margin-top: 6px; }
table { border-collapse: collapse; font-size: 13.5px; margin-top: 20px; width: 100%; }
th, td { padding: 4px 8px; text-align: right; border-bottom: 1px solid var(--line); }
th:first-child, td:first-child, td:nth-child(2), th:nth-child(2) { text-align: left; }
ul { list-style: none; padding: 0; display: flex; flex-wrap: wrap; gap: 5px 16px; font-size: 13.5px; margin: 8px 0; }
i { display: inline-block; width: .9em; height: .9em; margin-right: .35em; vertical-align: -.1em; }
"""
_HEADINGS = (
    "town", "looks", "junctions", "traffic lights", "crossings", "driving lanes [km]", "sidewalks [km]",
    "parking lots", "extent [m]", "heights [m]", "steepest [%]", "lanes a direction", "limits [km/h]",
)  # fmt: skip


def write_town_page(towns: Sequence[Town], folder: Path) -> Path:
    """Draw towns on `folder`/index.html, with a table of their figures; returns the page's path."""
    facts = [town_facts(town) for town in towns]
    legend = Markup().join(
        fill('<li><i style="background:{}"></i>{}</li>', colour, name) for name, colour in COLOURS.items()
    )
    figures = Markup().join(_figure(town, fact) for town, fact in zip(towns, facts, strict=True))
    rows = Markup().join(_row(town, fact) for town, fact in zip(towns, facts, strict=True))
    head = Markup().join(fill("<th>{}</th>", heading) for heading in _HEADINGS)
    parts = [
        Markup("<h1>Towns</h1>"),
        Markup("<p>North is up; the ground is shaded from low (green) to high (sand), lit from the north-west.</p>"),
        fill("<ul>{}</ul><main>{}</main>", legend, figures),
        fill("<table><thead><tr>{}</tr></thead><tbody>{}</tbody></table>", head, rows),
    ]
    text = document("Towns", parts, style=_STYLE, generator="cosim towns")
    folder.mkdir(parents=True, exist_ok=True)
    page = folder / "index.html"
    page.write_text(text, encoding="utf-8")
    return page


def _figure(town: Town, facts: TownFacts) -> str:
    words = f"{facts.lane_km:.1f} km of lanes, {facts.junctions} junctions, {facts.parking_lots} parking lots"
    title = fill("<h2>{} – {}</h2>", town.name, town.style)
    return fill("<figure>{}{}<figcaption>{}</figcaption></figure>", title, town_svg(town.streets), words)


def _row(town: Town, facts: TownFacts) -> str:
    cells = (
        town.name,
        town.style,
        facts.junctions,
        facts.lights,
        facts.crossings,
        f"{facts.lane_km:.1f}",
        f"{facts.sidewalk_km:.1f}",
        facts.parking_lots,
        f"{facts.extent_m[0]:.0f} × {facts.extent_m[1]:.0f}",
        f"{facts.height_m:.1f}",
        f"{facts.max_grade_percent:.1f}",
        ", ".join(map(str, facts.lanes)),
        ", ".join(f"{limit} ({km:.1f} km)" for limit, km in facts.limits_km.items()),
    )
    return Markup("<tr>") + Markup().join(fill("<td>{}</td>", cell) for cell in cells) + Markup("</tr>")
