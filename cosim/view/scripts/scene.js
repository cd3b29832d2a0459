// A canvas with points, boxes, and rings on the ground round the sensor, seen from an orbit.

const GROUND = [13 / 255, 16 / 255, 22 / 255], RING_COLOUR = [56, 66, 84], EGO_COLOUR = [226, 232, 240];
const RINGS_M = [10, 20, 40, 60, 80];

class Scene {
  constructor(canvas, orbit) {
    Object.assign(this, {canvas, orbit, size: 1, ground: -1.73});
    this.gl = glContext(canvas);
    this.redraw = onNextPicture(() => this.draw());
    orbit.listeners.push(this.redraw);
    orbit.attach(canvas);
    new ResizeObserver(this.redraw).observe(canvas);
    canvas.addEventListener('webglcontextlost', event => event.preventDefault());
    canvas.addEventListener('webglcontextrestored', () => { this.prepare(); this.refill(); });
    if (this.gl) this.prepare();
    this.lines = [];
  }

  prepare() {
    this.points = new GlPoints(this.gl);
    this.wires = new GlLines(this.gl);
    this.marks = new GlLines(this.gl);
    this.marks.set(groundMarks(this.ground));
  }

  setGround(metres) {
    if (!this.gl || metres === this.ground) return;
    this.ground = metres;
    this.marks.set(groundMarks(metres));
  }

  setPoints(xyz) { this.xyz = xyz; this.gl && this.points.setPlaces(xyz); this.redraw(); }
  setColours(rgba) { this.rgba = rgba; this.gl && this.points.setColours(rgba); this.redraw(); }
  setLines(lines) { this.lines = lines; this.gl && this.wires.set(lines); this.redraw(); }

  refill() {
    if (this.xyz) this.setPoints(this.xyz);
    if (this.rgba) this.setColours(this.rgba);
    this.setLines(this.lines);
  }

  draw() {
    const ratio = fitCanvas(this.canvas), {width, height} = this.canvas, gl = this.gl;
    this.matrix = this.orbit.matrix(width / height);
    if (gl && !gl.isContextLost()) {
      gl.viewport(0, 0, width, height);
      gl.clearColor(...GROUND, 1);
      gl.enable(gl.DEPTH_TEST);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      this.marks.draw(this.matrix, width, height, ratio * 0.9);
      this.points.draw(this.matrix, height, ratio, this.size);
      this.wires.draw(this.matrix, width, height, ratio * 1.5);
    }
    this.drawn?.(this.matrix, ratio);
  }
}

function groundMarks(z) {
  const lines = [];
  for (const radius of RINGS_M) {
    const steps = 24 + radius * 2;
    const at = step => [radius * Math.cos(step / steps * 2 * Math.PI), radius * Math.sin(step / steps * 2 * Math.PI), z];
    for (let step = 0; step < steps; step++) lines.push([at(step), at(step + 1), RING_COLOUR]);
  }
  lines.push([[0, 0, z], [80, 0, z], RING_COLOUR]);
  const arrow = [[1.6, 0], [-1.2, 0.85], [-0.7, 0], [-1.2, -0.85]].map(([x, y]) => [x, y, z]);
  arrow.forEach((from, k) => lines.push([from, arrow[(k + 1) % 4], EGO_COLOUR]));
  return lines;
}
