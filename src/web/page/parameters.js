// Every key of the configuration (/keys): live ones are changed here, the others are shown and need a restart.

import { byId } from "/panels.js";

const DONE = 0, NEEDS_RESTART = 2, VALUE_BYTES_MAX = 300; // a page may say 400 at once
const AT_ONCE = 3; // values that are asked for: the server holds four replies
const bytes = new TextEncoder();

function element(tag, properties, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

export class Parameters {
  constructor(requests) {
    this.requests = requests;
    this.rows = new Map(); // by the key's name
    this.allowed = false;
    byId("all-keys").addEventListener("change", () => this.show());
  }
  async fetch() {
    const groups = new Map();
    for (const key of await (await fetch("/keys")).json()) {
      const at = key.name.indexOf("."), section = at < 0 ? "general" : key.name.slice(0, at);
      if (!groups.has(section)) groups.set(section, this.group(section));
      groups.get(section).append(this.row(key));
    }
    byId("keys").replaceChildren(...groups.values());
    this.show();
  }
  group(section) {
    const group = element("details", {}, element("summary", { textContent: section }));
    group.addEventListener("toggle", () => this.read(group));
    return group;
  }
  row(key) {
    const id = "key-" + key.name, choices = key.kind === "boolean" ? ["true", "false"] : key.words;
    const input = choices
      ? element("select", { id }, ...choices.map((word) => element("option", { value: word, textContent: word })))
      : element("input", { id, type: "text", autocomplete: "off", spellcheck: false, inputMode: key.kind === "number" ? "decimal" : "text" });
    const button = element("button", { type: "submit", textContent: "Set" });
    const said = element("p", { className: "result" });
    said.setAttribute("role", "status");
    const help = element("p", { className: "help", id: id + "-help",
      textContent: `${key.help}. ${key.range}; default ${key.default}${key.cost ? ". More: " + key.cost : ""}${key.live ? "" : ". Needs a restart"}.` });
    input.setAttribute("aria-describedby", help.id);
    const row = element("form", { className: "parameter" }, element("label", { htmlFor: id, textContent: key.name }), input, ...(key.live ? [button] : []), help, said);
    row.addEventListener("submit", (event) => {
      event.preventDefault();
      this.set(key.name);
    });
    this.rows.set(key.name, { key, row, input, button, said, known: false });
    return row;
  }
  // Only what can be changed, unless all are wanted.
  show() {
    const all = byId("all-keys").checked;
    for (const { key, row } of this.rows.values()) row.hidden = !all && !key.live;
    for (const group of byId("keys").children) {
      group.hidden = !group.querySelector(".parameter:not([hidden])");
      this.read(group);
    }
  }
  allow(allowed) {
    this.allowed = allowed;
    for (const row of this.rows.values()) {
      row.known = false;
      row.button.disabled = !allowed;
      row.input.disabled = !allowed || !row.key.live;
    }
    for (const group of byId("keys").children) this.read(group);
  }
  // The values of the open groups, one after the other.
  read(group) {
    this.reading = (this.reading || Promise.resolve()).then(() => this.readNow(group));
  }
  async readNow(group) {
    const forms = [...group.querySelectorAll(".parameter")];
    await Promise.all(Array.from({ length: AT_ONCE }, () => this.readSome(group, forms)));
  }
  async readSome(group, forms) {
    for (let form; (form = forms.shift());) {
      const row = this.rows.get(form.firstChild.textContent);
      if (!group.open || !this.allowed || form.hidden || row.known) continue;
      row.known = true;
      try {
        this.heard(await this.ask(row.key.name, "", false));
      } catch (reason) {
        row.known = false;
        this.say(row, reason.message, "bad");
        forms.length = 0;
      }
    }
  }
  ask(name, value, keep) {
    return this.requests.ask((request) => `parameter ${request} ${keep ? "keep" : "once"} ${name}${value === "" ? "" : " " + value}`);
  }
  async set(name) {
    const row = this.rows.get(name), value = row.input.value.trim();
    if (bytes.encode(value).length > VALUE_BYTES_MAX) {
      this.say(row, `refused: the value has more than ${VALUE_BYTES_MAX} bytes`, "bad");
      return;
    }
    this.say(row, "sent");
    try {
      const answer = await this.ask(name, value === "" ? '""' : value, byId("keep").checked);
      if (answer.result === DONE) this.say(row, "in force: " + answer.value, "good");
      else if (answer.result === NEEDS_RESTART) this.say(row, "kept for the next start", "good");
      else this.say(row, `refused: ${answer.reason}. In force: ${answer.value}`, "bad");
    } catch (reason) {
      this.say(row, reason.message, "bad");
    }
  }
  // An answer to anybody: what is in force now.
  heard({ key, value, result }) {
    const row = this.rows.get(key);
    if (row && result === DONE && document.activeElement !== row.input) row.input.value = value;
  }
  say(row, text, result) {
    row.said.textContent = text;
    row.said.dataset.result = result || "";
  }
}
