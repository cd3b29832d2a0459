"""Effects outside the catalogue: unknown effects with formulas and charts, and dependences that remain unexplained."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from markupsafe import Markup

from cosim.discrepancy.diagnosis import Diagnosis
from cosim.discrepancy.evidence_matrix import EvidenceGrid
from cosim.discrepancy.quantities import channel_words, covariate_words, dependence_words, shown, unit_words
from cosim.discrepancy.report.beams import LAYOUT
from cosim.discrepancy.report.evidence_charts import AXES, grid_chart, sets_scale
from cosim.discrepancy.report.findings_section import change_words
from cosim.discrepancy.unexplained import Unexplained
from cosim.discrepancy.unknown.effect import Factor, UnknownEffect
from cosim.discrepancy.words import UNDETERMINED, table_words
from cosim.report import button, figure, section, table
from cosim.report.html import fill
from cosim.report.phrases import p_cell, p_words, round_with_error
from cosim.report.plot import Axis, Plot


def unexplained_section(diagnosis: Diagnosis) -> str:
    """HTML: significant dependences that remain; empty without any."""
    keys = {(cell.channel, cell.covariates) for cell in diagnosis.evidence}
    rows = [
        [
            channel_words(row.channel), _on(row), size_words(row), p_cell(row.p_value),
            _opener(row, keys),
        ]
        for row in diagnosis.unexplained
    ]  # fmt: skip
    text = (
        "Still significant with the final model and explained by no finding. p is family-wise: the probability that "
        "any hypothesis would be this significant if nothing were missing. Size: root mean square of the change."
    )
    listed = table(["channel", "by", "size", "p", ""], rows, words=(1,))
    return section("Unexplained dependences", listed, text=text if rows else "", anchor="unexplained")


def _opener(row: Unexplained, keys: Collection[tuple[str, tuple[str, ...]]]) -> str:
    """A button that opens the chart of the evidence; empty for effects."""
    if row.resembles or (row.channel, row.covariates) not in keys:
        return ""
    return button("chart", open=f"{row.channel}:{'+'.join(row.covariates)}")


def size_words(one: Unexplained) -> str:
    """The root mean square of a dependence with its unit."""
    if not np.isfinite(one.size) or one.size == 0:
        return "–"
    if one.unit == "m":
        return f"{100 * one.size:.2g} cm"
    return f"{one.size:.2g}" if one.channel == "intensity" else f"{100 * one.size:.2g} %"


def _on(row: Unexplained) -> str:
    if row.resembles:
        return f"similar to {row.resembles}"
    if row.channel.startswith("shared_"):
        return f"each {unit_words(row.covariates[0])}"
    return " and ".join(covariate_words(name) for name in row.covariates)


def unknown_section(diagnosis: Diagnosis) -> str:
    """HTML: formulas, fitted parameters, plug-ins and curves of unknown effects; empty without any."""
    if not diagnosis.unknowns:
        return ""
    changes = {change.name: change for change in diagnosis.changes}
    parts = (_unknown(unknown, change_words(changes.get(unknown.name))) for unknown in diagnosis.unknowns)
    return section("Effects that are in no catalogue", *parts)


def _unknown(unknown: UnknownEffect, change: str) -> str:
    curve = unknown.curve
    fit = fill("<p>The formula explains {} of the curve.</p>", _share(unknown.r2)) if unknown.terms else ""
    fit = fill("<p>No product of two formulas describes it: its values by bin are used.</p>") if unknown.grid else fit
    fit = fill("<p>The curve does not differ from a constant.</p>") if unknown.is_constant else fit
    parameters = ", ".join(_parameter(name, value, unknown) for name, value in unknown.params.items())
    parameters = fill("<p>Fitted together with everything else: {}.</p>", parameters) if parameters else ""
    law = table_words(unknown) or unknown.form
    details = "; ".join(filter(None, (f"in {curve.unit}" if curve.unit else "", unknown.variables)))
    variables = fill("<p>{}</p>", details) if details else ""  # starts with a unit or the name of a variable
    head = dependence_words(curve.channel, curve.covariates)
    error = fill("<p>Aligned error {}</p>", change.replace(Markup("<br>"), "; ")) if change else ""
    charts = Markup().join(_factor_chart(unknown, factor) for factor in unknown.factors)
    return fill(
        '<h3>{}, {}</h3><p class="formula">{}</p>{}{}{}{}<p>The improved sensor contains it as <code>'
        "{}.py</code>: a plug-in to rename and edit when its cause is known.</p>{}{}",
        head[0].upper() + head[1:],
        p_words(curve.p_value),
        law,
        variables,
        fit,
        parameters,
        error,
        unknown.name,
        charts or _grid_chart(unknown),
        _object_table(unknown),
    )


def _share(r2: float) -> str:
    return f"{r2:.1%}" if r2 > 0 else "nothing"


def _parameter(name: str, value: float, unknown: UnknownEffect) -> str:
    interval, unit = unknown.ci95.get(name), unknown.parameter_units.get(name, "")
    unit = f" {unit}" if unit else ""
    if interval is None:
        return f"{name} {value:.3g}{unit}".replace("-", "−")
    half = (interval[1] - interval[0]) / 2
    if not np.isfinite(half):
        return f"{name} {UNDETERMINED}"
    number, error = round_with_error(value, half)
    return f"{name} {number} ± {error}{unit}".replace("-", "−")


def _factor_chart(unknown: UnknownEffect, factor: Factor) -> str:
    """The curve over one covariate with two standard errors, and the fitted term; both factors of a pair in turn."""
    is_pair, is_first = len(unknown.factors) > 1, factor is unknown.factors[0]
    is_first = is_first or factor.covariate == unknown.curve.covariates[0]
    channel, covariate = AXES[unknown.curve.channel], shown(factor.covariate)
    convert = channel.convert if is_first else np.asarray
    y, sigma = np.asarray(factor.y, float), np.asarray(factor.sigma, float)
    known = np.isfinite(y) & np.isfinite(sigma)
    if not known.any():
        return ""
    label = f"{covariate.words} ({covariate.unit})" if covariate.unit else covariate.words
    if isinstance(factor.x, tuple):
        order = np.argsort(np.where(known, -np.abs(y / np.maximum(sigma, 1e-12)), 1.0), kind="stable")
        order = order[: min(LAYOUT.values, int(known.sum()))]
        x, y, sigma = np.arange(len(order), dtype=float), y[order], sigma[order]
        axis = Axis(-0.5, len(order) - 0.5, label, names=[factor.x[row].replace("_", " ") for row in order])
    else:
        x, y, sigma = np.asarray(factor.x, float)[known], y[known], sigma[known]
        ends = covariate.factor * np.array([x.min(), x.max() if np.ptp(x) > 0 else x.min() + 1])
        axis = Axis(float(ends[0]), float(ends[1]), label)
    bottom, middle, above = convert(y - 2 * sigma), convert(y), convert(y + 2 * sigma)
    usual = sets_scale(y, sigma)
    low, high = min(float(bottom[usual].min()), 0.0), max(float(above[usual].max()), 0.0)
    pad = 0.1 * (high - low) or 1e-9
    upright = Axis(low - pad, high + pad, channel.label if is_first else f"factor by {covariate.words.split(',')[0]}")
    plot = Plot(axis, upright, f"{upright.label} by {label}", 900, 320)
    plot.line(np.array([axis.low, axis.high]), np.zeros(2), "zero")
    if isinstance(factor.x, tuple):
        for position, *ends in zip(x, bottom, above, strict=True):
            plot.line(np.full(2, position), np.array(ends), "a")
        plot.line(x, middle, "none", dots=True)
        text = "Measured change by category, with two standard errors."
    else:
        plot.band(covariate.factor * x, bottom, above, "a")
        plot.line(covariate.factor * x, middle, "a", dots=True)
        fine = np.linspace(float(x.min()), float(x.max()), 300)
        plot.line(covariate.factor * fine, convert(factor.term.evaluate(fine)), "b")
        text = "Dots: change by bin next to all other findings, with two standard errors. Blue: the fitted term."
    if is_pair:
        text += " The effect is the product of both factors."
    return figure("", text, plot.svg(), kind="full", width_px=900)


def _grid_chart(unknown: UnknownEffect) -> str:
    """The measured values by pairs of bins of two covariates; empty for other effects."""
    curve = unknown.curve
    if unknown.grid is None:
        return ""
    head = dependence_words(curve.channel, curve.covariates)
    text = (
        f"Colour: {AXES[curve.channel].label} over its standard error; orange positive, blue negative, full colour "
        "from ±6. Values with two standard errors are shown above each tile."
    )
    grid = EvidenceGrid(curve.x[0], curve.x[1], curve.y, curve.sigma)
    drawn = grid_chart(curve.channel, curve.covariates, grid, head)
    return figure("", text, drawn, kind="full", width_px=760)


def _object_table(unknown: UnknownEffect) -> str:
    """Table of the errors of size or position of each class along the axes of its objects [cm]."""
    curve = unknown.curve
    if not curve.is_of_objects:
        return ""
    types, axes = (tuple(map(str, axis)) for axis in curve.x)
    rows = [
        [
            kind,
            *(f"{100 * y:+.1f} ± {200 * error:.1f} cm".replace("-", "−") for y, error in zip(*row, strict=True)),
        ]
        for kind, *row in zip(types, curve.y, curve.sigma, strict=True)
    ]
    return table(["class", *axes], rows)
