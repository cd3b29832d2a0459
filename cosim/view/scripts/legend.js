// What colours mean: a bar with ticks and unit, or names beside swatches.

function showLegend(element, frame, mode) {
  const why = frame.absent[mode.name];
  if (why) return element.replaceChildren(line('strong', mode.title), line('span', `not here: ${why}`, 'muted'));
  if (!mode.kind) return element.replaceChildren(line('strong', `${mode.title} [${mode.unit}]`), bar(mode), marks(mode),
    ...(mode.both ? [line('span', 'blue: measured nearer than the model says; gray: it says nothing', 'muted')] : []));
  const title = line('strong', mode.title);
  if (mode.kind === 'number')
    return element.replaceChildren(title, line('span', 'a hue an object, gray: static world', 'muted'));
  element.replaceChildren(title, ...mostCommon(frame).map(([row, count]) => {
    const text = line('span', `${frame.materials[row] ?? row} ${percent(count / frame.count)}`);
    return swatched(materialColour(frame, row), text);
  }));
}

function line(tag, text, name = '') {
  return Object.assign(document.createElement(tag), {textContent: text, className: name});
}

function swatched(rgb, text) {
  const box = document.createElement('i'), row = document.createElement('div');
  box.style.background = `rgb(${rgb})`;
  row.append(box, text);
  return row;
}

function bar(mode) {
  const stops = [];
  for (let row = 0; row < 256; row += 15) stops.push(`rgb(${mode.table.slice(3 * row, 3 * row + 3)})`);
  const element = line('div', '', 'bar');
  element.style.background = `linear-gradient(90deg,${stops})`;
  return element;
}

function marks(mode) {
  const element = line('div', '', 'marks');
  const values = mode.logarithmic ? [mode.low, ...TICKS_M.filter(tick => tick > 1.3 * mode.low && tick < 0.8 * mode.high),
    mode.high] : [0, 0.5, 1].map(part => mode.low + part * (mode.high - mode.low));
  for (const value of values) {
    const mark = line('span', mode.logarithmic ? String(Math.round(value)) : mode.text(value));
    mark.style.left = `${100 * share(mode, value)}%`;
    element.append(mark);
  }
  return element;
}

function mostCommon(frame) {
  const counts = new Map();
  for (const row of frame.columns.material.values)
    if (row !== NO_MATERIAL) counts.set(row, (counts.get(row) ?? 0) + 1);
  return [...counts].sort((a, b) => b[1] - a[1]).slice(0, 12);
}

const percent = part => part < 0.005 ? '< 1%' : `${Math.round(100 * part)}%`;
