"""What a decoder of keypoints, masks or anchors needs to know of a network beside its kind: which output is what, how many keypoints of
how many numbers, what is still before its LOGISTIC, and the anchors. Each function gives a Details, or raises ImportProblem."""
import dataclasses

import numpy as np

import segment
from graph import ImportProblem

POINTS_MAX, VALUES_MAX, COEFFICIENTS_MAX = 1000, 8, 256
LOGITS_SCORES, LOGITS_POINTS = 1, 2

# Networks of MediaPipe, by the input's side and the number of boxes: (stride, boxes per cell) of each grid, the keypoints of a box.
# Anchors are as large as the input, at the centres of cells (mediapipe/modules/*/*_detection*.pbtxt, SsdAnchorsCalculator).
BLAZE = {(128, 896, 6): ((8, 2), (16, 6)), (256, 896, 6): ((16, 2), (32, 6)), (192, 2304, 6): ((4, 1),),
         (128, 896, 7): ((8, 2), (16, 6)), (192, 2016, 7): ((8, 2), (16, 6)), (256, 2944, 7): ((8, 2), (16, 2), (32, 6)),
         (128, 896, 4): ((8, 2), (16, 6)), (224, 2254, 4): ((8, 2), (16, 2), (32, 6))}
# Landmarks by the input's side and the numbers of the output: keypoints, and numbers of each.
LANDMARKS = {(192, 1404): (468, 3), (256, 1434): (478, 3), (192, 136): (68, 2), (224, 63): (21, 3), (256, 63): (21, 3),
             (256, 195): (39, 5)}


# Those of them that take pictures as 0 to 1, before they are quantised, by the input's side and the numbers of an output.
FRACTIONS = {(192, 2016 * 18), (192, 1404), (256, 1434), (224, 63), (256, 195)}


@dataclasses.dataclass
class Details:
    classes: int = 1
    points: int = 0
    values: int = 0
    point_score: int = 0
    logits: int = 0
    roles: tuple = (0, 0, 0)
    coefficients: int = 0
    anchors: np.ndarray = None
    normalised: int = None  # None: by the range of the output
    anchor_count: int = 0
    probabilities: int = 0  # of a segmentation: the scores of a pixel

    def words(self):
        return [self.points, self.values, self.point_score, self.logits, *self.roles, self.coefficients]


def wrong(name, e, expected):
    shapes = " ".join(str([int(n) for n in t.shape]) for t in e.outs[:4])
    raise ImportProblem(f"--decoder {name}: found outputs {shapes[:80]}, expected {expected}")


def asked_points(arguments, metadata):
    """(count, numbers of each) by --points or the metadata; None: neither says it."""
    text = arguments.points
    if text is None:
        shape = metadata.get("kpt_shape")
        text = ",".join(str(n) for n in shape) if isinstance(shape, (list, tuple)) else None
    if text is None:
        return None
    parts = text.split(",")
    if len(parts) != 2 or not all(p.strip().isdecimal() for p in parts) or \
            not (1 <= int(parts[0]) <= POINTS_MAX and 2 <= int(parts[1]) <= VALUES_MAX):
        raise ImportProblem(f"--points: found {text[:40]!r}, expected COUNT,VALUES: up to {POINTS_MAX} keypoints of 2 to {VALUES_MAX} numbers")
    return int(parts[0]), int(parts[1])


def rows_of(e, output=0):
    """Of a head with columns: which rows are fractions, and the number of classes after the box that this says (0: it does not)."""
    known = e.mask(e.graph.outputs[output])
    rows = known[0].all(1) if known.ndim == 3 else np.zeros(0, bool)
    classes = 0
    while 4 + classes < len(rows) and rows[4 + classes]:
        classes += 1
    return rows, classes


def points_of(e, arguments):
    """(count, numbers of each) of a pose's keypoints: by --points, the metadata, or rows of x, y and a score from LOGISTIC; None: unknown."""
    rows, classes = rows_of(e)
    rest, asked = rows[4 + classes:], asked_points(arguments, e.metadata)
    if asked is None and len(rest) and len(rest) % 3 == 0 and (rest.reshape(-1, 3) == [False, False, True]).all():
        asked = len(rest) // 3, 3
    return asked


def pose(e, arguments):
    if len(e.shape) != 3 or len(e.outs) != 1:
        wrong("yolov8_pose", e, "one of [1, 4 + classes + keypoints, boxes]")
    rows, classes = rows_of(e)
    asked = points_of(e, arguments)
    if asked is None and 4 + classes == len(rows):
        raise ImportProblem("--decoder yolov8_pose: found scores from LOGISTIC in all rows after the box, expected keypoints: another decoder, or none")
    if asked is None:
        raise ImportProblem(f"--decoder yolov8_pose: found {len(rows) - 4 - classes} numbers after the classes, expected --points COUNT,VALUES")
    count, values = asked
    classes = len(rows) - 4 - count * values
    if classes < 1:
        wrong("yolov8_pose", e, f"4 numbers, classes and {count} keypoints of {values} for each box")
    places = rows[4 + classes:].reshape(count, values)[:, :2]
    if places.any():
        raise ImportProblem(f"--decoder yolov8_pose: found scores from LOGISTIC in {int(places.sum())} of {2 * count} rows of x and y of "
                            f"{count} keypoints, expected coordinates: another decoder, or none")
    return Details(classes, count, values, 2 if values == 3 else 0)


def pose_fault(e, arguments):
    """Why a tensor cannot be that of a YOLOv8 pose; None: it can."""
    rows, classes = rows_of(e)
    rest, asked = rows[4 + classes:], asked_points(arguments, e.metadata)
    if rows[:4].any() or not classes:
        return "has coordinates in rows 0 to 3, then scores from LOGISTIC"
    if len(rest) == 0 or asked and asked[0] * asked[1] != len(rest):
        return f"has {asked[0] * asked[1] if asked else 'some'} numbers after the classes, found {len(rest)}"
    if len(rest) % 3 == 0 and (rest.reshape(-1, 3) == [False, False, True]).all():
        return None
    return None if asked and asked[1] == 2 and not rest.any() else "has x, y and a score from LOGISTIC for each keypoint"


def prototypes(e):
    """Indices of the outputs of boxes and prototypes; None: no such outputs."""
    if len(e.outs) != 2 or sorted(len(t.shape) for t in e.outs) != [3, 4]:
        return None
    boxes = int(len(e.outs[0].shape) == 4)
    return boxes, 1 - boxes


def seg(e, arguments):
    pair = prototypes(e)
    if pair is None:
        wrong("yolov8_seg", e, "[1, 4 + classes + coefficients, n] and prototypes [1, h, w, coefficients]")
    coefficients = int(e.outs[pair[1]].shape[3])
    classes = int(e.outs[pair[0]].shape[1]) - 4 - coefficients
    if classes < 1 or coefficients > COEFFICIENTS_MAX:
        wrong("yolov8_seg", e, f"4 numbers, classes and {coefficients} coefficients for each box")
    return Details(classes, roles=(pair[0] + 1, 0, pair[1] + 1), coefficients=coefficients)


def seg_fault(e, arguments):
    """Why two outputs cannot be those of a YOLOv8 segmentation; None: they can."""
    boxes, other = prototypes(e)
    rows, classes = rows_of(e, boxes)
    coefficients = e.outs[other].shape[3]
    if e.outs[boxes].shape[2] not in e.cells():
        return f"has a box for each cell of its grids, found {e.outs[boxes].shape[2]}"
    if rows[:4].any() or not classes or len(rows) != 4 + classes + coefficients or rows[4 + classes:].any():
        return f"has scores from LOGISTIC in all rows between 4 and {coefficients} coefficients"
    return None


def obb(e, arguments):
    if len(e.shape) != 3 or len(e.outs) != 1 or e.shape[1] < 6:
        wrong("yolov8_obb", e, "one of [1, 4 + classes + 1, boxes]")
    if rows_of(e)[0][-1:].any():
        raise ImportProblem("--decoder yolov8_obb: found scores from LOGISTIC in the last row, expected the angle of each box: another decoder, or none")
    return Details(int(e.shape[1]) - 5)


def obb_fault(e, arguments):
    """Why a tensor cannot be that of YOLOv8's oriented boxes; None: it can."""
    rows, classes = rows_of(e)
    if rows[:4].any() or not classes or len(rows) != 5 + classes or rows[-1]:
        return "has scores from LOGISTIC in all rows between 4 and the last, the angle"
    return None


def yolox_cells(e):
    """Numbers of cells of the grids of 8, 16, 32, and of 64 pixels too."""
    _, h, w, _ = e.image
    cells = [(h // s) * (w // s) for s in (8, 16, 32, 64)]
    return sum(cells[:3]), sum(cells)


def yolox(e, arguments):
    if len(e.shape) != 3 or len(e.outs) != 1 or len(e.image) != 4 or e.shape[1] not in yolox_cells(e) or e.shape[2] < 6:
        wrong("yolox", e, "one of [1, cells of 8, 16 and 32 pixels, 5 + classes]")
    return Details(int(e.shape[2]) - 5, normalised=0)


def yolov3(e, arguments):
    text = (arguments.anchors or "").replace(",", " ").split()
    try:
        pairs = np.array(text, np.float32).reshape(-1, 2)
    except ValueError as problem:
        raise ImportProblem(f"--anchors: {problem}, expected pairs of numbers") from problem
    outs, count = e.outs, len(pairs) // max(len(e.outs), 1)
    shapes = [t.shape for t in outs]
    if any(len(s) != 4 or s[0] != 1 or s[3] != shapes[0][3] for s in shapes):
        wrong("yolov3", e, "several of [1, h, w, anchors (5 + classes)]")
    if count == 0 or count * len(outs) != len(pairs) or count > 8 or shapes[0][3] % count or shapes[0][3] // count < 6 or \
            not np.isfinite(pairs).all() or pairs.min() <= 0:
        raise ImportProblem(f"--decoder yolov3: found {len(pairs)} pairs of --anchors, expected as many for each of {len(outs)} outputs: widths "
                            "and heights in pixels of the input, as Darknet lists them, the smallest first")
    finest = sorted(range(len(outs)), key=lambda i: -shapes[i][1] * shapes[i][2])  # small anchors belong to many cells
    by_output = np.empty((len(outs), count, 2), np.float32)
    for place, output in enumerate(finest):
        by_output[output] = pairs[place * count:(place + 1) * count]
    return Details(int(shapes[0][3]) // count - 5, anchors=by_output, normalised=0, anchor_count=count)


def end2end(e, arguments):
    columns, asked = e.shape[-1] if len(e.shape) == 3 else 0, asked_points(arguments, e.metadata)
    count, values = asked or (0, 0)
    if columns != 6 + count * values or len(e.outs) != 1:
        wrong("end2end", e, "one of [1, n, 6 and --points COUNT,VALUES]")
    return Details(max(len(e.labels), 1), count, values, 2 if values == 3 else 0)


def movenet(e, arguments):
    shape = e.shape
    single = shape[-1] == 3 and int(np.prod(shape)) == 3 * shape[-2] if len(shape) > 1 else False
    count = shape[-2] if single else (shape[-1] - 5) // 3 if len(shape) == 3 and (shape[-1] - 5) % 3 == 0 else 0
    if len(e.outs) != 1 or not 1 <= count <= POINTS_MAX:
        wrong("movenet", e, "one of [1, 1, keypoints, 3] or [1, n, 3 keypoints + 5]")
    return Details(1, int(count), 3, 2, normalised=1)


def grid(side, levels):
    """[n][4]: centre y and x in fractions of the side, height and width 1."""
    centres = []
    for stride, boxes in levels:
        cells = -(-side // stride)
        y, x = np.mgrid[0:cells, 0:cells]
        centres.append(np.repeat(np.stack([(y.ravel() + 0.5) / cells, (x.ravel() + 0.5) / cells], 1), boxes, 0))
    found = np.concatenate(centres)
    return np.concatenate([found, np.ones_like(found)], 1).astype(np.float32)


def blaze_pair(e):
    """Indices of the outputs of boxes and scores, and what BLAZE is asked; None: no such outputs."""
    if len(e.outs) != 2 or len(e.image) != 4 or e.image[1] != e.image[2]:
        return None
    shapes = [tuple(t.shape) for t in e.outs]
    boxes = int(shapes[0][-1] == 1)
    if len(shapes[boxes]) != 3 or shapes[1 - boxes] != (*shapes[boxes][:2], 1) or shapes[boxes][2] % 2 or shapes[boxes][2] <= 4:
        return None
    return boxes, (int(e.image[1]), int(shapes[boxes][1]), (int(shapes[boxes][2]) - 4) // 2)


def blaze(e, arguments):
    pair = blaze_pair(e)
    if pair is None or pair[1] not in BLAZE:
        wrong("blaze", e, "[1, n, 4 + 2 keypoints] and [1, n, 1] of a face, palm or pose detector of MediaPipe")
    boxes, key = pair
    logits = 0 if e.mask(e.graph.outputs[1 - boxes]).all() else LOGITS_SCORES
    return Details(1, key[2], 2, 0, logits, (boxes + 1, 2 - boxes, 0), anchors=grid(key[0], BLAZE[key]), normalised=0)


def landmark_outputs(e, count):
    """Outputs of so many numbers, that of the largest range first, and those of one number."""
    sizes = [int(np.prod(t.shape)) for t in e.outs]

    def width(i):
        low, high = e.range_of(e.outs[i])
        return high - low
    return sorted((i for i, n in enumerate(sizes) if n == count), key=lambda i: -width(i)), [i for i, n in enumerate(sizes) if n == 1]


def landmark_form(e):
    """(keypoints, numbers of each) of a known network; None: it is none."""
    side = int(e.image[1]) if len(e.image) == 4 and e.image[1] == e.image[2] else 0
    for (known, count), form in LANDMARKS.items():
        if known == side and any(int(np.prod(t.shape)) == count for t in e.outs):
            return form
    return None


def landmarks(e, arguments):
    form = asked_points(arguments, {}) or landmark_form(e)
    if form is None:
        raise ImportProblem("--decoder landmarks: no network that is known here, expected --points COUNT,VALUES")
    outputs, ones = landmark_outputs(e, form[0] * form[1])
    if not outputs:
        wrong("landmarks", e, f"one of {form[0] * form[1]} numbers")
    logits = 0
    if ones and not e.mask(e.graph.outputs[ones[0]]).all():
        logits = LOGITS_SCORES
    if form[1] == 5:
        logits |= LOGITS_POINTS
    if not ones and len(e.outs) > 1:
        wrong("landmarks", e, "an output of one number, the score, beside them")
    roles = (outputs[0] + 1, ones[0] + 1 if ones else 0, 0)
    low, high = e.range_of(e.outs[outputs[0]])
    return Details(1, form[0], form[1], 3 if form[1] == 5 else 0, logits, roles, normalised=int(np.isfinite(high) and high - low < 8))


DETAILS = {"yolov8_pose": pose, "yolov8_seg": seg, "segment": lambda e, arguments: segment.details(e, Details), "yolov8_obb": obb, "yolox": yolox, "yolov3": yolov3,
            "end2end": end2end, "movenet": movenet, "blaze": blaze, "landmarks": landmarks}


def of(kind, e, arguments):
    """Details of a decoder that has any, else None."""
    return DETAILS[kind](e, arguments) if kind in DETAILS else None
