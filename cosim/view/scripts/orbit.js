// An eye that turns about a point: x forward, y left, z up, metres.
// Drag turns, drag with the right button or shift moves, the wheel comes nearer, a double click goes back.

const BEHIND = {target: [10, 0, 0], yaw: 0, pitch: 0.36, away: 30};
const ABOVE = {target: [12, 0, 0], yaw: 0, pitch: 1.5607, away: 85};
const FIELD_RAD = 0.9, NEAR_M = 0.3, FAR_M = 900;
// Clip depth is DEPTH_OF[0] · distance along the view + DEPTH_OF[1].
const DEPTH_OF = [(FAR_M + NEAR_M) / (FAR_M - NEAR_M), -2 * FAR_M * NEAR_M / (FAR_M - NEAR_M)];

class Orbit {
  constructor(start = BEHIND) {
    this.start = start;
    this.listeners = [];
    this.look(start);
  }

  look(place) {
    Object.assign(this, {...place, target: [...place.target]});
    this.changed();
  }

  changed() { for (const listener of this.listeners ?? []) listener(); }

  // World to clip axes for a canvas.
  matrix(aspect) {
    const {forward, left, up, eye} = this.axes();
    const view = viewMatrix(eye, left.map(value => -value), up, forward);
    return multiply(perspective(FIELD_RAD, aspect, NEAR_M, FAR_M), view);
  }

  axes() {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    const forward = [cp * cy, cp * sy, -sp], left = [-sy, cy, 0], up = [sp * cy, sp * sy, cp];
    return {forward, left, up, eye: this.target.map((value, axis) => value - this.away * forward[axis])};
  }

  turn(right, down) {
    this.yaw -= right * 0.006;
    this.pitch = Math.min(1.5607, Math.max(-0.35, this.pitch + down * 0.006));
    this.changed();
  }

  // Moves along the ground, as if it were held where it is touched.
  move(right, down, height) {
    const step = 2 * this.away * Math.tan(FIELD_RAD / 2) / height;
    const ahead = step * down / Math.max(0.35, Math.sin(Math.abs(this.pitch)));
    const [cy, sy] = [Math.cos(this.yaw), Math.sin(this.yaw)];
    this.target[0] += ahead * cy - right * step * sy;
    this.target[1] += ahead * sy + right * step * cy;
    this.changed();
  }

  zoom(factor) {
    this.away = Math.min(400, Math.max(1.5, this.away * factor));
    this.changed();
  }

  // Lets a pointer on an element steer.
  attach(element) {
    element.addEventListener('contextmenu', event => event.preventDefault());
    element.addEventListener('pointerdown', event => element.setPointerCapture(event.pointerId));
    element.addEventListener('pointermove', event => {
      if (!event.buttons) return;
      const moves = (event.buttons & 6) || event.shiftKey;
      if (moves) this.move(event.movementX, event.movementY, element.clientHeight);
      else this.turn(event.movementX, event.movementY);
    });
    element.addEventListener('wheel', event => {
      event.preventDefault();
      this.zoom(Math.exp(event.deltaY * 0.001));
    }, {passive: false});
    element.addEventListener('dblclick', () => this.look(this.start));
  }
}
