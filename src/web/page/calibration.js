// The calibration of the camera: a page of fovea-calibrate at the next port, which looks at the pictures of the run, and its result.

import { byId } from "/panels.js";

export class Calibration {
  constructor(settings, link) {
    this.settings = settings;
    this.link = link;
    byId("calibrate").addEventListener("click", () => this.post(byId("board").value.trim()));
    byId("end-calibration").addEventListener("click", () => this.post("end"));
    byId("use-calibration").addEventListener("click", () => this.use());
    this.look();
  }
  allow(allowed) {
    this.allowed = allowed;
    this.show();
  }
  async look() {
    const answer = await fetch("/calibration").catch(() => undefined);
    if (answer && answer.ok) this.state = await answer.json();
    this.show();
    clearTimeout(this.timer);
    if (this.state && this.state.state === "runs") this.timer = setTimeout(() => this.look(), 1000);
  }
  async post(text) {
    const answer = await fetch(`/calibration?robot=${this.link().robot || 0}`, { method: "POST", body: text }).catch(() => undefined);
    if (!answer || !answer.ok) byId("calibration-said").textContent = answer ? "refused: " + (await answer.text()) : "fovea-web does not answer";
    else await this.look();
  }
  show() {
    const { state } = this;
    byId("calibration").hidden = !state;
    if (!state) return;
    const runs = state.state === "runs", said = byId("calibration-said");
    byId("calibrate").disabled = byId("board").disabled = !this.allowed || runs;
    byId("end-calibration").disabled = !this.allowed || !runs;
    byId("use-calibration").disabled = !this.allowed || !state.file;
    if (JSON.stringify(state) === this.said) return;
    this.said = JSON.stringify(state);
    const link = document.createElement("a");
    link.href = runs ? `${location.protocol}//${location.hostname}:${state.port}/` : "/calibration/result";
    if (runs) link.target = "_blank";
    link.rel = "noopener";
    link.textContent = runs ? "the page of the calibration" : state.file;
    if (runs) said.replaceChildren(state.file ? `made ${state.file}: ` : "goes on: ", link);
    else if (state.file) said.replaceChildren("made ", link);
    else said.textContent = state.state === "ended" ? `ended with status ${state.status} and without a result` : "";
  }
  // As a file of settings that holds it alone: kept for the next start.
  async use() {
    const said = byId("calibration-said"), { file } = this.state, answer = await fetch("/calibration/result");
    if (!answer.ok) said.textContent = "there is no result any more";
    else await this.settings.ask(`# The calibration alone.\n---\n${await answer.text()}`, ({ reason }) => {
      said.textContent = `${file}: ${reason}`;
    }, said);
  }
}
