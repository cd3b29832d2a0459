// Scans beam by beam, and charts whose bins can be picked: what is picked stays in colour, all else is dimmed.
// The state stands in the address: #frame=000014&channel=range&side=1&slice=incidence:3

const data = JSON.parse(document.getElementById('scan-data').textContent);
const byId = id => document.getElementById(id);
const KINDS = {u1: Uint8Array, i1: Int8Array, u2: Uint16Array, i2: Int16Array};
const ABSENT = {range: -32768, intensity: -128, drop: -128};
const DIMMED = 0.14, GROUND_RGB = [13, 16, 22], START = {...BEHIND, yaw: 0.35, pitch: 0.42, away: 34, target: [0, 0, 0]};

async function unpackedScan(scan) {
  const bytes = Uint8Array.from(atob(scan.data), letter => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  const buffer = await new Response(stream).arrayBuffer(), count = scan.rings * scan.columns, arrays = {};
  let offset = 0;
  for (const [name, kind] of scan.arrays) {
    const length = count * KINDS[kind].BYTES_PER_ELEMENT;
    arrays[name] = new KINDS[kind](buffer.slice(offset, offset + length));
    offset += length;
  }
  const xyz = new Float32Array(3 * count);
  for (let beam = 0; beam < count; beam++) {
    const ring = Math.floor(beam / scan.columns), column = beam % scan.columns;
    const azimuth = scan.azimuth[ring] - scan.turn * column, reach = arrays.range[beam] * data.step_m;
    const flat = reach * Math.cos(scan.elevation[ring]);
    xyz.set(reach ? [flat * Math.cos(azimuth), flat * Math.sin(azimuth), reach * Math.sin(scan.elevation[ring])]
      : [0, 0, -1e4], 3 * beam);
  }
  return {...scan, count, arrays, xyz};
}

function colourOf(share) {
  const place = (Math.min(1, Math.max(-1, share)) + 1) / 2 * (data.stops.length - 1);
  const low = Math.min(Math.floor(place), data.stops.length - 2), part = place - low;
  return data.stops[low].map((value, band) => value + part * (data.stops[low + 1][band] - value));
}

class Explorer {
  constructor() {
    this.state = {frame: data.scans[0].name, channel: 'range', side: data.scans[0].errors.length - 1, slice: null};
    this.cache = {};
    this.image = byId('image');
    this.scene = new Scene(byId('cloud'), new Orbit(START));
    if (!this.scene.gl) byId('cloud').replaceWith('Points need WebGL, which is disabled or not available in this browser.');
    this.bind();
    this.readAddress();
  }

  readAddress() {
    const told = new URLSearchParams(location.hash.slice(1));
    const wanted = {...this.state};
    if (data.scans.some(scan => scan.name === told.get('frame'))) wanted.frame = told.get('frame');
    if (document.querySelector(`[data-tab="${CSS.escape(told.get('channel') ?? '')}"]`)) wanted.channel = told.get('channel');
    if (told.has('side')) wanted.side = Math.min(Number(told.get('side')) || 0, data.scans[0].errors.length - 1);
    const [covariate, bin] = (told.get('slice') ?? '').split(':');
    wanted.slice = data.bins[covariate]?.words[bin] !== undefined ? {covariate, bin: Number(bin)} : null;
    return this.show(wanted);
  }

  async show(change) {
    const state = this.state = {...this.state, ...change};
    this.cache[state.frame] ??= unpackedScan(data.scans.find(scan => scan.name === state.frame));
    const scan = await this.cache[state.frame];
    if (state !== this.state) return;
    this.scan = scan;
    this.paint();
    this.mark();
  }

  // The channel that scans are coloured by: spurious returns are shown in every one.
  get coloured() { return data.channels[this.state.channel] ? this.state.channel : 'range'; }

  paint() {
    const {scan, coloured: name, state: {slice, side}} = this, {limit, step} = data.channels[name];
    const residual = scan.arrays[`${side}:${name}`], states = scan.arrays[`${side}:state`];
    const of = slice && scan.arrays[`bin:${slice.covariate}`], rgba = new Uint8Array(4 * scan.count);
    let inside = 0, seen = 0;
    for (let beam = 0; beam < scan.count; beam++) {
      const known = residual[beam] !== ABSENT[name], plain = name === 'drop' ? known : states[beam] === data.matched && known;
      let colour = plain ? colourOf(residual[beam] * step / limit) : data.states[states[beam]];
      if (of && of[beam] !== slice.bin)
        colour = colour.map((value, band) => GROUND_RGB[band] + DIMMED * (value - GROUND_RGB[band]));
      else { inside++; seen += known; }
      rgba.set([...colour, 255], 4 * beam);
    }
    this.rgba = rgba;
    this.drawImage();
    this.scene.setPoints(scan.xyz);
    this.scene.setColours(rgba);
    Object.assign(byId('scan').dataset, {points: scan.arrays.range.reduce((sum, value) => sum + (value > 0), 0), inside,
      channel: name, side});
    const {factor, unit} = data.channels[name], ends = `${+(factor * limit).toPrecision(3)} ${unit}`.trim();
    byId('low').textContent = `−${ends}`;
    byId('high').textContent = `+${ends} measured − model`;
    this.sayPicked();
  }

  drawImage() {
    const {scan, rgba, image} = this;
    image.width = scan.columns;
    image.height = scan.rings;
    image.getContext('2d').putImageData(new ImageData(new Uint8ClampedArray(rgba), scan.columns, scan.rings), 0, 0);
  }

  // Mean of the known residuals among some beams, in the shown unit.
  mean(side, chosen) {
    const name = this.coloured, {step, factor} = data.channels[name], residual = this.scan.arrays[`${side}:${name}`];
    let sum = 0, count = 0;
    for (let beam = 0; beam < residual.length; beam++)
      if (chosen(beam) && residual[beam] !== ABSENT[name]) { sum += residual[beam]; count++; }
    return [count ? factor * step * sum / count : NaN, count];
  }

  sayPicked() {
    const {scan, state: {slice}} = this, box = byId('slice');
    box.textContent = '';
    if (!slice) { box.textContent = 'All beams. Click a bin of a chart to see its beams here.'; return; }
    const of = scan.arrays[`bin:${slice.covariate}`], chosen = beam => of[beam] === slice.bin;
    const {label, words} = data.bins[slice.covariate];
    if (this.state.channel === 'spurious') return this.sayStrays(`${label.split(',')[0]}: ${words[slice.bin]}`, chosen);
    const sides = scan.errors.map((_, side) => this.mean(side, chosen));
    const said = sides.map(([mean, count]) => count ? this.quantity(mean) : 'nothing compared');
    this.say(`${label.split(',')[0]}: ${words[slice.bin]}`, `${sides.at(-1)[1].toLocaleString('en')} beams compared, mean ` +
      (said.length > 1 ? `${said[0]} → ${said[1]}` : said[0]));
    box.dataset.means = sides.map(([mean]) => mean.toFixed(4)).join(' ');
  }

  sayStrays(head, chosen) {
    const states = this.scan.arrays[`${this.state.side}:state`];
    let strays = 0, beams = 0;
    for (let beam = 0; beam < states.length; beam++)
      if (chosen(beam)) { beams++; strays += states[beam] === data.stray; }
    this.say(head, `${strays.toLocaleString('en')} spurious returns of ${beams.toLocaleString('en')} beams`);
  }

  // What is picked, what there is to say of it, and the way back.
  say(head, rest) {
    const strong = document.createElement('b'), clear = document.createElement('button');
    strong.textContent = head;
    clear.textContent = 'show all beams';
    clear.addEventListener('click', () => this.pick(null));
    byId('slice').append(strong, ` in frame ${this.scan.name}: ${rest} `, clear);
  }

  quantity(value) {
    const {unit} = data.channels[this.coloured], digits = unit === 'cm' ? 2 : unit ? 1 : 4;
    return `${value < 0 ? '−' : '+'}${Math.abs(value).toFixed(digits)}${unit ? ' ' + unit : ''}`;
  }

  sayBeam(event) {
    if (!this.scan) return;
    const {scan, image} = this, box = image.getBoundingClientRect();
    const column = Math.min(scan.columns - 1, Math.max(0, Math.floor((event.clientX - box.left) / box.width * scan.columns)));
    const ring = Math.min(scan.rings - 1, Math.max(0, Math.floor((event.clientY - box.top) / box.height * scan.rings)));
    const beam = ring * scan.columns + column, reach = scan.arrays.range[beam] * data.step_m;
    const said = [`ring ${ring}`, reach ? `measured ${reach.toFixed(2)} m` : 'no return'];
    for (const name of ['material', 'kind']) {
      const bin = scan.arrays[`bin:${name}`]?.[beam];
      if (bin !== undefined && bin !== 255) said.push(data.bins[name].words[bin]);
    }
    const name = this.coloured, {step, factor} = data.channels[name];
    const told = scan.errors.map((_, side) => scan.arrays[`${side}:${name}`][beam]);
    if (told.every(value => value !== ABSENT[name]))
      said.push(`measured − model ${told.map(value => this.quantity(factor * step * value)).join(' → ')}`);
    byId('beam').textContent = said.join(', ');
  }

  pick(slice, channel = this.state.channel) {
    this.show({slice, channel}).then(() => this.writeAddress());
  }

  writeAddress() {
    const {frame, channel, side, slice} = this.state, told = new URLSearchParams({frame, channel, side});
    if (slice) told.set('slice', `${slice.covariate}:${slice.bin}`);
    history.replaceState(null, '', `#${told}`);
  }

  mark() {
    const {frame, channel, side, slice} = this.state;
    const press = (selector, is) => {
      for (const one of document.querySelectorAll(selector)) one.setAttribute('aria-pressed', is(one.dataset));
    };
    press('#scan [data-frame]', told => told.frame === frame);
    press('#scan [data-side]', told => Number(told.side) === side);
    press('[data-tab]', told => told.tab === channel);
    for (const panel of document.querySelectorAll('[data-panel]')) panel.hidden = panel.dataset.panel !== channel;
    for (const one of document.querySelectorAll('.target'))
      one.classList.toggle('picked', !!slice && one.dataset.covariate === slice.covariate && Number(one.dataset.bin) === slice.bin);
  }

  bind() {
    const on = (selector, does) => {
      for (const one of document.querySelectorAll(selector)) one.addEventListener('click', () => does(one.dataset));
    };
    const change = told => this.show(told).then(() => this.writeAddress());
    on('#scan [data-frame]', told => change({frame: told.frame}));
    on('#scan [data-side]', told => change({side: Number(told.side)}));
    on('[data-tab]', told => change({channel: told.tab}));
    on('.target', told => this.pick({covariate: told.covariate, bin: Number(told.bin)}, told.channel));
    for (const plot of document.querySelectorAll('svg.plot')) this.bindKeys([...plot.querySelectorAll('.target')]);
    this.image.addEventListener('pointermove', event => this.sayBeam(event));
    this.image.addEventListener('click', event => this.sayBeam(event));
    byId('cloud')?.addEventListener('keydown', event => this.onKey(event));
    document.addEventListener('keydown', event => event.key === 'Escape' && this.state.slice && this.pick(null));
    window.addEventListener('hashchange', () => this.readAddress());
  }

  // One stop of the tab key a chart; arrows go from bin to bin, Enter picks.
  bindKeys(targets) {
    targets.forEach((one, place) => {
      one.setAttribute('tabindex', place ? -1 : 0);
      one.addEventListener('keydown', event => {
        const next = {ArrowRight: place + 1, ArrowLeft: place - 1, Home: 0, End: targets.length - 1}[event.key];
        if (event.key === 'Enter' || event.key === ' ') one.dispatchEvent(new MouseEvent('click'));
        else if (targets[next]) targets[next].focus();
        else return;
        event.preventDefault();
      });
    });
  }

  onKey(event) {
    const orbit = this.scene.orbit, does = {
      ArrowLeft: () => orbit.turn(-20, 0), ArrowRight: () => orbit.turn(20, 0), ArrowUp: () => orbit.turn(0, -20),
      ArrowDown: () => orbit.turn(0, 20), '+': () => orbit.zoom(0.85), '=': () => orbit.zoom(0.85),
      '-': () => orbit.zoom(1.18), t: () => orbit.look(ABOVE), r: () => orbit.look(START),
    }[event.key];
    if (does) { event.preventDefault(); does(); }
  }
}

window.explorer = new Explorer();
