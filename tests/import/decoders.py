"""What `fovea detect` makes of photographs, beside a decoder written in numpy that shares no code with it: boxes, keypoints, classes. The
networks are made here, with outputs as those of known networks and numbers that follow from the photograph; their raw outputs are read
by `fovea model run`, which check_networks.sh proves equal to the reference. Needs tflite, numpy and flatbuffers, and the program.

    python3 tests/import/decoders.py [PHOTOGRAPH...]"""
import glob
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.join(HERE, "..", "..")
sys.path[:0] = [HERE, os.path.join(ROOT, "tools", "import")]

from builder import Builder  # noqa: E402
import heads  # noqa: E402

FOVEA = os.path.join(ROOT, os.environ.get("BUILD", "build"), "fovea")
SIDE = 64
SHARE = dict(scale=1 / 256, zero=-128)
PIXELS_MAX, SCORE_MAX, IOU_MIN = 0.5, 1e-4, 0.99


class Drawn(Builder):
    """A network whose numbers are convolutions of the picture by drawn weights."""

    def __init__(self, seed, side=SIDE):
        super().__init__()
        self.draw, self.side = np.random.default_rng(seed), side
        self.image = self.tensor("int8", (1, side, side, 3), 1 / 255, -128)

    def grid(self, stride, channels, share=True, spread=3.0, middle=0.0, scale=None):
        """[1, cells, channels]: scores from LOGISTIC, else numbers around 0 by `scale`."""
        cells = self.side // stride
        shape = (1, cells, cells, channels)
        weights = self.draw.normal(0, 1, (channels, stride, stride, 3))
        weights -= weights.mean((1, 2, 3), keepdims=True)
        step = np.abs(weights).max() / 127
        w = self.const("int8", np.round(weights / step), scale=[step] * channels, zero=0)
        bias = self.const("int32", np.full(channels, np.round(middle * stride / spread / (step / 255))), scale=[step / 255] * channels, zero=0)
        y, scaled = self.tensor("int8", shape, stride / 16, 0), self.tensor("int8", shape, spread / 16 if share else scale, 0)
        self.op("CONV_2D", [self.image, w, bias], [y], "Conv2D", StrideH=stride, StrideW=stride, DilationHFactor=1, DilationWFactor=1,
                Padding=1)
        # a picture's contrast is worth `spread`, whatever the stride
        self.op("MUL", [y, self.const("int8", np.full((1, 1, 1, 1), 100), scale=spread / stride / 100, zero=0)], [scaled], "Mul")
        if share:
            numbers, scaled = scaled, self.tensor("int8", shape, **SHARE)
            self.op("LOGISTIC", [numbers], [scaled])
        return self.rows(scaled, (1, cells * cells, channels))

    def rows(self, t, shape):
        kind, _, scales, zeros, _, _ = self.tensors[t]
        out = self.tensor(kind, shape, scales[0], zeros[0])
        self.op("RESHAPE", [t, self.const("int32", shape)], [out], "Reshape", NewShape=list(shape))
        return out

    def around(self, base, offset, scale, zero):
        """`base` (numbers) plus the numbers of a tensor of the same shape."""
        out = self.tensor("int8", base.shape, scale, zero)
        data = np.clip(np.round(base / scale) + zero, -128, 127)
        self.op("ADD", [self.const("int8", data, scale=scale, zero=zero), offset], [out], "Add")
        return out

    def joined(self, parts, axis, scale=1 / 256, zero=-128):
        shape = list(self.tensors[parts[0]][1])
        shape[axis] = sum(self.tensors[t][1][axis] for t in parts)
        out = self.tensor("int8", shape, scale, zero)
        self.op("CONCATENATION", parts, [out], "Concatenation", Axis=axis)
        return out

    def moved(self, t, scale):
        """The same bytes by another scale."""
        shape = self.tensors[t][1]
        out = self.tensor("int8", shape, scale, 0)
        times = scale / self.tensors[t][2][0]
        self.op("MUL", [t, self.const("int8", np.full((1, 1, 1), 127), scale=times / 127, zero=0)], [out], "Mul")
        return out

    def turned(self, t):
        kind, shape, scales, zeros, _, _ = self.tensors[t]
        out = self.tensor(kind, (shape[0], shape[2], shape[1]), scales[0], zeros[0])
        self.op("TRANSPOSE", [t, self.const("int32", [0, 2, 1])], [out], "Transpose")
        return out


def centres(side, stride):
    """[cells][2] in fractions of the side: x, y."""
    y, x = np.mgrid[0:side // stride, 0:side // stride]
    return np.stack([(x.ravel() + 0.5) * stride / side, (y.ravel() + 0.5) * stride / side], 1)


def near(b, stride, count, spread=0.4):
    """[1, cells, 2 count]: places within a cell or so, x y x y."""
    base = np.tile(centres(b.side, stride), (1, count))[None]
    return b.around(base, b.grid(stride, 2 * count, share=False, spread=spread * stride / b.side, scale=1 / 1024), **SHARE)


def sizes(b, stride):
    base = np.full((1, (b.side // stride) ** 2, 2), 1.5 * stride / b.side)
    return b.around(base, b.grid(stride, 2, share=False, spread=0.5 * stride / b.side, scale=1 / 1024), **SHARE)


def pose(classes=2, points=5):
    b = Drawn(1)
    levels = []
    for stride in (8, 16, 32):
        parts = [near(b, stride, 1), sizes(b, stride), b.grid(stride, classes, middle=-3.0)]
        for _ in range(points):
            parts += [near(b, stride, 1, 0.9), b.grid(stride, 1)]
        levels.append(b.joined(parts, 2))
    return b.bytes([b.image], [b.turned(b.joined(levels, 1))])


def seg(classes=2, coefficients=8):
    b = Drawn(7)
    levels = []
    for stride in (8, 16, 32):
        parts = [near(b, stride, 1), sizes(b, stride), b.grid(stride, classes, middle=-2.0)]
        signs = b.tensor("int8", (1, (b.side // stride) ** 2, coefficients), **SHARE)  # around 0, by the scale of the shares
        b.op("ADD", [b.grid(stride, coefficients, share=False, spread=0.5, scale=1 / 128),
                     b.const("int8", np.zeros((1, 1, 1)), scale=1 / 128, zero=0)], [signs], "Add")
        levels.append(b.joined(parts + [signs], 2))
    prototypes = b.grid(4, coefficients, share=False, spread=4.0, scale=1 / 8)
    return b.bytes([b.image], [b.turned(b.joined(levels, 1)), b.rows(prototypes, (1, 16, 16, coefficients))])


def obb(classes=2):
    b = Drawn(9)
    levels = []
    for stride in (8, 16, 32):
        parts = [near(b, stride, 1), sizes(b, stride), b.grid(stride, classes, middle=-2.0)]
        angle = b.around(np.full((1, (b.side // stride) ** 2, 1), 0.5), b.grid(stride, 1, share=False, spread=1.0, scale=1 / 256), **SHARE)
        levels.append(b.joined(parts + [angle], 2))
    return b.bytes([b.image], [b.turned(b.joined(levels, 1))])


def yolox(classes=2):
    b = Drawn(10)
    levels = []
    for stride in (8, 16, 32):
        numbers = b.around(np.full((1, (b.side // stride) ** 2, 4), 0.4), b.grid(stride, 4, share=False, spread=0.6, scale=1 / 64), 1 / 64, 0)
        shares = b.tensor("int8", (1, (b.side // stride) ** 2, 1 + classes), 1 / 64, 0)
        b.op("QUANTIZE", [b.grid(stride, 1 + classes, middle=-0.5)], [shares], "Quantize")
        levels.append(b.joined([numbers, shares], 2, 1 / 64, 0))
    return b.bytes([b.image], [b.joined(levels, 1, 1 / 64, 0)])


def yolov3(classes=2):
    b = Drawn(11)
    outs = []
    for stride in (8, 16):
        n = b.side // stride
        outs.append(b.rows(b.grid(stride, 2 * (5 + classes), share=False, spread=2.0, scale=1 / 16), (1, n, n, 2 * (5 + classes))))
    return b.bytes([b.image], outs)


def segment(classes=5):
    b = Drawn(8)
    numbers = b.rows(b.grid(2, classes, share=False, spread=4.0, scale=1 / 8), (1, 32, 32, classes))
    out = b.tensor("int8", (1, 32, 32, classes), **SHARE)
    b.op("SOFTMAX", [numbers], [out], "Softmax", Beta=1.0)
    return b.bytes([b.image], [out])


def blaze():
    b = Drawn(2, 128)
    boxes, scores = [], []
    for stride, per_cell in ((8, 2), (16, 6)):
        cells = (128 // stride) ** 2
        offset = b.moved(b.grid(stride, per_cell * 16, share=False, spread=0.12, scale=1 / 256), 0.5)
        middle = np.tile([0, 0, 1.5 * stride, 1.5 * stride] + [0] * 12, (1, cells, per_cell))
        boxes.append(b.rows(b.around(middle, offset, 1.0, 0), (1, cells * per_cell, 16)))
        logit = b.grid(stride, per_cell, share=False, spread=4.0, middle=-3.0, scale=1 / 8)
        scores.append(b.rows(logit, (1, cells * per_cell, 1)))
    return b.bytes([b.image], [b.joined(boxes, 1, 1.0, 0), b.joined(scores, 1, 1 / 8, 0)])


def movenet():
    b = Drawn(3)
    pooled = near(b, 16, 17, 3.0)  # of one cell of the picture
    scores = b.grid(16, 17)

    def one(t, count):
        cut = b.tensor("int8", (1, 1, count), **SHARE)
        b.op("STRIDED_SLICE", [t] + [b.const("int32", v) for v in ([0, 5, 0], [1, 6, count], [1, 1, 1])], [cut], "StridedSlice",
             BeginMask=0, EndMask=0, EllipsisMask=0, NewAxisMask=0, ShrinkAxisMask=0)
        return b.rows(cut, (1, 1, 17, count // 17))
    return b.bytes([b.image], [b.joined([one(pooled, 34), one(scores, 17)], 3)])


def landmarks():
    b = Drawn(4, 192)
    base = np.random.default_rng(9).uniform(40, 150, (1, 36, 39))
    offset = b.grid(32, 39, share=False, spread=4.0, scale=1 / 8)
    placed = b.around(base, offset, 1.0, -128 + 60)
    logit = b.grid(192, 1, share=False, spread=0.5, middle=2.0, scale=1 / 16)
    return b.bytes([b.image], [b.rows(placed, (1, 1, 1, 1404)), b.rows(logit, (1, 1, 1, 1))])


def end2end():
    b = Drawn(5)
    parts = [b.around(np.concatenate([centres(64, 8) - 0.08, centres(64, 8) + 0.08], 1)[None],
                      b.grid(8, 4, share=False, spread=0.04, scale=1 / 1024), **SHARE), b.grid(8, 1)]
    numbers = b.const("int8", (np.arange(64) % 3)[None, :, None] * 0 - 128, scale=1 / 256, zero=-128)
    return b.bytes([b.image], [b.joined(parts + [numbers], 2)])


def classifier():
    b = Drawn(6)
    logits = b.rows(b.grid(64, 12, share=False, spread=1.0, scale=1 / 16), (1, 12))
    out = b.tensor("int8", (1, 12), **SHARE)
    b.op("SOFTMAX", [logits], [out], "Softmax", Beta=1.0)
    return b.bytes([b.image], [out])


# name: network, options, whether the decoder must be chosen by itself
CASES = {"yolov8_pose": (pose, (), True), "blaze": (blaze, (), True), "landmarks": (landmarks, ("--score", "0.1"), True),
         "movenet": (movenet, ("--score", "0.05"), True), "end2end": (end2end, ("--decoder", "end2end"), False),
         "classifier": (classifier, (), True), "yolov8_seg": (seg, (), True), "segment": (segment, ("--labels", "LABELS"), True),
         "yolov8_obb": (obb, (), True), "yolox": (yolox, (), True),
         "yolov3": (yolov3, ("--decoder", "yolov3", "--anchors", "8,10,14,12,30,24,40,50"), False)}


def program(*arguments, cpu=None):
    environment = dict(os.environ, **({"FOVEA_CPU": cpu} if cpu else {}))
    ran = subprocess.run([FOVEA, *arguments], capture_output=True, text=True, env=environment, check=False)
    if ran.returncode:
        raise SystemExit(f"fovea {' '.join(arguments[:3])}: {ran.stderr.strip()}")
    return ran.stdout


def outputs_of(model, pictures, folder):
    """Real numbers by output, the picture first."""
    path = os.path.join(folder, "outputs.npz")
    program("model", "run", model, *pictures, "--out", path)
    with np.load(path) as file:
        count = sum("." not in name for name in file.files)
        return [np.float32(file[f"output{i}.scale"]) * (file[f"output{i}"].astype(np.float32) - file[f"output{i}.zero_point"])
                if f"output{i}.scale" in file.files else file[f"output{i}"].astype(np.float32) for i in range(count)]


def differs(found, expected):
    """Why two lists are not the same; None: they are."""
    if len(found) != len(expected):
        return f"{len(found)} found, {len(expected)} expected"
    for i, (f, e) in enumerate(zip(found, expected)):
        if f["class"] != e["class"] or abs(f["score"] - e["score"]) > SCORE_MAX:
            return f"number {i}: class {f['class']} by {f['score']}, expected {e['class']} by {e['score']:.6f}"
        if abs(f.get("angle", 0) - e.get("angle", 0)) > 1e-3:
            return f"number {i}: angle {f.get('angle')}, expected {e.get('angle')}"
        for key in ("box_px", "keypoints_px"):
            if (key in f) != (key in e):
                return f"number {i}: {key} of one only"
            if key in e:
                a, b = (np.array(v[key], float) for v in (f, e))
                if a.shape != b.shape or not np.allclose(a, b, atol=PIXELS_MAX, rtol=0, equal_nan=True):
                    return f"number {i}: {key} {a.tolist()} expected {b.tolist()}"
    return None


def mask_of(seen):
    """The mask of a line: the segment of each pixel, -1 where there is none."""
    runs = np.array(seen["runs"])
    return np.repeat(runs[:, 0], runs[:, 1]).reshape(seen["height"], seen["width"])


def masks_differ(seen, expected):
    """Why the masks differ, by the intersection over union of each segment; None: they do not."""
    found, segments = mask_of(seen), seen["segments"]
    if found.shape != expected.shape:
        return f"a mask of {found.shape}, expected {expected.shape}"
    found = np.where(expected == heads.DOUBT, heads.DOUBT, found)
    numbers = [s["object"] if s["object"] >= 0 else s["class"] for s in segments]
    if not set(np.unique(expected)) - {-1, heads.DOUBT} <= set(numbers):
        return f"segments {numbers}, expected {np.unique(expected)}"
    for i, number in enumerate(numbers):
        a, b = found == i, expected == number
        if (a | b).any() and (a & b).sum() < IOU_MIN * (a | b).sum():
            return f"segment {number}: {(a & b).sum()} of {(a | b).sum()} pixels agree"
    return None


def main():
    pictures = sys.argv[1:] or sorted(glob.glob(os.path.join(os.environ.get("FOVEA_DATA", ROOT + "/../shared/data"), "images", "*.jpg")))[:6]
    if not pictures:
        print("SKIPPED decoders: no photographs in $FOVEA_DATA/images")
        return 0
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, (make, options, chosen) in CASES.items():
            source, model = os.path.join(folder, name + ".tflite"), os.path.join(folder, name + ".fvm")
            with open(source, "wb") as file:
                file.write(make())
            labels = os.path.join(folder, "labels.txt")
            with open(labels, "w", encoding="ascii") as file:
                file.write("sky\nroad\ntree\nwall\ncat\n")
            options = [labels if o == "LABELS" else o for o in options]
            ran = subprocess.run([sys.executable, os.path.join(ROOT, "tools", "import"), source, "-o", model, *options], capture_output=True,
                                 text=True, check=False)
            if ran.returncode or chosen and f"decoder {name}" not in ran.stdout:
                print(f"WRONG  {name}: import: {ran.stderr.strip() or ran.stdout}")
                failed += 1
                continue
            chosen_pixels = 0
            lines = program("detect", "--model", model, *pictures)
            same = lines == program("detect", "--model", model, *pictures, cpu="c") == program("detect", "--model", model, "--units", "1", *pictures)
            outs, objects = outputs_of(model, pictures, folder), 0
            fault = None if same else "other results by another kernel set, or in units"
            for number, line in enumerate(lines.splitlines()):
                seen = json.loads(line)
                expected = heads.DECODERS[name]([o[number] for o in outs], seen["width"], seen["height"])
                listed = seen["classes" if "classes" in seen else "detections"]
                if "mask" in seen:
                    expected, mask = expected
                    fault = fault or masks_differ(seen["mask"], mask)
                    chosen_pixels += int((mask >= 0).sum())
                fault = fault or differs(listed, expected)
                objects += len(listed) + ("mask" in seen and not listed)
            if "segment" in name or "seg" in name:
                fault = fault or (None if chosen_pixels > 100 else f"{chosen_pixels} pixels in all masks")
            fault = fault or (None if objects else "nothing found in any photograph")
            failed += fault is not None
            print(f"{'WRONG ' if fault else 'equal '} {name}: {objects} found in {len(pictures)} photographs" + (f": {fault}" if fault else ""))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
