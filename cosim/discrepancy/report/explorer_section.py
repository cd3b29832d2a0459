"""Residuals of single beams: charts by covariate whose bins can be selected in whole scans. An illustration."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from importlib.resources import files

from markupsafe import Markup

from cosim.discrepancy.budget import FramePairs
from cosim.discrepancy.report.beams import BeamResiduals
from cosim.discrepancy.report.bins import USUAL, Bins, bins_of
from cosim.discrepancy.report.residual_charts import ResidualChart, all_charts, draw_chart, scale_of
from cosim.discrepancy.report.scan_view import scan_view
from cosim.report import button, legend, section
from cosim.report.html import fill


@dataclass(frozen=True, eq=False)
class Explored:
    """Residuals of validation frames for display.

    Attributes:
        beams: beams of the frames.
        bins: bins of covariates by name.
        charts: charts by channel.
    """

    beams: BeamResiduals
    bins: dict[str, Bins]
    charts: dict[str, list[ResidualChart]]

    @classmethod
    def of(cls, frame_pairs: FramePairs | None, shown: int, more: Collection[str] = ()) -> Explored | None:
        """Residuals of validation frames, `shown` of them as whole scans; `more`: further covariates."""
        if frame_pairs is None:
            return None
        names = tuple(dict.fromkeys((*USUAL, *more)))
        beams = BeamResiduals.of(frame_pairs, shown, names)
        bins = bins_of(beams.rows, names)
        return cls(beams, bins, all_charts(beams.rows, bins, beams.is_one))


def explorer_section(explored: Explored | None, sides: Sequence[str], *, text: str) -> str:
    """Build the HTML of the section; empty without frames.

    Args:
        explored: residuals to show.
        sides: names of before and after in legends.
        text: HTML text below the heading.
    """
    if explored is None or not explored.charts:
        return ""
    names = sides[-1:] if explored.beams.is_one else sides
    first = next(iter(explored.charts))
    tabs = Markup().join(
        button(charts[0].channel.title, name == first, tab=name) for name, charts in explored.charts.items()
    )
    panels = Markup().join(_panel(charts, name == first) for name, charts in explored.charts.items())
    colours = legend([(f"var(--{style})", word) for style, word in zip("ba"[-len(names) :], names, strict=True)])
    picks = fill('<div class="picks" role="group" aria-label="channel">{}</div>', tabs)
    left = fill('<div class="residuals">{}{}{}</div>', picks, colours, panels)
    right = scan_view(explored.beams.scans, explored.bins, names)
    body = fill('<div class="explore">{}{}</div>', left, right)
    return section("Residuals beam by beam", body, text=text, anchor="residuals")


def _panel(charts: Sequence[ResidualChart], is_shown: bool) -> str:
    top, channel = scale_of(charts), charts[0].channel
    figures = Markup().join(draw_chart(chart, top) for chart in charts)
    hidden = "" if is_shown else Markup(" hidden")
    return fill(
        '<div data-panel="{}"{}><p>{} Largest first, all on one scale.</p><div class="charts">{}</div></div>',
        channel.name,
        hidden,
        channel.signs,
        figures,
    )


def explorer_style() -> str:
    """CSS of what `explorer_section` returns."""
    return "\n" + (files("cosim.discrepancy.report") / "explorer.css").read_text(encoding="utf-8")
