"""Plots as inline SVG: axes, histograms, lines, bands, bars, images.

Texts are escaped here. Colours are defined in the page's style.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from markupsafe import Markup

WIDTH, HEIGHT = 560, 300
_LEFT, _RIGHT, _TOP, _BOTTOM = 64, 12, 12, 40
_NICE = (1, 2, 2.5, 5, 10)


@dataclass(frozen=True)
class Axis:
    """Axis of a plot.

    Attributes:
        low, high: limits.
        label: quantity and unit.
        log: whether the scale is logarithmic.
        names: category names at 0, 1, 2, … instead of numbers.
        percent: whether shares are shown in percent.
    """

    low: float
    high: float
    label: str = ""
    log: bool = False
    names: Sequence[str] = ()
    percent: bool = False

    def place(self, values: np.ndarray | float) -> np.ndarray:
        """Relative positions of values on the axis, 0–1 within its limits."""
        values, low, high = np.asarray(values, float), self.low, self.high
        if self.log:
            values, low, high = np.log10(np.maximum(values, low / 10)), math.log10(low), math.log10(high)
        return (values - low) / (high - low)

    def ticks(self, most: int) -> list[tuple[float, str]]:
        """Positions and texts of at most about `most` ticks."""
        if self.names:
            return list(enumerate(self.names))
        if self.log:
            decades = range(math.ceil(math.log10(self.low)), math.floor(math.log10(self.high)) + 1)
            return [(10.0**decade, f"{10**decade:g}") for decade in decades]
        step = _nice_step(self.high - self.low, most)
        numbers = np.arange(math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9) + 1) * step
        return [(float(n), _word(float(n), step, self.percent)) for n in numbers]


class Plot:
    """A plot to which elements are added one by one.

    Args:
        x, y: axes.
        width, height: size of the view box [px].
        title: title for screen readers.
    """

    def __init__(self, x: Axis, y: Axis, title: str, width: int = WIDTH, height: int = HEIGHT) -> None:
        self._x, self._y, self._title = x, y, title
        self._size = (width, height)
        self._frame = (_LEFT, _TOP, width - _RIGHT, height - _BOTTOM)
        self._parts: list[str] = []

    def steps(self, edges: np.ndarray, values: np.ndarray, style: str, filled: bool = True) -> None:
        """Add a histogram with k + 1 edges and k values."""
        x, y = np.repeat(edges, 2), np.concatenate([[0], np.repeat(values, 2), [0]])
        if filled:
            self._add("polygon", x, np.maximum(y, self._y.low), f"area {style}")
        self._add("polyline", x[1:-1], y[1:-1], f"line {style}")

    def line(self, x: np.ndarray, y: np.ndarray, style: str, dots: bool = False) -> None:
        """Add a line through points, with gaps at values that are not finite."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        good = np.isfinite(x) & np.isfinite(y)
        for run in np.split(np.arange(len(x)), np.flatnonzero(np.diff(good.astype(int))) + 1):
            if len(run) and good[run[0]]:
                self._add("polyline", x[run], y[run], f"line {style}")
        if dots:
            px, py = self._pixels(x[good], y[good])
            self._parts += [
                f'<circle class="dot {style}" cx="{a:.1f}" cy="{b:.1f}" r="2.6"/>' for a, b in zip(px, py, strict=True)
            ]

    def band(self, x: np.ndarray, low: np.ndarray, high: np.ndarray, style: str) -> None:
        """Add the area between two lines."""
        self._add("polygon", np.concatenate([x, x[::-1]]), np.concatenate([high, low[::-1]]), f"band {style}")

    def bars(
        self, positions: np.ndarray, values: np.ndarray, width: float, style: str, words: Sequence[str] = ()
    ) -> None:
        """Add vertical bars centred at `positions`, with texts above them."""
        x0, y0 = self._pixels(positions - width / 2, np.full(len(positions), self._y.low))
        x1, y1 = self._pixels(positions + width / 2, values)
        for row in range(len(positions)):
            height = max(0.0, float(y0[row] - y1[row]))
            self._parts.append(
                f'<rect class="bar {style}" x="{x0[row]:.1f}" y="{y0[row] - height:.1f}" '
                f'width="{x1[row] - x0[row]:.1f}" height="{height:.1f}"/>'
            )
            if words:
                middle = (x0[row] + x1[row]) / 2
                self._parts.append(_text(middle, y0[row] - height - 4, words[row], "middle", "value"))

    def picture(self, png: bytes, left: float, right: float, bottom: float, top: float) -> None:
        """Add a PNG image whose edges are given in axis values."""
        (x0, x1), (y0, y1) = self._pixels(np.array([left, right]), np.array([top, bottom]))
        data = base64.b64encode(png).decode()
        self._parts.append(
            f'<image x="{x0:.1f}" y="{y0:.1f}" width="{x1 - x0:.1f}" height="{y1 - y0:.1f}" preserveAspectRatio="none" '
            f'style="image-rendering:auto" href="data:image/png;base64,{data}"/>'
        )

    def target(self, x: tuple[float, float], words: str, **data: str) -> None:
        """Add a clickable vertical strip between two values; `words` are its tooltip and its accessible name."""
        (x0, x1), _ = self._pixels(np.array(x), np.zeros(2))
        attributes = "".join(f' data-{name.replace("_", "-")}="{escape(value)}"' for name, value in data.items())
        _, top, _, bottom = self._frame
        self._parts.append(
            f'<rect class="target" x="{x0:.1f}" y="{top}" width="{max(x1 - x0, 1):.1f}" height="{bottom - top}" '
            f'tabindex="-1" role="button" aria-label="{escape(words)}"{attributes}>'
            f"<title>{escape(words)}</title></rect>"
        )

    def tile(self, x: tuple[float, float], y: tuple[float, float], colour: str, words: str) -> None:
        """Add a filled rectangle in axis values; `words` are its tooltip."""
        (x0, x1), (y1, y0) = self._pixels(np.array(x), np.array(y))
        self._parts.append(
            f'<rect x="{x0:.1f}" y="{y0:.1f}" width="{x1 - x0 + 0.3:.1f}" height="{y1 - y0 + 0.3:.1f}" fill="{colour}">'
            f"<title>{escape(words)}</title></rect>"
        )

    def note(self, x: float, y: float, text: str, style: str = "value", anchor: str = "middle") -> None:
        """Add a text at a position in axis values."""
        px, py = self._pixels(np.array([x]), np.array([y]))
        self._parts.append(_text(float(px[0]), float(py[0]), text, anchor, style))

    def svg(self) -> Markup:
        """SVG text of the plot."""
        width, height = self._size
        left, top, right, bottom = self._frame
        inner = f"{left} {top} {right - left} {bottom - top + 1}"
        x, y, w, h = inner.split()
        clip = f'<svg x="{x}" y="{y}" width="{w}" height="{h}" viewBox="{inner}">'
        grid, words = self._grid()
        return Markup(
            f'<svg class="plot" viewBox="0 0 {width} {height}" role="img" aria-label="{escape(self._title)}">'
            f"{grid}{clip}{''.join(self._parts)}</svg>"
            f'<path class="axis" d="M{left} {top}V{bottom}H{right}"/>{words}</svg>'
        )

    def _grid(self) -> tuple[str, str]:
        left, top, right, bottom = self._frame
        lines, words = [], []
        for value, word in self._x.ticks(9):
            x = left + float(self._x.place(value)) * (right - left)
            if not self._x.names:
                lines.append(f"M{x:.1f} {top}V{bottom}")
            words.append(_text(x, bottom + 16, word, "middle"))
        for value, word in self._y.ticks(6):
            y = bottom - float(self._y.place(value)) * (bottom - top)
            lines.append(f"M{left} {y:.1f}H{right}")
            words.append(_text(left - 6, y + 4, word, "end"))
        words.append(_text((left + right) / 2, bottom + 33, self._x.label, "middle", "label"))
        words.append(
            f'<text class="label" text-anchor="middle" transform="translate(13 {(top + bottom) / 2:.0f}) rotate(-90)">'
            f"{escape(self._y.label)}</text>"
        )
        return f'<path class="grid" d="{"".join(lines)}"/>', "".join(words)

    def _add(self, shape: str, x: np.ndarray, y: np.ndarray, style: str) -> None:
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(*self._pixels(x, y), strict=True))
        self._parts.append(f'<{shape} class="{style}" points="{points}"/>')

    def _pixels(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        left, top, right, bottom = self._frame
        up = np.clip(self._y.place(y), -0.5, 1.5)
        return left + self._x.place(x) * (right - left), bottom - up * (bottom - top)


def nice_top(value: float) -> float:
    """Upper axis limit: the next tick above a value."""
    if not value > 0 or not math.isfinite(value):
        return 1.0
    step = _nice_step(value, 5)
    return math.ceil(value * 1.04 / step) * step


def _nice_step(length: float, most: int) -> float:
    raw = length / max(most, 1)
    scale = 10.0 ** math.floor(math.log10(raw))
    return next(nice * scale for nice in _NICE if nice * scale >= raw * (1 - 1e-9))


def _word(value: float, step: float, percent: bool) -> str:
    if percent:
        value, step = value * 100, step * 100
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    decimals += round(step * 10**decimals, 6) % 1 > 0
    return f"{value + 0.0:,.{decimals}f}{' %' if percent else ''}"


def _text(x: float, y: float, text: str, anchor: str, style: str = "tick") -> str:
    return f'<text class="{style}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'
