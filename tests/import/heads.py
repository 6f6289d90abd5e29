"""Decoders of networks' outputs, written in numpy from the heads' definitions and nothing of src/detect, for decoders.py. Each takes the
outputs of one picture and the picture's size, and gives what `fovea detect` should print, by falling score."""
import numpy as np


class Fit:
    """Where a picture of width x height lies in an input of side x side."""

    def __init__(self, side, width, height, letterbox=True):
        if letterbox:
            scale = min(side / width, side / height)
            w, h = max(1, int(np.floor(width * scale + 0.5))), max(1, int(np.floor(height * scale + 0.5)))
            self.left, self.top = (side - w) // 2, (side - h) // 2
        else:
            w, h, self.left, self.top = side, side, 0, 0
        self.sx, self.sy, self.width, self.height = w / width, h / height, width, height

    def point(self, x, y):
        return [(x - self.left) / self.sx - 0.5, (y - self.top) / self.sy - 0.5]

    def box(self, x0, y0, x1, y1):
        """None where nothing of it is in the picture."""
        (x0, y0), (x1, y1) = self.point(x0, y0), self.point(x1, y1)
        x0, x1 = np.clip([x0, x1], -0.5, self.width - 0.5)
        y0, y1 = np.clip([y0, y1], -0.5, self.height - 0.5)
        return [x0, y0, x1, y1] if x1 > x0 and y1 > y0 else None


def sigmoid(x):
    return 1 / (1 + np.exp(-np.asarray(x, float)))


def iou(a, b):
    w, h = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    if w <= 0 or h <= 0:
        return 0.0
    return w * h / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - w * h)


def suppressed(found, overlap=0.5):
    left = []
    for f in sorted(found, key=lambda f: -f["score"]):
        if all(k["class"] != f["class"] or iou(f["box_px"], k["box_px"]) <= overlap for k in left):
            left.append(f)
    return left[:300]


def entry(class_id, score, box=None, points=None):
    found = {"class": int(class_id), "score": float(min(max(score, 0.0), 1.0))}
    if box is not None:
        found["box_px"] = box
    if points is not None:
        found["keypoints_px"] = points
    return found


def yolov8_pose(outs, width, height, side=64, classes=2):
    fit, columns, found = Fit(side, width, height), outs[0][0].astype(float), []
    for v in columns.T:
        c = int(np.argmax(v[4:4 + classes]))
        x, y, w, h = v[:4] * side
        box = fit.box(x - w / 2, y - h / 2, x + w / 2, y + h / 2)
        if v[4 + c] >= 0.25 and box:
            points = [[*fit.point(p[0] * side, p[1] * side), min(p[2], 1.0)] for p in v[4 + classes:].reshape(-1, 3)]
            found.append(entry(c, v[4 + c], box, points))
    return limited(suppressed(found), 5)


def covariance(w, h, angle):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return turn @ np.diag([w * w / 12, h * h / 12]) @ turn.T


def probiou(p, q):
    """One minus the Hellinger distance of two normal distributions (centre, covariance)."""
    (m1, s1), (m2, s2) = p, q
    mean, d = (s1 + s2) / 2, m1 - m2
    bhattacharyya = d @ np.linalg.inv(mean) @ d / 8 + np.log(np.linalg.det(mean) / np.sqrt(np.linalg.det(s1) * np.linalg.det(s2))) / 2
    return 1 - np.sqrt(1 - np.exp(-bhattacharyya))


def yolov8_obb(outs, width, height, side=64):
    fit, columns, found = Fit(side, width, height), outs[0][0].astype(float), []
    for v in columns.T:
        c = int(np.argmax(v[4:-1]))
        x, y = fit.point(v[0] * side, v[1] * side)
        along = v[2] * side * np.array([np.cos(v[-1]) / fit.sx, np.sin(v[-1]) / fit.sy])  # the scales differ by the rounding of sizes
        across = v[3] * side * np.array([-np.sin(v[-1]) / fit.sx, np.cos(v[-1]) / fit.sy])
        w, h, angle = np.linalg.norm(along), np.linalg.norm(across), np.arctan2(along[1], along[0])
        if v[4 + c] >= 0.25 and w > 0 and h > 0:
            f = entry(c, v[4 + c], [x - w / 2, y - h / 2, x + w / 2, y + h / 2])
            found.append(dict(f, angle=angle, normal=(np.array([x, y]), covariance(w, h, angle))))
    left = []
    for f in sorted(found, key=lambda f: -f["score"]):
        if all(k["class"] != f["class"] or probiou(k["normal"], f["normal"]) < 0.5 for k in left):
            left.append(f)
    return left


def yolox(outs, width, height, side=64):
    fit, rows, found, at = Fit(side, width, height), outs[0][0].astype(float), [], 0
    for stride in (8, 16, 32):
        for y in range(side // stride):
            for x in range(side // stride):
                v = rows[at]
                at += 1
                c = int(np.argmax(v[5:]))
                cx, cy, w, h = (v[0] + x) * stride, (v[1] + y) * stride, np.exp(v[2]) * stride, np.exp(v[3]) * stride
                box = fit.box(cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2)
                if v[4] * v[5 + c] >= 0.25 and box:
                    found.append(entry(c, v[4] * v[5 + c], box))
    return suppressed(found)


def yolov3(outs, width, height, side=64, anchors=(((8, 10), (14, 12)), ((30, 24), (40, 50)))):
    """Finest grid first, as its anchors."""
    fit, found = Fit(side, width, height), []
    for values, pairs in zip(outs, anchors):
        _, rows, columns, _ = (1, *values.shape[1:])
        cells = values[0].reshape(rows, columns, len(pairs), -1).astype(float)
        for (y, x, a), _ in np.ndenumerate(cells[..., 0]):
            t = cells[y, x, a]
            cx, cy = (x + sigmoid(t[0])) / columns * side, (y + sigmoid(t[1])) / rows * side
            w, h = pairs[a][0] * np.exp(t[2]), pairs[a][1] * np.exp(t[3])
            box = fit.box(cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2)
            found += [entry(c, s, box) for c, s in enumerate(sigmoid(t[4]) * sigmoid(t[5:])) if s >= 0.25 and box]
    return suppressed(found)


DOUBT = -2  # a pixel of a mask that may have either value


def place(fit, side, w, h):
    """Of the mask's pixel (x, y) in the picture."""
    x, y = np.meshgrid((np.arange(w) + 0.5) * side / w, (np.arange(h) + 0.5) * side / h)
    return (x - fit.left) / fit.sx - 0.5, (y - fit.top) / fit.sy - 0.5


def yolov8_seg(outs, width, height, side=64, classes=2):
    fit, columns, found = Fit(side, width, height), outs[0][0].astype(float), []
    for v in columns.T:
        c = int(np.argmax(v[4:4 + classes]))
        x, y, w, h = v[:4] * side
        box = fit.box(x - w / 2, y - h / 2, x + w / 2, y + h / 2)
        if v[4 + c] >= 0.25 and box:
            found.append(dict(entry(c, v[4 + c], box), v=v))
    found = suppressed(found)
    prototypes = outs[1][0].astype(float)
    x, y = place(fit, side, *prototypes.shape[1::-1])
    mask = np.full(prototypes.shape[:2], -1)
    for i, f in reversed(list(enumerate(found[:64]))):
        x0, y0, x1, y1 = f["box_px"]
        share = sigmoid(prototypes @ f["v"][4 + classes:])
        mask[(share > 0.5) & (x >= x0) & (x < x1) & (y >= y0) & (y < y1)] = i
    for f in found[:64]:  # centres on an edge, where rounding decides
        x0, y0, x1, y1 = f["box_px"]
        mask[(np.minimum(np.abs(x - x0), np.abs(x - x1)) < 1e-3) | (np.minimum(np.abs(y - y0), np.abs(y - y1)) < 1e-3)] = DOUBT
    for f in found:
        del f["v"]
    return found, mask


def segment(outs, width, height, side=64):
    fit, scores = Fit(side, width, height, False), outs[0][0].astype(float)
    x, y = place(fit, side, *scores.shape[1::-1])
    mask = np.argmax(scores, -1)
    mask[(x < -0.5) | (x >= width - 0.5) | (y < -0.5) | (y >= height - 0.5)] = -1
    return [], mask


def limited(found, points):
    """Keypoints of the first sets only: 100, and 3000 points in all."""
    for f in found[min(100, 3000 // points):]:
        del f["keypoints_px"]
    return found


def blaze(outs, width, height):
    fit, found = Fit(128, width, height), []
    centres = []
    for stride, count in ((8, 2), (16, 6)):
        for y in range(128 // stride):
            for x in range(128 // stride):
                centres += [((x + 0.5) * stride, (y + 0.5) * stride)] * count
    for v, logit, (cx, cy) in zip(outs[0][0].astype(float), outs[1][0, :, 0], centres):
        score = sigmoid(logit)
        x, y, w, h = v[0] + cx, v[1] + cy, v[2], v[3]
        box = fit.box(x - w / 2, y - h / 2, x + w / 2, y + h / 2)
        if score >= 0.25 and box:
            found.append(entry(0, score, box, [[*fit.point(px + cx, py + cy), np.nan] for px, py in v[4:].reshape(-1, 2)]))
    return limited(suppressed(found), 6)


def movenet(outs, width, height):
    fit, points = Fit(64, width, height), outs[0].reshape(17, 3).astype(float)
    score = np.clip(points[:, 2], 0, 1).mean()
    placed = [[*fit.point(x * 64, y * 64), min(s, 1.0)] for y, x, s in points]
    return [entry(0, score, None, placed)] if score >= 0.05 else []


def landmarks(outs, width, height):
    fit, score = Fit(192, width, height, False), sigmoid(outs[1].ravel()[0])
    placed = [[*fit.point(x, y), np.nan] for x, y, _ in outs[0].reshape(-1, 3).astype(float)]
    return [entry(0, score, None, placed)] if score >= 0.1 else []


def end2end(outs, width, height):
    fit, found = Fit(64, width, height), []
    for row in outs[0][0].astype(float):
        box = fit.box(*row[:4] * 64)
        if row[4] >= 0.25 and box:
            found.append(entry(round(row[5]), row[4], box))
    return sorted(found, key=lambda f: -f["score"])


def classifier(outs, width, height):
    scores = outs[0].ravel()
    return [entry(c, scores[c]) for c in np.argsort(-scores, kind="stable")[:5]]


DECODERS = {"yolov8_pose": yolov8_pose, "blaze": blaze, "movenet": movenet, "landmarks": landmarks, "end2end": end2end,
            "classifier": classifier, "yolov8_seg": yolov8_seg, "segment": segment, "yolov8_obb": yolov8_obb, "yolox": yolox, "yolov3": yolov3}
