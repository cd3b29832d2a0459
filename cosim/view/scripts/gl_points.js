// Points as round discs of a size in metres, never smaller than can be seen.
// Which of two discs of one surface lies on top is left to chance: the nearer one would always hide the other, and a
// picture of residuals would look as if all were measured too near.

class GlPoints {
  constructor(gl) {
    this.gl = gl;
    this.place = new GlColumn(gl, 3);
    this.colour = new GlColumn(gl, 4);
    this.count = 0;
    this.program = glProgram(gl, `
      attribute vec3 place; attribute vec4 colour; varying vec4 shade;
      uniform mat4 matrix; uniform float focal, radius, least, most; uniform vec2 depthOf;
      const float SURFACE_M = 0.12;
      void main() {
        gl_Position = matrix * vec4(place, 1.0);
        float chance = fract(sin(dot(place, vec3(12.9898, 78.233, 37.719))) * 43758.5453) - 0.5;
        float depth = gl_Position.w + SURFACE_M * chance;
        gl_Position.z = depthOf.x * depth + depthOf.y;
        gl_PointSize = clamp(2.0 * radius * focal / max(gl_Position.w, 0.1), least, most);
        shade = colour;
      }`, `
      precision mediump float; varying vec4 shade;
      void main() {
        vec2 away = gl_PointCoord - 0.5;
        if (dot(away, away) > 0.26) discard;
        gl_FragColor = vec4(shade.rgb, 1.0);
      }`);
  }

  // xyz: Float32Array of n × 3 metres.
  setPlaces(xyz) { this.place.fill(xyz); this.count = xyz.length / 3; }

  // rgba: Uint8Array of n × 4.
  setColours(rgba) { this.colour.fill(rgba); }

  draw(matrix, height, ratio, size) {
    const {gl, program: {program, uniforms, attributes}} = this;
    if (!this.count) return;
    gl.useProgram(program);
    this.place.feed(attributes.place);
    this.colour.feed(attributes.colour);
    gl.uniformMatrix4fv(uniforms.matrix, false, matrix);
    gl.uniform2f(uniforms.depthOf, ...DEPTH_OF);
    gl.uniform1f(uniforms.focal, height / 2 / Math.tan(FIELD_RAD / 2));
    gl.uniform1f(uniforms.radius, 0.022 * size);
    gl.uniform1f(uniforms.least, 1.25 * ratio * size);
    gl.uniform1f(uniforms.most, 7 * ratio * size);
    gl.drawArrays(gl.POINTS, 0, this.count);
  }
}
