"""Charts of residuals beside the scans that they are of: a click on a bin shows its beams."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files

from cosim.discrepancy.aligned import Judged
from cosim.discrepancy.report.beams import Beams
from cosim.discrepancy.report.bins import USUAL, Bins, bins_of
from cosim.discrepancy.report.residual_charts import Chart, all_charts, drawn, scale_of
from cosim.discrepancy.report.scan_view import scan_view
from cosim.report import button, legend, section


@dataclass(frozen=True, eq=False)
class Explored:
    """What a page shows of judged frames.

    Attributes:
        beams: of the frames.
        bins: of covariates, by name.
        charts: by channel.
    """

    beams: Beams
    bins: dict[str, Bins]
    charts: dict[str, list[Chart]]

    @classmethod
    def of(cls, judged: Judged | None, shown: int, more: Collection[str] = ()) -> Explored | None:
        """Of judged frames, `shown` of them whole; `more` names covariates beside the usual ones."""
        return None if judged is None else cls.of_beams(Beams.of(judged, shown), more)

    @classmethod
    def of_beams(cls, beams: Beams, more: Collection[str] = ()) -> Explored:
        """Of beams that have been gathered."""
        bins = bins_of(beams.rows, (*USUAL, *more))
        return cls(beams, bins, all_charts(beams.rows, bins, beams.is_one))

    @property
    def count(self) -> int:
        """How many charts there are."""
        return sum(len(charts) for charts in self.charts.values())

    @property
    def left(self) -> tuple[Chart, ...]:
        """Charts that show a dependence in the end, the surest first."""
        found = [one for charts in self.charts.values() for one in charts if one.shows(one.after, self.count)]
        return tuple(sorted(found, key=lambda one: one.after.p_value))


def explorer_section(found: Explored | None, sides: Sequence[str], *, text: str) -> str:
    """HTML; empty without frames.

    Args:
        found: what is shown.
        sides: words on before and after, as in legends.
        text: what was taken out of residuals (HTML).
    """
    if found is None or not found.charts:
        return ""
    told = sides[-1:] if found.beams.is_one else sides
    first = next(iter(found.charts))
    tabs = "".join(button(charts[0].channel.title, name == first, tab=name) for name, charts in found.charts.items())
    panels = "".join(_panel(charts, found.count, name == first) for name, charts in found.charts.items())
    colours = legend([(f"var(--{style})", escape(word)) for style, word in zip("ba"[-len(told) :], told, strict=True)])
    picks = f'<div class="picks" role="group" aria-label="channel">{tabs}</div>'
    left = f'<div class="residuals">{picks}{colours}{panels}</div>'
    right = scan_view(found.beams.scans, found.bins, told)
    body = f'<div class="explore">{left}{right}</div>'
    return section("Residuals, and the beams that they are of", body, text=text, anchor="residuals")


def _panel(charts: Sequence[Chart], count: int, is_shown: bool) -> str:
    top, channel = scale_of(charts), charts[0].channel
    figures = "".join(drawn(one, top, count) for one in charts)
    hidden = "" if is_shown else " hidden"
    return (
        f'<div data-panel="{channel.name}"{hidden}><p>{channel.signs} Those with most to tell first, one scale.</p>'
        f'<div class="charts">{figures}</div></div>'
    )


def explorer_style() -> str:
    """CSS of what `explorer_section` gives."""
    return "\n" + (files("cosim.discrepancy.report") / "explorer.css").read_text(encoding="utf-8")
