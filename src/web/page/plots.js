// Lines over the last two minutes, on a canvas, with their newest values as text beside it.

const SPAN_MS = 120000;
const COLOURS = ["#5fd0ff", "#ffb347", "#7ee787", "#ff8fb1", "#c9a2ff", "#ffe066", "#66e0c8", "#ff7f66", "#a3b8ff", "#d9c2a0"];

export class Plot {
  constructor(canvas, legend, unit, digits) {
    Object.assign(this, { canvas, legend, unit, digits, lines: new Map() });
    this.context = canvas.getContext("2d");
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  forget() {
    this.lines.clear();
    this.legend.replaceChildren();
    this.draw();
  }

  // Values by name, at this instant.
  add(values) {
    const now = performance.now();
    for (const [name, value] of Object.entries(values)) {
      if (!Number.isFinite(value)) continue;
      if (!this.lines.has(name)) this.lines.set(name, this.begin(name));
      const line = this.lines.get(name);
      line.points.push([now, value]);
      while (line.points[0][0] < now - SPAN_MS) line.points.shift();
      line.text.textContent = `${name} ${value.toFixed(this.digits)}${this.unit}`;
    }
    this.draw();
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

  draw() {
    const { canvas, context } = this, ratio = Math.min(devicePixelRatio || 1, 2);
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (!width || !height) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    context.clearRect(0, 0, width, height);
    const now = performance.now();
    let most = 0, oldest = now;
    for (const { points } of this.lines.values()) {
      for (const [, value] of points) most = Math.max(most, value);
      oldest = Math.min(oldest, points[0][0]);
    }
    const span = [15000, 30000, 60000].find((some) => now - oldest < some) || SPAN_MS;
    const step = 10 ** Math.floor(Math.log10(most || 1)), top = Math.ceil((most * 1.05 || 1) / (step / 2)) * (step / 2);
    const left = 46 * ratio, bottom = height - 18 * ratio;
    const x = (time) => left + (width - left - 4 * ratio) * (1 - (now - time) / span);
    const y = (value) => bottom - (bottom - 6 * ratio) * (value / top);
    context.font = `${11 * ratio}px system-ui, sans-serif`;
    context.fillStyle = "#9fb3c3";
    context.strokeStyle = "#22323f";
    context.lineWidth = ratio;
    for (let i = 0; i <= 4; i++) {
      const value = (top * i) / 4;
      context.beginPath();
      context.moveTo(left, y(value));
      context.lineTo(width, y(value));
      context.stroke();
      context.textAlign = "right";
      context.textBaseline = "middle";
      context.fillText(value >= 100 ? value.toFixed(0) : value.toPrecision(2), left - 6 * ratio, y(value));
    }
    context.textBaseline = "alphabetic";
    for (const [seconds, align] of [[span / 1000, "left"], [span / 2000, "center"], [0, "right"]]) {
      context.textAlign = align;
      context.fillText(seconds ? `-${seconds} s` : "now", x(now - seconds * 1000), height - 4 * ratio);
    }
    context.lineWidth = 1.7 * ratio;
    context.lineJoin = "round";
    for (const { colour, points } of this.lines.values()) {
      context.strokeStyle = colour;
      context.beginPath();
      points.forEach(([time, value], i) => context[i ? "lineTo" : "moveTo"](x(time), y(value)));
      context.stroke();
    }
  }
}
