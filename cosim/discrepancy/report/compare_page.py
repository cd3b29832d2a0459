"""The page of `cosim compare`: how far, where, what it depends on, and what could not be known."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from cosim.discrepancy.compare import Comparison
from cosim.discrepancy.report.cloud import clouds
from cosim.discrepancy.report.gathered import Rows, Scan
from cosim.discrepancy.report.notes_section import notes_section
from cosim.discrepancy.report.residual_charts import CHANNELS, WORDS, ChannelOf, ResidualChart, residual_charts
from cosim.discrepancy.report.residual_image import legend, limit_of, residual_svg
from cosim.discrepancy.report.style import STYLE
from cosim.discrepancy.scores import SCALES
from cosim.discrepancy.slices import Slice
from cosim.report.html import document

_CHANNEL_WORDS = {"range": "ranges", "intensity": "intensities", "drop": "returns", "spurious": "spurious points"}
_WORTH_A_WORD = 0.05  # share of the excess
_CLEAR = {"cm": 0.1, "": 0.003, "%": 0.3}  # dependences below this are not worth a word


def format_comparison(found: Comparison, rows: Rows, scans: Sequence[Scan], command: str) -> str:
    """The HTML text.

    Args:
        found: the comparison.
        rows: for the charts.
        scans: frames shown whole.
        command: what to run next, to be copied.
    """
    charts = {channel.title: residual_charts(rows, channel) for channel in CHANNELS}
    title = f"{escape(found.sensor)} against {escape(found.drive)}"
    sections = [
        f"<header><h1>{title}</h1>{_verdict(found, charts, command)}{_figures(found)}</header>",
        _slices(found.slices),
        _frames(list(scans)),
        *(_dependences(channel, charts[channel.title]) for channel in CHANNELS),
        _notes(found),
    ]
    return document(f"{found.sensor} against {found.drive}", sections, style=STYLE, generator="cosim compare")


def _verdict(found: Comparison, charts: dict[str, list[ResidualChart]], command: str) -> str:
    run = f'<p class="next">What is missing: <code>{escape(command)}</code></p>'
    if found.floor is None:
        return f'<p class="verdict">Error {found.error:.3g}; what noise alone would make is not known.</p>{run}'
    floor = found.floor.error
    if found.at_floor:
        said = (
            f'<span class="good">At the noise floor.</span> The error {found.error:.3g} is what noise alone makes '
            f"({floor:.3g}): by this number the model is as good as these measurements can tell."
        )
        small = (
            f'<p class="next">Small effects can hide in noise; this asks for them: <code>{escape(command)}</code></p>'
        )
        return f'<p class="verdict">{said}</p>{small}'
    above = found.error / floor if floor > 0 else float("inf")
    share = f"{above - 1:.0%} above" if above < 2 else f"{above:.1f} times"
    said = '<span class="bad">Above the noise floor.</span> '
    said += f"The error {found.error:.3g} is {share} what noise alone makes ({floor:.3g})."
    if found.slices:
        run = f'<p class="next">Worst place: {escape(str(found.slices[0]))}.</p>{run}'
    return f'<p class="verdict">{said}{_excess(found, charts)}</p>{run}'


def _excess(found: Comparison, charts: dict[str, list[ResidualChart]]) -> str:
    """The channels in which the error lies above the floor, with what is off in each."""
    excess = found.excess
    total = sum(excess.values())
    order = [name for name in excess if excess[name] > _WORTH_A_WORD * total]
    said = [
        f"<b>{_CHANNEL_WORDS[name]}</b> ({excess[name] / total:.0%}): {_off(name, found, charts)}" for name in order
    ]
    return f" The excess lies in {'; '.join(said)}." if said else ""


def _off(name: str, found: Comparison, charts: dict[str, list[ResidualChart]]) -> str:
    t = found.totals
    if name == "spurious":
        return f"{t.spurious / t.frames:,.0f} points a frame where the model has {t.foreseen / t.frames:,.0f}"
    channel = CHANNELS[("range", "intensity", "drop").index(name)]
    mean = {
        "range": f"on average {100 * t.signed / max(t.matched, 1):+.2f} cm",
        "intensity": f"on average {t.intensity_signed / max(t.lit, 1) + 0.0:+.3f}",
        "drop": f"{t.dropped / t.frames:,.0f} lost a frame where the model loses {t.foreseen_drops / t.frames:,.0f}",
    }[name]
    leading = [chart for chart in charts[channel.title] if chart.strength > _CLEAR[channel.unit]][:1]
    return ", ".join(
        [mean, *(f"varying with {WORDS[one.covariate]} ({_reach(one.strength, channel)})" for one in leading)]
    )


def _figures(found: Comparison) -> str:
    json, parts = found.to_json()["channels"], found.totals.parts()
    floor = found.floor.parts if found.floor else {}

    def score(name: str) -> str:
        own = f"{parts[name] / SCALES[name]:.2f}"
        return f"{own} <small>floor {floor[name] / SCALES[name]:.2f}</small>" if name in floor else own

    items = [("Frames", f"{found.totals.frames:,}"), ("Points", f"{found.totals.points:,}")]
    items += [(f"{name} score", score(name)) for name in parts]
    ranges = json["range"]
    items += [
        ("Range bias", f"{100 * ranges['bias_m']:+.2f} cm"),
        ("Range RMSE", f"{100 * ranges['rmse_m']:.2f} cm"),
        ("Range MAE", f"{100 * ranges['mae_m']:.2f} cm"),
    ]
    if "intensity" in json:
        items += [
            ("Intensity bias", f"{round(json['intensity']['bias'], 4) + 0.0:+.4f}"),
            ("Intensity RMSE", f"{json['intensity']['rmse']:.4f}"),
        ]
    items += [
        ("Lost returns", f"{found.totals.dropped / found.totals.frames:,.0f} <small>a frame</small>"),
        ("Spurious", f"{json['spurious']['per_frame']:,.1f} <small>a frame</small>"),
    ]
    cells = "".join(
        f"<div><dt>{escape(name[0].upper() + name[1:])}</dt><dd>{value}</dd></div>" for name, value in items
    )
    how = "The error is the mean of the scores; each is a mean over beams in units of its scale."
    return f"<dl>{cells}</dl><p>{how}</p>"


def _slices(slices: Sequence[Slice]) -> str:
    if not slices:
        return ""
    rows = "".join(
        f'<tr><th>{escape(one.where)}</th><td class="words">{one.channel}</td><td>{_residual(one)}</td>'
        f"<td>{_spread(one)}</td><td>{one.beams:,}</td>"
        f'<td><span class="meter"><i style="width:{min(100 * one.share, 100):.1f}%"></i></span> '
        f"{one.share:.1%}</td></tr>"
        for one in slices
    )
    return (
        "<section><h2>Where it is worst</h2><table><thead><tr><th></th><th></th><th>mean residual</th><th>spread</th>"
        f"<th>beams</th><th>share of the channel’s error</th></tr></thead><tbody>{rows}</tbody></table></section>"
    )


def _residual(one: Slice) -> str:
    return {
        "range": f"{100 * one.bias:+.2f} cm",
        "drop": f"{one.bias:+.1%} returns",
        "intensity": f"{one.bias:+.4f}",
    }[one.channel]


def _spread(one: Slice) -> str:
    return {"range": f"{100 * one.spread:.2f} cm", "drop": "", "intensity": f"{one.spread:.4f}"}[one.channel]


def _frames(scans: list[Scan]) -> str:
    if not scans:
        return ""
    limit_m = limit_of(scans)
    buttons = "".join(
        f'<button data-show="{escape(scan.name)}" aria-pressed="{str(row == 0).lower()}">frame {escape(scan.name)}: '
        f"error {scan.error:.3f}{', the worst' if row == 0 and len(scans) > 1 else ''}</button>"
        for row, scan in enumerate(scans)
    )
    pictures = "".join(
        f'<div data-frame="{escape(scan.name)}"{"" if row == 0 else " hidden"}>{residual_svg(scan, limit_m)}</div>'
        for row, scan in enumerate(scans)
    )
    return (
        f'<section><h2>Range residuals, beam by beam</h2><div class="frames">{buttons}</div>'
        '<figure class="full"><figcaption><h3>The scan as its sensor took it</h3>'
        f"<p>A row a ring, 0 on top; the front in the middle.</p></figcaption>"
        f"{pictures}{legend(limit_m)}</figure>{clouds(scans, limit_m)}</section>"
    )


def _dependences(channel: ChannelOf, charts: Sequence[ResidualChart]) -> str:
    if not charts:
        return ""
    telling = [chart for chart in charts if max(chart.strength, chart.apparent) > _CLEAR[channel.unit]]
    flat = [chart for chart in charts if chart not in telling]
    shown = f'<div class="charts">{_drawn(telling, channel)}</div>' if telling else ""
    if flat:
        names = ", ".join(WORDS[chart.covariate] for chart in flat)
        shown += f"<details><summary>no dependence beyond chance on {names}</summary>"
        shown += f'<div class="charts">{_drawn(flat, channel)}</div></details>'
    return (
        f"<section><h2>{channel.title}: what the residual depends on</h2><p>{channel.signs} Means of equally filled "
        "bins with 95 % bands that allow for errors which the beams of one frame share; strongest first, one scale."
        f"</p>{shown}</section>"
    )


def _drawn(charts: Sequence[ResidualChart], channel: ChannelOf) -> str:
    return "".join(
        f"<figure><figcaption><h3>against {WORDS[chart.covariate]}</h3><p>{_caption(chart, channel)}</p></figcaption>"
        f"{chart.svg}</figure>"
        for chart in charts
    )


def _caption(chart: ResidualChart, channel: ChannelOf) -> str:
    if chart.strength > _CLEAR[channel.unit]:
        return f"varies by {_reach(chart.strength, channel)}"
    if chart.apparent > _CLEAR[channel.unit]:
        return f"varies by {_reach(chart.apparent, channel)}, but no more than these few frames differ"
    return "no dependence beyond chance"


def _reach(size: float, channel: ChannelOf) -> str:
    return f"±{size:.1f} {channel.unit}" if channel.unit else f"±{size:.3f}"


def _notes(found: Comparison) -> str:
    said = [*found.notes]
    if found.floor is not None:
        said.append(f"the noise floor is {found.floor.how}")
    return notes_section(said)
