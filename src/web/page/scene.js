// Path, landmarks, keyframes and free space in three dimensions, drawn on a 2-D canvas. All is in the frame `map`.

import { FloorGrid } from "/layers.js";

const PATH = "#5fd0ff", LAND = "#9fb3c3", KEY = "#ffcc4d", BODY = "#3ddc84", GRID = "#1d3040";

const rotate = ([w, x, y, z], [a, b, c]) => {
  const u = 2 * (y * c - z * b), v = 2 * (z * a - x * c), n = 2 * (x * b - y * a);
  return [a + w * u + y * n - z * v, b + w * v + z * u - x * n, c + w * n + x * v - y * u];
};
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const sum = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));

export class Scene {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.shown = { follow: true, landmarks: true, keyframes: true, floor: true };
    this.floor = new FloorGrid();
    this.turn = { azimuth: -0.9, elevation: 0.75, distance: 8, target: [0, 0, 0] };
    this.forget();
    this.listen();
    new ResizeObserver(() => this.ask()).observe(canvas);
  }

  forget() {
    this.path = { epoch: -1, places: new Float32Array(0), first: 0 };
    this.landmarks = new Map(); // by slot
    this.keyframes = new Map();
    this.floor.forget();
    this.pose = null;
    this.fitted = 0;
    this.ask();
  }

  // ---- what comes

  addPath({ epoch, first, places }) {
    const fresh = epoch !== this.path.epoch || first < this.path.first;
    const old = fresh ? new Float32Array(0) : this.path.places.subarray(0, 3 * (first - this.path.first));
    const all = new Float32Array(old.length + places.length);
    all.set(old);
    all.set(places, old.length);
    this.path = { epoch, first: fresh ? first : this.path.first, places: all };
    this.ask();
  }
  addPose(pose) {
    this.pose = Number.isFinite(pose.position[0]) ? pose : null;
    this.up = Number.isFinite(pose.gravity[0]) ? unit(scaled([...pose.gravity], -1))
      : pose.child_frame === "cam0" ? [0, -1, 0] : [0, 0, 1];
    this.ask();
  }
  addMap(map) {
    const own = (p) => sum(scaled(rotate(map.own_orientation, p), map.own_scale), map.own_position);
    for (let slot = map.landmark_first; slot < map.landmark_last; slot++) this.landmarks.delete(slot);
    for (let slot = map.keyframe_first; slot < map.keyframe_last; slot++) this.keyframes.delete(slot);
    for (let i = 0; i < map.landmark_count; i++)
      if (map.landmark_map[i] === map.map_id)
        this.landmarks.set(map.landmark_slot[i], own(map.landmark_p.subarray(3 * i, 3 * i + 3)));
    for (const frame of map.keyframes)
      if (frame.map_id === map.map_id) {
        const axis = (v) => rotate(map.own_orientation, rotate(frame.orientation, v));
        this.keyframes.set(frame.slot, { at: own(frame.position), x: axis([1, 0, 0]), y: axis([0, 1, 0]), z: axis([0, 0, 1]) });
      }
    this.ask();
  }

  addFloor(message) {
    this.floor.take(message);
    this.ask();
  }

  // ---- the eye

  toMap(p) {
    const pose = this.pose;
    if (!pose || !Number.isFinite(pose.map_scale)) return p;
    return sum(scaled(rotate(pose.map_orientation, p), pose.map_scale), pose.map_position);
  }
  basis() {
    const up = this.up || [0, -1, 0];
    const east = unit(cross(Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], up));
    const north = cross(up, east);
    const { azimuth, elevation } = this.turn;
    const flat = sum(scaled(east, Math.cos(azimuth)), scaled(north, Math.sin(azimuth)));
    const back = sum(scaled(flat, Math.cos(elevation)), scaled(up, Math.sin(elevation)));
    const right = unit(cross(up, back));
    return { east, north, up, back, right, above: cross(back, right) };
  }
  project(p, eye) {
    const d = [p[0] - eye.target[0], p[1] - eye.target[1], p[2] - eye.target[2]];
    const depth = eye.distance - dot(d, eye.back);
    if (depth < eye.distance * 0.05) return null;
    const f = eye.focal / depth;
    return [eye.middle[0] + f * dot(d, eye.right), eye.middle[1] - f * dot(d, eye.above), depth];
  }

  // ---- drawing

  ask() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.draw();
    });
  }
  bounds() {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const { places } = this.path;
    for (let i = 0; i < places.length; i += 3) {
      const p = this.toMap([places[i], places[i + 1], places[i + 2]]);
      for (let k = 0; k < 3; k++) {
        low[k] = Math.min(low[k], p[k]);
        high[k] = Math.max(high[k], p[k]);
      }
    }
    return places.length ? { low, high, size: Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]) } : null;
  }
  fit() {
    const bounds = this.bounds();
    if (!bounds) return;
    this.turn.target = scaled(sum(bounds.low, bounds.high), 0.5);
    this.turn.distance = Math.max(bounds.size * 1.3, 0.5);
  }

  draw() {
    const { canvas, context } = this, ratio = Math.min(devicePixelRatio || 1, 2);
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (!width || !height) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const bounds = this.bounds();
    if (this.shown.follow && bounds) this.fit();
    const eye = { ...this.turn, ...this.basis(), focal: Math.min(width, height) * 1.05, middle: [width / 2, height / 2] };
    this.eye = eye;
    context.fillStyle = "#08111a";
    context.fillRect(0, 0, width, height);
    this.drawGrid(eye, bounds, ratio);
    if (this.shown.floor) this.drawFloor(eye);
    if (this.shown.landmarks) this.drawLandmarks(eye, ratio);
    if (this.shown.keyframes) this.drawKeyframes(eye, ratio);
    this.drawPath(eye, ratio);
    this.drawBody(eye, ratio);
  }

  line(a, b, eye) {
    const p = this.project(a, eye), q = this.project(b, eye);
    if (!p || !q) return;
    this.context.moveTo(p[0], p[1]);
    this.context.lineTo(q[0], q[1]);
  }
  drawGrid(eye, bounds, ratio) {
    const { context } = this;
    const step = 10 ** Math.floor(Math.log10(eye.distance)) / (eye.distance / 10 ** Math.floor(Math.log10(eye.distance)) < 3 ? 2 : 1);
    const low = bounds ? Math.min(dot(bounds.low, eye.up), dot(bounds.high, eye.up)) : 0;
    const origin = sum(sum(scaled(eye.east, Math.round(dot(eye.target, eye.east) / step) * step),
      scaled(eye.north, Math.round(dot(eye.target, eye.north) / step) * step)), scaled(eye.up, low));
    context.strokeStyle = GRID;
    context.lineWidth = ratio;
    context.beginPath();
    for (let i = -8; i <= 8; i++) {
      const along = (axis, other) => this.line(sum(origin, sum(scaled(axis, i * step), scaled(other, -8 * step))),
        sum(origin, sum(scaled(axis, i * step), scaled(other, 8 * step))), eye);
      along(eye.east, eye.north);
      along(eye.north, eye.east);
    }
    context.stroke();
    this.step = step;
  }
  drawFloor(eye) {
    const { place } = this.floor;
    this.floor.draw(this.context, (x, y) => this.project(this.toMap(sum(rotate(place.origin_orientation, [x, y, 0]), place.origin_position)), eye));
  }
  drawLandmarks(eye, ratio) {
    const { context } = this;
    context.fillStyle = LAND;
    for (const p of this.landmarks.values()) {
      const at = this.project(p, eye);
      if (at) context.fillRect(at[0] - ratio * 0.7, at[1] - ratio * 0.7, 1.4 * ratio, 1.4 * ratio);
    }
  }
  frustum(at, x, y, z, size, eye) {
    const corner = (a, b) => sum(at, sum(scaled(z, size), sum(scaled(x, a * size * 0.7), scaled(y, b * size * 0.5))));
    const corners = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
    corners.forEach((p, i) => {
      this.line(at, p, eye);
      this.line(p, corners[(i + 1) % 4], eye);
    });
  }
  drawKeyframes(eye, ratio) {
    const { context } = this;
    context.strokeStyle = KEY;
    context.lineWidth = ratio * 0.8;
    context.globalAlpha = 0.6;
    context.beginPath();
    for (const { at, x, y, z } of this.keyframes.values()) this.frustum(at, x, y, z, eye.distance * 0.016, eye);
    context.stroke();
    context.globalAlpha = 1;
  }
  drawPath(eye, ratio) {
    const { context } = this, { places } = this.path;
    context.strokeStyle = PATH;
    context.lineWidth = 2.5 * ratio;
    context.lineJoin = "round";
    context.beginPath();
    let down = false;
    for (let i = 0; i < places.length; i += 3) {
      const at = this.project(this.toMap([places[i], places[i + 1], places[i + 2]]), eye);
      if (at) context[down ? "lineTo" : "moveTo"](at[0], at[1]);
      down = Boolean(at);
    }
    context.stroke();
  }
  drawBody(eye, ratio) {
    const { context, pose } = this;
    if (!pose) return;
    const axis = (v) => rotate(pose.map_orientation, rotate(pose.orientation, v));
    const cam = pose.child_frame === "cam0";
    const x = axis(cam ? [1, 0, 0] : [0, -1, 0]), y = axis(cam ? [0, 1, 0] : [0, 0, -1]), z = axis(cam ? [0, 0, 1] : [1, 0, 0]);
    context.strokeStyle = BODY;
    context.lineWidth = 2.5 * ratio;
    context.beginPath();
    this.frustum(this.toMap(pose.position), x, y, z, eye.distance * 0.05, eye);
    context.stroke();
  }

  // ---- hands: pointer, wheel, two fingers, keys

  free() {
    this.shown.follow = false;
    this.onFree?.();
    this.ask();
  }
  zoom(factor) {
    this.turn.distance = Math.min(1e5, Math.max(1e-3, this.turn.distance * factor));
    this.free();
  }
  rotateBy(azimuth, elevation) {
    this.turn.azimuth += azimuth;
    this.turn.elevation = Math.min(1.57, Math.max(-1.57, this.turn.elevation + elevation));
    this.ask();
  }
  pan(dx, dy) {
    const scale = this.turn.distance / this.canvas.clientHeight;
    this.turn.target = sum(this.turn.target, sum(scaled(this.eye.right, -dx * scale), scaled(this.eye.above, dy * scale)));
    this.free();
  }
  listen() {
    const { canvas } = this, fingers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, event);
    });
    const away = (event) => fingers.delete(event.pointerId);
    canvas.addEventListener("pointerup", away);
    canvas.addEventListener("pointercancel", away);
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const dx = event.clientX - before.clientX, dy = event.clientY - before.clientY;
      if (fingers.size === 2) {
        const other = [...fingers.values()].find((finger) => finger.pointerId !== event.pointerId);
        const apart = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
        this.zoom(apart(before) / Math.max(1, apart(event)));
        this.pan(dx / 2, dy / 2);
      } else if (event.shiftKey || event.buttons & 6) {
        this.pan(dx, dy);
      } else {
        this.rotateBy(-dx * 0.008, dy * 0.008);
      }
      fingers.set(event.pointerId, event);
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(event.deltaY * 0.0012));
    }, { passive: false });
    const keys = {
      ArrowLeft: () => this.rotateBy(-0.12, 0), ArrowRight: () => this.rotateBy(0.12, 0), ArrowUp: () => this.rotateBy(0, 0.1),
      ArrowDown: () => this.rotateBy(0, -0.1), "+": () => this.zoom(0.85), "-": () => this.zoom(1.18),
    };
    canvas.addEventListener("keydown", (event) => {
      if (!keys[event.key]) return;
      event.preventDefault();
      keys[event.key]();
    });
  }
}
