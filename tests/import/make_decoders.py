"""Write tests/golden/decoders.txt: outputs of detection heads, and the boxes that they stand for by an independent computation
in double precision with numpy, from the heads' definitions (YOLOv5 and YOLOv8: ultralytics' exports; YOLOv2: Redmon and Farhadi,
"YOLO9000", CVPR 2017, section 2; SSD: Liu et al., ECCV 2016, with the box coding of Faster R-CNN).

One case: a line "head NAME d0 d1 ... scale zero classes normalised agnostic score iou anchors...", a line with the output's bytes in
hex, a line per box "box class score x0 y0 x1 y1" in input pixels, by falling score, a line "end". Needs numpy."""
import os

import numpy as np

WIDTH, HEIGHT = 96, 64
HERE = os.path.dirname(os.path.abspath(__file__))


def sigmoid(x):
    return 1 / (1 + np.exp(-x))


def overlap(a, b):
    w = min(a[2], b[2]) - max(a[0], b[0])
    h = min(a[3], b[3]) - max(a[1], b[1])
    if w <= 0 or h <= 0:
        return 0.0
    return w * h / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - w * h)


def suppressed(found, iou, agnostic):
    """Greedy, by falling score; earlier entries first among equals."""
    left = []
    for f in sorted(found, key=lambda f: -f[1]):
        if all(overlap(f[2], k[2]) <= iou or (k[0] != f[0] and not agnostic) for k in left):
            left.append(f)
    return left


def clipped(x, y, w, h):
    return [min(max(x - w / 2, 0), WIDTH), min(max(y - h / 2, 0), HEIGHT), min(max(x + w / 2, 0), WIDTH),
            min(max(y + h / 2, 0), HEIGHT)]


def taken(found):
    return [f for f in found if f[2][2] > f[2][0] and f[2][3] > f[2][1]]


def yolov5(v, case):
    found = []
    for row in v.reshape(-1, 5 + case["classes"]):
        x, y, w, h = row[:4] * ([WIDTH, HEIGHT, WIDTH, HEIGHT] if case["normalised"] else 1)
        found += [(c, row[4] * row[5 + c], clipped(x, y, w, h)) for c in range(case["classes"])]
    return found


def yolov8(v, case):
    found = []
    for column in v.reshape(4 + case["classes"], -1).T:
        x, y, w, h = column[:4] * ([WIDTH, HEIGHT, WIDTH, HEIGHT] if case["normalised"] else 1)
        c = int(np.argmax(column[4:]))
        found.append((c, column[4 + c], clipped(x, y, w, h)))
    return found


def yolov2(v, case):
    found = []
    _, rows, columns, _ = v.shape
    anchors = np.array(case["anchors"]).reshape(-1, 2)
    cells = v.reshape(rows, columns, len(anchors), 5 + case["classes"])
    for j in range(rows):
        for i in range(columns):
            for a, (aw, ah) in enumerate(anchors):
                t = cells[j, i, a]
                share = np.exp(t[5:]) / np.exp(t[5:]).sum()
                box = clipped((i + sigmoid(t[0])) / columns * WIDTH, (j + sigmoid(t[1])) / rows * HEIGHT,
                              aw * np.exp(t[2]) / columns * WIDTH, ah * np.exp(t[3]) / rows * HEIGHT)
                found += [(c, sigmoid(t[4]) * share[c], box) for c in range(case["classes"])]
    return found


HEADS = {"yolov5": yolov5, "yolov8": yolov8, "yolov2": yolov2}


def write(file, name, r, shape, scale, zero, **case):
    case = dict(dict(classes=3, normalised=0, agnostic=0, score=0.3, iou=0.5, anchors=[]), **case)
    for _ in range(1000):  # no score or overlap so near to a threshold that rounding would decide
        data = r.integers(0, 256, shape).astype(np.uint8)
        if name != "yolov2":
            rows = data.reshape(-1, 5 + case["classes"]) if name == "yolov5" else data.reshape(4 + case["classes"], -1).T
            rows[:, 2:4] //= 3
            if not case["normalised"]:  # boxes in pixels leave few steps for scores from 0 to 1, and one beyond for rounding
                rows[:, 4:] = zero + r.integers(0, 4, rows[:, 4:].shape)
        values = (data.astype(np.float64) - zero) * np.float64(np.float32(scale))
        found = taken(HEADS[name](values, case))
        found = [(c, min(score, 1.0), box) for c, score, box in found]
        near = any(abs(f[1] - case["score"]) < 1e-4 for f in found)
        found = [f for f in found if f[1] >= case["score"]]
        near |= any(abs(overlap(a[2], b[2]) - case["iou"]) < 1e-4 for a in found for b in found)
        boxes = suppressed(found, case["iou"], case["agnostic"])
        if not near and 3 <= len(boxes) < len(found):
            break
    else:
        raise SystemExit(f"{name}: no case without doubt")
    file.write(" ".join(str(v) for v in ("head", name, *shape, scale, zero, case["classes"], case["normalised"],
                                         case["agnostic"], case["score"], case["iou"], *case["anchors"])) + "\n")
    file.write(data.tobytes().hex() + "\n")
    for c, score, box in boxes:
        file.write("box " + " ".join(f"{v:.9g}" for v in (c, score, *box)) + "\n")
    file.write("end\n")


def main():
    r = np.random.default_rng(7)
    with open(os.path.join(HERE, "..", "golden", "decoders.txt"), "w", encoding="ascii") as file:
        for agnostic in (0, 1):
            write(file, "yolov5", r, (1, 40, 8), 1 / 255, 0, normalised=1, agnostic=agnostic)
            write(file, "yolov5", r, (1, 40, 8), 0.4, 0, agnostic=agnostic)
            write(file, "yolov8", r, (1, 7, 50), 1 / 255, 0, normalised=1, score=0.8, agnostic=agnostic)
            write(file, "yolov8", r, (1, 7, 50), 0.4, 3, agnostic=agnostic)
            write(file, "yolov2", r, (1, 3, 4, 16), 0.03, 128, anchors=[1.08, 1.19, 0.6, 0.5], agnostic=agnostic)
            write(file, "yolov2", r, (1, 2, 5, 30), 0.05, 120, classes=10, anchors=[1.3, 1.7, 2.1, 0.8], score=0.2,
                  agnostic=agnostic)


if __name__ == "__main__":
    main()
