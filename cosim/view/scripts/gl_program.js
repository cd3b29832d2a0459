// WebGL programs and buffers.

function glContext(canvas) {
  return canvas.getContext('webgl', {antialias: true, alpha: false, preserveDrawingBuffer: true});
}

function glProgram(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [kind, code] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, code);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  const uniforms = {}, attributes = {};
  for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
    const {name} = gl.getActiveUniform(program, i);
    uniforms[name] = gl.getUniformLocation(program, name);
  }
  for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_ATTRIBUTES); i++) {
    const {name} = gl.getActiveAttrib(program, i);
    attributes[name] = gl.getAttribLocation(program, name);
  }
  return {program, uniforms, attributes};
}

// One attribute of every vertex: floats, or bytes that mean 0–1.
class GlColumn {
  constructor(gl, size) {
    Object.assign(this, {gl, size, buffer: gl.createBuffer(), bytes: false});
  }

  fill(values) {
    this.bytes = values instanceof Uint8Array;
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.buffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, values, this.gl.STATIC_DRAW);
  }

  feed(place) {
    const {gl} = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, this.size, this.bytes ? gl.UNSIGNED_BYTE : gl.FLOAT, this.bytes, 0, 0);
  }
}
