// The maps in the folder of the run, one of which can be loaded into it.

import { byId, megabytes, names } from "/panels.js";

export class Maps {
  constructor(types, requests) {
    this.requests = requests;
    this.results = names(types, "fovea.command_result_t", "RESULT_");
    byId("load-map").addEventListener("click", () => this.load());
    byId("map-file").addEventListener("pointerdown", () => this.list());
    byId("map-file").addEventListener("focus", () => this.list());
  }
  allow(allowed) {
    byId("load-map").disabled = byId("map-file").disabled = !allowed;
    if (allowed && !this.allowed) this.list();
    if (!allowed) byId("maps").hidden = true;
    this.allowed = allowed;
  }
  // Without a folder of maps there is nothing to choose from.
  async list() {
    if (this.asked || performance.now() - this.listed < 2000) return;
    this.asked = true;
    try {
      const answer = await this.requests.ask((request) => `map ${request}`);
      byId("maps").hidden = !answer.files;
      if (answer.files) this.show(answer.files);
      this.listed = performance.now();
    } catch (reason) {
      byId("maps").hidden = true;
    }
    this.asked = false;
  }
  show(files) {
    const select = byId("map-file"), chosen = select.value;
    const words = files.map(({ name, landmarks, bytes }) => [name, `${name}, ${landmarks} landmarks, ${megabytes(bytes)}`]);
    if (words.length === 0) words.push(["", "no maps yet"]);
    if (JSON.stringify(words) === this.shown) return; // it may be open
    this.shown = JSON.stringify(words);
    select.replaceChildren(...words.map(([name, text]) => new Option(text, name, false, name === chosen)));
    byId("load-map").disabled = files.length === 0;
  }
  async load() {
    const name = byId("map-file").value, said = byId("answer");
    if (!name) return;
    const say = (text, good) => {
      said.textContent = `load ${name}: ${text}`;
      said.dataset.result = good === undefined ? "" : good ? "good" : "bad";
    };
    say("sent");
    try {
      const answer = await this.requests.ask((request) => `map ${request} ${name}`);
      say(this.results[answer.result] + (answer.reason ? ": " + answer.reason : ""), answer.result === 0);
    } catch (reason) {
      say(reason.message, false);
    }
  }
}
