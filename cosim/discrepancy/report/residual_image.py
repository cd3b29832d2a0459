"""The scan as the sensor took it, coloured by how far the model is off: a row a ring, a column an azimuth."""

from __future__ import annotations

import base64

import numpy as np

from cosim.discrepancy.report.gathered import AMBIGUOUS, DROPPED, MATCHED, SILENT, SPURIOUS, UNFORESEEN, Scan
from cosim.drives.kitti import encode_rgb

LEVELS = 241
_ROUND_M = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
_STOPS = (0.0, 0.25, 0.5, 0.75, 1.0)
_COLOURS = np.array([[23, 92, 211], [116, 176, 240], [238, 238, 234], [246, 160, 92], [202, 40, 30]], float)
STATES = {
    AMBIGUOUS: ("ambiguous: at an edge, or not trusted", (96, 102, 112)),
    DROPPED: ("dropped: the model has a return, the sensor none", (226, 60, 214)),
    SPURIOUS: ("spurious: a return from where nothing is", (92, 232, 70)),
    UNFORESEEN: ("unforeseen: a return that the model does not have", (250, 226, 60)),
    SILENT: ("neither returns", (8, 10, 14)),
}
_WIDTH, _ROW, _LEFT, _FOOT = 1560, 4, 46, 40


def palette() -> np.ndarray:
    """(256, 3) uint8: residuals from blue (measured nearer) over white to red (farther), then the states."""
    table = np.zeros((256, 3), np.uint8)
    share = np.linspace(0, 1, LEVELS)
    table[:LEVELS] = np.rint(np.stack([np.interp(share, _STOPS, _COLOURS[:, band]) for band in range(3)], 1))
    for state, (_, colour) in STATES.items():
        table[LEVELS + state] = colour
    return table


def colour_index(scan: Scan, limit_m: float) -> np.ndarray:
    """(n,) uint8 rows of the palette; the ends stand for ±limit_m and beyond."""
    share = np.clip(scan.residual_m / limit_m, -1, 1)
    index = np.rint((share + 1) / 2 * (LEVELS - 1)).astype(np.uint8)
    return np.where(scan.state == MATCHED, index, LEVELS + scan.state).astype(np.uint8)


def limit_of(scans: list[Scan]) -> float:
    """A round residual [m] that nineteen of twenty beams stay below."""
    sizes = np.concatenate([np.abs(scan.residual_m[scan.state == MATCHED]) for scan in scans])
    reach = float(np.quantile(sizes, 0.95)) if len(sizes) else 0.0
    return next((value for value in _ROUND_M if value >= reach), _ROUND_M[-1])


def residual_svg(scan: Scan, limit_m: float) -> str:
    """The picture with its axes."""
    cells = palette()[colour_index(scan, limit_m)].reshape(scan.rings, scan.firings, 3)
    png = base64.b64encode(encode_rgb(cells)).decode()
    height = max(scan.rings * _ROW, 160)
    inner = _WIDTH - _LEFT - 10
    parts = [
        f'<image x="{_LEFT}" y="4" width="{inner}" height="{height}" preserveAspectRatio="none" '
        f'style="image-rendering:pixelated" href="data:image/png;base64,{png}"/>'
    ]
    for degrees in range(-180, 181, 45):
        x = _LEFT + (180 - degrees) / 360 * inner
        side = {0: " ahead", 90: " left", -90: " right", 180: " behind", -180: " behind"}.get(degrees, "")
        anchor = {180: "start", -180: "end"}.get(degrees, "middle")
        parts.append(f'<path class="axis" d="M{x:.0f} {height + 4}v5"/>')
        parts.append(f'<text x="{x:.0f}" y="{height + 24}" text-anchor="{anchor}">{degrees:+d}°{side}</text>')
    for ring in range(0, scan.rings, max(1, scan.rings // 4)):
        y = 4 + (ring + 0.5) / scan.rings * height
        parts.append(f'<text x="{_LEFT - 6}" y="{y + 4:.0f}" text-anchor="end">{ring}</text>')
    label = f"range residuals of frame {scan.name} by ring and azimuth"
    size = f"0 0 {_WIDTH} {height + _FOOT - 8}"
    return f'<svg class="plot scan" viewBox="{size}" role="img" aria-label="{label}">{"".join(parts)}</svg>'


def legend(limit_m: float) -> str:
    """HTML: the scale and the states."""
    stops = ",".join(f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in _COLOURS)
    bar = f'<i style="width:150px;background:linear-gradient(90deg,{stops})"></i>'
    reach = f"{100 * limit_m:g} cm"
    items = [f"<span>−{reach} (measured nearer) {bar} +{reach} (farther)</span>"]
    for words, colour in STATES.values():
        items.append(f'<span><i style="background:rgb{colour}"></i> {words}</span>')
    return f'<div class="legend">{"".join(items)}</div>'
