"""The confusion matrix of a network that labels pixels, computed with numpy and nothing of src/: beside `fovea segment --evaluate --json`.

    python3 tests/segment/confusion.py [--letterbox WIDTHxHEIGHT] OUTPUTS.npz|MODEL.tflite IMAGES LABELS MAP EVALUATION.json CLASS=NUMBER...

OUTPUTS.npz is what `fovea model run` gave for the pictures of the folder IMAGES by name; of a MODEL.tflite with 8-bit pixels as input LiteRT's
reference kernels run, on pictures resized here (needs ai-edge-litert). Of a network whose input keeps the pictures' shape, --letterbox is the
input's size. MAP is in the command's form, with these classes. Prints the matrix; ends
with 1 where the evaluation is another."""
import json
import os
import struct
import sys
import zlib

import numpy as np


def png(path):
    """The samples of a PNG of 8 bits without interlace: [h][w] or [h][w][3] (RFC 2083)."""
    with open(path, "rb") as file:
        data = file.read()
    at, packed = 8, b""
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        if kind == b"IHDR":
            width, height, bits, colour, _, _, interlaced = struct.unpack_from(">2I5B", data, at + 8)
        if kind == b"IDAT":
            packed += data[at + 8:at + 8 + size]
        at += 12 + size
    if bits != 8 or colour not in (0, 2, 3) or interlaced:
        raise SystemExit(f"{path}: found {bits} bits, colour type {colour}, expected 8 bits of grey, palette or RGB, not interlaced")
    step = 3 if colour == 2 else 1
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + width * step)
    above, found = np.zeros(width * step, np.uint8), []
    for kind, row in zip(rows[:, 0], rows[:, 1:]):
        above = unfiltered(kind, row, above, step)
        found.append(above)
    return np.array(found).reshape((height, width) if step == 1 else (height, width, 3))


def unfiltered(kind, row, above, step):
    if kind == 0:
        return row
    if kind == 2:
        return row + above
    if kind == 1:
        return np.add.accumulate(row.reshape(-1, step), 0, np.uint8).reshape(-1)
    out = [0] * step + row.tolist()
    over = [0] * step + above.tolist()
    for i in range(step, len(out)):
        a, b, c = out[i - step], over[i], over[i - step]
        if kind == 3:
            guess = (a + b) // 2
        else:
            p = a + b - c
            guess = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
        out[i] = out[i] + guess & 255
    return np.array(out[step:], np.uint8)


def resized(picture, height, width):
    """Bilinear, pixel centres aligned, edges repeated, weights of 15 bits, rounded once."""
    def weights(count, size):
        at = np.maximum(((2 * np.arange(count, dtype=np.int64) + 1) * size * 32768 // count - 32768) // 2, 0)
        low = np.minimum(at >> 15, size - 1)
        return low, np.minimum(low + 1, size - 1), np.where(at >> 15 >= size - 1, 0, at & 32767)
    picture = picture.astype(np.int64)
    y0, y1, wy = weights(height, picture.shape[0])
    x0, x1, wx = weights(width, picture.shape[1])
    wy, wx = wy[:, None, None], wx[None, :, None]
    across = [picture[y][:, x0] * (32768 - wx) + picture[y][:, x1] * wx for y in (y0, y1)]
    return (across[0] * (32768 - wy) + across[1] * wy + (1 << 29) >> 30).astype(np.uint8)


def reference(path, pictures):
    """What LiteRT's reference kernels make of each picture."""
    from ai_edge_litert.interpreter import Interpreter, OpResolverType
    run = Interpreter(path, num_threads=1, experimental_op_resolver_type=OpResolverType.BUILTIN_REF)
    run.allocate_tensors()
    source, target = run.get_input_details()[0], run.get_output_details()[0]
    if source["dtype"] is not np.uint8:
        raise SystemExit(f"{path}: found {source['dtype']} as input, expected bytes")
    for picture in pictures:
        run.set_tensor(source["index"], resized(png(picture), *source["shape"][1:3])[None])
        run.invoke()
        yield run.get_tensor(target["index"])[0]


def classes_of(output):
    """[h][w]: numbers, or the place of the largest score."""
    return np.argmax(output, -1) if output.ndim == 3 and output.shape[-1] > 1 else output.reshape(output.shape[:2]).astype(np.int64)


def nearest(size, cells, side, first, part):
    """For each of `size` pixels along an axis of the picture, which the input of `side` pixels shows in `part` of them from `first` on, the nearest of
    `cells` of the mask by their centres, of those whose centre is in that part; of two as near the later one."""
    pixels = (2 * first * size + (2 * np.arange(size, dtype=np.int64) + 1) * part) * cells  # unit: the input's pixel / (2 size cells)
    centres = (2 * np.arange(cells, dtype=np.int64) + 1) * side * size
    inside = np.flatnonzero((centres >= 2 * first * size * cells) & (centres < 2 * (first + part) * size * cells))[::-1]
    return inside[np.argmin(np.abs(centres[inside][:, None] - pixels), 0)]


def at_size(mask, height, width, box=None):
    """At the picture's size. The whole mask shows the whole picture, or, in a `box` of [width, height] pixels, the largest part of the picture's shape
    in its middle."""
    if box is None:
        box, shown = (width, height), (width, height)
    elif box[0] * height <= box[1] * width:
        shown = box[0], int(height * box[0] / width + 0.5)
    else:
        shown = int(width * box[1] / height + 0.5), box[1]
    x, y = (nearest(size, cells, side, (side - part) // 2, part)
            for size, cells, side, part in zip((width, height), mask.shape[::-1], box, shown))
    return mask[y][:, x]


def read_map(path, numbers):
    """Rows by label, and the names of the rows in the order of their first line; "other" is the last, "none of them" where that is a class."""
    rows, names, rest = {}, [], "none of them" if "other" in numbers else "other"
    with open(path, encoding="utf-8-sig") as file:
        for line in file:
            parts = line.split("#")[0].split(None, 1)
            if not parts or parts[1].strip() == "ignore":
                continue
            name = parts[1].strip()
            if name != rest and name not in names:
                names.append(name)
            rows[int(parts[0])] = name
    columns = {numbers[name]: place for place, name in enumerate(names)}
    return {label: names.index(name) if name in names else len(names) for label, name in rows.items()}, columns, names + [rest]


def main():
    words, box = sys.argv[1:], None
    if words[0] == "--letterbox":
        box, words = tuple(int(side) for side in words[1].split("x")), words[2:]
    source, images, labels, mapping, evaluation, *named = words
    numbers = {name: int(number) for name, number in (entry.split("=") for entry in named)}
    rows, columns, names = read_map(mapping, numbers)
    pictures = sorted(os.path.join(images, name) for name in os.listdir(images))
    outputs = reference(source, pictures) if source.endswith(".tflite") else (o[0] for o in np.load(source)["output0"])
    matrix = np.zeros((len(names), len(names)), np.int64)
    for picture, output in zip(pictures, outputs, strict=True):
        truth = png(os.path.join(labels, os.path.basename(picture)))
        seen = at_size(classes_of(output), *truth.shape, box)
        row = np.vectorize(lambda label: rows.get(label, -1))(np.arange(256))[truth]
        column = np.vectorize(lambda c: columns.get(c, len(names) - 1))(np.arange(256))[seen]
        judged = row >= 0
        np.add.at(matrix, (row[judged], column[judged]), 1)
    with open(evaluation, encoding="utf-8") as file:
        found = json.loads(file.read())
    print(matrix.tolist())
    iou = [matrix[i, i] / (matrix[i].sum() + matrix[:, i].sum() - matrix[i, i]) for i in range(len(names) - 1)
           if matrix[i].sum() + matrix[:, i].sum()]
    same = found["classes"] == names and found["confusion"] == matrix.tolist() and found["pixels"] == matrix.sum() and \
        found["pictures"] == len(pictures) and np.allclose([v for v in found["iou"] if v is not None], iou, atol=1e-6)
    if not same:
        print(f"WRONG  the evaluation is {found}")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
