// Points and boxes in three dimensions, with names over boxes and the values of the point under the pointer.

const PICK_PX = 7, NAMED_M = 60;

class SpacePanel {
  constructor(element, orbit, look) {
    const [canvas, over] = element.querySelectorAll('canvas');
    Object.assign(this, {element, over, look, tip: element.querySelector('.tip'), boxes: []});
    this.scene = new Scene(canvas, orbit);
    this.scene.drawn = matrix => this.drawNames(matrix);
    canvas.addEventListener('pointermove', event => {
      this.pointer = event.buttons ? null : [event.offsetX, event.offsetY];
      this.pick();
    });
    canvas.addEventListener('pointerleave', () => { this.pointer = null; this.pick(); });
    this.pick = onNextPicture(() => this.showPoint());
    if (!this.scene.gl) element.querySelector('.fault').hidden = false;
  }

  setFrame(frame) {
    this.frame = frame;
    this.scene.setGround(frame.ground);
    this.scene.setPoints(frame.xyz);
  }

  setColours(rgba) { this.scene.setColours(rgba); }

  setBoxes(boxes) {
    this.boxes = boxes;
    this.scene.setLines(boxLines(boxes, this.look.colourOf));
  }

  resize() { this.scene.size = this.look.size; this.scene.redraw(); }

  drawNames(matrix) {
    const ratio = fitCanvas(this.over), {width, height} = this.over, context = this.over.getContext('2d');
    context.clearRect(0, 0, width, height);
    if (!this.frame) return;
    context.font = `${12 * ratio}px system-ui, sans-serif`;
    context.textAlign = 'center';
    context.lineWidth = 3 * ratio;
    context.strokeStyle = '#0d1016';
    this.nameRings(context, matrix, ratio);
    if (this.look.names) this.nameBoxes(context, matrix, ratio);
  }

  nameRings(context, matrix, ratio) {
    context.fillStyle = '#8d99ad';
    for (const radius of RINGS_M) {
      const away = radius * Math.SQRT1_2, {width, height} = this.over;
      const [u, v, w] = toPixels(matrix, away, -away, this.frame.ground, width, height);
      if (w < 0.3) continue;
      context.strokeText(`${radius} m`, u, v + 4 * ratio);
      context.fillText(`${radius} m`, u, v + 4 * ratio);
    }
  }

  nameBoxes(context, matrix, ratio) {
    const taken = [], {width, height} = this.over;
    for (const box of [...this.boxes].sort((a, b) => distanceOf(a) - distanceOf(b))) {
      if (distanceOf(box) > NAMED_M && box.source !== 'label') continue;
      const [x, y, z] = box.centre, [u, v, w] = toPixels(matrix, x, y, z + box.size[2] / 2 + 0.35, width, height);
      if (w < 0.3 || u < 0 || v < 0 || u > width || v > height) continue;
      if (taken.some(([a, b]) => Math.abs(a - u) < 62 * ratio && Math.abs(b - v) < 14 * ratio)) continue;
      taken.push([u, v]);
      const text = `${box.kind} ${distanceOf(box).toFixed(0)} m`;
      context.strokeText(text, u, v);
      context.fillStyle = `rgb(${this.look.colourOf(box.kind)})`;
      context.fillText(text, u, v);
    }
  }

  // The row of the nearest point to the eye within a few pixels of the pointer, or −1.
  under(x, y) {
    const {clientWidth: width, clientHeight: height} = this.scene.canvas, {xyz} = this.frame;
    let found = -1, nearest = Infinity;
    for (let row = 0; row < this.frame.count; row++) {
      const [u, v, w] = toPixels(this.scene.matrix, xyz[3 * row], xyz[3 * row + 1], xyz[3 * row + 2], width, height);
      if (w < 0.3 || Math.abs(u - x) > PICK_PX || Math.abs(v - y) > PICK_PX) continue;
      const cost = Math.hypot(u - x, v - y) / PICK_PX + w / 40;
      if (cost < nearest) [found, nearest] = [row, cost];
    }
    return found;
  }

  showPoint() {
    const row = this.pointer && this.frame && this.scene.matrix ? this.under(...this.pointer) : -1;
    this.tip.hidden = row < 0;
    if (row < 0) return;
    this.tip.textContent = describePoint(this.frame, row);
    const left = this.pointer[0] + 16, over = left + this.tip.offsetWidth > this.element.clientWidth;
    this.tip.style.left = `${over ? this.pointer[0] - this.tip.offsetWidth - 12 : left}px`;
    this.tip.style.top = `${Math.min(this.pointer[1] + 12, this.element.clientHeight - this.tip.offsetHeight - 4)}px`;
  }
}

function describePoint(frame, row) {
  const [x, y, z] = frame.xyz.slice(3 * row, 3 * row + 3);
  const said = [`range ${frame.value('range', row).toFixed(2)} m, azimuth ${(Math.atan2(y, x) * 180 / Math.PI).toFixed(1)}°`,
    `x ${x.toFixed(2)}  y ${y.toFixed(2)}  z ${z.toFixed(2)} m`];
  const {ring, intensity, instance, material, residual} = frame.columns;
  const beam = [ring && `ring ${ring.values[row]}`, intensity && `intensity ${frame.value('intensity', row).toFixed(2)}`];
  if (ring || intensity) said.push(beam.filter(Boolean).join(', '));
  if (material && material.values[row] !== NO_MATERIAL) said.push(frame.materials[material.values[row]]);
  if (instance && instance.values[row] !== STATIC) {
    const objects = frame.boxes.filter(box => box.source === 'object');
    const box = (objects.length ? objects : frame.boxes)[instance.values[row]];
    said.push(box ? `${box.kind}: ${box.note}` : `object ${instance.values[row]}`);
  }
  if (residual && !Number.isNaN(frame.value('residual', row)))
    said.push(`measured − expected ${(100 * frame.value('residual', row)).toFixed(1)} cm`);
  return said.join('\n');
}
