// What networks and the free space say of the world: a mask over the picture, a grid in the scene.

const UNKNOWN = -1;

// What is left of a message before the one that is shown. A clock that was set back by more is none of it.
function isOlder(stamp, shown) {
  const age = shown === undefined ? 0 : Number(shown - stamp.time_ns);
  return age > 0 && age < 1e9;
}

// The classes of the pixels (segmentation_t), over the picture. Pieces of one stamp make one mask.
export class Mask {
  constructor() {
    this.canvas = document.createElement("canvas");
    this.names = [];
  }
  take(message) {
    const { width, height, stamp, classes } = message;
    if (isOlder(stamp, this.stamp)) return;
    if (stamp.time_ns !== this.stamp || this.canvas.width !== width || this.canvas.height !== height) {
      Object.assign(this.canvas, { width, height });
      this.stamp = stamp.time_ns;
    }
    this.place = message;
    const image = new ImageData(width, Math.max(1, message.row_count));
    const colours = new Uint32Array(256), shift = new Uint8Array(new Uint32Array([1]).buffer)[0] === 1 ? [0, 8, 16, 24] : [24, 16, 8, 0];
    classes.forEach(({ red, green, blue }, i) => { colours[i] = ((255 << shift[3]) | (blue << shift[2]) | (green << shift[1]) | (red << shift[0])) >>> 0; });
    const pixels = new Uint32Array(image.data.buffer);
    for (let run = 0, at = 0; run < message.run_count; at += message.run_length[run++]) pixels.fill(colours[message.run_class[run]], at, at + message.run_length[run]);
    this.canvas.getContext("2d").putImageData(image, 0, message.first_row);
    this.names = this.name(classes);
  }
  // The classes that are there, the largest first.
  name(classes) {
    const there = classes.filter((one) => one.fraction >= 0.005).sort((a, b) => b.fraction - a.fraction).slice(0, 8);
    return there.map(({ class_name, class_id, red, green, blue, fraction }) => {
      const item = document.createElement("li"), square = document.createElement("canvas"), context = square.getContext("2d");
      Object.assign(square, { width: 12, height: 12 });
      context.fillStyle = `rgb(${red}, ${green}, ${blue})`;
      context.fillRect(0, 0, 12, 12);
      item.append(square, ` ${class_name || "class " + class_id} ${Math.round(100 * fraction)} %`);
      return item;
    });
  }
  // On a canvas with k pixels for each of the raw image.
  draw(context, k) {
    if (!this.place) return;
    const { raw_scale_x: sx, raw_scale_y: sy, raw_offset_x: ox, raw_offset_y: oy, width, height } = this.place;
    context.globalAlpha = 0.45;
    context.imageSmoothingEnabled = false;
    context.drawImage(this.canvas, (ox - sx / 2 + 0.5) * k, (oy - sy / 2 + 0.5) * k, sx * width * k, sy * height * k);
    context.globalAlpha = 1;
  }
  forget() {
    this.place = this.stamp = undefined;
    this.names = [];
  }
}

// Free and occupied cells (grid_t), as runs along the rows: a few polygons instead of all cells.
export class FloorGrid {
  take(message) {
    const { stamp, width, first_row, cells, row_count } = message;
    if (isOlder(stamp, this.stamp)) return;
    if (stamp.time_ns !== this.stamp) Object.assign(this, { stamp: stamp.time_ns, free: [], occupied: [] });
    this.place = message;
    const kind = (value) => value === UNKNOWN ? null : value < 100 * message.free_below ? this.free : value > 100 * message.occupied_above ? this.occupied : null;
    for (let row = 0; row < row_count; row++)
      for (let x = 0, begin = 0; x < width; x++) {
        const here = kind(cells[row * width + x]), next = x + 1 < width ? kind(cells[row * width + x + 1]) : null;
        if (here && here !== next) here.push([begin, x + 1, first_row + row]);
        if (here !== next) begin = x + 1;
      }
  }
  // to(x, y) projects a point of the grid (metres from its origin) to the canvas; null: it is behind the eye.
  draw(context, to) {
    if (!this.place) return;
    const side = this.place.resolution_m;
    for (const [runs, colour] of [[this.free, "#2f8f5f88"], [this.occupied, "#ff6b6bcc"]]) {
      context.fillStyle = colour;
      context.beginPath();
      for (const [begin, end, row] of runs) {
        const corners = [[begin, row], [end, row], [end, row + 1], [begin, row + 1]].map(([x, y]) => to(x * side, y * side));
        if (corners.includes(null)) continue;
        corners.forEach((p, i) => context[i ? "lineTo" : "moveTo"](p[0], p[1]));
      }
      context.fill();
    }
  }
  forget() {
    this.place = this.stamp = undefined;
  }
}
