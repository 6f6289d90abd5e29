"""Which decoder reads a network's outputs. One is chosen only when the shapes of outputs and input, what makes the scores (fraction.py), the
metadata (task, names), the labels and the ranges of quantisation agree; trial.py then tries it on pictures. Otherwise the import
stops with one line that names the candidates."""
import numpy as np

import details
import forms
import fraction
import segment
from graph import ImportProblem, REFUSAL_MAX, origin

LABELS_MAX = 4096  # what the loader takes
BOXES_MOST = 2.0  # of boxes in shares of the picture, which may reach beyond it
BOXES_LEAST = 0.75  # of the same: where the last cells have their centres, and more
BACKGROUND = ("background", "???", "_background_", "none")
MOVED = ("QUANTIZE", "DEQUANTIZE", "CAST", "RESHAPE", "SQUEEZE", "EXPAND_DIMS")  # the same numbers
SEVERAL = ("ssd_raw", "yolov8_seg", "blaze", "landmarks", "yolov3")  # decoders of several outputs
STRIDES = ((8, 16, 32), (4, 8, 16, 32), (8, 16, 32, 64), (16, 32), (4, 8, 16))
TASKS = {"detect": ("yolov5", "yolov8", "yolox", "end2end"), "classify": ("classifier",), "segment": ("yolov8_seg",), "pose": ("yolov8_pose", "end2end", "movenet"),
         "obb": ("yolov8_obb",)}  # of Ultralytics' exports


def cells_of(h, w):
    """Numbers of cells that the grids of a YOLO network of this input may have together."""
    return {sum(-(-h // s) * -(-w // s) for s in strides) for strides in STRIDES}


class Evidence:
    """What is known of a network before its decoder is."""

    def __init__(self, graph, labels, metadata, arguments):
        self.graph, self.labels, self.metadata, self.arguments = graph, labels, metadata, arguments
        self.anchors = arguments.anchors
        self.mask = fraction.of(graph)
        self.outs = [graph.tensors[t] for t in graph.outputs]
        self.inputs = [t for t in graph.inputs if graph.tensors[t].data is None]
        self.shape = tuple(self.outs[0].shape)
        self.image = graph.tensors[self.inputs[0]].shape if self.inputs else ()

    def range_of(self, tensor):
        tensor = self.graph.tensors[origin(self.graph, tensor.index)[0]]
        if not tensor.is8:
            return -np.inf, np.inf
        return tuple(float(tensor.scale0) * (v - tensor.zero_u8) for v in (0, 255))

    def cells(self):
        return cells_of(*self.image[1:3]) if len(self.image) == 4 else set()


def yolo(e, rows, n, per_cell, name):
    """Why a tensor of `rows` numbers for each of n boxes cannot be that of this head; None: it can."""
    first = 5 if name == "yolov5" else 4
    known = e.mask(e.graph.outputs[0])[0]
    known = known if name == "yolov8" else known.T
    scores = rows - 4
    if len(e.outs) != 1:
        return f"has one output, found {len(e.outs)}"
    if n not in {per_cell * c for c in e.cells()}:
        return f"has {per_cell} box{'es' if per_cell > 1 else ''} for each cell of its grids, found {n} boxes"
    if not known[4:].all():
        return f"has {scores} rows of scores from LOGISTIC, found {int(known[4:].all(1).sum())}"
    if known[:4].all(1).any():
        return "has coordinates of boxes in rows 0 to 3, found scores from LOGISTIC"
    most = e.range_of(e.outs[0])[1]
    if (name == "yolov8" or per_cell > 1) and BOXES_MOST < most < np.inf:  # YOLOX has boxes in cells
        return f"has boxes as shares of the picture, found numbers to {most:.3g}, whose steps lose the scores"
    return short(e, e.outs[0], name) or labelled(e, rows - first)


def short(e, tensor, name):
    """Boxes of all cells reach over the whole picture, whatever is on it: a range that ends before has lost those beyond."""
    most = e.range_of(tensor)[1]
    return f"has boxes over the whole picture, found numbers to {most:.3g}" if name != "yolox" and most < BOXES_LEAST else None


def labelled(e, classes):
    """Labels there are must be as many as the classes, or one more, of which the first is the background."""
    extra = int(bool(e.labels) and e.labels[0].lower() in BACKGROUND)
    if e.labels and not classes <= len(e.labels) <= classes + extra:
        return f"would tell {classes} classes apart, found {len(e.labels)} labels"
    return None


def classifier(e):
    found = int(np.prod(e.shape))
    low, high = e.range_of(e.outs[0])
    if len(e.outs) != 1:
        return f"has one output, found {len(e.outs)}"
    if found != e.shape[-1]:
        return f"has one row of scores, found {found // max(1, e.shape[-1])}"
    if found > LABELS_MAX:
        return f"has at most {LABELS_MAX} classes, found {found}"
    if not e.mask(e.graph.outputs[0]).all():
        return f"ends in SOFTMAX or LOGISTIC, found numbers from {low:.3g} to {high:.3g}" if np.isfinite(high) else \
            "ends in SOFTMAX or LOGISTIC"
    if not e.labels and e.metadata.get("task") != "classify" and origin(e.graph, e.graph.outputs[0])[1].name != "SOFTMAX":
        return "ends in SOFTMAX, or has labels: numbers from LOGISTIC may stand for anything"
    return labelled(e, found) if len(e.labels) != found - 1 else None


def fomo(e):
    _, h, w, classes = e.shape
    if len(e.outs) != 1:
        return f"has one output, found {len(e.outs)}"
    if origin(e.graph, e.graph.outputs[0])[1].name != "SOFTMAX":
        return "ends in SOFTMAX"
    side = 4 if e.labels else 8  # networks that label pixels have cells of 4 x 4, too
    if len(e.image) != 4 or classes < 2 or e.image[1] < side * h or e.image[2] < side * w:
        return f"has cells of {side} x {side} pixels and more, found {h} x {w} of them"
    if len(e.labels) == classes and e.labels[0].lower() not in BACKGROUND:
        return f"has a background before its {classes - 1} classes, found the label {e.labels[0][:20]!r}"
    return labelled(e, classes - 1)


def ssd_raw(e):
    tensors = sorted(e.graph.outputs, key=lambda t: e.graph.tensors[t].shape[-1:] != (4,))
    if not e.mask(tensors[1]).all():
        low, high = e.range_of(e.graph.tensors[tensors[1]])
        if low < -0.05 or high > 1.05:
            return f"has scores from 0 to 1, found {low:.3g} to {high:.3g}"
    return None


def end2end(e):
    """Rows of corners, score and class: the metadata must say so, since classes are no fractions and other rows look alike."""
    if e.metadata.get("end2end") not in (True, "True", "true"):
        return "needs metadata that say end2end"
    points = details.asked_points(e.arguments, e.metadata) or (0, 0)
    if e.shape[2] != 6 + points[0] * points[1]:
        return f"has {6 + points[0] * points[1]} numbers in a row, found {e.shape[2]}"
    return None


def movenet(e):
    """The third number of each keypoint is a score, those before it are not: where all are from LOGISTIC they may be anything from 0 to 1,
    but for metadata of a pose. Of several people there are a box and a score besides."""
    mask = e.mask(e.graph.outputs[0])
    several = forms.several_people(e)
    if not several and (e.shape[-2] != 17 or len(e.outs) != 1):
        return f"has 17 keypoints in one output, found {e.shape[-2]}"
    low, high = e.range_of(e.outs[0])
    if np.isfinite(high) and (low < -0.5 or high > 1.5):
        return f"has fractions of the picture, found numbers from {low:.3g} to {high:.3g}"
    points = (mask[..., :51] if several else mask).reshape(-1, 3)
    if not points[:, 2].all() or several and not mask[..., 55].all():
        return "has scores from LOGISTIC in every third number"
    told = e.metadata.get("task") == "pose" and list(e.metadata.get("kpt_shape", ())) == [17, 3]
    return "has coordinates in two of three numbers, found all from LOGISTIC" if points[:, :2].any() and not told else None


def blaze(e):
    key = details.blaze_pair(e)[1]
    if key not in details.BLAZE:
        return f"is not known with {key[1]} boxes of {key[2]} keypoints for {key[0]} pixels"
    low, high = e.range_of(e.outs[0])
    return f"has boxes in pixels, found numbers from {low:.3g} to {high:.3g}" if np.isfinite(high) and high - low < 8 else None


def landmarks(e):
    form = details.landmark_form(e)
    if form is None:
        return "is not known with this input"
    outputs, ones = details.landmark_outputs(e, form[0] * form[1])
    if not ones or len(e.outs) > 5:
        return f"has an output of one number, the score, found {len(ones)}"
    points = e.outs[outputs[0]]
    low, high = e.range_of(points)
    if e.mask(e.graph.outputs[outputs[0]]).all() or np.isfinite(high) and high - low < e.image[1] / 4:
        return f"has keypoints in pixels, found numbers from {low:.3g} to {high:.3g}"
    return None


def several(e):
    """Candidates of networks of several outputs."""
    if details.blaze_pair(e):
        return {"blaze": blaze(e)}
    if details.prototypes(e):
        boxes = details.prototypes(e)[0]
        return {"yolov8_seg": details.seg_fault(e, e.arguments) or short(e, e.outs[boxes], "yolov8_seg") or labelled(e, details.rows_of(e, boxes)[1])}
    if len(e.image) == 4 and len(e.outs) <= 5 and any(int(np.prod(t.shape)) >= 20 for t in e.outs) and \
            details.landmark_outputs(e, 0)[1]:
        return {"landmarks": landmarks(e)}
    return {}


def candidates(e):
    """Decoders by name that the shapes allow, with why each cannot be or None."""
    shape, found = e.shape, {}
    if any(op.name == "TFLite_Detection_PostProcess" for op in e.graph.ops):
        return {"ssd": None}
    op = origin(e.graph, e.graph.outputs[0], MOVED[:4])[1]
    if op is not None and op.name == "ARG_MAX" and len(shape) >= 3 and len(e.outs) == 1:
        return {"segment": segment.labels_fault(e)}
    if len(e.outs) == 2 and e.anchors and any(t.shape[-1:] == (4,) for t in e.outs):
        return {"ssd_raw": ssd_raw(e)}
    if len(e.outs) > 1 and several(e):
        return several(e)
    for name, fault in (("ssd_raw", ssd_raw), ("yolov3", lambda e: None)):
        if forms.FORMS[name][2](e):
            return {name: fault(e) or "needs its anchors"}
    if len(shape) == 2 or len(shape) == 4 and shape[:3] == (1, 1, 1):
        found["classifier"] = classifier(e)
    elif len(shape) == 4 and shape[:2] == (1, 1) and shape[3] == 3 or forms.several_people(e):
        found["movenet"] = movenet(e)
    elif len(shape) == 3 and shape[1] < shape[2] and shape[1] > 4:
        found["yolov8"] = yolo(e, shape[1], shape[2], 1, "yolov8")
        if found["yolov8"] and shape[2] in e.cells() and len(e.outs) == 1:
            found["yolov8_obb"] = details.obb_fault(e, e.arguments) or short(e, e.outs[0], "yolov8_obb") or labelled(e, shape[1] - 5)
            found["yolov8_pose"] = details.pose_fault(e, e.arguments) or short(e, e.outs[0], "yolov8_pose") or labelled(e, details.rows_of(e)[1])
    elif len(shape) == 3 and shape[2] >= 6 and shape[1] in (100, 300):
        found["end2end"] = end2end(e)
    elif len(shape) == 3 and shape[2] > 5:
        found["yolov5"] = yolo(e, shape[2], shape[1], 3, "yolov5")
        if len(e.image) == 4 and shape[1] in details.yolox_cells(e):
            found = {"yolox": yolo(e, shape[2], shape[1], 1, "yolov5")}
    elif len(shape) == 4 and e.anchors:
        found["yolov2"] = forms.yolov2_fault(e)
    elif len(shape) == 4 and op is not None and op.name == "SOFTMAX":
        coarse = len(e.image) == 4 and e.image[1] >= 4 * shape[1] and e.image[2] >= 4 * shape[2]
        found = {"fomo": fomo(e), "segment": segment.fault(e)} if coarse else {"segment": segment.fault(e)}
    elif len(shape) == 4:
        found["segment"] = segment.fault(e)
    return found


def shape_text(e, most=3):
    texts = [f"{t.type.lower()}[{', '.join(str(n) for n in t.shape)}]" for t in e.outs[:most]]
    return " ".join(texts) + (f" and {len(e.outs) - most} more" if len(e.outs) > most else "")


def refusal(e, reason, names):
    """The line that names what could read the outputs, in REFUSAL_MAX characters: what matters least goes first."""
    raw, unsure = "--decoder none for the raw outputs", ", which no decoder is certain to read"
    for outputs, why, none, count in ((3, reason, raw, 3), (1, reason, raw, 3), (1, reason, raw, 2), (1, reason, raw, 1), (1, reason, raw[:14], 1),
                                      (1, unsure, raw, 1), (1, "", raw, 1)):
        ways = " or ".join(forms.option(e, name) for name in names[:count])
        text = f"found outputs {shape_text(e, outputs)}{why}: expected {none}" + (f", or {ways} if it is that" if ways else "")
        if len(text) <= REFUSAL_MAX:
            break
    return text


def one_input(e):
    if len(e.inputs) > 1:
        name = e.graph.tensors[e.inputs[1]].name[:40]
        raise ImportProblem(f"found {len(e.inputs)} inputs; the loop sets the first, a picture, and nothing would set {name!r}: expected "
                            "--state IN=OUT of a state, or --decoder none and a file for every input")


def choose(e):
    """The name of the decoder. Raises ImportProblem when nothing is certain."""
    raw = "expected --decoder none for the raw outputs"
    one_input(e)
    task, found = e.metadata.get("task"), candidates(e)
    fitting = [name for name, fault in found.items() if fault is None]
    if task in TASKS and found and not (set(fitting) or set(found)) <= set(TASKS[task]):
        fitting, found = [], {}
    if task in TASKS and not fitting and not found:
        raise ImportProblem(f"its metadata say task {task}, which no decoder here reads from {shape_text(e)}: {raw}")
    if len(fitting) == 1:
        return fitting[0]
    if len(fitting) > 1:
        raise ImportProblem(f"found outputs {shape_text(e)}, which {' and '.join(fitting)} both read: expected "
                            f"{' or '.join(forms.option(e, name) for name in fitting)}, or --decoder none for the raw outputs")
    possible = forms.proposed(e, lambda name: True)
    first = next((name for name in found if name in possible or name == "yolov2"), None)
    names = sorted(forms.proposed(e, lambda name: is_held(e, name) and (first != "yolov2" or name == first)), key=lambda name: (name != first, name not in found))
    if first is None and not names and len(e.outs) == 1:  # the best that can be said
        first = next(iter(found), None)
        names = [first] if first is not None and is_held(e, first) else []
    if first is not None:
        raise ImportProblem(refusal(e, f"; {first} {found[first]}", names))
    lacking = ", which no decoder is certain to read" if names else f", which no decoder reads{' together' if len(e.outs) > 1 else ''}"
    raise ImportProblem(refusal(e, lacking, names) + (", or --outputs NAME to keep one" if len(e.outs) > 1 and not names else ""))


def hold(e, name):
    """A decoder that the user names is believed, but for what it can only misread: outputs of other axes, scores from another range, numbers of
    another kind, inputs that nobody sets."""
    if name != "none":
        one_input(e)
    if name == "ssd" and not any(op.name == "TFLite_Detection_PostProcess" for op in e.graph.ops):
        raise ImportProblem("--decoder ssd: found no operator TFLite_Detection_PostProcess, expected it, or --decoder ssd_raw with --anchors")
    if not forms.fits(e, name):
        raise ImportProblem(f"--decoder {name}: found outputs {shape_text(e, 2)}, expected {forms.FORMS[name][0]}, or none")
    hold_scores(e, name)
    other = {"yolov5": "yolov8", "yolov8": "yolov5"}.get(name)
    if other and candidates(e).get(other, "no") is None:
        raise ImportProblem(f"--decoder {name}: found outputs {shape_text(e, 2)}, which {other} reads: expected --decoder {other}, or none")
    hold_heads(e, name)
    if name not in ("classifier", "fomo", "ssd_raw"):
        return
    tensors = sorted(e.graph.outputs, key=lambda t: e.graph.tensors[t].shape[-1:] != (4,))
    t = tensors[1] if name == "ssd_raw" and len(tensors) == 2 else e.graph.outputs[0]
    low, high = e.range_of(e.graph.tensors[t])
    if not e.mask(t).all() and np.isfinite(high) and (low < -0.05 or high > 1.05):
        raise ImportProblem(f"--decoder {name}: found numbers from {low:.3g} to {high:.3g}, expected scores from 0 to 1 (an export with its "
                            "SOFTMAX or LOGISTIC), or none")


def hold_scores(e, name):
    """Classes' numbers, as ARG_MAX makes them, are no scores."""
    if name in ("none", "segment", "ssd", "embedding"):
        return
    for t in e.graph.outputs if name in SEVERAL else e.graph.outputs[:1]:
        tensor = e.graph.tensors[origin(e.graph, t, MOVED)[0]]
        if not tensor.is8 and tensor.type != "FLOAT32":
            raise ImportProblem(f"--decoder {name}: found {tensor.type.lower()} numbers in outputs {shape_text(e, 2)}, expected scores of 8 bits, or none")


def hold_heads(e, name):
    """Boxes reach over the picture; numbers are no scores before the decoder makes them; and of heads whose classes lie between other numbers,
    labels say where they end."""
    if name == "yolov2" and forms.yolov2_fault(e):
        raise ImportProblem(f"--decoder yolov2: it {forms.yolov2_fault(e)}: expected another decoder, or none")
    if name not in ("yolov5", "yolov8", "yolov8_pose", "yolov8_obb", "yolov8_seg"):
        return
    pair = details.prototypes(e) if name == "yolov8_seg" else None
    fault = short(e, e.outs[pair[0] if pair else 0], name)
    if fault is None and name.startswith("yolov8_"):
        fault = labelled(e, details.of(name, e, e.arguments).classes)
    if fault:
        raise ImportProblem(f"--decoder {name}: it {fault}: expected another decoder, or none")


def is_held(e, name):
    """Whether hold() and the decoder's details believe the user: an option that would be refused is not proposed, but for what another
    option says."""
    try:
        hold(e, name)
        details.of(name, e, e.arguments)
    except ImportProblem as problem:
        return "--points" in str(problem) or "--anchors" in str(problem)
    return True


def metadata_of(text):
    """The dictionary that a text holds, in Python's form or as JSON; {} where it holds none."""
    import ast
    import json
    for read in (json.loads, ast.literal_eval):
        try:
            found = read(text)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            continue
        if isinstance(found, dict):
            return found
    return {}
