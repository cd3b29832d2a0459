// One drive: its facts, its points and its camera.

class Pane {
  constructor(element, drive, orbit, look) {
    Object.assign(this, {element, drive, look});
    this.space = new SpacePanel(element.querySelector('.space'), orbit, look);
    this.image = new ImagePanel(element.querySelector('.image canvas'), look);
    this.facts = element.querySelector('.facts');
    this.legend = element.querySelector('.legend');
  }

  async setFrame(frame) {
    await this.image.setFrame(frame, this.look.camera);
    this.frame = frame;
    this.space.setFrame(frame);
    this.element.querySelector('.no-image').hidden = frame.cameras.length > 0;
    const camera = this.image.camera ? [['camera', this.image.camera.name]] : [];
    this.facts.replaceChildren(...[['frame', frame.name], ...frame.facts, ...camera].map(([name, value]) => {
      const item = line('span', ''), title = line('small', `${name} `);
      item.append(title, value);
      return item;
    }));
    this.dress();
  }

  // Colours and boxes as the controls say.
  dress() {
    const rgba = colours(this.frame, this.look.mode), boxes = shownBoxes(this.frame, this.look.boxes);
    this.space.setColours(rgba);
    this.space.setBoxes(boxes);
    this.space.resize();
    this.image.setColours(rgba);
    this.image.setBoxes(boxes);
    showLegend(this.legend, this.frame, this.look.mode);
  }
}
