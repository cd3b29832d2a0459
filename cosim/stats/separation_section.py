"""The part of the page on the two-sample test."""

from __future__ import annotations

import base64
from collections.abc import Sequence

import cv2
import numpy as np
from markupsafe import Markup

from cosim.report.html import fill
from cosim.report.parts import section, table
from cosim.report.plot import Axis, Plot, nice_top
from cosim.stats.two_sample import TwoSample
from cosim.stats.two_sample.result import ChannelResult, FigureResult, TellingPatch

_SHOWN_FIGURES = 12
_SCALE = 5  # pixels a cell
_NEAR_M, _FAR_M = 2.0, 80.0

STYLE = """
.patches { display: grid; grid-template-columns: repeat(auto-fill, minmax(215px, 1fr)); gap: 12px; }
.patches figure { padding: 8px; } .patches img { width: 100%; image-rendering: pixelated; display: block;
  margin-bottom: 4px; } .patches figcaption { padding: 0 0 4px; font-size: 12.5px; color: var(--muted); }
.auc { position: relative; display: inline-block; width: 260px; height: 14px; background: #1d2430; border-radius: 3px; }
.auc i, .auc b, .auc u { position: absolute; top: 0; bottom: 0; }
.auc i { background: var(--a); opacity: .55; } .auc b { width: 3px; background: var(--a); }
.auc u { width: 3px; background: var(--b); }
h3.a { color: var(--a); } h3.b { color: var(--b); }
"""


def separation_section(test: TwoSample | str | None) -> str:
    """HTML of the test, or of the reason why there is none; empty if no test was requested."""
    title = "Can the two sets be distinguished?"
    if test is None:
        return ""
    if isinstance(test, str):
        return section(title, fill("<p>No two-sample test: {}.</p>", test))
    a, b = (name for name in test.information["titles"])
    grid, units = test.information["grid"], test.information["units"]
    rows = "lasers" if grid["rows_are_lasers"] else "bins of elevation"
    text = (
        f"Boosted trees name the set of patches of {grid['patch'][0]} {rows} × {grid['patch'][1]} columns of "
        f"{grid['step_deg']:.2f}° within {grid['sector_deg']:.0f}° about the forward direction, from 25 simple "
        f"figures, and are evaluated on units that took no part in their training ({units[0]} and {units[1]}, unit: "
        f"{test.information['unit']!s}). AUC 0.5: they cannot; 1: always. Baseline: the first half of {b} "
        "against its second. The interval counts whole units and leaves the trees as they are."
    )
    return section(
        title,
        _channels(test.channels),
        _regions(test),
        fill("<h3>Single features that distinguish them</h3>{}", _figures(test.figures, a, b)),
        *(
            fill('<h3 class="{}">Most telling patches of {}</h3>{}', style, name, _patches(patches))
            for style, name, patches in zip("ab", (a, b), test.telling, strict=True)
        ),
        text=text,
        anchor="separation",
    )


def _channels(channels: Sequence[ChannelResult]) -> str:
    rows = []
    for item in channels:
        base = item.baseline
        rows.append(
            (
                item.channel,
                f"{item.sets.auc:.3f}",
                f"{item.sets.low:.3f} – {item.sets.high:.3f}",
                "" if item.sets.p_value is None else f"{item.sets.p_value:.3f}",
                "—" if base is None else f"{base.auc:.3f}",
                "" if base is None else f"{base.low:.3f} – {base.high:.3f}",
                _bar(item),
            )
        )
    return table(("figures", "AUC", "95 %", "p", "baseline", "95 %", "0.5 to 1: set, and baseline (blue)"), rows, {6})


def _bar(item: ChannelResult) -> str:
    def place(auc: float) -> float:
        return 200 * min(max(auc - 0.5, 0.0), 0.5)

    low, high, middle = place(item.sets.low), place(item.sets.high), place(item.sets.auc)
    base = "" if item.baseline is None else fill('<u style="left:{:.1f}%"></u>', place(item.baseline.auc))
    return fill(
        '<span class="auc"><i style="left:{:.1f}%;width:{:.1f}%"></i><b style="left:{:.1f}%"></b>{}</span>',
        low,
        max(high - low, 0.5),
        min(middle, 99),
        base,
    )


def _regions(test: TwoSample) -> str:
    channels = [item.channel for item in test.channels]
    rows = [
        (
            item.title,
            f"{item.patches[0]:,}",
            f"{item.patches[1]:,}",
            *(f"{item.auc[channel]:.3f}" for channel in channels),
        )
        for item in test.regions
    ]
    heads = ("where 30 % or more of a patch is", "patches", "of the reference", *(f"AUC, {name}" for name in channels))
    return fill("<h3>Where</h3>{}", table(heads, rows)) if rows else ""


def _figures(figures: Sequence[FigureResult], a: str, b: str) -> str:
    charts = []
    for item in figures[:_SHOWN_FIGURES]:
        low, high = float(item.edges[0]), float(item.edges[-1])
        top = nice_top(float(item.shares.max()))
        plot = Plot(Axis(low, high, item.title), Axis(0, top, "share of patches", percent=True), item.title)
        for style, share in zip("ab", item.shares, strict=True):
            plot.steps(item.edges, share, style)
        more = a if item.is_larger else b
        charts.append(
            fill(
                "<figure><figcaption><h3>{}</h3><p>{}; own AUC {:.3f}, larger in {}</p></figcaption>{}</figure>",
                item.title,
                item.channel,
                item.auc,
                more,
                plot.svg(),
            )
        )
    return fill('<div class="charts">{}</div>', Markup().join(charts))


def _patches(patches: Sequence[TellingPatch]) -> str:
    return Markup('<div class="patches">') + Markup().join(_patch(patch) for patch in patches) + Markup("</div>")


def _patch(patch: TellingPatch) -> str:
    range_m, intensity = patch.picture.astype(np.float32)
    depth = np.log(np.clip(range_m, _NEAR_M, _FAR_M) / _NEAR_M) / np.log(_FAR_M / _NEAR_M)
    pictures = [
        _png(depth, cv2.COLORMAP_TURBO, f"range, {_NEAR_M:.0f} to {_FAR_M:.0f} m, logarithmic"),
        _png(np.clip(intensity, 0, 1), cv2.COLORMAP_INFERNO, "intensity, 0 to 1"),
    ]
    return fill(
        "<figure><figcaption>frame {}, patch {}, {}: {:.3f}</figcaption>{}</figure>",
        patch.frame,
        patch.place[0],
        patch.place[1],
        patch.probability,
        Markup().join(pictures),
    )


def _png(values: np.ndarray, colours: int, words: str) -> str:
    """An image element; cells without return are gray."""
    there = np.isfinite(values)
    picture = cv2.applyColorMap(np.where(there, 255 * np.nan_to_num(values), 0).astype(np.uint8), colours)
    picture[~there] = (70, 62, 58)
    large = np.repeat(np.repeat(picture, 2 * _SCALE, 0), _SCALE, 1)
    data = base64.b64encode(cv2.imencode(".png", large)[1].tobytes()).decode()
    return fill('<img alt="{}" title="{}" src="data:image/png;base64,{}">', words, words, data)
