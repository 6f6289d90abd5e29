// The recordings in the folder of the run, one of which can be downloaded.

import { byId, megabytes } from "/panels.js";

export class Recordings {
  constructor() {
    byId("download-recording").addEventListener("click", () => this.download());
    for (const event of ["pointerdown", "focus"]) byId("recording-file").addEventListener(event, () => this.list());
    this.list();
  }
  // Without a folder of recordings there is nothing to choose from.
  async list() {
    if (this.asked || performance.now() - this.listed < 2000) return;
    this.asked = true;
    const answer = await fetch("/recordings").catch(() => undefined);
    const files = answer && answer.ok ? await answer.json() : null;
    this.asked = false;
    this.listed = performance.now();
    byId("recordings").hidden = !files;
    if (files) this.show(files);
  }
  show(files) {
    const select = byId("recording-file"), chosen = select.value;
    const words = files.map(({ name, bytes }) => [name, `${name}, ${megabytes(bytes)}`]);
    if (words.length === 0) words.push(["", "no recordings yet"]);
    if (JSON.stringify(words) === this.shown) return; // it may be open
    this.shown = JSON.stringify(words);
    select.replaceChildren(...words.map(([name, text]) => new Option(text, name, false, name === chosen)));
    byId("download-recording").disabled = files.length === 0;
  }
  download() {
    const name = byId("recording-file").value, anchor = document.createElement("a");
    if (!name) return;
    anchor.href = "/recordings/" + name;
    anchor.download = name;
    anchor.click();
  }
  // A recording has ended, or another file has begun.
  changed() {
    this.listed = undefined;
    this.list();
  }
}
