"""The evidence: a heat map of all hypotheses, channel by covariate, each cell with the chart of its statistic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.resources import files

import numpy as np
from markupsafe import Markup

from cosim.discrepancy.evidence_matrix import EvidenceCell, EvidenceCurve, EvidenceGrid
from cosim.discrepancy.quantities import CHANNELS, SHOWN, channel_words, covariate_words, unit_words
from cosim.discrepancy.report.evidence_charts import (
    AXES,
    MOST_NAMES,
    categories_of,
    curve_chart,
    grid_chart,
    has_chart,
)
from cosim.discrepancy.settings import Settings
from cosim.discrepancy.unexplained import Unexplained
from cosim.report import figure, section
from cosim.report.html import fill
from cosim.report.phrases import p_words

_GROUND, _WARM, _HOT = (27, 33, 44), (214, 96, 36), (255, 226, 120)
_LEAST_TOP = 100.0  # gain of the brightest colour, at least


def evidence_section(
    cells: Sequence[EvidenceCell], listed: Sequence[Unexplained], settings: Settings, *, has_findings: bool
) -> str:
    """HTML; empty without cells.

    Args:
        cells: of the matrix.
        listed: dependences that remain unexplained.
        settings: level and least gain, above which a cell counts as significant.
        has_findings: whether the initial and the final model differ.
    """
    best = _strongest(cells)
    if not best:
        return ""
    names = {key: f"{key[0]}:{'+'.join(key[1])}" for key in best}
    top = max(_LEAST_TOP, *(max(cell.gain, cell.gain_after) for cell in best.values()))
    blocks = {
        "One covariate": [key for key in best if not _is_shared(key) and len(key[1]) == 1],
        "Two covariates": [key for key in best if len(key[1]) > 1],
        "Errors that beams share": [key for key in best if _is_shared(key)],
    }
    view = _View(settings, top, has_findings, frozenset((row.channel, row.covariates) for row in listed))
    tables = Markup().join(_table(title, keys, best, names, view) for title, keys in blocks.items() if keys)
    first = max(best, key=lambda key: _rank(best[key], settings))
    charts = Markup().join(_chart(cell, names[key], view, is_shown=key == first) for key, cell in best.items())
    text = (
        "Each cell is a hypothesis: the channel (row) depends on the covariate (column). "
        + ("Left half: with the initial model; right half: with all findings. " if has_findings else "")
        + fill(
            "Colour: gain, the log-likelihood that the dependence gains on clusters of beams that took no "
            "part in its fit, on a logarithmic scale. A dot marks cells that are significant: family-wise p "
            "≤ {:g} and a gain of at least {:g}. Poses, objects, map and all fitted parameters are "
            "eliminated. Empty cells were tested in a first pass and are too weak to be significant, or are "
            "not defined. <b>Click a cell for its chart.</b>",
            settings.selection.level,
            settings.selection.least_gain,
        )
    )
    body = fill(
        '<div class="evidence"><div>{}{}</div><div class="evidence-charts">{}</div></div>', tables, _scale(top), charts
    )
    script = (files("cosim.discrepancy.report") / "evidence.js").read_text(encoding="utf-8")
    return section("Evidence", body, Markup(f"<script>{script}</script>"), text=text, anchor="evidence")


def evidence_style() -> str:
    """CSS of what `evidence_section` returns."""
    return "\n" + (files("cosim.discrepancy.report") / "evidence.css").read_text(encoding="utf-8")


def is_significant(gain: float, p_value: float, settings: Settings) -> bool:
    """Whether a cell is significant: the rule by which terms are selected."""
    return p_value <= settings.selection.level and gain >= settings.selection.least_gain


_Key = tuple[str, tuple[str, ...]]


@dataclass(frozen=True)
class _View:
    """Display settings common to all cells.

    Attributes:
        settings: numeric choices.
        top: gain of the brightest colour.
        has_findings: whether the initial and the final model differ.
        listed: cells that remain unexplained.
    """

    settings: Settings
    top: float
    has_findings: bool
    listed: frozenset[_Key]


def _strongest(cells: Sequence[EvidenceCell]) -> dict[_Key, EvidenceCell]:
    """Cell with the largest gain for each channel and covariates; classes of objects and waves are merged."""
    best: dict[_Key, EvidenceCell] = {}
    for cell in cells:
        key = cell.channel, cell.covariates
        if key not in best or max(cell.gain, cell.gain_after) > max(best[key].gain, best[key].gain_after):
            best[key] = cell
    return best


def _is_shared(key: _Key) -> bool:
    return key[0].startswith("shared_")


def _rank(cell: EvidenceCell, settings: Settings) -> tuple[bool, float, float]:
    """Sort key by importance: significance in the final model, then gain in the initial model; means first."""
    after = cell.gain_after if is_significant(cell.gain_after, cell.p_value_after, settings) else 0.0
    is_mean_curve = cell.before is not None and not cell.channel.endswith("_variance")
    return after > 0, after, cell.gain if is_mean_curve else 0.0


def _table(
    title: str, keys: Sequence[_Key], best: dict[_Key, EvidenceCell], names: dict[_Key, str], view: _View
) -> str:
    order = {name: position for position, name in enumerate(SHOWN)}
    columns = sorted(dict.fromkeys(key[1] for key in keys), key=lambda on: [order.get(name, 99) for name in on])
    channels = [name for name in CHANNELS if any(key[0] == name for key in keys)]
    is_shared = _is_shared(keys[0])
    heads = Markup().join(fill("<th><span>{}</span></th>", _column_words(on, is_shared=is_shared)) for on in columns)
    rows = []
    for channel in channels:
        tds = Markup().join(
            _cell(best[channel, on], names[channel, on], view) if (channel, on) in best else Markup("<td></td>")
            for on in columns
        )
        rows.append(fill("<tr><th>{}</th>{}</tr>", channel_words(channel), tds))
    return fill(
        '<table class="heat"><caption>{}</caption><thead><tr><th></th>{}</tr></thead><tbody>{}</tbody></table>',
        title,
        heads,
        Markup().join(rows),
    )


def _column_words(covariates: tuple[str, ...], *, is_shared: bool) -> str:
    if is_shared:
        return unit_words(covariates[0])
    return " × ".join(covariate_words(name) for name in covariates)


def _cell(cell: EvidenceCell, name: str, view: _View) -> str:
    sides = [(cell.gain, cell.p_value)] if view.has_findings else []
    sides.append((cell.gain_after, cell.p_value_after))
    colours = [_colour(gain, view.top) for gain, _ in sides]
    marks = [Markup("<i></i>") if is_significant(*side, view.settings) else Markup("<b></b>") for side in sides]
    if marks[-1] == Markup("<i></i>") and (cell.channel, cell.covariates) not in view.listed:
        marks[-1] = Markup('<i class="weak"></i>')
    dots = Markup().join(marks)
    words = f"{_title(cell)}: {_figures(cell, view)}"
    background = f"linear-gradient(90deg,{colours[0]} 50%,{colours[-1]} 50%)"
    return fill(
        '<td><button type="button" data-cell="{}" style="background:{}" title="{}" aria-label="{}">{}</button></td>',
        name,
        background,
        words,
        words,
        dots,
    )


def _title(cell: EvidenceCell) -> str:
    channel = channel_words(cell.channel)
    channel = channel[0].upper() + channel[1:]
    if cell.channel.startswith("shared_"):
        return f"{channel} shared by each {unit_words(cell.covariates[0])}"
    if cell.covariates == ("constant",):
        return f"{channel}, the same for all beams"
    words = f"{channel} by {' and '.join(covariate_words(name) for name in cell.covariates)}"
    return f"{words} ({detail})" if (detail := _detail(cell)) else words


def _detail(cell: EvidenceCell) -> str:
    """Class of objects, number of waves or frequency, which the names of the covariates do not contain."""
    if cell.covariates[-1] in ("object_size", "object_place"):
        return cell.name.removeprefix(f"{cell.channel} by ").rpartition(" ")[0]
    if cell.name.endswith(("waves per turn", "Hz")):
        return cell.name.removeprefix(f"{cell.channel} ").removeprefix("by scan: ")
    return ""


def _figures(cell: EvidenceCell, view: _View) -> str:
    before = _side(cell.gain, cell.p_value, cell.before)
    after = _side(cell.gain_after, cell.p_value_after, cell.after)
    if not view.has_findings:
        return after
    return f"initial model: {before}; with all findings: {after}"


def _side(gain: float, p_value: float, curve: EvidenceCurve | EvidenceGrid | None) -> str:
    """Gain and p-value of one model; empty for cells that the screening excluded."""
    is_left_out = gain == 0 and p_value == 1 and curve is None
    return "not significant in the first pass" if is_left_out else f"gain {gain:.1f}, {p_words(p_value)}"


def _colour(gain: float, top: float) -> str:
    """Logarithmic colour: dark for gains up to 1, bright for the largest gain."""
    share = float(np.clip(np.log10(max(gain, 1.0)) / np.log10(top), 0, 1))
    low, high, part = (_GROUND, _WARM, 2 * share) if share < 0.5 else (_WARM, _HOT, 2 * share - 1)
    return "rgb({},{},{})".format(*(round(a + part * (b - a)) for a, b in zip(low, high, strict=True)))


def _scale(top: float) -> str:
    gains = [10.0**decade for decade in range(int(np.floor(np.log10(top))) + 1)]
    samples = Markup().join(
        fill(
            '<span><i style="background:{}"></i> gain {}</span>',
            _colour(gain, top),
            "≤ 1" if gain == 1 else f"{gain:g}",
        )
        for gain in gains
    )
    return fill(
        '<div class="legend">{}<span><u></u> significant</span><span><u class="weak"></u> significant by '
        "this linear test, but not after an exact refit with all findings</span></div>",
        samples,
    )


def _chart(cell: EvidenceCell, name: str, view: _View, *, is_shown: bool) -> str:
    figures = _figures(cell, view)
    text = f"{figures[0].upper()}{figures[1:]}."
    if cell.is_rejected:
        text += " An exact refit with this term gains no more than chance: it was not added."
    if not view.has_findings:
        cell = replace(cell, before=None)
    if not has_chart(cell):
        text += " This hypothesis has no chart over bins: gain and p are its whole statistic."
        body = ""
    elif isinstance(cell.after, EvidenceGrid) or isinstance(cell.before, EvidenceGrid):
        text, body = _grids(cell, text)
    else:
        text, body = _curves(cell, text, view)
    hidden = "" if is_shown else Markup(" hidden")
    return fill('<div data-chart="{}"{}>{}</div>', name, hidden, figure(_title(cell), text, body))


def _curves(cell: EvidenceCell, text: str, view: _View) -> tuple[str, str]:
    """Words and chart of coefficients by one covariate."""
    text += " Coefficients of one Gauss–Newton step by bin, with two standard errors: the statistic of the test"
    sides = {"before": (cell.before, "blue: initial model"), "after": (cell.after, "orange: with all findings")}
    sides = {name: words for name, (curve, words) in sides.items() if curve is not None and view.has_findings}
    text += Markup().join(fill('; <span class="{}">{}</span>', name, words) for name, words in sides.items())
    names = categories_of([curve for curve in (cell.before, cell.after) if isinstance(curve, EvidenceCurve)])
    text += f"; the {MOST_NAMES} most significant of {len(names)} categories." if len(names) > MOST_NAMES else "."
    return text, curve_chart(cell, _title(cell))


def _grids(cell: EvidenceCell, text: str) -> tuple[str, str]:
    """Words and charts of coefficients by two covariates: the initial model above, the final one below."""
    text += (
        f" Colour: {AXES[cell.channel].label}, coefficient of one Gauss–Newton step by pair of bins over its standard "
        "error; orange positive, blue negative, full colour from ±6. Bins have equal numbers of beams or equal width; "
        "values with two standard errors are shown above each tile."
    )
    grids = [("initial model", cell.before), ("with all findings", cell.after)]
    drawn = [(words, grid) for words, grid in grids if isinstance(grid, EvidenceGrid)]
    parts = [
        (fill('<p class="small">{}</p>', words.capitalize()) if len(drawn) > 1 else "")
        + grid_chart(cell.channel, cell.covariates, grid, _title(cell))
        for words, grid in drawn
    ]
    return text, Markup().join(parts)
