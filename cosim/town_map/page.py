"""The page of towns: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

from cosim.town_map.drawing import COLOURS, town_svg
from cosim.town_map.facts import TownFacts, town_facts
from sumo_nets import Town

_STYLE = """
body{font:15px/1.45 system-ui,sans-serif;margin:0 auto;max-width:1500px;padding:1.5rem;color:#1d2127;background:#fbfaf7}
h1{font-size:1.5rem;margin:0 0 .3rem}h2{font-size:1.05rem;margin:.2rem 0}
main{display:grid;grid-template-columns:repeat(auto-fill,minmax(440px,1fr));gap:1.2rem;margin-top:1rem}
figure{margin:0;background:#fff;border:1px solid #ddd;border-radius:6px;padding:.6rem}
svg{width:100%;aspect-ratio:1;display:block}figcaption{font-size:.85rem;color:#444;margin-top:.4rem}
table{border-collapse:collapse;font-size:.85rem;margin-top:1rem;width:100%}
th,td{padding:.25rem .5rem;text-align:right;border-bottom:1px solid #e3e0d8}
th:first-child,td:first-child,td:nth-child(2),th:nth-child(2){text-align:left}
ul{list-style:none;padding:0;display:flex;flex-wrap:wrap;gap:.3rem 1rem;font-size:.85rem;margin:.5rem 0}
i{display:inline-block;width:.9em;height:.9em;margin-right:.35em;vertical-align:-.1em;border:1px solid #0003}
"""
_HEADINGS = (
    "town", "looks", "junctions", "traffic lights", "crossings", "driving lanes [km]", "sidewalks [km]",
    "parking lots", "extent [m]", "heights [m]", "steepest [%]", "lanes a direction", "limits [km/h]",
)  # fmt: skip


def write_town_page(towns: Sequence[Town], folder: Path) -> Path:
    """Draw towns on `folder`/index.html, with a table of their figures; returns the page's path."""
    facts = [town_facts(town) for town in towns]
    legend = "".join(f'<li><i style="background:{colour}"></i>{name}</li>' for name, colour in COLOURS.items())
    figures = "".join(_figure(town, fact) for town, fact in zip(towns, facts, strict=True))
    rows = "".join(_row(town, fact) for town, fact in zip(towns, facts, strict=True))
    head = "".join(f"<th>{heading}</th>" for heading in _HEADINGS)
    text = (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>Towns</title>'
        f"<style>{_STYLE}</style></head><body><h1>Towns</h1>"
        "<p>North is up; the ground is shaded from low (green) to high (sand), lit from the north-west.</p>"
        f"<ul>{legend}</ul><main>{figures}</main>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></body></html>\n"
    )
    folder.mkdir(parents=True, exist_ok=True)
    page = folder / "index.html"
    page.write_text(text, encoding="utf-8")
    return page


def _figure(town: Town, facts: TownFacts) -> str:
    words = f"{facts.lane_km:.1f} km of lanes, {facts.junctions} junctions, {facts.parking_lots} parking lots"
    title = f"<h2>{escape(town.name)} – {escape(town.style)}</h2>"
    return f"<figure>{title}{town_svg(town.streets)}<figcaption>{words}</figcaption></figure>"


def _row(town: Town, facts: TownFacts) -> str:
    cells = (
        escape(town.name),
        escape(town.style),
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
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
