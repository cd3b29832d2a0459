// What points may be coloured by. Each mode gives a colour to a value, and says how its scale reads.

const ROUND_M = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1];
const TICKS_M = [1, 2, 5, 10, 20, 40, 80];
const STATIC = -1, NO_MATERIAL = 255;

const fixed = digits => value => value.toFixed(digits);

const MODES = [
  {name: 'intensity', key: '1', title: 'Intensity', unit: 'of 1', low: 0, high: 1, table: VIRIDIS, text: fixed(2)},
  {name: 'range', key: '2', title: 'Range', unit: 'm', low: 3, high: 80, table: SPECTRUM, logarithmic: true,
    text: fixed(1)},
  {name: 'ring', key: '3', title: 'Ring', unit: 'top is 0', low: 0, high: 63, table: SPECTRUM, text: fixed(0)},
  {name: 'instance', key: '4', title: 'Object', unit: '', kind: 'number'},
  {name: 'material', key: '5', title: 'Material', unit: '', kind: 'name'},
  {name: 'residual', key: '6', title: 'Residual', unit: 'cm', low: -0.05, high: 0.05, table: DIVERGING, both: true,
    text: value => `${value > 0 ? '+' : ''}${(100 * value).toFixed(Math.abs(value) < 0.1 ? 1 : 0)}`},
];

// A scale's place of a value, 0–1.
function share(mode, value) {
  const part = mode.logarithmic ? Math.log(Math.max(value, 1e-3) / mode.low) / Math.log(mode.high / mode.low)
    : (value - mode.low) / (mode.high - mode.low);
  return Math.min(1, Math.max(0, part));
}

// Fits scales to what frames hold, once.
function fitScales(frames, intensityTop) {
  const mode = name => MODES.find(one => one.name === name);
  mode('intensity').high = intensityTop;
  for (const frame of frames) if (frame.columns.ring)
    mode('ring').high = Math.max(mode('ring').high, frame.columns.ring.values.reduce((a, b) => Math.max(a, b), 0));
  fitResidual(frames);
}

// The round limit that nineteen of twenty residuals stay below.
function fitResidual(frames) {
  const mode = MODES.find(one => one.name === 'residual'), sizes = [];
  for (const frame of frames) if (frame.columns.residual)
    for (let row = 0; row < frame.count; row += 5) {
      const value = frame.value('residual', row);
      if (!Number.isNaN(value)) sizes.push(Math.abs(value));
    }
  if (!sizes.length || mode.fitted) return;
  sizes.sort((a, b) => a - b);
  const reach = sizes[Math.floor(0.95 * (sizes.length - 1))];
  mode.high = ROUND_M.find(limit => limit >= reach) ?? 1;
  mode.low = -mode.high;
  mode.fitted = true;
}

// Makes the present scale's end nearer or farther.
function stretch(mode, factor) {
  if (mode.kind || mode.name === 'ring') return;
  mode.high = Math.max(mode.logarithmic ? 2 * mode.low : 1e-3, mode.high * factor);
  if (mode.both) mode.low = -mode.high;
}

// Uint8Array of n × RGBA.
function colours(frame, mode) {
  const rgba = new Uint8Array(4 * frame.count).fill(255), column = frame.columns[mode.name];
  for (let row = 0; row < frame.count; row++) rgba.set(UNKNOWN, 4 * row);
  if (!column || !frame.count) return rgba;
  if (mode.kind) numberColours(frame, mode, rgba);
  else for (let row = 0; row < frame.count; row++) {
    const value = frame.value(mode.name, row);
    if (Number.isNaN(value)) continue;
    const place = 3 * Math.round(255 * share(mode, value));
    for (let band = 0; band < 3; band++) rgba[4 * row + band] = mode.table[place + band];
  }
  return rgba;
}

// A hue a number; what has no object stays gray, lit by its intensity so that its surfaces can be told apart.
function numberColours(frame, mode, rgba) {
  const {values} = frame.columns[mode.name], none = mode.kind === 'name' ? NO_MATERIAL : STATIC;
  const bright = frame.columns.intensity?.values, table = new Map([[none, UNKNOWN]]);
  for (let row = 0; row < frame.count; row++) {
    const light = bright ? 0.55 + 0.45 * Math.min(1, bright[row] / 128) : 0.9;
    const number = values[row];
    if (!table.has(number)) table.set(number, mode.kind === 'name' ? materialColour(frame, number) : numberColour(number));
    const own = table.get(number);
    for (let band = 0; band < 3; band++) rgba[4 * row + band] = own[band] * light;
  }
}
