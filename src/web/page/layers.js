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

// Free and occupied cells (grid_t) as pixels of a picture, red, green, blue and opacity of each. Pieces of one stamp make one grid.
const FREE = [47, 143, 95, 136], OCCUPIED = [255, 107, 107, 204], NOTHING = [0, 0, 0, 0];

export class FloorGrid {
  take(message) {
    const { stamp, width, height, first_row, cells } = message, bytes = 4 * width * height;
    if (isOlder(stamp, this.stamp)) return;
    if (!this.pixels || this.pixels.length !== bytes || this.place?.width !== width) this.pixels = new Uint8Array(bytes);
    else if (stamp.time_ns !== this.stamp) this.pixels.fill(0);
    this.stamp = stamp.time_ns;
    this.place = message;
    this.changed = true; // and not drawn yet
    const kind = (value) => value === UNKNOWN ? NOTHING : value < 100 * message.free_below ? FREE : value > 100 * message.occupied_above ? OCCUPIED : NOTHING;
    cells.forEach((value, i) => this.pixels.set(kind(value), 4 * (first_row * width + i)));
  }
  forget() {
    this.place = this.stamp = this.pixels = undefined;
    this.changed = true;
  }
}
