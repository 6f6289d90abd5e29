"""The shapes of outputs that each decoder reads. What a user names is held against them, and only decoders that could read a network are
proposed: those shapes are narrower, since anything may have three axes."""
import numpy as np

import details
import segment
from graph import origin

GRIDS = (8, 16, 32, 64)  # pixels of a cell
PEOPLE_MAX = 64  # of a network for the poses of several


def axes(e, *counts):
    return len(e.shape) in counts


def alone(e):
    return len(e.outs) == 1


def same_shape(e):
    """Whether an output of h x w, as segmentations have, has the input's proportions, to the rounding of its sizes."""
    h, w = e.shape[1:3] if len(e.shape) > 2 else e.shape
    return len(e.image) != 4 or abs(h * e.image[2] - w * e.image[1]) <= 8 * max(e.image[1:3])


def row(e):
    return int(np.prod(e.shape)) == e.shape[-1] if e.shape else False


def on_grid(e, shape):
    """Whether [1, h, w, n] has a cell for each 8, 16, 32 or 64 pixels of the input."""
    return len(shape) == 4 and len(e.image) == 4 and any((shape[1], shape[2]) == (-(-e.image[1] // s), -(-e.image[2] // s)) for s in GRIDS)


def columns(e, rows):
    return alone(e) and axes(e, 3) and e.shape[1] >= rows and e.shape[2] in e.cells()


def yolov3(e):
    shapes = [tuple(t.shape) for t in e.outs]
    return len(shapes) > 1 and len(set(shapes)) == len(shapes) and all(on_grid(e, s) and s[3] == shapes[0][3] >= 6 for s in shapes)


def yolov2_fault(e):
    """Why an output of 4 axes cannot be YOLOv2's; None: it can. Its head leaves LOGISTIC and SOFTMAX to the decoder."""
    numbers, pairs = e.shape[3], len((e.anchors or "").replace(",", " ").split()) // 2
    if not alone(e):
        return f"has one output, found {len(e.outs)}"
    if numbers < 6 or pairs and (numbers % pairs or numbers < 6 * pairs):
        return f"has {max(pairs, 1)} x (5 + classes) numbers for each cell, found {numbers}"
    if e.mask(e.graph.outputs[0]).any():
        return "has numbers before LOGISTIC and SOFTMAX, found scores that they made"
    return None


def fomo(e):
    made = origin(e.graph, e.graph.outputs[0])[1]
    return alone(e) and e.shape[3] > 1 and len(e.image) == 4 and 4 * e.shape[1] <= e.image[1] and 4 * e.shape[2] <= e.image[2] and \
        made is not None and made.name == "SOFTMAX"


def several_people(e):
    """MoveNet's 17 keypoints of three numbers, four of a box, and a score, of each person."""
    return alone(e) and axes(e, 3) and e.shape[2] == 56 and e.shape[1] <= PEOPLE_MAX and e.shape[2] not in e.cells()


def movenet(e):
    return several_people(e) or alone(e) and axes(e, 4) and e.shape[:2] == (1, 1) and e.shape[3] == 3


def landmarks(e):
    sizes = [int(np.prod(t.shape)) for t in e.outs]
    return len(e.image) == 4 and len(sizes) <= 5 and 1 in sizes and any(n >= 8 and 0 in (n % 2, n % 3, n % 5) for n in sizes)


def ssd_raw(e):
    shapes = sorted((tuple(t.shape) for t in e.outs), key=lambda s: s[-1:] != (4,))
    return len(shapes) == 2 and () not in shapes and shapes[0][-1] == 4 and np.prod(shapes[0]) > 4 and shapes[1][-1] > 1 and \
        np.prod(shapes[1]) == np.prod(shapes[0]) // 4 * shapes[1][-1]


def yolov8_seg(e):
    pair = details.prototypes(e)
    if pair is None:
        return False
    boxes, masks = (tuple(e.outs[i].shape) for i in pair)
    return boxes[2] in e.cells() and boxes[1] > 4 + masks[3]


def is_map(e):
    """Whether an output has rows and columns, of the input's proportions."""
    return axes(e, 2, 3, 4) and min(e.shape[1:3] if len(e.shape) > 2 else e.shape) > 1 and same_shape(e)


def segments(e):
    sides = e.shape[1:3] if len(e.shape) > 2 else (0, 0)
    return alone(e) and axes(e, 3, 4) and len(e.image) == 4 and same_shape(e) and 8 * sides[0] >= e.image[1] and 8 * sides[1] >= e.image[2] and \
        (len(e.shape) == 3 or e.shape[3] <= segment.CLASSES_MAX)


# By decoder: what it reads, whether a network's outputs are so at all, and whether they are so that it is worth proposing.
FORMS = {
    "classifier": ("one row of scores", row, lambda e: alone(e) and 1 < e.shape[-1]),
    "ssd": ("TFLite_Detection_PostProcess", lambda e: True, lambda e: any(op.name == "TFLite_Detection_PostProcess" for op in e.graph.ops)),
    "ssd_raw": ("boxes [n, 4] and scores [n, 1 + classes]", lambda e: True, ssd_raw),
    "yolov5": ("3 axes: [1, n, 5 + classes]", lambda e: axes(e, 3) and e.shape[2] >= 6,
               lambda e: alone(e) and e.shape[1] in {3 * n for n in e.cells()}),
    "yolov8": ("3 axes: [1, 4 + classes, n]", lambda e: axes(e, 3) and e.shape[1] >= 5, lambda e: columns(e, 5)),
    "yolov2": ("4 axes: [1, h, w, anchors (5 + classes)]", lambda e: axes(e, 4), lambda e: yolov2_fault(e) is None and on_grid(e, e.shape)),
    "fomo": ("4 axes: [1, h, w, 1 + classes]", lambda e: axes(e, 4), fomo),
    "segment": ("[1, h, w] or [1, h, w, classes] of the input's proportions", is_map, segments),
    "yolov8_pose": ("3 axes: [1, 4 + classes + keypoints, n]", lambda e: axes(e, 3), lambda e: columns(e, 9) and not details.rows_of(e)[0][4:].all()),
    "yolov8_seg": ("[1, 4 + classes + coefficients, n] and prototypes", lambda e: True, yolov8_seg),
    "yolov8_obb": ("3 axes: [1, 4 + classes + 1, n]", lambda e: axes(e, 3), lambda e: columns(e, 6)),
    "end2end": ("[1, n, 6 + keypoints]", lambda e: True, lambda e: alone(e) and axes(e, 3) and e.shape[2] >= 6 and e.shape[1] in (100, 300)),
    "movenet": ("3 or 4 axes: [1, 1, keypoints, 3] or [1, n, 3 keypoints + 5]", lambda e: axes(e, 3, 4), movenet),
    "blaze": ("boxes and scores of MediaPipe", lambda e: True, lambda e: details.blaze_pair(e) is not None and details.blaze_pair(e)[1] in details.BLAZE),
    "landmarks": ("keypoints, and one score", lambda e: True, landmarks),
    "yolox": ("3 axes: [1, n, 5 + classes]", lambda e: axes(e, 3), lambda e: alone(e) and len(e.image) == 4 and e.shape[2] >= 6 and
              e.shape[1] in details.yolox_cells(e)),
    "yolov3": ("several of [1, h, w, anchors (5 + classes)]", lambda e: True, yolov3),
}


def fits(e, name):
    return name not in FORMS or bool(FORMS[name][1](e))


def option(e, name):
    """What the user writes for this decoder."""
    more = {"yolov2": " --anchors PAIRS", "yolov3": " --anchors PAIRS", "ssd_raw": " --anchors FILE"}.get(name, "")
    if name == "landmarks" and details.landmark_form(e) is None or name == "yolov8_pose" and details.points_of(e, e.arguments) is None:
        more = " --points COUNT,VALUES"
    return f"--decoder {name}{more if '--anchors' not in more or not e.anchors else ''}"


def proposed(e, held):
    """Decoders that the outputs' shapes permit; held(name): and which hold() would believe."""
    return [name for name, (_, read, worth) in FORMS.items() if read(e) and worth(e) and held(name)]
