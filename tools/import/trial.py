"""A decoder is tried: the network runs on drawn pictures, and its outputs must look as that decoder's do. Where it was chosen here, they must
look so in all; where the user named it, they must only not be what it never gives."""
import subprocess

import numpy as np

import segment
from choose import STRIDES
from graph import ImportProblem


def pictures(h, w, channels):
    """A smooth one, one of rectangles on grey, one of noise; bytes."""
    y, x = np.mgrid[0:h, 0:w] / max(h, w)
    phase = np.arange(channels)
    smooth = 127.5 + 80 * np.sin(7 * x[..., None] + phase) * np.cos(5 * y[..., None] - phase)
    draw = np.random.default_rng(5)
    blocks = np.full((h, w, channels), 110.0)
    for _ in range(12):
        top, left = draw.integers(0, h), draw.integers(0, w)
        blocks[top:top + h // 4, left:left + w // 5] = draw.integers(0, 256, channels)
    noise = draw.integers(0, 256, (h, w, channels))
    return [np.clip(p, 0, 255).astype(np.uint8) for p in (smooth, blocks, noise)]


def as_input(tensor, picture, mean, scale):
    """A picture as the loop would write it; `tensor` is that of the .tflite file."""
    real = (picture.astype(np.float64) - mean) * scale
    if not tensor.is8:
        return real.astype(np.float32)[None]
    value = np.floor(real / float(tensor.scale0) + tensor.zero_u8 + 0.5)
    value = np.clip(value, 0, 255).astype(np.uint8)
    return ((value ^ 128).view(np.int8) if tensor.signed else value)[None]


def real(tensor, found):
    if not tensor.is8:
        return found.astype(np.float64)
    return (found.astype(np.float64) + tensor.bias8 - tensor.zero_u8) * float(tensor.scale0)


def centres(h, w, n, per_cell):
    """Of the cells that n boxes belong to, in fractions of the size, and half a cell's size; None: another order."""
    for strides in STRIDES:
        at = [(s, -(-h // s), -(-w // s)) for s in strides]
        if per_cell * sum(rows * columns for _, rows, columns in at) != n:
            continue
        found = []
        for s, rows, columns in at:
            y, x = np.mgrid[0:rows, 0:columns]
            found.append(np.repeat(np.stack([(x.ravel() + 0.5) * s / w, (y.ravel() + 0.5) * s / h], 1), per_cell, 0))
        return np.concatenate(found)
    return None


def agreement(a, b):
    """The correlation of two lists; 0 where one is constant."""
    a, b = a - a.mean(), b - b.mean()
    spread = np.sqrt(np.mean(a * a) * np.mean(b * b))
    return float(np.mean(a * b) / spread) if spread > 1e-9 else 0.0


def scores_look_wrong(scores):
    low, high = scores.min(), scores.max()
    return None if low > -0.02 and high < 1.02 else f"scores from {low:.3g} to {high:.3g}"


def boxes_look_wrong(values, h, w, per_cell, normalised, chosen):
    """`values` [n][4 + scores]."""
    size = 1.0 if normalised else np.array([w, h, w, h])
    box, n = values[:, :4] / size, len(values)
    if np.mean((box[:, 2:] >= 0) & (box[:, 2:] < 2)) < 0.98:
        return "sizes of boxes below 0 or above twice the picture"
    if np.mean((box[:, :2] > -0.25) & (box[:, :2] < 1.25)) < 0.98:
        return "boxes far outside the picture"
    if scores_look_wrong(values[:, 4:]) or not chosen:
        return scores_look_wrong(values[:, 4:])
    cells = centres(h, w, n, per_cell)
    if cells is not None and min(agreement(box[:, i], cells[:, i]) for i in (0, 1)) < 0.6:
        return "boxes that do not lie near their cells"
    sure = values[:, 4:5] * values[:, 5:] if per_cell == 3 else values[:, 4:]
    if np.mean(sure.max(1) > 0.5) > 0.2:
        return f"{100 * np.mean(sure.max(1) > 0.5):.0f} % of all boxes above a score of 0.5"
    return None


def points_look_wrong(points, size):
    """`points` [...][2], in the unit of `size`."""
    inside = (points > -size) & (points < 2 * size)
    return "keypoints far outside the picture" if np.mean(inside) < 0.9 else None


def poses_look_wrong(points, size, h, w):
    """Keypoints of the boxes of cells, `points` [n][count][2 and more]: around their cells, whatever the picture."""
    cells = centres(h, w, len(points), 1)
    middle = points[..., :2].mean(1) / size
    if cells is not None and min(agreement(middle[:, i], cells[:, i]) for i in (0, 1)) < 0.3:
        return "keypoints that do not lie around their cells"
    return points_look_wrong(points[..., :2], size) or (scores_look_wrong(points[..., 2]) if points.shape[-1] == 3 else None)


def angles_look_wrong(angles):
    """From a quarter of a turn to the left to three to the right; what is never below 0 and nearly always 0 is another score."""
    if np.abs(angles).max() > 7:
        return "angles beyond a turn"
    return "a last row that is 0 nearly everywhere, as scores are, and no angle" if angles.min() >= 0 and np.mean(angles < 0.02) > 0.8 else None


def cells_look_wrong(rows, h, w, chosen):
    """Of YOLOX, before the cells are added."""
    at = [(s, h // s, w // s) for s in (8, 16, 32, 64)]
    cells = np.concatenate([np.stack([x.ravel(), y.ravel(), 0 * x.ravel() + s], 1)
                            for s, h, w in at for y, x in [np.mgrid[0:h, 0:w]]])[:len(rows)]
    if chosen and min(agreement(rows[:, i], (cells[:, i] + 0.5) * cells[:, 2]) for i in (0, 1)) > 0.6:
        return "centres that grow with their cells, so boxes that are already decoded"
    if np.mean(np.abs(rows[:, 2:4]) > 6) > 0.02:
        return "numbers that are no logarithms of sizes in cells"
    boxes = np.concatenate([(rows[:, :2] + cells[:, :2]) * cells[:, 2:], np.exp(np.clip(rows[:, 2:4], -9, 9)) * cells[:, 2:],
                            rows[:, 4:5] * rows[:, 5:]], 1)
    return boxes_look_wrong(boxes, h, w, 1, False, chosen)


def details_look_wrong(kind, outs, image, normalised, known, chosen, smooth):
    """The same for decoders with details, of all outputs in the order of their roles."""
    size = np.array([1.0, 1.0] if normalised else [image[2], image[1]])
    first, (h, w) = outs[0], image[1:3]
    if kind == "yolov8_pose":
        values = first[0].T
        points = values[:, 4 + known.classes:].reshape(len(values), known.points, known.values)
        return boxes_look_wrong(values[:, :4 + known.classes], h, w, 1, normalised, chosen) or poses_look_wrong(points, size, h, w)
    if kind == "yolov8_obb":
        return boxes_look_wrong(first[0].T[:, :-1], h, w, 1, normalised, chosen) or angles_look_wrong(first[0, -1])
    if kind == "yolov8_seg":
        return boxes_look_wrong(first[0].T[:, :4 + known.classes], h, w, 1, normalised, chosen)
    if kind == "yolox":
        return cells_look_wrong(first[0], h, w, chosen)
    if kind == "movenet":
        values = first.reshape(-1, 3) if first.shape[-1] == 3 else first.reshape(-1, first.shape[-1])[:, :-5].reshape(-1, 3)
        return points_look_wrong(values[:, :2], 1.0) or scores_look_wrong(values[:, 2])
    if kind == "blaze":
        scores = outs[1] if not known.logits else 1 / (1 + np.exp(-np.clip(outs[1], -80, 80)))
        if chosen and np.mean(scores > 0.5) > 0.2:
            return f"{100 * np.mean(scores > 0.5):.0f} % of all boxes above a score of 0.5"
        return points_look_wrong(first[0, :, :2] + known.anchors[:, 1::-1] * size, size)
    if kind == "landmarks":
        return points_look_wrong(first.reshape(known.points, known.values)[:, :2], size)
    if kind == "segment" and smooth and chosen and segment.scatter(first) > 0.5:
        return f"another class in {100 * segment.scatter(first):.0f} % of all neighbours"
    if kind == "end2end":
        rows = first[0]
        if chosen and (np.diff(rows[:, 4]) > 0.02).any():
            return "scores that do not fall from row to row"
        return scores_look_wrong(rows[:, 4])
    return None


def looks_wrong(kind, values, image, normalised, chosen):
    """What is wrong with the first output on a picture, None: nothing."""
    if kind in ("classifier", "fomo") and scores_look_wrong(values):
        return scores_look_wrong(values)
    if kind == "fomo" and chosen and np.mean(values[..., 0] > 0.5) < 0.4:
        return f"background in {100 * np.mean(values[..., 0] > 0.5):.0f} % of all cells"
    if kind in ("yolov5", "yolov8"):
        values = values[0].T if kind == "yolov8" else values[0]
        return boxes_look_wrong(values, image[1], image[2], 3 if kind == "yolov5" else 1, normalised, chosen)
    return None


def engine(data):
    """None where it was not built."""
    try:
        from engine import Engine
        return Engine(data)
    except RuntimeError as problem:  # what the loader says of a model
        raise ImportProblem(f"its operators are none that the engine runs ({' '.join(str(problem).split())[:120]})") from problem
    except (ImportError, OSError, SystemExit, subprocess.CalledProcessError):
        return None


def by_role(outs, known):
    """Outputs in the order of their roles."""
    places = [role - 1 if role else i for i, role in enumerate(known.roles)]
    return [outs[i] for i in places if i < len(outs)]


def run(data, graph, kind, mean, scale, normalised, known, chosen):
    """True: tried. False: the engine was not built. Raises ImportProblem when a picture's outputs do not look right."""
    source = next(graph.tensors[t] for t in graph.inputs if graph.tensors[t].data is None)
    if kind in ("ssd", "ssd_raw", "none", "embedding") or len(source.shape) != 4 or source.shape[3] not in (1, 3):
        return True  # said by the operator itself, or by the user's anchors
    tried = engine(data)
    if tried is None:
        return False
    for number, picture in enumerate(pictures(*source.shape[1:])):
        tried.set_input(0, as_input(source, picture, mean, scale))
        tried.run()
        outs = [real(graph.tensors[t], tried.tensor(i)) for t, i in zip(graph.outputs, tried.outputs)]
        fault = looks_wrong(kind, outs[0], source.shape, normalised, chosen) if known is None else \
            details_look_wrong(kind, by_role(outs, known), source.shape, normalised, known, chosen, number == 0)
        if fault and chosen:
            raise ImportProblem(f"as {kind} its outputs on drawn picture {number} have {fault}: "
                                f"expected --decoder none for the raw outputs, or --decoder {kind} if it is that")
        if fault:
            raise ImportProblem(f"--decoder {kind}: its outputs on drawn picture {number} have {fault}: expected another decoder, or none")
    return True
