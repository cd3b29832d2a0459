"""Points of a scan in three dimensions, coloured by residual: packed for the page, and the script that turns them."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence

import numpy as np

from cosim.discrepancy.pages.gathered import MATCHED, Scan
from cosim.discrepancy.pages.residual_image import colour_index, palette

_MOST_POINTS = 45_000
_STEP_M = 0.01


def clouds(scans: Sequence[Scan], limit_m: float) -> str:
    """HTML: a canvas for the scans' points and what draws them; `show(name)` of the script changes the frame."""
    packed = {scan.name: _packed(scan, limit_m) for scan in scans}
    data = json.dumps({"step": _STEP_M, "colours": palette().ravel().tolist(), "scans": packed}, separators=(",", ":"))
    return (
        '<figure class="full"><figcaption><h3>Points by residual</h3>'
        "<p>Drag to turn, scroll to come nearer, double-click to go back. The rings on the ground lie 10, 20 and 40 m "
        "around the sensor, which looks along the line.</p></figcaption>"
        '<canvas id="cloud" width="1500" height="560" aria-label="points in three dimensions"></canvas></figure>'
        f'<script type="application/json" id="cloud-data">{data}</script>\n<script>{_SCRIPT}</script>'
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
(() => {
const data = JSON.parse(document.getElementById('cloud-data').textContent);
const canvas = document.getElementById('cloud'), context = canvas.getContext('2d');
const W = canvas.width, H = canvas.height, image = context.createImageData(W, H);
const pixels = new Uint32Array(image.data.buffer), depth = new Float32Array(W * H);
const rgb = Array.from({length: 256}, (_, i) => (0xff000000 | (data.colours[3*i+2] << 16)
  | (data.colours[3*i+1] << 8) | data.colours[3*i]) >>> 0);
const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));
const start = {yaw: 0.35, pitch: 0.42, away: 34};
let view = {...start}, xyz = new Int16Array(0), colour = new Uint8Array(0), waiting = false;
const ground = [];
for (const radius of [10, 20, 40]) for (let a = 0; a < 60 * radius; a++)
  ground.push(radius * Math.cos(a / 30 / radius * Math.PI), radius * Math.sin(a / 30 / radius * Math.PI), -1.73);
for (let a = 0; a < 400; a++) ground.push(a / 40, 0, -1.73);
function draw() {
  waiting = false;
  pixels.fill(0xff160d0b); depth.fill(1e9);
  const cy = Math.cos(view.yaw), sy = Math.sin(view.yaw), cp = Math.cos(view.pitch), sp = Math.sin(view.pitch);
  const focus = H * 1.1;
  function put(x, y, z, c, size) {
    const ahead = x * cy + y * sy, left = y * cy - x * sy;
    const far = ahead * cp - z * sp + view.away, up = ahead * sp + z * cp;
    if (far < 0.5) return;
    const u = (W / 2 - left / far * focus) | 0, v = (H / 2 - up / far * focus) | 0;
    if (u < 0 || v < 0 || u >= W - 2 || v >= H - 2) return;
    for (let j = 0; j < size; j++) for (let i = 0; i < size; i++) {
      const k = (v + j) * W + u + i;
      if (far < depth[k]) { depth[k] = far; pixels[k] = c; }
    }
  }
  for (let i = 0; i < ground.length; i += 3) put(ground[i], ground[i+1], ground[i+2], 0xff5c4a3c, 1);
  const step = data.step;
  for (let i = 0; i < colour.length; i++)
    put(xyz[3*i] * step, xyz[3*i+1] * step, xyz[3*i+2] * step, rgb[colour[i]], 2);
  context.putImageData(image, 0, 0);
  canvas.dataset.points = colour.length;
}
function later() { if (!waiting) { waiting = true; requestAnimationFrame(draw); } }
function show(name) {
  xyz = new Int16Array(bytes(data.scans[name].xyz).buffer); colour = bytes(data.scans[name].colour);
  for (const part of document.querySelectorAll('[data-frame]')) part.hidden = part.dataset.frame !== name;
  for (const button of document.querySelectorAll('[data-show]'))
    button.setAttribute('aria-pressed', button.dataset.show === name);
  later();
}
canvas.addEventListener('pointerdown', event => canvas.setPointerCapture(event.pointerId));
canvas.addEventListener('pointermove', event => {
  if (!(event.buttons & 1)) return;
  view.yaw += event.movementX * 0.006;
  view.pitch = Math.min(1.57, Math.max(-0.3, view.pitch + event.movementY * 0.006));
  later();
});
canvas.addEventListener('wheel', event => {
  event.preventDefault();
  view.away = Math.min(200, Math.max(3, view.away * Math.exp(event.deltaY * 0.001))); later();
}, {passive: false});
canvas.addEventListener('dblclick', () => { view = {...start}; later(); });
for (const button of document.querySelectorAll('[data-show]'))
  button.addEventListener('click', () => show(button.dataset.show));
show(Object.keys(data.scans)[0]);
})();
"""
