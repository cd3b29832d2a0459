// A camera image with the points that it sees, nearest on top, and boxes, in the colours of the other panel.
// The wheel comes nearer, dragging moves, a double click shows the whole; images of two drives do so together.

const IMAGE_NEAR_M = 0.3, MOST_ENLARGED = 16;
const WHOLE = {scale: 1, x: 0, y: 0};

class ImagePanel {
  constructor(canvas, look) {
    Object.assign(this, {canvas, look, boxes: []});
    this.redraw = onNextPicture(() => this.draw());
    new ResizeObserver(this.redraw).observe(canvas.parentElement);
    canvas.addEventListener('wheel', event => {
      event.preventDefault();
      this.enlarge(Math.exp(-event.deltaY * 0.001), event.offsetX / canvas.clientWidth, event.offsetY / canvas.clientHeight);
    }, {passive: false});
    canvas.addEventListener('pointerdown', event => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener('pointermove', event => {
      if (event.buttons) this.shift(-event.movementX / canvas.clientWidth, -event.movementY / canvas.clientHeight);
    });
    canvas.addEventListener('dblclick', () => look.showPart(WHOLE));
  }

  // About a place given in shares of the canvas.
  enlarge(factor, across, down) {
    const {scale, x, y} = this.look.part, next = Math.min(MOST_ENLARGED, Math.max(1, scale * factor));
    const gain = 1 / scale - 1 / next;
    this.look.showPart({scale: next, x: x + across * gain, y: y + down * gain});
  }

  shift(across, down) {
    const {scale, x, y} = this.look.part;
    this.look.showPart({scale, x: x + across / scale, y: y + down / scale});
  }

  async setFrame(frame, camera) {
    this.camera = frame.cameras.find(one => one.name === camera) ?? frame.cameras[0];
    this.canvas.hidden = !this.camera;
    const picture = this.camera ? await frame.picture(this.camera.name) : null;
    [this.frame, this.picture, this.seen] = [frame, picture, null];
  }

  setColours(rgba) { this.rgba = rgba; this.redraw(); }
  setBoxes(boxes) { this.boxes = boxes; this.redraw(); }

  carry(x, y, z) {
    const m = this.camera.matrix;
    return [m[0] * x + m[1] * y + m[2] * z + m[3], m[4] * x + m[5] * y + m[6] * z + m[7],
      m[8] * x + m[9] * y + m[10] * z + m[11]];
  }

  // Rows, pixels and depths of the points within the image, far ones first, those of one surface in no order.
  project() {
    const {xyz, count} = this.frame, {width, height} = this.picture, found = [];
    for (let row = 0; row < count; row++) {
      const [ud, vd, depth] = this.carry(xyz[3 * row], xyz[3 * row + 1], xyz[3 * row + 2]);
      if (depth < IMAGE_NEAR_M) continue;
      const u = ud / depth, v = vd / depth;
      if (u >= -0.5 && v >= -0.5 && u < width - 0.5 && v < height - 0.5) found.push([depth, u, v, row]);
    }
    return found.sort((a, b) => Math.round(4 * b[0]) - Math.round(4 * a[0]));
  }

  draw() {
    if (!this.picture) return;
    const {canvas, picture, look} = this, holder = canvas.parentElement, ratio = Math.min(devicePixelRatio || 1, 2);
    const scale = Math.min(holder.clientWidth / picture.width, holder.clientHeight / picture.height);
    if (!(scale > 0)) return;
    Object.assign(canvas.style, {width: `${picture.width * scale}px`, height: `${picture.height * scale}px`});
    canvas.width = Math.round(picture.width * scale * ratio);
    canvas.height = Math.round(picture.height * scale * ratio);
    const context = canvas.getContext('2d'), part = look.part;
    const enlarge = canvas.width / picture.width * part.scale;
    const left = part.x * picture.width, top = part.y * picture.height;
    context.imageSmoothingEnabled = enlarge < 4;
    context.setTransform(enlarge, 0, 0, enlarge, -left * enlarge, -top * enlarge);
    context.drawImage(picture, 0, 0);
    // (0, 0) is the centre of the first pixel
    context.setTransform(enlarge, 0, 0, enlarge, (0.5 - left) * enlarge, (0.5 - top) * enlarge);
    if (look.projected && this.rgba) this.drawPoints(context, enlarge, ratio * Math.sqrt(part.scale));
    context.lineWidth = 1.6 * ratio / enlarge;
    for (const box of this.boxes) this.drawBox(context, box);
  }

  drawPoints(context, enlarge, ratio) {
    this.seen ??= this.project();
    context.fillStyle = '#0d101666';
    context.fillRect(-0.5, -0.5, this.picture.width, this.picture.height);
    const size = 1.7 * this.look.size * ratio / enlarge;
    for (const [, u, v, row] of this.seen) {
      context.fillStyle = `rgb(${this.rgba[4 * row]},${this.rgba[4 * row + 1]},${this.rgba[4 * row + 2]})`;
      context.fillRect(u - size / 2, v - size / 2, size, size);
    }
  }

  drawBox(context, box) {
    const corners = cornersOf(box).map(corner => this.carry(...corner));
    context.strokeStyle = `rgb(${this.look.colourOf(box.kind).map(value => value * (box.source === 'label' ? 1 : 0.62))})`;
    context.beginPath();
    for (let [a, b] of EDGES.map(([from, to]) => [corners[from], corners[to]])) {
      if (a[2] < IMAGE_NEAR_M && b[2] < IMAGE_NEAR_M) continue;
      [a, b] = [cut(a, b), cut(b, a)];
      context.moveTo(a[0] / a[2], a[1] / a[2]);
      context.lineTo(b[0] / b[2], b[1] / b[2]);
    }
    context.stroke();
  }
}

// `inner` moved towards `outer` until it lies before the camera.
function cut(inner, outer) {
  if (inner[2] >= IMAGE_NEAR_M) return inner;
  const part = (IMAGE_NEAR_M - inner[2]) / (outer[2] - inner[2]);
  return inner.map((value, axis) => value + part * (outer[axis] - value));
}
