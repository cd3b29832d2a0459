// Lines of any width: each is a strip of two triangles that the vertex program widens on the screen.

class GlLines {
  constructor(gl) {
    this.gl = gl;
    [this.start, this.end, this.corner, this.colour] = [3, 3, 2, 4].map(size => new GlColumn(gl, size));
    this.count = 0;
    this.program = glProgram(gl, `
      attribute vec3 start, end; attribute vec2 corner; attribute vec4 colour; varying vec4 shade;
      uniform mat4 matrix; uniform vec2 size; uniform float width;
      const float NEAR = 0.3;
      void main() {
        vec4 a = matrix * vec4(start, 1.0), b = matrix * vec4(end, 1.0);
        if (a.w < NEAR && b.w >= NEAR) a = mix(a, b, (NEAR - a.w) / (b.w - a.w));
        if (b.w < NEAR && a.w >= NEAR) b = mix(b, a, (NEAR - b.w) / (a.w - b.w));
        vec2 along = (b.xy / b.w - a.xy / a.w) * size;
        float reach = length(along);
        along = reach > 0.0 ? along / reach : vec2(1.0, 0.0);
        vec4 place = corner.x < 0.5 ? a : b;
        place.xy += vec2(-along.y, along.x) * corner.y * width / size * place.w;
        gl_Position = place;
        shade = colour;
      }`, `
      precision mediump float; varying vec4 shade;
      void main() { gl_FragColor = shade; }`);
  }

  // lines: [[x, y, z], [x, y, z], [r, g, b]] each, colours 0–255.
  set(lines) {
    const n = lines.length * 6, corners = [[0, -1], [1, -1], [1, 1], [0, -1], [1, 1], [0, 1]];
    const start = new Float32Array(3 * n), end = new Float32Array(3 * n);
    const corner = new Float32Array(2 * n), colour = new Uint8Array(4 * n);
    lines.forEach(([from, to, rgb], line) => corners.forEach((pair, k) => {
      const row = 6 * line + k;
      start.set(from, 3 * row); end.set(to, 3 * row); corner.set(pair, 2 * row); colour.set([...rgb, 255], 4 * row);
    }));
    this.start.fill(start); this.end.fill(end); this.corner.fill(corner); this.colour.fill(colour);
    this.count = n;
  }

  draw(matrix, width, height, thickness) {
    const {gl, program: {program, uniforms, attributes}} = this;
    if (!this.count) return;
    gl.useProgram(program);
    for (const name of ['start', 'end', 'corner', 'colour']) this[name].feed(attributes[name]);
    gl.uniformMatrix4fv(uniforms.matrix, false, matrix);
    gl.uniform2f(uniforms.size, width, height);
    gl.uniform1f(uniforms.width, thickness);
    gl.drawArrays(gl.TRIANGLES, 0, this.count);
  }
}
