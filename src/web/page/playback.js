// A recording that is played in place of a run: play, pause, position, speed. All pages see the same.

import { byId } from "/panels.js";

const clock = (ms) => `${Math.floor(ms / 60000)}:${(ms / 1000 % 60).toFixed(1).padStart(4, "0")}`;

export class Playback {
  constructor(link) {
    this.link = link;
    this.held = false; // the slider is being moved
    byId("play").addEventListener("click", () => this.say(this.paused ? "resume" : "pause"));
    byId("speed").addEventListener("change", () => this.say("speed " + byId("speed").value));
    byId("position").addEventListener("input", () => {
      this.held = true;
      this.label(Number(byId("position").value));
    });
    for (const end of ["pointerup", "pointercancel", "blur"]) // back where it was, there is no change
      byId("position").addEventListener(end, () => { this.held = false; });
    byId("position").addEventListener("change", () => {
      this.held = false;
      this.say("seek " + byId("position").value);
    });
  }
  say(words) {
    this.link().say("play 0 " + words);
  }
  allow(role) {
    for (const name of ["play", "position", "speed"]) byId(name).disabled = role !== "operate";
  }
  show({ position_ms, length_ms, speed, paused }) {
    this.paused = paused;
    this.length_ms = length_ms;
    byId("playback").hidden = false;
    byId("actions").hidden = byId("parameters").hidden = true; // there is no run to ask
    byId("play").textContent = paused ? "Play" : "Pause";
    byId("position").max = length_ms;
    byId("speed").value = String(speed);
    if (this.held) return;
    byId("position").value = position_ms;
    this.label(position_ms);
  }
  label(ms) {
    byId("at").textContent = `${clock(ms)} of ${clock(this.length_ms)}`;
  }
}
