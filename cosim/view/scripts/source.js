// Where frames come from: this very file, or the server that it was opened at.

class InlineSource {
  async bytes(kind, drive, name) {
    const element = [...document.querySelectorAll(`script[data-${kind}="${drive}"]`)]
      .find(one => one.dataset.name === name);
    if (!element) throw new Error(`frame ${name} is not in this file`);
    return Uint8Array.from(atob(element.textContent), letter => letter.charCodeAt(0));
  }
}

class ServedSource {
  async bytes(kind, drive, name) {
    const answer = await fetch(`${kind}/${drive}/${encodeURIComponent(name)}`);
    if (!answer.ok) throw new Error(await answer.text() || `frame ${name}: ${answer.status}`);
    return answer.arrayBuffer();
  }
}

// Keeps the last frames that were asked for.
class FrameStore {
  constructor(source, most) { Object.assign(this, {source, most, kept: new Map()}); }

  get(drive, name) {
    const key = `${drive}/${name}`;
    const found = this.kept.get(key) ?? this.load(drive, name);
    this.kept.delete(key);
    this.kept.set(key, found);
    found.catch(() => this.kept.delete(key));
    for (const oldest of this.kept.keys()) {
      if (this.kept.size <= this.most) break;
      this.kept.delete(oldest);
    }
    return found;
  }

  async load(drive, name) {
    return new ViewFrame(await unpacked(await this.source.bytes('frame', drive, name)));
  }

  // What is only made when it is asked for, such as residuals.
  complete(drive, frame) {
    frame.completing ??= this.source.bytes('extra', drive, frame.name).then(unpacked).then(extra => frame.add(extra));
    return frame.completing;
  }
}
