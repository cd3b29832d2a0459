"""What no effect of the catalogue explains: its shape, formula and plug-in."""

from __future__ import annotations

from html import escape

import numpy as np

from cosim.discrepancy.diagnosis import Diagnosis
from cosim.discrepancy.report.layout import LAYOUT
from cosim.discrepancy.unknown.formulas import evaluate
from cosim.discrepancy.unknown.shape import Shape
from cosim.discrepancy.words import channel_words, table_words
from cosim.report import figure, section
from cosim.report.plot import Axis, Plot

_UNITS = {"range": " (m)", "intensity": " (relative)", "drop": " (probability)"}


def unknown_section(found: Diagnosis) -> str:
    """HTML: formulas, as fitted, plug-ins, and curves; empty where nothing is unknown."""
    if not found.unknowns:
        return ""
    return section("What no effect of the catalogue explains", *(_one(unknown) for unknown in found.unknowns))


def _one(unknown: Shape) -> str:
    fit = f"<p>The formula explains {unknown.r2:.1%} of the shape.</p>" if unknown.formula else ""
    fitted = ", ".join(_plain(name, value, unknown.ci95.get(name)) for name, value in unknown.params.items())
    fitted = f"<p>Fitted together with everything else: {escape(fitted)}.</p>" if fitted else ""
    law = table_words(unknown) if unknown.names and unknown.factor is None else unknown.text
    return (
        f'<p>{escape(_depends(unknown))}</p><p class="formula">{escape(law)}</p>{fit}{fitted}'
        f"<p>The improved sensor has it as <code>{escape(unknown.name)}.py</code> beside it: a plug-in to be renamed "
        f"and edited once its cause is known.</p>{_curve(unknown)}"
    )


def _plain(name: str, value: float, interval: list[float] | None) -> str:
    said = f"{name} {value:.3g}".replace("-", "−")
    return said if interval is None else f"{said} ± {(interval[1] - interval[0]) / 2:.2g}"


def _depends(unknown: Shape) -> str:
    unit = f" [{unknown.unit}]" if unknown.unit else ""
    of = "" if unknown.names else f", x{unit}"
    on = " and ".join(unknown.covariates).replace("_", " ")
    return f"{channel_words(unknown.channel).capitalize()} depends on {on}{of}:"


def _curve(unknown: Shape) -> str:
    x, y, sigma = (np.asarray(part, float) for part in (unknown.x, unknown.y, unknown.sigma))
    name = unknown.covariate.replace("_", " ")
    if unknown.names:
        order = np.argsort(-np.abs(y / np.maximum(sigma, 1e-12)), kind="stable")[: LAYOUT.values]
        x, y, sigma = np.arange(len(order), dtype=float), y[order], sigma[order]
        axis = Axis(-0.5, len(order) - 0.5, name, names=[unknown.names[row].replace("_", " ") for row in order])
    else:
        unit = f" ({unknown.unit})" if unknown.unit else ""
        axis = Axis(float(x.min()), float(x.max()) if np.ptp(x) > 0 else float(x.min()) + 1, f"{name}{unit}")
    low, high = float((y - 2 * sigma).min()), float((y + 2 * sigma).max())
    reach = max(high, 0.0) - min(low, 0.0) or 1e-9
    label = f"{channel_words(unknown.channel)} left over{_UNITS.get(unknown.channel, '')}"
    upright = Axis(min(low, 0.0) - 0.15 * reach, max(high, 0.0) + 0.15 * reach, label)
    plot = Plot(axis, upright, f"left over against {name}", 900, 320)
    plot.line(np.array([axis.low, axis.high]), np.zeros(2), "zero")
    if unknown.names:
        for place, level, side in zip(x, y, 2 * sigma, strict=True):
            plot.line(np.full(2, place), np.array([level - side, level + side]), "a")
        plot.line(x, y, "none", dots=True)
    else:
        plot.band(x, y - 2 * sigma, y + 2 * sigma, "a")
        plot.line(x, y, "a", dots=True)
        if unknown.formula is not None:
            fine = np.linspace(axis.low, axis.high, 300)
            plot.line(fine, evaluate(unknown.formula, fine), "b")
    text = "What is left over without it. Dots: bins with two standard errors."
    text += "" if unknown.formula is None or unknown.names else " Blue: the formula."
    return figure("", text, plot.svg(), kind="full", width_px=900)
