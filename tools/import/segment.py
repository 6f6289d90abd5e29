"""Networks that label pixels: whether an output is that of one, how many classes it tells apart, and their colours."""
import numpy as np

from graph import ImportProblem, origin

CLASSES_MAX = 255
SHAPES = "one of [1, h, w], [1, h, w, 1] or [1, h, w, up to 255 classes]"


def arg_max(e):
    """How many classes the operator compares that an output of classes' numbers comes from; 0: there is none."""
    op = origin(e.graph, e.graph.outputs[0], ("QUANTIZE", "DEQUANTIZE", "CAST", "RESHAPE", "SQUEEZE", "EXPAND_DIMS"))[1]
    if op is None or op.name != "ARG_MAX":
        return 0
    axis, shape = e.graph.tensors[op.inputs[1]].data, e.graph.tensors[op.inputs[0]].shape
    return int(shape[int(np.asarray(axis).ravel()[0])]) if axis is not None else 0


def details(e, make):
    """Classes by pixel, or scores of each: as many classes as scores; 0: the output holds their numbers, and nothing says how many."""
    channels = int(e.shape[3]) if len(e.shape) == 4 else 1
    if len(e.outs) != 1 or not 2 <= len(e.shape) <= 4 or channels > CLASSES_MAX:
        shapes = " ".join(str([int(n) for n in t.shape]) for t in e.outs[:4])
        raise ImportProblem(f"--decoder segment: found outputs {shapes[:80]}, expected {SHAPES}")
    numbers = arg_max(e) if channels == 1 else 0
    share = not numbers and bool(e.mask(e.graph.outputs[0]).all())
    classes = channels if channels > 1 or share else numbers if 1 < numbers <= CLASSES_MAX else 0
    return make(classes, normalised=0, probabilities=int(share))


def labels_fault(e):
    """Of an output of classes' numbers: labels must not be fewer. What files say after them is no label."""
    classes, sides = arg_max(e), e.shape[1:3]
    if len(e.image) != 4 or 8 * sides[0] < e.image[1] or 8 * sides[1] < e.image[2]:
        return f"has at least an eighth of the input's size, found {sides[0]} x {sides[1]}"
    return f"tells {classes} classes apart, found {len(e.labels)} labels" if 0 < len(e.labels) < classes else None


def fault(e):
    """Why an output of [1, h, w, n] cannot be scores of each pixel; None: it can. Only names of as many classes make it certain: maps of
    heat, depth or features look alike."""
    _, h, w, channels = e.shape
    share = e.mask(e.graph.outputs[0]).all()
    ends = origin(e.graph, e.graph.outputs[0])[1]
    if len(e.outs) != 1:
        return f"has one output, found {len(e.outs)}"
    if channels > CLASSES_MAX:
        return f"tells up to {CLASSES_MAX} classes apart, found {channels}"
    if len(e.image) != 4 or 8 * h < e.image[1] or 8 * w < e.image[2] or abs(h * e.image[2] - w * e.image[1]) > 8 * max(e.image[1:3]):
        return f"has the input's shape and at least an eighth of its size, found {h} x {w}"
    if len(e.labels) != channels:
        return f"needs {channels} label{'s' if channels > 1 else ''}, found {len(e.labels)}"
    if channels == 1 and not share:
        return "has a score from LOGISTIC"
    if not share and (h, w) != tuple(e.image[1:3]) and (ends is None or ends.name not in ("RESIZE_BILINEAR", "RESIZE_NEAREST_NEIGHBOR")):
        return f"ends in SOFTMAX or LOGISTIC, or has the input's size, found {h} x {w} of {e.image[1]} x {e.image[2]}"
    return None


def colours(path, lines, classes):
    """Bytes [n][3] of a file's lines, a class each."""
    found = []
    for number, line in enumerate(lines, 1):
        parts = line.split()
        text = parts[0][1:] if len(parts) == 1 and parts[0].startswith("#") else ""
        if len(text) == 6 and all(c in "0123456789abcdefABCDEF" for c in text):
            found.append([int(text[i:i + 2], 16) for i in (0, 2, 4)])
        elif len(parts) == 3 and all(p.isascii() and p.isdecimal() and int(p) < 256 for p in parts):
            found.append([int(p) for p in parts])
        else:
            raise ImportProblem(f"{path}: line {number}: found {line[:40]!r}, expected #rrggbb or three numbers from 0 to 255")
    if not found or len(found) > CLASSES_MAX or classes and len(found) != classes:
        raise ImportProblem(f"{path}: found {len(found)} colours, expected {classes or f'1 to {CLASSES_MAX}'}, one for each class")
    return np.array(found, np.uint8)


def scatter(values):
    """The share of neighbours of unlike class in an output of scores or of classes' numbers."""
    classes = values[0].argmax(-1) if values.ndim == 4 and values.shape[-1] > 1 else np.round(values).reshape(values.shape[1:3] if values.ndim == 4 else values.shape[-2:])
    return max(np.mean(classes[1:] != classes[:-1]), np.mean(classes[:, 1:] != classes[:, :-1]))
