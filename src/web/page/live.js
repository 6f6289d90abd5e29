// The live picture and what is drawn on it. Coordinates of messages are pixels of the raw image, whose (0, 0) is the centre of the top
// left pixel; the canvas has a whole number of its own pixels for each of them.

import { Mask } from "/layers.js";

const COLOURS = ["#5fd0ff", "#ffb347", "#7ee787", "#ff8fb1", "#c9a2ff", "#ffe066", "#66e0c8", "#ff7f66"];
const LEVELS = ["#49f2a5", "#8fe36b", "#d4d94f", "#f2b84b", "#f58b5c", "#f06d8c", "#c77dff", "#8fa8ff"];
const TRAIL = 45;

export class Live {
  constructor(canvas, classes, link, onShown) {
    this.classes = classes;
    this.masks = [new Mask(), new Mask()]; // of the two networks
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.link = link;
    this.onShown = onShown;
    this.layers = { classes: true, features: true, boxes: true, tracks: true, keypoints: true };
    this.trails = new Map();
    this.busy = false;
    this.waiting = this.ready = null;
    const channel = new MessageChannel();
    channel.port1.onmessage = () => this.picture && this.onShown(this.picture);
    this.painted = channel.port2;
  }

  // The newest picture: one is decoded at a time, and one waits.
  async show(picture) {
    if (this.waiting) this.acknowledge(this.waiting);
    this.waiting = picture;
    if (this.busy) return;
    this.busy = true;
    while (this.waiting) {
      const next = this.waiting;
      this.waiting = null;
      await this.decode(next);
    }
    this.busy = false;
  }
  acknowledge(picture) {
    this.link().say("ack " + picture.number);
  }
  // For the next frame of the screen, whose picture is the newest that is decoded by then.
  async decode(picture) {
    const { before } = this;
    let bitmap;
    try {
      bitmap = await createImageBitmap(new Blob([picture.jpeg], { type: "image/jpeg" }));
    } catch (error) {
      console.warn("a picture cannot be shown:", error.message);
    }
    if (!bitmap || before !== this.before) {
      if (bitmap) bitmap.close();
      this.acknowledge(picture);
      return;
    }
    if (this.ready) this.leaveOut();
    else if (document.hidden) setTimeout(() => this.put(), 0);
    else requestAnimationFrame(() => this.put());
    this.ready = { picture, bitmap };
  }
  leaveOut() {
    this.ready.bitmap.close();
    this.acknowledge(this.ready.picture);
    this.ready = null;
  }
  put() {
    if (!this.ready) return;
    const { picture, bitmap } = this.ready, last = this.picture;
    if (this.bitmap) this.bitmap.close();
    this.bitmap = bitmap;
    this.picture = picture;
    this.ready = null;
    // What happened in one of the frames between was not seen before this one: half of them is the mean.
    const steps = last ? picture.sequence - last.sequence : 1;
    picture.between_ms = steps > 1 ? (picture.stamp_ns - last.stamp_ns) * 1e-6 * (steps - 1) / steps / 2 : 0;
    this.draw();
    this.acknowledge(picture);
    this.painted.postMessage(picture.number); // heard when this frame of the screen is painted
  }

  objects(message) {
    this.boxesStamp = message.stamp.time_ns; // of the image that they were found in
    this.boxes = message.objects.filter((object) => object.state !== 3).map((object) => ({
      box: object.box, id: object.id, name: object.class_name || "class " + object.class_id, score: object.score,
      faint: object.state !== 1, distance: object.located === 1 ? object.position_m[2] : NaN,
    }));
    this.hasObjects = true;
    const present = new Set();
    for (const object of message.objects) {
      if (object.state === 3) continue;
      present.add(object.id);
      const trail = this.trails.get(object.id) || [];
      trail.push([(object.box.x_min_px + object.box.x_max_px) / 2, object.box.y_max_px]);
      if (trail.length > TRAIL) trail.shift();
      this.trails.set(object.id, trail);
    }
    for (const id of this.trails.keys()) if (!present.has(id)) this.trails.delete(id);
  }
  detections(message) {
    if (this.hasObjects) return; // they are the same things, filtered over time
    this.boxes = message.detections.map((found) => ({
      box: found.box, id: BigInt(found.class_id), name: found.class_name || "class " + found.class_id, score: found.score,
      distance: NaN,
    }));
  }
  segmentation(message, network) {
    if (message.camera !== 0) return; // not on this picture
    this.masks[network].take(message);
    this.classes.replaceChildren(...this.masks.flatMap((mask) => mask.names));
  }
  keypoints(message) {
    this.sets = message.sets;
  }
  // Pictures of another camera follow.
  look(camera) {
    this.clear();
    this.camera = camera;
  }
  // No picture of another robot stays.
  clear() {
    this.before = this.before ? this.before + 1 : 1;
    this.waiting = this.picture = null;
    if (this.ready) this.leaveOut();
    if (this.bitmap) this.bitmap.close();
    this.bitmap = null;
    this.context.clearRect(0, 0, this.canvas.width, this.canvas.height);
  }
  forget() {
    this.boxes = this.sets = undefined;
    this.hasObjects = false;
    this.trails.clear();
    for (const mask of this.masks) mask.forget();
    this.classes.replaceChildren();
  }

  draw() {
    const { canvas, context, bitmap, picture } = this;
    if (!bitmap) return;
    const wanted = canvas.clientWidth * Math.min(devicePixelRatio || 1, 2);
    const k = Math.max(1, Math.min(3, Math.round(wanted / picture.width)));
    if (canvas.width !== k * picture.width || canvas.height !== k * picture.height) {
      canvas.width = k * picture.width;
      canvas.height = k * picture.height;
    }
    context.imageSmoothingEnabled = true;
    context.drawImage(bitmap, 0, 0, k * bitmap.width * picture.shrink, k * bitmap.height * picture.shrink);
    this.k = k;
    if (this.camera) return; // what is found is of the first camera
    if (this.layers.classes) for (const mask of this.masks) mask.draw(context, k);
    if (this.layers.features) this.drawFeatures();
    if (this.layers.tracks) this.drawTrails();
    if (this.layers.keypoints && this.sets) this.drawKeypoints();
    if (this.layers.boxes && this.boxes) this.drawBoxes();
  }

  at(pixel) {
    return (pixel + 0.5) * this.k;
  }
  drawFeatures() {
    const { context, picture, k } = this;
    for (let level = 0; level < LEVELS.length; level++) {
      context.fillStyle = LEVELS[level];
      for (let i = 0; i < picture.points.length; i += 3)
        if (picture.points[i + 2] === level)
          context.fillRect(this.at(picture.points[i]) - k, this.at(picture.points[i + 1]) - k, 2 * k, 2 * k);
    }
  }
  drawTrails() {
    const { context, k } = this;
    context.lineWidth = 1.5 * k;
    for (const [id, trail] of this.trails) {
      context.strokeStyle = COLOURS[Number(id % 8n)];
      context.beginPath();
      trail.forEach(([x, y], i) => context[i ? "lineTo" : "moveTo"](this.at(x), this.at(y)));
      context.stroke();
    }
  }
  drawKeypoints() {
    const { context, k } = this;
    context.fillStyle = "#ff5ea8";
    for (const set of this.sets)
      for (let i = 0; i < set.point_count; i++) {
        if (set.point_score[i] < 0.3) continue;
        context.beginPath();
        context.arc(this.at(set.p_px[2 * i]), this.at(set.p_px[2 * i + 1]), 3 * k, 0, 7);
        context.fill();
      }
  }
  drawBoxes() {
    const { context, k } = this;
    context.font = `600 ${12 * k}px system-ui, sans-serif`;
    context.textBaseline = "top";
    for (const { box, id, name, score, faint, distance } of this.boxes) {
      const colour = COLOURS[Number(id % 8n)];
      const x = this.at(box.x_min_px) - k / 2, y = this.at(box.y_min_px) - k / 2;
      context.setLineDash(faint ? [5 * k, 4 * k] : []);
      context.lineWidth = 2 * k;
      context.strokeStyle = colour;
      context.strokeRect(x, y, (box.x_max_px - box.x_min_px) * k, (box.y_max_px - box.y_min_px) * k);
      context.setLineDash([]);
      const label = `${name} ${this.hasObjects ? "#" + id + " " : ""}${Math.round(100 * score)} %` +
        (Number.isFinite(distance) ? ` ${distance.toFixed(1)} m` : "");
      const width = context.measureText(label).width + 8 * k, height = 16 * k;
      const top = y > height ? y - height - k : y + k;
      const left = Math.max(0, Math.min(x - k, this.canvas.width - width));
      context.fillStyle = colour;
      context.fillRect(left, top, width, height);
      context.fillStyle = "#06121a";
      context.fillText(label, left + 4 * k, top + 2 * k);
    }
  }
}
