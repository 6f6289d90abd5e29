// Numbers, words and buttons beside the pictures.

export const byId = (id) => document.getElementById(id);

// {"Latency": "12 ms"} as the terms of a list; what is undefined is left out.
export function facts(list, values) {
  const shown = Object.entries(values).filter(([, value]) => value !== undefined);
  if (list.childElementCount !== shown.length)
    list.replaceChildren(...shown.map(() => {
      const pair = document.createElement("div");
      pair.append(document.createElement("dt"), document.createElement("dd"));
      return pair;
    }));
  shown.forEach(([name, value], i) => {
    const [term, text] = list.children[i].children;
    if (term.textContent !== name) term.textContent = name;
    if (text.textContent !== value) text.textContent = value;
  });
}

export const fixed = (value, digits, unit) => (Number.isFinite(value) ? value.toFixed(digits) + (unit || "") : "not known");

// The names of constants of a type, by their numbers: STATE_LOST = 3 gives names[3] = "lost".
export function names(types, type, prefix) {
  const found = [];
  for (const [name, value] of Object.entries(types.get(type).constants))
    if (name.startsWith(prefix)) found[value] = name.slice(prefix.length).toLowerCase();
  return found;
}

export class PosePanel {
  constructor(types) {
    this.states = names(types, "fovea.pose_t", "STATE_");
    this.scales = names(types, "fovea.pose_t", "SCALE_");
    this.since = performance.now();
    setInterval(() => this.tick(), 1000);
  }
  show(pose) {
    const state = this.states[pose.state] || "?";
    if (state !== this.state) {
      this.state = state;
      this.since = performance.now();
      byId("state").dataset.state = state;
      byId("state-word").textContent = state;
      byId("state-said").textContent = "pose: " + state;
      this.tick();
    }
    const metric = this.scales[pose.scale_state] === "metric", unit = metric ? " m" : "";
    const has = Number.isFinite(pose.position[0]);
    facts(byId("pose-facts"), {
      [metric ? "Position, m" : "Position"]: has ? [...pose.position].map((value) => value.toFixed(2)).join("  ") : "none",
      Speed: Number.isFinite(pose.velocity[0]) ? Math.hypot(...pose.velocity).toFixed(2) + (metric ? " m/s" : " /s") : "not known",
      Scale: this.scales[pose.scale_state] || "?",
      Uncertainty: has && pose.covariance[0] >= 0 ? Math.sqrt(pose.covariance[0] + pose.covariance[6] + pose.covariance[11]).toPrecision(2) + unit : "not known",
      Inliers: String(pose.inliers),
      Quality: fixed(100 * pose.quality, 0, " %"),
      Map: pose.map_id < 0 ? "none" : `${pose.map_id} in ${pose.parent_frame}`,
      Calibration: pose.uncalibrated ? "guessed" : undefined,
    });
  }
  tick() {
    if (this.state) byId("state-since").textContent = `for ${Math.round((performance.now() - this.since) / 1000)} s`;
  }
  forget() {
    this.state = undefined;
    byId("state").dataset.state = "none";
    byId("state-word").textContent = "no pose yet";
    byId("state-since").textContent = "";
    byId("pose-facts").replaceChildren();
  }
}

// Give a file to the browser's user.
export function download(name, blob) {
  const anchor = document.createElement("a");
  anchor.href = URL.createObjectURL(blob);
  anchor.download = name;
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(anchor.href), 1000);
}

// The log as text, oldest line first.
export function saveLog() {
  const lines = [...byId("log").children].reverse().map((line) => `${line.firstChild.dateTime} ${line.lastChild.textContent}\n`);
  download(`fovea-log-${new Date().toISOString().slice(0, 19).replaceAll(":", "")}.txt`, new Blob(lines, { type: "text/plain" }));
}

export function logLine({ number, utime, text }) {
  const list = byId("log"), line = document.createElement("li"), time = document.createElement("time"), words = document.createElement("span");
  if (number === 0) list.replaceChildren();
  const date = new Date(utime / 1000);
  time.dateTime = date.toISOString();
  time.textContent = date.toTimeString().slice(0, 8);
  words.textContent = text;
  line.append(time, words);
  list.prepend(line);
  while (list.childElementCount > 200) list.lastChild.remove();
}

// Which parts of the run have a fault, and why.
export function showHealth(states, message) {
  const parts = message.parts.filter((part) => part.state !== 0);
  byId("health").hidden = parts.length === 0;
  byId("health").dataset.state = states[message.state] || "failed";
  byId("health").textContent = parts.map((part) => `${part.name} ${states[part.state]}: ${part.reason}`).join("; ");
}

export const megabytes = (bytes) => `${(Number(bytes) / 1e6).toFixed(1)} MB`;

// Recordings that the buttons begin and end: state, size, and what the disk has left.
export function showRecorder(states, message) {
  const state = states[message.state], parts = [];
  if (state === "ready") parts.push(message.file ? `recorded ${message.file}, ${megabytes(message.bytes)}` : "not recording");
  else parts.push(`${state === "records" ? "recording" : state} ${message.file}, ${megabytes(message.bytes)}`);
  if (message.reason) parts.push(`it ended early: ${message.reason}`);
  if (message.free_bytes >= 0) parts.push(`${(Number(message.free_bytes) / 1e9).toFixed(1)} GB free`);
  byId("recorder").hidden = false;
  byId("recorder").dataset.state = state;
  byId("recording").textContent = parts.join("; ");
}

// Buttons that send commands, and the run's answers.
export class Actions {
  constructor(types, requests) {
    this.requests = requests;
    this.results = names(types, "fovea.command_result_t", "RESULT_");
    for (const button of document.querySelectorAll("[data-command]")) button.addEventListener("click", () => this.press(button));
  }
  allow(hello) {
    const allowed = hello.commands && hello.running;
    for (const button of document.querySelectorAll("[data-command]")) button.disabled = !allowed;
    const why = hello.role !== "operate" ? "Your token allows to look, not to operate."
      : !hello.commands ? "fovea-web was started without --lcm-url, or found no LCM there: no commands." : "";
    if (why || !allowed) this.say(why);
  }
  async press(button) {
    const words = button.dataset.command, ask = button.dataset.confirm;
    if (ask && !button.classList.contains("sure")) {
      const label = button.textContent;
      button.classList.add("sure");
      button.textContent = ask;
      setTimeout(() => {
        button.classList.remove("sure");
        button.textContent = label;
      }, 4000);
      return;
    }
    this.say(words + ": sent");
    try {
      const answer = await this.requests.ask((request) => `command ${request} ${words}`);
      this.say(`${words}: ${this.results[answer.result]}${answer.reason ? ": " + answer.reason : ""}`, answer.result === 0 ? "good" : "bad");
    } catch (reason) {
      this.say(`${words}: ${reason.message}`, "bad");
    }
  }
  say(text, result) {
    byId("answer").textContent = text || "\u00a0";
    byId("answer").dataset.result = result || "";
  }
}
