"""Scans on a page, as a point cloud and as a range image: packed data and the script that draws them."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

import numpy as np
from markupsafe import Markup

from cosim.discrepancy.report.beams import (
    AMBIGUOUS,
    DROPPED,
    LAYOUT,
    MATCHED,
    SILENT,
    SPURIOUS,
    UNFORESEEN,
    ShownScan,
    Side,
)
from cosim.discrepancy.report.bins import Bins
from cosim.report import button, legend
from cosim.report.html import fill
from cosim.view.scripts import scene_script

SHOWN_CHANNELS = ("range", "intensity", "drop")
_STEP_M, _STEP, _ABSENT = 0.01, {"range": 0.001, "intensity": 0.005, "drop": 0.01}, -128
_ABSENT_RANGE = -32768
_ROUND = {"range": (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0), "intensity": (0.02, 0.05, 0.1, 0.2, 0.5), "drop": (1.0,)}
_UNITS = {"range": (100.0, "cm"), "intensity": (1.0, ""), "drop": (100.0, "%")}
_STOPS = ((23, 92, 211), (116, 176, 240), (238, 238, 234), (246, 160, 92), (202, 40, 30))
_STATES = {
    MATCHED: ("", (238, 238, 234)),
    AMBIGUOUS: ("ambiguous: at an edge, or not trusted", (82, 88, 98)),
    DROPPED: ("dropped: the model predicts a return, the sensor has none", (226, 60, 214)),
    SPURIOUS: ("spurious: a return away from all surfaces", (92, 232, 70)),
    UNFORESEEN: ("unpredicted: a return that the model does not predict", (250, 226, 60)),
    SILENT: ("no return in both", (8, 10, 14)),
}


def scan_view(scans: Sequence[ShownScan], bins: Mapping[str, Bins], sides: Sequence[str]) -> str:
    """Build the HTML of the buttons, both pictures, and their data.

    Args:
        scans: scans to show; the first is selected initially.
        bins: bins of covariates that can be selected.
        sides: names of before and after; one name if there is only one side.
    """
    if not scans:
        return ""
    frames = Markup().join(
        button(f"frame {scan.name}{', the worst' if row == 0 and len(scans) > 1 else ''}", row == 0, frame=scan.name)
        for row, scan in enumerate(scans)
    )
    toggle = Markup().join(button(word, row == len(sides) - 1, side=str(row)) for row, word in enumerate(sides))
    data = json.dumps(packed_scans(scans, bins, len(sides)), separators=(",", ":"), allow_nan=False)
    data = Markup(data.replace("<", "\\u003c"))
    states = [(f"rgb{colour}", words) for words, colour in _STATES.values() if words]
    gradient = f"linear-gradient(90deg,{','.join(f'rgb{stop}' for stop in _STOPS)})"
    return (
        fill('<div class="scan" id="scan"><div class="picks">{}</div>', frames)
        + (fill('<div class="picks" role="group" aria-label="model">{}</div>', toggle) if len(sides) > 1 else "")
        + fill(
            '<p class="slice" id="slice" aria-live="polite"></p><canvas id="image" aria-label="the scan as a '
            'range image: one row per ring, one column per azimuth"></canvas><div class="ends"><span>left, '
            "+180°</span><span>+90°</span><span>ahead</span><span>−90°</span><span>−180°, right</span></div>"
            '<canvas id="cloud" tabindex="0" aria-label="points in three dimensions"></canvas><p '
            'class="beam" id="beam">Point at the scan for a single beam. Drag the points to turn them, with '
            "shift to move, scroll to come nearer; or use the arrow keys, + and −, t for the top view, r to "
            'go back.</p><div class="legend"><span><b id="low"></b> <i style="width:130px;background:{}"></i>'
            ' <b id="high"></b></span></div>{}</div><script type="application/json" id="scan-data">'
            "{}</script>\n{}",
            gradient,
            legend(states),
            data,
            scene_script(_script()),
        )
    )


def packed_scans(scans: Sequence[ShownScan], bins: Mapping[str, Bins], sides: int = 2) -> dict[str, Any]:
    """Data for the script as plain values; the arrays of a scan are concatenated, gzipped and base64-encoded."""
    return {
        "channels": {
            name: {
                "limit": _limit(scans, name),
                "step": _STEP[name],
                "factor": _UNITS[name][0],
                "unit": _UNITS[name][1],
            }
            for name in SHOWN_CHANNELS
        },
        "stops": _STOPS,
        "states": [list(_STATES[state][1]) for state in sorted(_STATES)],
        "matched": MATCHED,
        "spurious_probability": SPURIOUS,
        "step_m": _STEP_M,
        "bins": {name: {"label": one.shown.words, "words": one.words()} for name, one in bins.items()},
        "scans": [_packed(scan, bins, sides) for scan in scans],
    }


def _packed(scan: ShownScan, bins: Mapping[str, Bins], sides: int) -> dict[str, Any]:
    every = max(1, -(-scan.rings * scan.firings // LAYOUT.beams))
    columns = -(-scan.firings // every)
    arrays: list[tuple[str, np.ndarray]] = [
        ("range", _thinned(_steps(scan.measured_m, _STEP_M, 0, Markup("<u2")), scan, every))
    ]
    for number, side in enumerate((scan.before, scan.after)[-sides:]):
        arrays += [(f"{number}:{name}", _thinned(values, scan, every)) for name, values in _of_side(side)]
    arrays += [(f"bin:{name}", _thinned(one.of_scan(scan), scan, every)) for name, one in bins.items()]
    return {
        "name": scan.name,
        "rings": scan.rings,
        "columns": columns,
        "turn": 2 * np.pi * every / scan.firings,
        "elevation": np.round(scan.elevation_rad, 5).tolist(),
        "azimuth": np.round(scan.azimuth_rad, 5).tolist(),
        "errors": [
            round(side.error, 3) if np.isfinite(side.error) else None for side in (scan.before, scan.after)[-sides:]
        ],
        "arrays": [[name, values.dtype.str[1:]] for name, values in arrays],
        "data": base64.b64encode(
            gzip.compress(b"".join(values.tobytes() for _, values in arrays), 9, mtime=0)
        ).decode(),
    }


def _of_side(side: Side) -> list[tuple[str, np.ndarray]]:
    found = [("state", side.state)]
    for name in SHOWN_CHANNELS:
        kind, absent = (Markup("<i2"), _ABSENT_RANGE) if name == "range" else ("|i1", _ABSENT)
        found.append((name, _steps(side.residuals[name], _STEP[name], absent, kind)))
    return found


def _steps(values: np.ndarray, step: float, absent: int, kind: str) -> np.ndarray:
    """Round to integer numbers of steps; `absent` for NaN."""
    info = np.iinfo(kind)
    least = absent + 1 if absent < 0 else info.min
    whole = np.clip(np.rint(np.nan_to_num(values) / step), least, info.max)
    return np.where(np.isfinite(values), whole, absent).astype(kind)


def _thinned(values: np.ndarray, scan: ShownScan, every: int) -> np.ndarray:
    return np.ascontiguousarray(values.reshape(scan.rings, scan.firings)[:, ::every]).ravel()


def _limit(scans: Sequence[ShownScan], name: str) -> float:
    """Round limit above the 95 % quantile of absolute residuals, before and after."""
    sizes = np.concatenate([np.abs(side.residuals[name]) for scan in scans for side in (scan.before, scan.after)])
    sizes = sizes[np.isfinite(sizes)]
    reach = float(np.quantile(sizes, 0.95)) if len(sizes) else 0.0
    return next((value for value in _ROUND[name] if value >= reach), _ROUND[name][-1])


def _script() -> str:
    return (files("cosim.discrepancy.report") / "explorer.js").read_text(encoding="utf-8")
