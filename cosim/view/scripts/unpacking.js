// Frames as `cosim/view/interactive/packing.py` packs them.

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Response(stream).arrayBuffer();
}

// {header, columns: name → {values, scale}, images: name → Blob}
async function unpacked(bytes) {
  const buffer = await inflated(bytes);
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const columns = {}, images = {};
  for (const {name, coding, scale, offset} of header.columns)
    columns[name] = {scale, values: columnValues(new Uint8Array(buffer, 4 + length + offset), coding, header.points)};
  for (const {name, offset, length: size} of header.images)
    images[name] = new Blob([new Uint8Array(buffer, 4 + length + offset, size)], {type: 'image/jpeg'});
  return {header, columns, images};
}

function columnValues(bytes, coding, count) {
  if (coding === 'u8') return bytes.slice(0, count);
  const values = new Int16Array(count);
  for (let row = 0; row < count; row++) {
    const zigzag = bytes[row] | bytes[count + row] << 8;
    values[row] = zigzag >>> 1 ^ -(zigzag & 1);
    if (coding === 'delta' && row) values[row] += values[row - 1];
  }
  return values;
}
