// 4 × 4 matrices as 16 numbers, column by column, as WebGL wants them.

function multiply(a, b) {
  const out = new Float32Array(16);
  for (let column = 0; column < 4; column++)
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[4 * k + row] * b[4 * column + k];
      out[4 * column + row] = sum;
    }
  return out;
}

// A pinhole view `fieldRad` high.
function perspective(fieldRad, aspect, near, far) {
  const focal = 1 / Math.tan(fieldRad / 2), depth = near - far;
  return new Float32Array([focal / aspect, 0, 0, 0, 0, focal, 0, 0,
    0, 0, (far + near) / depth, -1, 0, 0, 2 * far * near / depth, 0]);
}

// World to eye axes for an eye that looks along `forward`, with `right` and `up` square to it.
function viewMatrix(eye, right, up, forward) {
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  return new Float32Array([right[0], up[0], -forward[0], 0, right[1], up[1], -forward[1], 0,
    right[2], up[2], -forward[2], 0, -dot(right, eye), -dot(up, eye), dot(forward, eye), 1]);
}

// [x, y, w] in pixels of a canvas `width` × `height`; w ≤ 0 is behind the eye.
function toPixels(matrix, x, y, z, width, height) {
  const w = matrix[3] * x + matrix[7] * y + matrix[11] * z + matrix[15];
  const u = matrix[0] * x + matrix[4] * y + matrix[8] * z + matrix[12];
  const v = matrix[1] * x + matrix[5] * y + matrix[9] * z + matrix[13];
  return [(u / w + 1) / 2 * width, (1 - v / w) / 2 * height, w];
}
