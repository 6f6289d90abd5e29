"""How a model is used: preprocessing, labels and decoder, from the model (choose.py) and from options."""
import argparse
import os
import struct

import numpy as np

import choose
import details
import ranges
import segment
from choose import LABELS_MAX
from graph import ImportProblem, origin

DECODERS = ["none", "classifier", "ssd", "ssd_raw", "yolov5", "yolov8", "yolov2", "fomo", "segment", "embedding", "yolov8_pose", "yolov8_seg",
            "yolov8_obb", "end2end", "movenet", "blaze", "landmarks", "yolox", "yolov3"]
SIDE_MAX = 8192
READERS = {"points": ("yolov8_pose", "end2end", "landmarks"), "anchors": ("ssd_raw", "yolov2", "yolov3"), "box_scales": ("ssd_raw",),
           "colours": ("segment",)}  # options, and the decoders that read them
ORDERS = {"rgb": 0, "bgr": 1, "grey": 2}


def add_arguments(parser):
    parser.add_argument("--labels", help="text file, one label per line (`index name` lines are understood); with --quantise also a folder of "
                        "label files (YOLO's, classes.txt), for average precision")
    parser.add_argument("--colours", metavar="FILE", help="colours of the classes of a segmentation, one a line in their order: #rrggbb or red green blue; "
                        "default: PASCAL VOC's palette")
    parser.add_argument("--decoder", choices=DECODERS, metavar="NAME", help="default: the one that outputs, scores and metadata agree on; none: raw outputs "
                        f"only; others: {', '.join(DECODERS[1:])}")
    parser.add_argument("--outputs", action="append", default=[], metavar="NAME",
                        help="end the network in this tensor, and leave out what only others need; may be given several times")
    parser.add_argument("--state", action="append", default=[], metavar="IN=OUT",
                        help="input IN is the tensor OUT of the run before, at first the real zero; for each state one")
    parser.add_argument("--names", action="store_true", help="print the inputs and each operator's outputs by name, for --outputs and --state, and write nothing")
    parser.add_argument("--fit", choices=["stretch", "letterbox"], help="default: letterbox for YOLO, else stretch")
    parser.add_argument("--order", choices=list(ORDERS), help="colour order of the input, default rgb (bgr for YOLOX, grey for 1 channel)")
    parser.add_argument("--mean", type=float, help="subtracted from pixels (0..255); default from the quantisation")
    parser.add_argument("--scale", type=float, help="multiplies (pixel - mean); default from the quantisation")
    parser.add_argument("--score", type=float, help="score threshold, default 0.25, of classifiers 0")
    parser.add_argument("--most", type=int, help="detections of one image at most, default 300, of classifiers 5: the best are kept")
    parser.add_argument("--points", metavar="COUNT,VALUES", help="keypoints of each object, and numbers of each: x, y, and in poses a score")
    parser.add_argument("--class-score", action="append", default=[], metavar="CLASS=SCORE",
                        help="threshold of one class, by label or number; may be given several times")
    parser.add_argument("--iou", type=float, default=0.5, help="overlap threshold of suppression, default 0.5")
    parser.add_argument("--agnostic", action="store_true", help="suppress across classes")
    parser.add_argument("--anchors", help="YOLOv2: width,height pairs in cells, comma separated; ssd_raw: text file of n rows of "
                        "centre y, centre x, height, width, or of four rows of n")
    parser.add_argument("--box-scales", help="ssd_raw: divisors of y, x, h, w, default 10,10,5,5")


def bits(value):
    return struct.unpack("<i", struct.pack("<f", value))[0]


def read_lines(path):
    """Those that are not empty."""
    try:
        with open(path, encoding="utf-8") as file:
            return [line.strip() for line in file if line.strip()]
    except UnicodeDecodeError as problem:
        found = f"byte {problem.start}: found {problem.object[problem.start]:#04x}"
        raise ImportProblem(f"{path}: {found}, expected text in UTF-8") from problem


def read_labels(path):
    lines = read_lines(path)
    if len(lines) > LABELS_MAX or any("\0" in line for line in lines):
        raise ImportProblem(f"{path}: found {len(lines)} labels, expected at most {LABELS_MAX} without zero bytes")
    return arrange(lines)


def labels_of(arguments, own):
    """Of the file that is named; of a folder its classes.txt, where the model brings no labels along."""
    if not os.path.isdir(arguments.labels):
        return read_labels(arguments.labels)
    if not arguments.quantise:
        raise ImportProblem(f"--labels {arguments.labels}: found a folder, expected a text file (a folder of label files goes with --quantise)")
    path = os.path.join(arguments.labels, "classes.txt")
    return own or (read_labels(path) if os.path.exists(path) else [])


def arrange(lines):
    """Lines `index name` or plain names in order."""
    numbered = [line.split(None, 1) for line in lines]
    if all(len(p) == 2 and p[0].rstrip(":").isdecimal() for p in numbered):
        table = {int(p[0].rstrip(":")): p[1] for p in numbered}
        if table and max(table) < LABELS_MAX:
            return [table.get(i, "") for i in range(max(table) + 1)]
    return lines


def archive(path):
    """Labels and metadata that a model brings along, in text files of a zip archive appended to it."""
    import zipfile
    try:
        with zipfile.ZipFile(path) as file:
            names = sorted((n for n in file.namelist() if n.endswith((".txt", ".json"))), key=lambda n: "label" not in n.lower())
            text = file.read(names[0]).decode("utf-8").strip() if names else ""
    except (zipfile.BadZipFile, OSError, UnicodeDecodeError, NotImplementedError, RuntimeError):
        return [], {}
    metadata = choose.metadata_of(text) if text.startswith("{") else {}
    labels = named_labels(metadata) if text.startswith("{") else [line.strip() for line in text.splitlines()]
    return [] if len(labels) > LABELS_MAX or any("\0" in label for label in labels) else labels, metadata


def named_labels(metadata):
    """From a dictionary that holds `names` by class or in their order."""
    names = metadata.get("names")
    try:
        table = dict(enumerate(names) if isinstance(names, list) else ((int(k), v) for k, v in names.items()))
    except (AttributeError, TypeError, ValueError):
        return []
    return [str(table.get(i, "")) for i in range(max(table) + 1)] if table and 0 <= max(table) < LABELS_MAX else []


def fit_of(kind):
    """How a decoder's network sees its pictures, where no option says it."""
    return "letterbox" if kind.startswith(("yolo", "end2end", "movenet", "blaze")) else "stretch"


def order_of(kind):
    """Of an input of three channels: YOLOX reads pictures as OpenCV does. None: as most do."""
    return "bgr" if kind == "yolox" else None


def chosen(evidence, arguments):
    """The decoder's name, and whether it was chosen here; --check compares outputs, whatever reads them."""
    if arguments.decoder:
        choose.hold(evidence, arguments.decoder)
        kind = arguments.decoder
    else:
        try:
            kind = choose.choose(evidence)
        except ImportProblem:
            if getattr(arguments, "check", []) is None:
                raise
            return "none", False
    for name, readers in READERS.items():
        if getattr(arguments, name) is not None and kind not in readers:
            raise ImportProblem(f"--{name.replace('_', '-')}: found with decoder {kind}, expected {' or '.join(readers)}")
    return kind, not arguments.decoder


def classes_of(kind, graph, pairs):
    """How many classes the outputs tell apart when read so."""
    shapes = [graph.tensors[t].shape for t in graph.outputs]
    first = (0, 0) + tuple(shapes[0])
    if kind == "ssd":
        made = [op for op in graph.ops if op.name == "TFLite_Detection_PostProcess"]
        return int(made[0].custom["num_classes"]) if made else 0
    if kind == "ssd_raw":
        return raw_outputs(graph)[1].shape[-1] - 1
    if kind == "yolov2":
        return first[-1] // pairs - 5 if pairs else 0
    return {"classifier": first[-1], "yolov5": first[-1] - 5, "yolov8": first[-2] - 4, "fomo": first[-1] - 1}.get(kind, 0)


def describe(path, graph, net, arguments):
    """Labels, preprocessing and decoder for the file; and what a trial of the decoder needs."""
    if arguments is None:
        arguments = argparse.ArgumentParser()
        add_arguments(arguments)
        arguments = arguments.parse_args([])
    labels, metadata = archive(path)
    labels = labels if arguments.labels is None else labels_of(arguments, labels)
    evidence = choose.Evidence(graph, labels, metadata, arguments)
    kind, is_chosen = chosen(evidence, arguments)
    known = details.of(kind, evidence, arguments)
    if kind == "segment" and known.classes:
        labels = labels[:known.classes]
    shape = graph.tensors[graph.inputs[0]].shape
    shape = shape if len(shape) == 4 and max(shape[1:3]) <= SIDE_MAX else (1, 0, 0, 0)
    fit = arguments.fit or fit_of(kind)
    order = arguments.order or ("grey" if shape[3] == 1 else order_of(kind) or "rgb")
    mean, scale = ranges.settled(graph, arguments, kind)
    for name, value in (("--mean", mean), ("--scale", scale)):
        if not abs(value) <= 1e6 or name == "--scale" and value == 0:
            raise ImportProblem(f"{name}: found {value}, expected a number up to 1e6" + (", and not 0" if value == 0 else ""))
    channels = shape[3] if shape[3] in (1, 3) else 0
    preprocess = [int(fit == "letterbox"), shape[2], shape[1], channels, ORDERS[order], *[bits(mean)] * 3,
                  *[bits(scale)] * 3, 114]
    trial = (kind, mean, scale, is_share(kind, graph, known), known, is_chosen)
    return (labels, preprocess, decoder_words(kind, graph, net, labels, arguments, known)), trial


def numbers(text, what, low=-1e6, high=1e6):
    try:
        found = [float(v) for v in text.replace(",", " ").split()]
    except ValueError as problem:
        raise ImportProblem(f"{what}: {problem}, expected numbers") from problem
    for value in found:
        if not low <= value <= high:
            raise ImportProblem(f"{what}: found {value:g}, expected numbers from {low:g} to {high:g}")
    return found


def yolo_anchors(text):
    found = numbers(text or "", "--anchors", 0)
    if len(found) % 2 or len(found) > 16:
        raise ImportProblem(f"--anchors: found {len(found)} numbers, expected up to 8 pairs")
    return found


def raw_outputs(graph):
    """Boxes and scores, which files list in either order: boxes have 4 numbers."""
    outs = sorted((graph.tensors[t] for t in graph.outputs[:2]), key=lambda t: t.shape[-1:] != (4,))
    shapes = [t.shape for t in outs]
    if len(outs) != 2 or () in shapes or shapes[0][-1] != 4 or outs[1].size != outs[0].size // 4 * shapes[1][-1]:
        raise ImportProblem(f"--decoder ssd_raw: found outputs {[list(s) for s in shapes]}, "
                            "expected boxes [n, 4] and scores [n, 1 + classes]")
    return outs


def ssd_anchors(path, graph):
    """[n][4] for as many boxes as the output holds."""
    boxes = raw_outputs(graph)[0].size // 4
    if path is None:
        raise ImportProblem("--decoder ssd_raw: the anchors are missing, expected --anchors FILE")
    lines = read_lines(path)
    found = np.array(numbers(" ".join(lines), path), np.float32)
    if found.size != 4 * boxes:
        raise ImportProblem(f"{path}: found {found.size} numbers, expected 4 for each of {boxes} boxes")
    return found.reshape(4, boxes).T if len(lines) == 4 and boxes != 4 else found.reshape(boxes, 4)


def share(text, what):
    found = numbers(str(text), what, 0, 1)
    if len(found) != 1:
        raise ImportProblem(f"{what}: found {text!r}, expected a number from 0 to 1")
    return found[0]


def class_thresholds(arguments, score, labels, first_label, classes):
    """A threshold for every class."""
    table = np.full(classes, score, np.float32)
    for entry in arguments.class_score:
        name, _, text = entry.rpartition("=")
        known = labels[first_label:first_label + classes]
        number = known.index(name) if name in known else int(name) if name.isdecimal() else -1
        if not 0 <= number < classes:
            raise ImportProblem(f"--class-score: found {entry!r}, expected CLASS=SCORE with a label or a number below {classes}")
        table[number] = share(text, f"--class-score {entry}")
    return table


def is_share(kind, graph, known):
    """Whether boxes are fractions of the input's size rather than pixels, by the range of the 8-bit output."""
    if known is not None and known.normalised is not None:
        return bool(known.normalised)
    t = graph.outputs[known.roles[0] - 1 if known is not None and known.roles[0] else 0]
    out = graph.tensors[origin(graph, t)[0]]
    return (kind in ("yolov5", "yolov8") or known is not None) and out.is8 and \
        float(out.scale0) * 256 < max(4.0, graph.tensors[graph.inputs[0]].shape[2] / 8)


def decoder_words(kind, graph, net, labels, arguments, known):
    """struct fv_model_decode; places of tables count from the data as those of operators do."""
    score = (0.0 if kind == "classifier" else 0.25) if arguments.score is None else share(arguments.score, "--score")
    most = (5 if kind == "classifier" else 300) if arguments.most is None else arguments.most
    if not 1 <= most <= 300:
        raise ImportProblem(f"--most: found {most}, expected 1 to 300")
    pairs = yolo_anchors(arguments.anchors) if kind == "yolov2" else []
    if kind == "yolov2" and not pairs:
        raise ImportProblem("--decoder yolov2: the anchors are missing, expected --anchors W,H,W,H...")
    classes = known.classes if known is not None else max(classes_of(kind, graph, len(pairs) // 2), 0)
    if classes > LABELS_MAX:
        raise ImportProblem(f"--decoder {kind}: found {classes} classes, expected at most {LABELS_MAX}")
    background = int(kind == "classifier" and classes == 1001)
    first_label = int(bool(labels) and len(labels) == classes - background + 1 and labels[0].lower() in ("background", "???"))
    table = net.blob(class_thresholds(arguments, score, labels, first_label, classes)) if arguments.class_score else 0
    boxes = net.blob(ssd_anchors(arguments.anchors, graph)) if kind == "ssd_raw" else 0
    scales = numbers("10,10,5,5" if arguments.box_scales is None else arguments.box_scales, "--box-scales", 1e-6) if boxes else [0] * 4
    if known is not None and known.anchors is not None:
        boxes = net.blob(known.anchors)
    colours = segment.colours(arguments.colours, read_lines(arguments.colours), classes) if arguments.colours is not None else np.zeros((0, 3), np.uint8)
    if len(scales) != 4:
        raise ImportProblem(f"--box-scales: found {len(scales)} numbers, expected four")
    return [DECODERS.index(kind), classes, bits(score), bits(share(arguments.iou, "--iou")),
            int(arguments.agnostic), most, int(is_share(kind, graph, known)), (known.anchor_count if known is not None else 0) or len(pairs) // 2, *[bits(v) for v in pairs],
            *[0] * (16 - len(pairs)), first_label, background, table, boxes, *[bits(v) for v in scales],
            *(known or details.Details()).words(), net.blob(colours) if len(colours) else 0, len(colours),
            known.probabilities if known is not None else 0]
