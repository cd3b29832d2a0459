"""The page: one HTML file with everything in it, no scripts and nothing fetched."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from markupsafe import Markup

from cosim.report.html import document, fill
from cosim.stats.charts import STYLES, Chart, label_charts, point_charts, position_charts, scan_charts
from cosim.stats.compare import DIRECTIONS, Distance
from cosim.stats.separation_section import STYLE as _SEPARATION_STYLE
from cosim.stats.separation_section import separation_section
from cosim.stats.summary import describe, histogram_mean, zero_share
from cosim.stats.tally import FOCUS, INTENSITIES, Collected
from cosim.stats.two_sample import TwoSample

_MOST_RELATIVE = 2.0  # standard deviations that fill the bar


def format_page(
    sets: Sequence[Collected],
    distances: Sequence[Distance],
    beside: Sequence[Distance] = (),
    separation: TwoSample | str | None = None,
) -> str:
    """The HTML text about one set, two with their distances, or three: the last is also compared with the second.

    `separation` is the two-sample test of the first two, or why there is none.
    """
    title = " against ".join(found.title for found in sets[:2])
    title += Markup().join(f", with {found.title}" for found in sets[2:])
    sections = [
        fill("<header><h1>{}</h1>{}</header>", title, _facts(sets)),
        _absent(sets),
        separation_section(separation),
        _distances(distances, sets),
        _distances(beside, (sets[2], sets[1])) if len(sets) > 2 else "",
        _section("Where the cars are", position_charts(sets), "maps" if len(sets) > 1 else ""),
        _section("Points on cars against distance", point_charts(sets), "pairs"),
        _section("Scans", scan_charts(sets)),
        _section("Labels", label_charts(sets)),
        _dimensions(sets),
    ]
    return document(title, sections, style=_STYLE + _SEPARATION_STYLE, generator="cosim stats")


def _facts(sets: Sequence[Collected]) -> str:
    rows = []
    for style, found in zip(STYLES, sets, strict=False):
        facts = [("", found.title), ("Kind", found.kind), ("Frames", f"{len(found.frames):,}")]
        if found.labelled.any():
            facts += [("Objects", f"{len(found.objects):,}"), (f"{FOCUS}s", f"{len(found.focus):,}")]
            facts.append((f"{FOCUS}s a frame", f"{found.focus_per_frame.mean():.2f}"))
        if found.scanned.any():
            scans = found.scans
            facts.append(("Points a scan", f"{scans.points[found.scanned].mean():,.0f}"))
            rings = scans.rings[found.scanned & (scans.rings > 0)]
            facts.append(("Rings", f"{rings.mean():.0f}" if len(rings) else "unknown"))
            for name, counts in (("all points", scans.intensity.sum(0)), ("cars", scans.car_intensity.sum(0))):
                mean = histogram_mean(counts, INTENSITIES)
                if isfinite(mean):
                    facts.append((f"Intensity, {name}", f"{mean:.3f}"))
                    facts.append((f"Zeros, {name}", f"{zero_share(counts):.1%}"))
        cells = Markup().join(fill("<div><dt>{}</dt><dd>{}</dd></div>", name, value) for name, value in facts)
        rows.append(fill('<dl class="{}">{}</dl>', style, cells))
    return Markup().join(rows)


def _absent(sets: Sequence[Collected]) -> str:
    notes = [f"{found.title}: {note}" for found in sets for note in found.notes]
    if not notes:
        return ""
    return fill('<ul class="absent">{}</ul>', Markup().join(fill("<li>{}</li>", note) for note in notes))


def _distances(distances: Sequence[Distance], sets: Sequence[Collected]) -> str:
    if len(sets) < 2:
        return ""
    if not distances:
        return Markup(
            "<section><h2>Distances</h2><p>The two sets have nothing in common that could be compared.</p></section>"
        )
    rows = []
    for item in distances:
        share = min(item.relative / _MOST_RELATIVE, 1)
        chance = item.chance / item.wasserstein * share if item.wasserstein > 0 else 0
        kolmogorov = "" if item.kolmogorov is None else f"{item.kolmogorov:.2f}"
        tick = fill('<b style="left:{:.1f}%"></b>', min(100 * chance, 100))
        bar = fill('<span class="meter"><i style="width:{:.1f}%"></i>{}</span>', 100 * share, tick)
        rows.append(
            fill(
                "<tr><th>{}</th><td>{}</td><td>{} – {}</td><td>{}</td><td>{}</td><td class=unit>{}</td><td>"
                "{:.2f}</td><td class=bar>{}</td><td>{}</td></tr>",
                item.title,
                _number(item.wasserstein),
                _number(item.low),
                _number(item.high),
                _number(item.chance),
                _number(item.floor),
                "" if item.unit == "1" else item.unit,
                item.relative,
                bar,
                kolmogorov,
            )
        )
    return fill(
        "<section><h2>Distances of {} from {}</h2><p>1-Wasserstein distance: how far, on average, one "
        "set’s values must move to become the other’s; of positions the mean over {} directions of the "
        "plane (sliced), distance × height with both axes in standard deviations. The interval is drawn "
        "over frames; frames of one drive resemble each other, so it is rather too narrow. Chance is "
        "what two sets of these sizes drawn from both together would show: the tick on the bar. The "
        "floor is how far some frames of {} (as many, at most half) are from its rest.</p><table><thead>"
        "<tr><th></th><th>distance</th><th>95 %</th><th>chance</th><th>floor</th><th></th><th>in sd of "
        "{}</th><th></th><th>KS</th></tr></thead><tbody>{}</tbody></table></section>",
        sets[0].title,
        sets[1].title,
        DIRECTIONS,
        sets[1].title,
        sets[1].title,
        Markup().join(rows),
    )


def _section(title: str, charts: Sequence[Chart], layout: str = "") -> str:
    if not charts:
        return ""
    figures = Markup("\n").join(
        fill(
            '<figure class="{}"><figcaption><h3>{}</h3><p>{}</p></figcaption>{}</figure>',
            chart.size,
            chart.title,
            chart.text,
            chart.svg,
        )
        for chart in charts
    )
    return fill('<section><h2>{}</h2><div class="charts {}">{}</div></section>', title, layout, figures)


def _dimensions(sets: Sequence[Collected]) -> str:
    rows = []
    for style, found in zip(STYLES, sets, strict=False):
        for name in sorted(set(found.objects.type.tolist()), key=lambda word: -found.classes[word]):
            size = found.objects.of_type(name).size
            cells = []
            for column in range(3):
                statistics = describe(size[:, column])
                cells.append(
                    fill(
                        "<td>{:.2f} ± {:.2f}</td><td>{:.2f} – {:.2f}</td>",
                        statistics["mean"],
                        statistics["sd"],
                        statistics["p5"],
                        statistics["p95"],
                    )
                )
            rows.append(
                fill(
                    '<tr><th class="{}">{}</th><th>{}</th><td>{:,}</td>{}</tr>',
                    style,
                    found.title,
                    name,
                    len(size),
                    Markup().join(cells),
                )
            )
    if not rows:
        return ""
    heads = Markup().join(fill("<th>{} (m)</th><th>5 – 95 %</th>", side) for side in ("length", "width", "height"))
    return fill(
        "<section><h2>Sizes by class</h2><table><thead><tr><th></th><th></th><th>objects</th>{}</tr>"
        "</thead><tbody>{}</tbody></table></section>",
        heads,
        Markup().join(rows),
    )


def _number(value: float) -> str:
    if not isfinite(value):
        return "—"
    if value >= 1000:
        return f"{value:,.0f}"
    return f"{value:.3f}" if value < 1 else f"{value:.2f}"


_STYLE = """
:root { --a: #ffb23e; --b: #5aa9ff; --c: #6fd08c; }
dl { display: flex; flex-wrap: wrap; align-items: end; gap: 6px 30px; margin: 0 0 12px; padding-left: 12px;
  border-left: 4px solid; }
dl.a { border-color: var(--a); } dl.b { border-color: var(--b); } dl.c { border-color: var(--c); }
dl div:first-child { min-width: 130px; } dl div:first-child dd { font-weight: 650; }
dl.a div:first-child dd, th.a { color: var(--a); } dl.b div:first-child dd, th.b { color: var(--b); }
dl.c div:first-child dd, th.c { color: var(--c); }
dt { color: var(--muted); font-size: 12px; } dd { margin: 0; font-size: 17px; font-variant-numeric: tabular-nums; }
section { border-top: 1px solid var(--line); padding-top: 22px; margin-top: 26px; }
.charts { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(420px, 100%), 1fr)); gap: 16px; }
.maps { grid-template-columns: repeat(3, minmax(0, 1fr)); }
.pairs { grid-template-columns: repeat(2, minmax(0, 1fr)); }
.wide { grid-column: span 2; } .full { grid-column: 1 / -1; }
figure { margin: 0; border: 1px solid var(--line); border-radius: 8px; background: var(--panel); display: flex;
  flex-direction: column; justify-content: flex-start; }
figcaption { padding: 10px 14px 2px; } figcaption p { font-size: 13px; }
svg.plot { display: block; width: 100%; height: auto; padding: 4px 8px 6px; }
svg text { fill: var(--muted); font-size: 12px; font-variant-numeric: tabular-nums; }
svg .label { font-size: 12.5px; } svg .value { font-size: 11px; fill: var(--text); }
.grid { stroke: var(--line); stroke-width: 1; fill: none; } .axis { stroke: #4a5568; fill: none; }
.line { fill: none; stroke-width: 1.8; stroke-linejoin: round; } .area { opacity: .16; } .band { opacity: .2; }
.bar { opacity: .85; }
.line.a { stroke: var(--a); } .line.b { stroke: var(--b); } .line.c { stroke: var(--c); }
.area.a, .band.a, .bar.a, .dot.a { fill: var(--a); } .area.b, .band.b, .bar.b, .dot.b { fill: var(--b); }
.area.c, .band.c, .bar.c, .dot.c { fill: var(--c); }
table { border-collapse: collapse; margin-top: 14px; font-variant-numeric: tabular-nums; font-size: 14px; }
th, td { padding: 4px 14px 4px 0; text-align: right; white-space: nowrap; border-bottom: 1px solid var(--line); }
thead th { color: var(--muted); font-weight: 500; font-size: 12.5px; }
tbody th { text-align: left; font-weight: 500; } .unit { text-align: left; color: var(--muted); padding-left: 0; }
td + td { padding-left: 10px; } td.unit { padding-left: 0; }
.meter { display: inline-block; position: relative; width: 220px; height: 11px; background: #1d2430;
  border-radius: 3px; }
.meter i { position: absolute; inset: 0 auto 0 0; background: var(--a); border-radius: 3px; }
.meter b { position: absolute; top: -2px; bottom: -2px; width: 2px; background: var(--text); }
.absent { margin: 10px 0 0; padding-left: 20px; color: var(--muted); }
@media (max-width: 900px) { .maps, .pairs { grid-template-columns: minmax(0, 1fr); } .wide { grid-column: auto; }
  section { overflow-x: auto; } }
"""
