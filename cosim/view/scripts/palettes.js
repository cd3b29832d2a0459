// Colour tables of 256 × RGB, from a few stops.

function palette(stops) {
  const table = new Uint8Array(768);
  for (let row = 0; row < 256; row++) {
    const place = row / 255 * (stops.length - 1), low = Math.min(stops.length - 2, Math.floor(place));
    for (let band = 0; band < 3; band++)
      table[3 * row + band] = stops[low][band] + (place - low) * (stops[low + 1][band] - stops[low][band]);
  }
  return table;
}

// Of even steps to the eye, its darkest part left out so that low values show on black.
const VIRIDIS = palette([[69, 55, 129], [57, 86, 140], [45, 113, 142], [35, 138, 141], [32, 163, 134],
  [60, 188, 117], [115, 208, 85], [184, 222, 41], [253, 231, 37]]);
const SPECTRUM = palette([[226, 70, 54], [250, 140, 40], [244, 206, 58], [150, 222, 80], [56, 206, 144],
  [44, 172, 214], [76, 120, 236], [112, 84, 200]]);
const DIVERGING = palette([[38, 110, 232], [116, 176, 240], [238, 238, 234], [246, 160, 92], [222, 46, 32]]);
const UNKNOWN = [92, 100, 116];

// Vivid colours of numbers from 0; neighbours in number differ most.
function numberColour(number) {
  const hue = (number * 0.61803398875 % 1) * 6, strong = number % 3 === 1 ? 0.42 : 0.68;
  const part = shift => {
    const k = (shift + hue) % 6;
    return Math.round(255 * (1 - strong * Math.max(0, Math.min(k, 4 - k, 1))));
  };
  return [part(5), part(3), part(1)];
}
