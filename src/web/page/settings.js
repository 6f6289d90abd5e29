// All settings of the run as one file: saved here, and given back to it.

import { byId, download, names } from "/panels.js";

export class Settings {
  constructor(types, requests) {
    this.requests = requests;
    this.results = names(types, "fovea.settings_result_t", "RESULT_");
    byId("back-up").addEventListener("click", () => this.backUp());
    byId("restore").addEventListener("click", () => byId("restored").click());
    byId("restored").addEventListener("change", () => this.restore());
  }
  allow(allowed) {
    byId("back-up").disabled = byId("restore").disabled = !allowed;
  }
  say(text, good, said = byId("settings-said")) {
    said.textContent = text;
    said.dataset.result = good ? "good" : "bad";
  }
  async ask(text, done, said) {
    try {
      const answer = await this.requests.post("/settings?robot=" + (this.requests.link().robot || 0), text);
      if (answer.result === 0) done(answer);
      else this.say(`${this.results[answer.result]}: ${answer.reason}`, false, said);
    } catch (reason) {
      this.say(reason.message, false, said);
    }
  }
  backUp() {
    return this.ask("\n", (answer) => {
      const name = `fovea-settings-${new Date().toISOString().slice(0, 10)}.yaml`;
      download(name, new Blob([answer.text], { type: "application/yaml" }));
      this.say(`saved as ${name}`, true);
    });
  }
  async restore() {
    const input = byId("restored"), file = input.files[0];
    if (!file) return;
    const text = file.size <= 32767 ? await file.text() : "";
    input.value = "";
    if (!text) this.say(`refused: found ${file.size} bytes, expected 1 to 32767`);
    else await this.ask(text, (answer) => this.say(`restored ${file.name}: ${answer.reason}`, true));
  }
}
