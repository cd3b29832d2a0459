// The page: drives side by side, one slider, one eye, one mode of colours. Its state is `window.cosimView`.

const settings = JSON.parse(document.getElementById('settings').textContent);
const byId = id => document.getElementById(id);
const PREFETCHED = 2;

class Viewer {
  constructor() {
    this.look = {mode: MODES[0], boxes: 'labels', projected: true, names: true, size: 1, camera: null, part: WHOLE,
      showPart: part => this.showPart(part), colourOf: kind => settings.classes[kind.toLowerCase()] ?? settings.other_class};
    this.orbit = new Orbit();
    this.steps = settings.steps;
    this.store = new FrameStore(settings.served ? new ServedSource() : new InlineSource(), 10 * settings.drives.length);
    this.panes = settings.drives.map((drive, row) =>
      new Pane(document.querySelectorAll('.pane')[row], drive, this.orbit, this.look));
    Object.assign(this, {index: 0, ready: false, fault: null, wanted: null, timer: null});
    this.bindControls();
    this.go(this.fromAddress());
  }

  fromAddress() {
    return Math.max(0, this.steps.findIndex(([name]) => `#${encodeURIComponent(name)}` === location.hash));
  }

  // Shows a step; of several asked for meanwhile, the last.
  async go(index) {
    this.wanted = Math.min(this.steps.length - 1, Math.max(0, index));
    byId('slider').value = this.wanted;
    if (this.busy) return this.busy;
    this.busy = this.showWanted();
    try { await this.busy; } finally { this.busy = null; }
  }

  async showWanted() {
    this.ready = false;
    while (this.wanted !== null) {
      const index = this.wanted;
      this.wanted = null;
      await this.show(index).catch(error => this.complain(error));
    }
    this.ready = true;
  }

  async show(index) {
    const frames = await Promise.all(this.steps[index].map((name, drive) => this.store.get(drive, name)));
    if (!this.fitted) fitScales(frames, settings.intensity_top);
    this.fitted = true;
    await this.complete(frames);
    const imageless = !frames.some(frame => frame.cameras.length);
    document.querySelector('main').classList.toggle('imageless', imageless);
    await Promise.all(frames.map((frame, row) => this.panes[row].setFrame(frame)));
    [this.index, this.frames] = [index, frames];
    this.complain(null);
    byId('place').textContent = `${index + 1} / ${this.steps.length}`;
    history.replaceState(null, '', `#${encodeURIComponent(this.steps[index][0])}`);
    this.showModes();
    for (let ahead = 1; ahead <= PREFETCHED && index + ahead < this.steps.length; ahead++)
      this.steps[index + ahead].forEach((name, drive) => this.store.get(drive, name).catch(() => {}));
  }

  // Fetches what the mode needs and frames lack as yet.
  async complete(frames) {
    const lacking = frames.map((frame, drive) => [frame, drive]).filter(([frame]) => frame.deferred.has(this.look.mode.name));
    if (!lacking.length) return;
    byId('waiting').hidden = false;
    try { await Promise.all(lacking.map(([frame, drive]) => this.store.complete(drive, frame))); }
    finally { byId('waiting').hidden = true; }
    fitResidual(frames);
  }

  // Shows a part of the images: how much enlarged, and its corner as shares of the image.
  showPart({scale, x, y}) {
    const within = value => Math.min(1 - 1 / scale, Math.max(0, value));
    this.look.part = {scale, x: within(x), y: within(y)};
    for (const pane of this.panes) pane.image.redraw();
  }

  complain(error) {
    this.fault = error ? error.message : null;
    byId('fault').textContent = this.fault ?? '';
  }

  async setMode(name) {
    const mode = MODES.find(one => one.name === name);
    if (!mode || !this.available(mode)) return;
    this.look.mode = mode;
    this.showModes();
    await this.go(this.wanted ?? this.index);
  }

  available(mode) { return (this.frames ?? []).some(frame => !frame.absent[mode.name]); }

  showModes() {
    for (const button of document.querySelectorAll('[data-mode]')) {
      const mode = MODES.find(one => one.name === button.dataset.mode), open = this.available(mode);
      button.disabled = !open;
      button.title = open ? `key ${mode.key}` : this.frames.map(frame => frame.absent[mode.name]).join('; ');
      button.setAttribute('aria-pressed', mode === this.look.mode);
    }
    byId('boxes').textContent = `boxes: ${this.look.boxes}`;
    byId('projected').setAttribute('aria-pressed', this.look.projected);
    byId('names').setAttribute('aria-pressed', this.look.names);
  }

  dress() {
    this.showModes();
    for (const pane of this.panes) if (pane.frame) pane.dress();
  }

  play(on = !this.timer) {
    clearInterval(this.timer);
    this.timer = on ? setInterval(() => this.ready && this.go((this.index + 1) % this.steps.length), 200) : null;
    byId('play').textContent = this.timer ? '❚❚' : '▶';
  }

  nextCamera() {
    const names = this.frames[0].cameras.map(camera => camera.name);
    const now = names.indexOf(this.look.camera ?? names[0]);
    this.look.camera = names[(now + 1) % names.length] ?? null;
    this.go(this.index);
  }

  bindControls() {
    const slider = byId('slider');
    slider.max = this.steps.length - 1;
    slider.addEventListener('input', () => this.go(Number(slider.value)));
    const buttons = {play: 'play', boxes: 'nextBoxes', projected: 'toggleProjected', names: 'toggleNames', behind: 'behind',
      above: 'above', camera: 'nextCamera', help: 'toggleHelp'};
    for (const [id, does] of Object.entries(buttons)) byId(id).addEventListener('click', () => this[does]());
    for (const mode of MODES) {
      const button = line('button', mode.title);
      button.dataset.mode = mode.name;
      button.addEventListener('click', () => this.setMode(mode.name));
      byId('modes').append(button);
    }
    document.addEventListener('keydown', event => this.onKey(event));
    window.addEventListener('hashchange', () => this.go(this.fromAddress()));
    byId('camera').hidden = settings.cameras < 2;
  }

  nextBoxes() {
    this.look.boxes = BOX_CHOICES[(BOX_CHOICES.indexOf(this.look.boxes) + 1) % BOX_CHOICES.length];
    this.dress();
  }
  toggleProjected() { this.look.projected = !this.look.projected; this.dress(); }
  toggleNames() { this.look.names = !this.look.names; this.dress(); }
  behind() { this.orbit.look(BEHIND); }
  above() { this.orbit.look(ABOVE); }
  toggleHelp() { byId('keys').hidden = !byId('keys').hidden; }
  resize(factor) { this.look.size = Math.min(6, Math.max(0.4, this.look.size * factor)); this.dress(); }
  stretch(factor) { stretch(this.look.mode, factor); this.dress(); }

  onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const mode = MODES.find(one => one.key === event.key);
    const does = {
      ArrowRight: () => this.go((this.wanted ?? this.index) + 1), ArrowLeft: () => this.go((this.wanted ?? this.index) - 1),
      PageDown: () => this.go(this.index + 10), PageUp: () => this.go(this.index - 10),
      Home: () => this.go(0), End: () => this.go(this.steps.length - 1), ' ': () => this.play(),
      b: () => this.nextBoxes(), p: () => this.toggleProjected(), n: () => this.toggleNames(), r: () => this.behind(),
      t: () => this.above(), c: () => this.nextCamera(), '+': () => this.resize(1.25), '=': () => this.resize(1.25),
      '-': () => this.resize(0.8), ']': () => this.stretch(1.25), '[': () => this.stretch(0.8), '?': () => this.toggleHelp(),
    }[event.key] ?? (mode && (() => this.setMode(mode.name)));
    if (!does) return;
    event.preventDefault();
    does();
  }
}

window.cosimView = new Viewer();
