// Values of the last two minutes, with the newest as text. charts.js draws them.

const SPAN_MS = 120000;
const COLOURS = ["#5fd0ff", "#ffb347", "#7ee787", "#ff8fb1", "#c9a2ff", "#ffe066", "#66e0c8", "#ff7f66", "#a3b8ff", "#d9c2a0"];

export class Plot {
  constructor(canvas, legend, unit, digits) {
    Object.assign(this, { canvas, legend, unit, digits, lines: new Map(), onChange: () => {} });
  }

  forget() {
    this.lines.clear();
    this.legend.replaceChildren();
    this.onChange();
  }

  // Values by name, at this instant.
  add(values) {
    const now = performance.now();
    for (const [name, value] of Object.entries(values)) {
      if (!Number.isFinite(value)) continue;
      if (!this.lines.has(name)) this.lines.set(name, this.begin(name));
      const line = this.lines.get(name);
      line.points.push({ x: now, y: value });
      while (line.points[0].x < now - SPAN_MS) line.points.shift();
      line.text.textContent = `${name} ${this.say(value)}`;
    }
    this.onChange();
  }
  say(value) {
    return value.toFixed(this.digits) + this.unit;
  }
  begin(name) {
    const colour = COLOURS[this.lines.size % COLOURS.length];
    const item = document.createElement("li"), text = document.createElement("span");
    const key = document.createElementNS("http://www.w3.org/2000/svg", "svg"), mark = document.createElementNS(key.namespaceURI, "rect");
    for (const [attribute, value] of Object.entries({ width: 12, height: 12, rx: 3, fill: colour })) mark.setAttribute(attribute, value);
    key.setAttribute("aria-hidden", "true");
    key.append(mark);
    item.append(key, text);
    this.legend.append(item);
    return { colour, text, points: [], name };
  }
}
