// One frame: what is known of its points, its boxes and its cameras.

class ViewFrame {
  constructor({header, columns, images}) {
    Object.assign(this, {columns, images, absent: header.absent, materials: header.materials, name: header.name,
      count: header.points, facts: header.facts, boxes: header.boxes, cameras: header.cameras,
      ground: header.ground_m, deferred: new Set(header.deferred)});
    this.xyz = new Float32Array(3 * this.count);
    for (const [axis, name] of ['x', 'y', 'z'].entries()) {
      const {values, scale} = columns[name];
      for (let row = 0; row < this.count; row++) this.xyz[3 * row + axis] = values[row] * scale;
    }
    const range = new Float32Array(this.count);
    for (let row = 0; row < this.count; row++)
      range[row] = Math.hypot(this.xyz[3 * row], this.xyz[3 * row + 1], this.xyz[3 * row + 2]);
    columns.range = {values: range, scale: 1};
    if (!this.count) for (const name of Object.keys(columns)) this.absent[name] = 'the scan holds no point';
  }

  add({header, columns}) {
    Object.assign(this.columns, columns);
    Object.assign(this.absent, header.absent);
    if (header.materials.length) this.materials = header.materials;
    this.deferred.clear();
  }

  // The value of a point in the column's unit; NaN where it is not known.
  value(name, row) {
    const {values, scale} = this.columns[name];
    return values[row] === -32768 ? NaN : values[row] * scale;
  }

  async picture(name) {
    this.pictures ??= {};
    this.pictures[name] ??= createImageBitmap(this.images[name]);
    return this.pictures[name];
  }
}
