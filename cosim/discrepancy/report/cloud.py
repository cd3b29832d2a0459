"""Points of a scan in three dimensions, coloured by residual: packed for the page, and the script that turns them."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence

import numpy as np

from cosim.discrepancy.report.gathered import MATCHED, Scan
from cosim.discrepancy.report.residual_image import colour_index, palette
from cosim.view.scripts import scene_script

_MOST_POINTS = 45_000
_STEP_M = 0.01


def clouds(scans: Sequence[Scan], limit_m: float) -> str:
    """HTML: a canvas for the scans' points and what draws them; `show(name)` of the script changes the frame."""
    packed = {scan.name: _packed(scan, limit_m) for scan in scans}
    data = json.dumps({"step": _STEP_M, "colours": palette().ravel().tolist(), "scans": packed}, separators=(",", ":"))
    return (
        '<figure class="full"><figcaption><h3>Points by residual</h3>'
        "<p>Drag to turn, with shift to move, scroll to come nearer, double-click to go back. The rings on the ground "
        "lie 10, 20, 40, 60 and 80 m around the sensor, which looks along the line.</p></figcaption>"
        '<canvas id="cloud" style="height:560px" aria-label="points in three dimensions"></canvas></figure>'
        f'<script type="application/json" id="cloud-data">{data}</script>\n{scene_script(_SCRIPT)}'
    )


def _packed(scan: Scan, limit_m: float) -> dict[str, str]:
    """Base64 of int16 centimetres, (n, 3), and of uint8 colours, (n,); matched points are thinned out first."""
    there = np.isfinite(scan.xyz).all(1)
    rare = np.flatnonzero(there & (scan.state != MATCHED))
    plain = np.flatnonzero(there & (scan.state == MATCHED))
    every = max(1, -(-len(plain) // max(_MOST_POINTS - len(rare), _MOST_POINTS // 2)))
    rows = np.concatenate([plain[::every], rare])
    xyz = np.clip(np.rint(scan.xyz[rows] / _STEP_M), -32767, 32767).astype("<i2")
    return {"xyz": _text(xyz), "colour": _text(colour_index(scan, limit_m)[rows])}


def _text(values: np.ndarray) -> str:
    return base64.b64encode(values.tobytes()).decode()


_SCRIPT = """
const data = JSON.parse(document.getElementById('cloud-data').textContent);
const canvas = document.getElementById('cloud');
const scene = new Scene(canvas, new Orbit({...BEHIND, yaw: 0.35, pitch: 0.42, away: 34, target: [0, 0, 0]}));
const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
function show(name) {
  const xyz = Float32Array.from(new Int16Array(bytes(data.scans[name].xyz).buffer), value => value * data.step);
  const index = bytes(data.scans[name].colour), rgba = new Uint8Array(4 * index.length).fill(255);
  index.forEach((row, point) => rgba.set(data.colours.slice(3 * row, 3 * row + 3), 4 * point));
  scene.setPoints(xyz);
  scene.setColours(rgba);
  canvas.dataset.points = index.length;
  for (const part of document.querySelectorAll('[data-frame]')) part.hidden = part.dataset.frame !== name;
  for (const button of document.querySelectorAll('[data-show]'))
    button.setAttribute('aria-pressed', button.dataset.show === name);
}
for (const button of document.querySelectorAll('[data-show]'))
  button.addEventListener('click', () => show(button.dataset.show));
if (!scene.gl) canvas.replaceWith('Points need WebGL, which this browser has turned off or lacks.');
show(Object.keys(data.scans)[0]);
"""
