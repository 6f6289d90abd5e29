// The websocket: packets in (src/web/client.h says how they look), words out. It connects again by itself.

import { decode } from "/lcm.js";

const TYPES = {
  POSE: "pose_t", RUN: "run_t", STATISTICS: "statistics_t", CAMERA_STATUS: "camera_status_t", HEALTH: "health_t",
  OBJECTS: "objects_t", DETECTIONS: "detections_t", DETECTIONS2: "detections_t", KEYPOINTS: "keypoints_t",
  KEYPOINTS2: "keypoints_t", MAP: "map_t", COMMAND_RESULT: "command_result_t", RECORDER: "recorder_t", SETTINGS_RESULT: "settings_result_t", MAP_FILES: "map_files_t", GRID: "grid_t",
  SEGMENTATION: "segmentation_t", SEGMENTATION2: "segmentation_t",
  PARAMETER_RESULT: "parameter_result_t",
};
const MESSAGE = 1, PICTURE = 2, PATH = 3, TRIES = 20;
const words = new TextDecoder();

export class Link {
  // `hear` has a function for each kind of thing that may come; missing ones are not called.
  constructor(types, hear) {
    this.types = types;
    this.hear = hear;
    this.wait_ms = 250;
    this.connect();
  }

  connect() {
    this.best = null; // of the tries to tie the clocks: the fastest
    this.tries = 0;
    this.socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/`, "fovea");
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => {
      this.wait_ms = 250;
      this.tell("link", "live");
      this.visible();
      this.ping();
    };
    this.socket.onmessage = (event) => {
      if (typeof event.data === "string") this.text(JSON.parse(event.data));
      else this.packets(event.data);
    };
    this.socket.onclose = () => {
      this.tell("link", "gone");
      setTimeout(() => this.connect(), this.wait_ms);
      this.wait_ms = Math.min(this.wait_ms * 1.6, 3000);
    };
  }

  tell(kind, ...what) {
    if (this.hear[kind]) this.hear[kind](...what);
  }
  say(text) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(text);
  }
  visible() {
    this.say(document.hidden ? "pictures 0" : "pictures 1");
  }

  // The server's clock in this page's: the fastest of 20 ways there and back halves best.
  ping() {
    this.say("ping " + performance.now().toFixed(3));
  }
  pong(message) {
    const now = performance.now(), sent = Number(message.echo), way = now - sent;
    if (!this.best || way <= this.best.way) this.best = { way, offset: message.now_ms - (now + sent) / 2 };
    if (++this.tries % TRIES === 0) this.best.way *= 1.5; // clocks drift: a later try may win again
    setTimeout(() => this.ping(), this.tries < TRIES ? 50 : 2000);
  }
  serverNow() {
    return this.best ? performance.now() + this.best.offset : NaN;
  }

  text(message) {
    if (message.kind === "pong") this.pong(message);
    else this.tell(message.kind, message);
  }
  packets(buffer) {
    const view = new DataView(buffer);
    for (let at = 0; at < buffer.byteLength; at += 4 + view.getUint32(at))
      this.packet(new Uint8Array(buffer, at + 4, view.getUint32(at)));
  }
  packet(bytes) {
    if (bytes[0] === MESSAGE) {
      const channel = words.decode(bytes.subarray(2, 2 + bytes[1]));
      if (TYPES[channel]) this.tell(channel, decode(this.types, "fovea." + TYPES[channel], bytes.subarray(2 + bytes[1])));
    } else if (bytes[0] === PICTURE) {
      this.tell("picture", readPicture(bytes));
    } else if (bytes[0] === PATH) {
      this.tell("path", readPath(bytes));
    }
  }
}

function readPicture(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const count = view.getUint32(48);
  const points = new Float32Array(3 * count);
  for (let i = 0, at = 52; i < count; i++, at += 5) {
    points[3 * i] = view.getUint16(at) / 8;
    points[3 * i + 1] = view.getUint16(at + 2) / 8;
    points[3 * i + 2] = view.getUint8(at + 4);
  }
  return {
    quality: view.getUint8(1), shrink: view.getUint16(2), number: view.getUint32(4),
    stamp_ns: Number(view.getBigInt64(8)), sequence: Number(view.getBigInt64(16)),
    age_ms: Number(view.getBigInt64(24)) * 1e-6, held_ms: view.getUint32(32) * 1e-3,
    sent_ms: Number(view.getBigInt64(36)) * 1e-6, width: view.getUint16(44), height: view.getUint16(46),
    points, jpeg: bytes.subarray(52 + 5 * count),
  };
}

function readPath(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const count = view.getUint32(13);
  const places = new Float32Array(3 * count);
  for (let i = 0; i < 3 * count; i++) places[i] = view.getFloat32(17 + 4 * i);
  return { epoch: view.getUint32(1), first: Number(view.getBigUint64(5)), places };
}
