"""How a model is used: preprocessing, labels and decoder, guessed from its shape and set by options."""
import os
import struct

import numpy as np

DECODERS = ["none", "classifier", "ssd", "ssd_raw", "yolov5", "yolov8", "yolov2", "fomo", "segment"]
ORDERS = {"rgb": 0, "bgr": 1, "grey": 2}


def add_arguments(parser):
    parser.add_argument("--labels", help="text file, one label per line (`index name` lines are understood)")
    parser.add_argument("--decoder", choices=DECODERS, help="default: guessed from the outputs")
    parser.add_argument("--fit", choices=["stretch", "letterbox"], help="default: letterbox for YOLO, else stretch")
    parser.add_argument("--order", choices=list(ORDERS), help="colour order of the input, default rgb (grey for 1)")
    parser.add_argument("--mean", type=float, help="subtracted from pixels (0..255); default from the quantisation")
    parser.add_argument("--scale", type=float, help="multiplies (pixel - mean); default from the quantisation")
    parser.add_argument("--score", type=float, default=0.25, help="score threshold, default 0.25")
    parser.add_argument("--iou", type=float, default=0.5, help="overlap threshold of suppression, default 0.5")
    parser.add_argument("--agnostic", action="store_true", help="suppress across classes")
    parser.add_argument("--anchors", help="YOLOv2: width,height pairs in cells, comma separated")


def bits(value):
    return struct.unpack("<i", struct.pack("<f", value))[0]


def read_labels(path, graph):
    if path is None:
        return archived_labels(graph)
    with open(path, encoding="utf-8") as file:
        lines = [line.strip() for line in file if line.strip()]
    return arrange(lines)


def arrange(lines):
    """Lines `index name` or plain names in order."""
    numbered = [line.split(None, 1) for line in lines]
    if all(len(p) == 2 and p[0].rstrip(":").isdigit() for p in numbered):
        table = {int(p[0].rstrip(":")): p[1] for p in numbered}
        return [table.get(i, "") for i in range(max(table) + 1)]
    return lines


def archived_labels(graph):
    """Labels that model metadata brings along: a zip archive appended to the file holds text files."""
    return graph.metadata.get("fovea_labels", [])


def zipped_labels(path):
    import zipfile
    try:
        with zipfile.ZipFile(path) as archive:
            names = [n for n in archive.namelist() if n.endswith(".txt")]
            text = archive.read(names[0]).decode("utf-8") if names else ""
    except (zipfile.BadZipFile, OSError):
        return []
    if text.lstrip().startswith("{"):  # a dictionary that holds `names` by class
        import ast
        names = ast.literal_eval(text.strip()).get("names", {})
        return [str(names.get(i, "")) for i in range(max(names) + 1)] if names else []
    return [line.strip() for line in text.splitlines()]


def guess(graph):
    """Decoder and number of classes."""
    outs = [graph.tensors[t] for t in graph.outputs]
    if any(op.name == "TFLite_Detection_PostProcess" for op in graph.ops):
        op = next(op for op in graph.ops if op.name == "TFLite_Detection_PostProcess")
        return "ssd", int(op.custom["num_classes"])
    shape = outs[0].shape
    last = graph.ops[-1].name if graph.ops else ""
    if last == "ARG_MAX" and len(shape) >= 3:
        return "segment", 0
    if len(shape) == 2:
        return "classifier", shape[1]
    if len(shape) == 3 and shape[1] < shape[2] and shape[1] > 4:
        return "yolov8", shape[1] - 4
    if len(shape) == 3 and shape[2] > 5:
        return "yolov5", shape[2] - 5
    if len(shape) == 4 and last == "SOFTMAX":
        return "fomo", shape[3] - 1
    return "none", 0


def describe(path, graph, net, arguments):
    kind, classes = guess(graph)
    if arguments is not None and arguments.decoder:
        kind = arguments.decoder
    labels = read_labels(arguments.labels if arguments else None, graph) or zipped_labels(path)
    tensor = graph.tensors[graph.inputs[0]]
    shape = tensor.shape if len(tensor.shape) == 4 else (1, 0, 0, 0)
    fit = arguments.fit if arguments and arguments.fit else ("letterbox" if kind.startswith("yolo") else "stretch")
    order = arguments.order if arguments and arguments.order else ("grey" if shape[3] == 1 else "rgb")
    mean, scale = natural_range(tensor)
    if arguments is not None and arguments.mean is not None:
        mean = arguments.mean
    if arguments is not None and arguments.scale is not None:
        scale = arguments.scale
    channels = shape[3] if shape[3] in (1, 3) else 0
    preprocess = [int(fit == "letterbox"), shape[2], shape[1], channels, ORDERS[order], *[bits(mean)] * 3,
                  *[bits(scale)] * 3, 114]
    return labels, preprocess, decoder_words(kind, classes, graph, arguments)


def natural_range(tensor):
    """8-bit inputs: the mean and scale for which the quantised value is the pixel itself (images as bytes)."""
    if tensor.is8 and float(tensor.scale0) > 0:
        return float(tensor.zero_u8), float(tensor.scale0)
    return 127.5, 1 / 127.5


def decoder_words(kind, classes, graph, arguments):
    anchors = [float(v) for v in arguments.anchors.split(",")] if arguments and arguments.anchors else []
    words = [DECODERS.index(kind), classes, bits(arguments.score if arguments else 0.25),
             bits(arguments.iou if arguments else 0.5), int(bool(arguments and arguments.agnostic)), 300, 0,
             len(anchors) // 2, *[bits(v) for v in anchors], *[0] * (16 - len(anchors))]
    if kind in ("yolov5", "yolov8"):
        out = graph.tensors[graph.outputs[0]]
        width = graph.tensors[graph.inputs[0]].shape[2]
        words[6] = int(out.is8 and float(out.scale0) * 256 < max(4.0, width / 8))
    words += [0, int(kind == "classifier" and classes == 1001), 0]
    return words
