"""What tools/import writes about a model's use: decoder, classes, thresholds, anchors, labels and preprocessing, and how it refuses
what does not fit. Needs tflite, numpy and flatbuffers; no reference.

    python3 tests/import/uses.py"""
import contextlib
import importlib.util
import io
import os
import random
import resource
import struct
import sys
import tempfile
import zipfile
import zlib

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
IMPORT = os.path.join(HERE, "..", "..", "tools", "import")
sys.path[:0] = [HERE, IMPORT]

from builder import Builder  # noqa: E402

SPEC = importlib.util.spec_from_file_location("tool", os.path.join(IMPORT, "__main__.py"))
TOOL = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(TOOL)
ENGINE = TOOL.trial.engine
COSTS = sys.modules["costs"]
V8 = ("--decoder", "yolov8")
DECODERS = TOOL.use.DECODERS


def network(out_shapes, last=None, ends="int8", scale_in=1 / 255, scale_out=1 / 256, zero_in=-128, image=(1, 24, 32, 3)):
    """An image reshaped, tiled or cut into outputs; `ends` float32: quantised inside."""
    b, pixels = Builder(), int(np.prod(image))
    x = q = b.tensor("int8", image, scale_in, zero_in)
    if ends == "float32":
        x = b.tensor("float32", image)
        b.op("QUANTIZE", [x], [q], "Quantize")
    flat = b.tensor("int8", (1, pixels), scale_in, zero_in)
    b.op("RESHAPE", [q, b.const("int32", [1, pixels])], [flat], "Reshape", NewShape=[1, pixels])
    outs = []
    for shape in out_shapes:
        size = int(np.prod(shape))
        cut, out = b.tensor("int8", (1, size), scale_in, zero_in), b.tensor("int8", shape, scale_in, zero_in)
        b.op("STRIDED_SLICE", [flat] + [b.const("int32", v) for v in ([0, 0], [1, size], [1, 1])], [cut], "StridedSlice", BeginMask=0,
             EndMask=0, EllipsisMask=0, NewAxisMask=0, ShrinkAxisMask=0)
        b.op("RESHAPE", [cut, b.const("int32", shape)], [out], "Reshape", NewShape=list(shape))
        if last == "SOFTMAX":
            soft = b.tensor("int8", shape, scale_out, -128)
            b.op("SOFTMAX", [out], [soft], "Softmax", Beta=1.0)
            out = soft
        if last == "LOGISTIC":
            share = b.tensor("int8", shape, 1 / 256, -128)
            b.op("LOGISTIC", [out], [share])
            out = share
        if last == "ARG_MAX":
            index = b.tensor("int32", shape[:-1])
            b.op("ARG_MAX", [out, b.const("int32", -1)], [index], "ArgMax", OutputType=2)
            out = b.tensor("float32", shape[:-1])
            b.op("CAST", [index], [out], "Cast", InDataType=2, OutDataType=0)
        elif ends == "float32":
            real = b.tensor("float32", shape)
            b.op("DEQUANTIZE", [out], [real], "Dequantize")
            out = real
        outs.append(out)
    return b.bytes([x], outs)


class Written:
    """A .fvm file's header."""

    def __init__(self, raw):
        self.raw = raw
        words = struct.unpack_from("<22I", raw, 4)
        at, count = words[13], words[12]
        self.labels = raw[at:].split(b"\0")[:count]
        self.names = raw[words[20]:words[20] + words[21]].split(b"\0")[:-1]
        self.mean, self.scale = struct.unpack_from("<f", raw, 160 + 20)[0], struct.unpack_from("<f", raw, 160 + 32)[0]
        d = struct.unpack_from("<2i2f4i16f4i4f", raw, 224)
        self.decoder, self.classes, self.score, self.iou, _, _, self.normalised, self.pairs = DECODERS[d[0]], *d[1:8]
        self.first_label, self.background, thresholds, anchors = d[24:28]
        self.box_scales = d[28:32]
        self.thresholds = np.frombuffer(raw, "<f4", self.classes, thresholds) if thresholds else None
        self.anchors = np.frombuffer(raw, "<f4", 12, anchors) if anchors else None


class Bench:
    def __init__(self, folder):
        self.folder, self.wrong = folder, 0

    def file(self, name, text):
        path = os.path.join(self.folder, name)
        with open(path, "wb" if isinstance(text, bytes) else "w") as file:
            file.write(text)
        return path

    def run(self, model, *options, trial=True):
        path, out = self.file("m.tflite", model), os.path.join(self.folder, "m.fvm")
        sys.argv = ["import", path, "-o", out, *options]
        TOOL.trial.engine = ENGINE if trial else lambda data: None
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as text:
            try:
                status = TOOL.main()
            except Exception as problem:  # what a user would see as a traceback
                return 1, repr(problem)
        if status:
            return status, text.getvalue()
        with open(out, "rb") as file:
            return Written(file.read())

    def holds(self, what, found, expected):
        same = found is not None and np.shape(found) == np.shape(expected) and \
            (np.allclose(found, expected, rtol=1e-5) if not isinstance(expected, str) else found == expected)
        self.wrong += not same
        print(f"{'holds ' if same else 'WRONG '} {what}" + ("" if same else f": found {found}, expected {expected}"))

    def refused(self, what, model, text, *options):
        found = self.run(model, *options)
        status, line = (0, "") if isinstance(found, Written) else found
        same = line.count("\n") == 1 and text in line and status == 2
        self.wrong += not same
        print(f"{'holds ' if same else 'WRONG '} {what}: {line.strip() if same else repr(line[-300:])}")


def centres(n):
    """Of n cells of 8, 16 and 32 pixels on 64 x 64, in bytes; the boxes are as large as their cells."""
    per_cell, rows = n // 84, []
    for size in (8, 16, 32):
        rows += [(x + size / 2, y + size / 2, size, size) for y in range(0, 64, size) for x in range(0, 64, size) for _ in range(per_cell)]
    return np.clip(np.array(rows) * 4, 0, 255) - 128


def yolo(kind, classes, n, extra=0, sigmoid=True, boxes=centres, outputs=1, step=1 / 256):
    """A network of 64 x 64 with such a head: constant boxes, scores from the picture, `extra` rows that are neither; `step`: of its bytes."""
    b = Builder()
    x, by_rows = b.tensor("int8", (1, 64, 64, 3), 0.03, 127), kind == "yolov5"
    flat = b.tensor("int8", (1, 12288), 0.03, 127)
    b.op("RESHAPE", [x, b.const("int32", [1, 12288])], [flat], "Reshape", NewShape=[1, 12288])

    def rows(count):
        shape, size = (1, n, count) if by_rows else (1, count, n), count * n
        cut, out = b.tensor("int8", (1, size), 0.03, 127), b.tensor("int8", shape, 0.03, 127)
        b.op("STRIDED_SLICE", [flat] + [b.const("int32", v) for v in ([0, 0], [1, size], [1, 1])], [cut], "StridedSlice", BeginMask=0,
             EndMask=0, EllipsisMask=0, NewAxisMask=0, ShrinkAxisMask=0)
        b.op("RESHAPE", [cut, b.const("int32", shape)], [out], "Reshape", NewShape=list(shape))
        return out
    scores = classes + by_rows
    parts = [b.const("int8", boxes(n)[None] if by_rows else boxes(n).T[None], scale=1 / 256, zero=-128), rows(scores)]
    if sigmoid:
        made = b.tensor("int8", b.tensors[parts[1]][1], 1 / 256, -128)
        b.op("LOGISTIC", parts[1:], [made])
        parts[1] = made
    parts += [rows(extra)] if extra else []
    count = 4 + scores + extra
    out = b.tensor("int8", (1, n, count) if by_rows else (1, count, n), step, -128)
    b.op("CONCATENATION", parts, [out], "Concatenation", Axis=2 if by_rows else 1)
    return b.bytes([x], [out] + [parts[1]] * (outputs - 1))


def guesses(bench):
    """A decoder is chosen where everything agrees, and nothing is written where it does not."""
    for ends in ("int8", "float32"):
        for shapes, last, options, decoder, classes in (
                ([(1, 20)], "SOFTMAX", (), "classifier", 20), ([(1, 1, 1, 20)], "SOFTMAX", (), "classifier", 20),
                ([(1, 3, 4, 4)], "SOFTMAX", (), "fomo", 3), ([(1, 6, 8, 4)], None, ("--decoder", "none"), "none", 0),
                ([(1, 6, 8, 4)], "ARG_MAX", (), "segment", 4), ([(1, 3, 4, 16)], None, ("--anchors", "1,2,3,4"), "yolov2", 3),
                ([(1, 40, 7)], None, ("--decoder", "yolov8"), "yolov8", 36)):
            sure = last == "SOFTMAX" and len(shapes[0]) == 4
            found = bench.run(network(shapes, last, ends, 2 / 255 if sure else 1 / 255, zero_in=64 if sure else -128), *options,
                              **({"trial": False} if decoder in ("fomo", "segment") else {}))
            bench.holds(f"{decoder} of {shapes[0]} {ends}", getattr(found, "decoder", found[1] if isinstance(found, tuple) else ""), decoder)
            bench.holds(f"its {classes} classes", getattr(found, "classes", None), classes)
        for what, shapes, last in (("an embedding", [(1, 128)], None), ("landmarks and a presence", [(1, 1, 1, 136), (1, 1, 1, 1)], None),
                                   ("an odd head", [(1, 56, 40)], None), ("anchors of a face detector", [(1, 96, 16), (1, 96, 1)], None),
                                   ("boxes after suppression", [(1, 30, 6)], None), ("key points", [(1, 1, 17, 3)], None),
                                   ("a mask", [(1, 24, 32, 1)], None), ("scores of every pixel", [(1, 12, 16, 4)], "SOFTMAX"),
                                   ("a picture of numbers from 0 to 1", [(1, 768)], "LOGISTIC"),
                                   ("characters of a plate", [(9, 37)], "SOFTMAX"), ("characters of a text", [(1, 1, 24, 40)], "ARG_MAX")):
            bench.refused(f"{what} {ends}", network(shapes, last, ends), "--decoder none")
        bench.refused(f"scores of pixels of 4 x 4 {ends}", network([(1, 6, 8, 4)], "SOFTMAX", ends), "cells of 8 x 8")
        for what, last, scale in (("classes and a score", "LOGISTIC", 1 / 255), ("small numbers and a score", None, 0.05)):
            bench.refused(f"{what} with the shapes of a hand's keypoints {ends}", network([(1, 63), (1, 1)], last, ends, scale, image=(1, 224, 224, 3)),
                          "keypoints in pixels")
        labels = bench.file("numbers.txt", "".join(f"{i}\n" for i in range(10)))
        found = bench.run(network([(1, 10)], "LOGISTIC", ends), "--labels", labels, trial=False)
        bench.holds(f"a classifier from LOGISTIC with labels {ends}", getattr(found, "decoder", found), "classifier")
    for decoder in ("yolov8", "yolov5", "fomo", "yolov2"):
        bench.refused(f"two scores as {decoder}", network([(1, 2)], "SOFTMAX"), "axes: [1, ", "--decoder", decoder)
    bench.refused("nine rows of scores", network([(9, 37)], "SOFTMAX"), "expected one row", "--decoder", "classifier")
    bench.refused("boxes without their operator", network([(1, 40, 7)]), "TFLite_Detection_PostProcess", "--decoder", "ssd")
    bench.refused("a picture that is lost", network([(1, 20)], "SOFTMAX"), "and not 0", "--scale", "0")
    bench.refused("scores that are none", network([(1, 20)], None, scale_in=0.1), "from 0 to 25.5", "--decoder", "classifier")
    bench.refused("the same, chosen: what would be refused is not proposed", network([(1, 20)], None, scale_in=0.1), "for the raw outputs\n")


def heads(bench):
    """YOLO heads, and what only looks like one: poses, masks, coordinates before their decoding, other grids and labels."""
    names = bench.file("two.txt", "cat\ndog\n")
    for kind, n, other in (("yolov8", 84, 80), ("yolov5", 252, 80)):
        found = bench.run(yolo(kind, 3, n))
        bench.holds(f"{kind} of {n} boxes", getattr(found, "decoder", found), kind)
        wrong = "yolov5" if kind == "yolov8" else "yolov8"
        bench.refused(f"{wrong} where {kind} fits", yolo(kind, 3, n), f"expected --decoder {kind}", "--decoder", wrong)
        bench.holds("its classes and fractions", (getattr(found, "classes", 0), getattr(found, "normalised", 0)), (3, 1))
        for what, model in (("rows that are no scores", yolo(kind, 1, n, 8)), ("no sigmoid", yolo(kind, 3, n, sigmoid=False)),
                            ("another number of boxes", yolo(kind, 3, other, boxes=lambda n: np.zeros((n, 4))))):
            bench.refused(f"{kind}: {what}", model, f"--decoder {kind}")
        bench.refused(f"{kind}: prototypes beside it", yolo(kind, 3, n, outputs=2), "expected --decoder none")
        bench.refused(f"{kind}: two labels for three classes", yolo(kind, 3, n), "found 2 labels", "--labels", names)
        if not isinstance(found, Written) or ENGINE(found.raw) is None:
            print("SKIPPED trials of decoders on pictures: the engine is not built for this machine")
        else:
            for what, boxes in (("boxes away from their cells", lambda n: centres(n)[::-1]),
                                ("boxes all in one place", lambda n: 0 * centres(n))):
                bench.refused(f"{kind}: {what}", yolo(kind, 3, n, boxes=boxes), "near their cells")
    bench.refused("boxes in pixels beside scores", yolo("yolov8", 3, 84, step=1.2), "whose steps lose the scores")
    bench.refused("decoded boxes of one per cell", yolo("yolov5", 3, 84), "already decoded")
    model = yolo("yolov8", 3, 84)
    for task, text in (("pose", "task pose"), ("segment", "task segment"), ("obb", "task obb"), ("classify", "task classify")):
        bench.refused(f"metadata of task {task}", model + zipped({"metadata.json": '{"task": "%s"}' % task}), text)
    found = bench.run(model + zipped({"metadata.json": '{"task": "detect", "names": {"0": "a", "1": "b", "2": "c"}}'}))
    bench.holds("metadata of task detect", getattr(found, "decoder", found), "yolov8")


def planes(bench):
    """A picture as [1, channels, h, w] is one: its size and channels are known, and real ones keep their range."""
    for real in (False, True):
        b = Builder()
        q = b.tensor("int8", (1, 3, 24, 32), 1 / 255, -128)
        x = b.tensor("float32", (1, 3, 24, 32)) if real else q
        if real:
            b.op("QUANTIZE", [x], [q], "Quantize")
        turned = b.tensor("int8", (1, 24, 32, 3), 1 / 255, -128)
        b.op("TRANSPOSE", [q, b.const("int32", [0, 2, 3, 1])], [turned], "Transpose")
        found = bench.run(b.bytes([x], [turned]), "--decoder", "none")
        raw = getattr(found, "raw", bytes(512))
        bench.holds(f"the size of a picture in planes, {'real' if real else '8-bit'}", struct.unpack_from("<4i", raw, 164), (32, 24, 3, 0))
        bench.holds("its range", (found.mean, found.scale), (0, 1 / 255))


def states(bench):
    """A second input is nobody's in the loop."""
    b = Builder()
    x, s = b.tensor("int8", (1, 24, 32, 3), 1 / 255, -128), b.tensor("int8", (1, 24, 32, 3), 1 / 255, -128)
    y = b.tensor("int8", (1, 24, 32, 3), 1 / 128, -128)
    b.op("ADD", [x, s], [y], "Add")
    model = b.bytes([x, s], [y])
    bench.refused("a second input", model, "nothing would set 't1'")
    bench.refused("and a decoder", model, "nothing would set 't1'", "--decoder", "segment")
    found = bench.run(model, "--decoder", "none")
    bench.holds("raw outputs of two inputs", getattr(found, "decoder", ""), "none")
    bench.holds("the name of the output", getattr(found, "names", []) == [b"t2"], True)


def outputs(bench):
    """A tail that is cut off: the network ends in the tensors that are named, and needs no operator behind them."""
    b = Builder()
    x, y = b.tensor("int8", (1, 8, 8, 3), 0.1, 0), b.tensor("int8", (1, 8, 8, 3), 0.1, 0)
    z = b.tensor("int8", (1, 8, 8, 3), 0.1, 0)
    b.op("RELU", [x], [y])
    b.op("CUMSUM", [y, b.const("int32", 1)], [z], "Cumsum")
    model = b.bytes([x], [z])
    bench.refused("a tail that is not supported", model, "CUMSUM", "--decoder", "none")
    found = bench.run(model, "--decoder", "none", "--outputs", "t1")
    bench.holds("the network before it", getattr(found, "names", found) == [b"t1"], True)
    bench.refused("a name that nothing computes", model, "no computed tensor 't7'", "--decoder", "none", "--outputs", "t7")
    bench.refused("an input", model, "no computed tensor 't0'", "--decoder", "none", "--outputs", "t0")


def refusals(bench):
    """What to do instead, in 200 letters and the file's name at most."""
    for weights in ("int8", "float32"):
        b = Builder()
        x, y = b.tensor("float32", (1, 8, 8, 3)), b.tensor("float32", (1, 8, 8, 4))
        w = b.const(weights, np.ones((4, 3, 3, 3)), **({"scale": 0.1, "zero": 0} if weights == "int8" else {}))
        b.op("CONV_2D", [x, w], [y], "Conv2D", StrideH=1, StrideW=1, DilationHFactor=1, DilationWFactor=1, Padding=0)
        bench.refused(f"real numbers by {weights} weights", b.bytes([x], [y]), "export full integer quantisation")
    b = Builder()
    x = [b.tensor("int8", (1, 8, 8, 3), 0.1, 0) for _ in range(40)]
    y = b.tensor("int8", (1, 8, 8, 3), 0.1, 0)
    b.op("ADD_N", x, [y], "AddN")
    b.op("CUMSUM", [y, b.const("int32", 1)], [b.tensor("int8", (1, 8, 8, 3), 0.1, 0)], "Cumsum")
    status, line = bench.run(b.bytes(x[:1], [y]))
    bench.holds("an operator of many inputs is refused in 200 letters",
                (status, "ADD_N: not supported" in line, "nor CUMSUM" in line, "--outputs NAME" in line, len(line.split(": ", 1)[1]) <= 201),
                (2, 1, 1, 1, 1))


def rests(bench):
    """Refusals name the operator, and say what to export instead."""
    def one(name, kind, shape, options=None, before=False, other=None, keys=None, **fields):
        b = Builder()
        x = b.tensor("int8", shape, 0.1, 0) if before else b.tensor(kind, shape, **(keys or {}))
        y = b.tensor(kind, shape, **(keys or {})) if before else x
        if before:
            b.op("DEQUANTIZE", [x], [y], "Dequantize")
        b.op(name, [y] + ([] if other is None else [b.const(kind, other, **(keys or {}))]), [b.tensor(kind, shape, **(keys or {}))], options, **fields)
        return b, x
    for name, options, other in (("MUL", "Mul", [[2.0]]), ("ADD", "Add", [[2.0]]), ("LOGISTIC", None, None)):
        for before, remedy in ((False, "or let --quantise do it on pictures"), (True, "or end before it: --outputs NAME")):
            b, x = one(name, "float32", (1, 8), options, before, other)
            bench.refused(f"{name} of real numbers", b.bytes([x], [len(b.tensors) - 1]), f"operator {int(before)} {name}: found float32, expected int8 or uint8 "
                          f"throughout: export full integer quantisation, {remedy}")
    b, x = one("MUL", "float32", (1, 8), "Mul", other=[[2.0]])
    b.const("int8", np.ones((4, 4)), scale=0.1)
    bench.refused("beside weights of 8 bits", b.bytes([x], [2]), "full integer quantisation, with a representative data set")
    b, x = one("LOGISTIC", "float16", (1, 8))
    bench.refused("numbers of half precision", b.bytes([x], [1]), "operator 0 LOGISTIC: found float16 in tensor 0 't0', expected int8 or uint8: export full")
    eight = {"scale": 0.1}
    b, x = one("ABS", "int8", (1, 1, 2, 2, 2, 2, 2, 2), keys=eight)
    bench.refused("tensors of eight axes", b.bytes([x], [1]), "operator 0 ABS: tensor 0 't0' has shape [1, 1, 2, 2, 2, 2, 2, 2], expected at most 6 axes, none "
                  "empty: export without it, or end before it: --outputs NAME")
    b, x = one("WHILE", "int8", (1, 8), "While", keys=eight, CondSubgraphIndex=1, BodySubgraphIndex=2)
    b.subgraphs = 3
    bench.refused("a loop", b.bytes([x], [1]), "operator 0 WHILE: runs another of 3 subgraphs, expected 1: export with the loop unrolled")
    b, x = one("ABS", "int8", (1, 8), keys=eight)
    b.subgraphs = 2
    bench.refused("two signatures", b.bytes([x], [1]), "2 subgraphs, expected 1: export a single signature")
    b = Builder()
    x, y = b.tensor("int8", (1, 8, 8, 8), 0.1, 0), b.tensor("int8", (1, 8, 8, 300), 0.1, 0)
    b.op("GATHER", [x, b.const("int32", np.arange(300) * 5 % 8)], [y], "Gather", Axis=3)
    line = bench.run(b.bytes([x], [y]))[1]
    bench.holds("what of an operator is not supported is said in 200 letters", ("GATHER: not supported (300 runs" in line, "--outputs NAME" in line,
                                                                            len(line.strip().split(": ", 1)[1]) <= 200), (1, 1, 1))


def beyond(bench):
    """What the engine refuses to load is refused in a line, also where a decoder was to be tried on it."""
    b = Builder()
    x, y = b.tensor("int8", (1, 8, 8, 3), 1 / 255, -128), b.tensor("int8", (1, 1, 1, 4), 0.1, 0)
    w = b.const("int8", np.ones((4, 1, 1, 3)), scale=[0.1] * 4, zero=0)
    b.op("CONV_2D", [x, w], [y], "Conv2D", StrideH=70000, StrideW=70000, DilationHFactor=1, DilationWFactor=1, Padding=0)
    flat, z = b.tensor("int8", (1, 4), 0.1, 0), b.tensor("int8", (1, 4), 1 / 256, -128)
    b.op("RESHAPE", [y, b.const("int32", [1, 4])], [flat], "Reshape", NewShape=[1, 4])
    b.op("SOFTMAX", [flat], [z], "Softmax", Beta=1.0)
    bench.refused("a stride beyond the engine's", b.bytes([x], [z]), "window is out of range")


def thresholds(bench):
    names = bench.file("names.txt", "cat\ndog\nowl\n")
    found = bench.run(network([(1, 7, 40)]), *V8, "--labels", names, "--score", "0.3", "--class-score", "dog=0.6", "--class-score", "2=0.1")
    bench.holds("thresholds by class", found.thresholds, [0.3, 0.6, 0.1])
    bench.holds("without any", int(bench.run(network([(1, 7, 40)]), *V8).thresholds is None), 1)
    for entry in ("cow=0.5", "dog=2", "dog", "dog=", "dog=a", "7=0.5", "dog=nan", "\u00b2=0.5"):
        bench.refused(f"--class-score {entry}", network([(1, 7, 40)]), "--class-score", *V8, "--labels", names, "--class-score", entry)
    for option in ("--score", "--iou"):
        bench.refused(f"{option} 2", network([(1, 7, 40)]), option, option, "2", *V8)


def labels(bench):
    """A first line for the background, which is no class."""
    names = bench.file("names.txt", "background\n" + "".join(f"l{i}\n" for i in range(1000)))
    found = bench.run(network([(1, 1001)], "SOFTMAX"), "--labels", names)
    bench.holds("1001 labels of 1001 outputs", (found.background, found.first_label, len(found.labels)), (1, 1, 1001))
    names = bench.file("names.txt", "".join(f"l{i}\n" for i in range(1000)))
    found = bench.run(network([(1, 1001)], "SOFTMAX"), "--labels", names)
    bench.holds("1000 labels of 1001 outputs", (found.background, found.first_label), (1, 0))
    found = bench.run(network([(1, 7, 40)]), *V8, "--labels", bench.file("names.txt", "???\ncat\ndog\nowl\n"))
    bench.holds("a line of ??? before them", found.first_label, 1)


def anchors(bench):
    rows = np.arange(12).reshape(3, 4) / 12 + 0.25
    for shapes in ([(1, 3, 4), (1, 3, 6)], [(1, 3, 6), (1, 3, 4)], [(1, 3, 1, 4), (1, 3, 6)], [(1, 3, 4), (1, 3, 3)]):
        for name, table in (("rows", rows), ("columns", rows.T)):
            path = bench.file("anchors.txt", "\n".join(" ".join(f"{v:.7f}" for v in row) for row in table))
            found = bench.run(network(shapes), "--anchors", path)
            bench.holds(f"anchors in {name} for {shapes}", found.anchors, rows.ravel())
            bench.holds("decoder", found.decoder, "ssd_raw")
            classes = max(s[-1] for s in shapes if s[-1] != 4) - 1
            bench.holds("classes and scales", (found.classes, *found.box_scales), (classes, 10, 10, 5, 5))
    boxes = network([(1, 3, 4), (1, 3, 6)])
    bench.refused("no anchors", boxes, "--anchors FILE", "--decoder", "ssd_raw")
    bench.refused("too few", boxes, "expected 4 for each of 3", "--anchors", bench.file("anchors.txt", "1 2 3 4"))
    bench.refused("no numbers", boxes, "expected numbers", "--anchors", bench.file("anchors.txt", "a b"))
    for what, text in (("no text", b"\xff\xfe"), ("no finite number", "1 nan 1 1 " * 3), ("a huge number", "1 1e300 1 1 " * 3)):
        bench.refused(what, boxes, "anchors.txt", "--anchors", bench.file("anchors.txt", text))
    bench.refused("fewer scores than boxes", network([(1, 3, 4), (1, 2, 6)]), "expected boxes", "--anchors", "x")
    bench.refused("no boxes", network([(1, 20)]), "expected boxes", "--decoder", "ssd_raw", "--anchors", "x")
    path = bench.file("anchors.txt", "1 2 3 4 " * 3)
    for scales in ("0,1,1,1", "1,nan,1,1", "1e300,1,1,1", "1,1,1", ""):
        bench.refused(f"scales {scales}", boxes, "--box-scales", "--anchors", path, "--box-scales", scales)
    grid = network([(1, 3, 4, 16)])
    for text in ("1,2,3", "1,nan", "1,1e300", "1,-2"):
        bench.refused(f"pairs {text}", grid, "--anchors", f"--anchors={text}")
    bench.refused("no pairs", grid, "--anchors", "--decoder", "yolov2")


def unread(bench):
    """Options of other decoders than the one that is named or chosen."""
    classes = network([(1, 20)], "SOFTMAX")
    for option, value, expected in (("--points", "5,3", "expected yolov8_pose or end2end or landmarks"), ("--box-scales", "1,1,1,1", "expected ssd_raw"),
                                    ("--anchors", "1,2", "expected ssd_raw or yolov2 or yolov3"), ("--colours", "x", "expected segment")):
        for kind, model, named in (("classifier", classes, ()), ("none", classes, ("--decoder", "none")), ("yolov8", network([(1, 7, 40)]), V8)):
            bench.refused(f"{option} with {kind}", model, f"{option}: found with decoder {kind}, {expected}", option, value, *named)


def sound():
    """An input as long as a second of sound, pooled into a row."""
    b = Builder()
    x, y = b.tensor("int8", (1, 1, 16000, 1), 0.03, 0), b.tensor("int8", (1, 1, 8000, 1), 0.03, 0)
    b.op("MAX_POOL_2D", [x], [y], "Pool2D", StrideH=1, StrideW=2, FilterHeight=1, FilterWidth=2, Padding=0)
    z = b.tensor("int8", (1, 8000), 0.03, 0)
    b.op("RESHAPE", [y, b.const("int32", [1, 8000])], [z], "Reshape", NewShape=[1, 8000])
    return b.bytes([x], [z])


def loaded(bench):
    """What the loader takes: at most 4096 classes, images up to 8192 wide."""
    found = bench.run(sound(), "--decoder", "none")
    bench.holds("no classifier of 8000 classes", getattr(found, "decoder", ""), "none")
    bench.holds("no image 16000 wide", struct.unpack_from("<4i", getattr(found, "raw", bytes(512)), 160), (0, 0, 0, 0))
    bench.refused("asked for", sound(), "from -3.84 to 3.81", "--decoder", "classifier")


def cuts(bench):
    """--recut changes the cost of rows alone; the shipped files are what it makes of those before."""
    for name in ("shipped", "segmenter"):
        with open(os.path.join(HERE, "..", "..", "src", "detect", f"{name}.fvm"), "rb") as file:
            shipped = file.read()
        at = struct.unpack_from("<I", shipped, 32)[0] + 4 * 15
        before = bytearray(shipped)
        struct.pack_into("<i", before, at, 133120)  # as they were imported, before costs were measured
        struct.pack_into("<I", before, 12, zlib.crc32(bytes(before[16:])))
        bench.holds(f"{name}.fvm as it was before", bytes(before) == shipped, False)
        made = bench.run(bytes(before), "--recut", "0")
        bench.holds(f"{name}.fvm cut anew is the committed one", getattr(made, "raw", b"") == shipped, True)
    others = [i for i, kind in enumerate(kinds_of(shipped)) if kind != 1]
    bench.refused("nothing to cut", shipped, "expected a convolution or a fully connected layer", "--recut", str(others[0]))
    bench.refused("no such operator", shipped, "found no such operator, expected numbers from 0 to", "--recut", "0,99")
    bench.refused("no numbers", shipped, "found no such operator", "--recut", "-1")
    bench.refused("a damaged file", shipped[:-1], "the stated size is", "--recut", "0")


def kinds_of(raw):
    count, at = struct.unpack_from("<2I", raw, 28)
    return [struct.unpack_from("<i", raw, at + 256 * i)[0] for i in range(count)]


def units(bench):
    """No row of a large layer is more than a unit's work; units are cut by the set that takes longest."""
    for what, shape, weights in (("connected", (1, 2000), (3000, 2000)), ("convolution", (1, 7, 7, 512), (512, 3, 3, 512))):
        b = Builder()
        x, y = b.tensor("int8", shape, 0.03, 0), b.tensor("int8", (*shape[:-1], weights[0]), 1.0, 0)
        w = b.tensor("int8", weights, 0.01, 0, np.ones(weights, np.int8))
        if len(shape) == 2:
            b.op("FULLY_CONNECTED", [x, w, -1], [y], "FullyConnected")
        else:
            b.op("CONV_2D", [x, w], [y], "Conv2D", StrideH=1, StrideW=1, DilationHFactor=1, DilationWFactor=1, Padding=0)
        found = bench.run(b.bytes([x], [y]), "--decoder", "none")
        count, at = struct.unpack_from("<2I", found.raw, 28)
        costs = np.frombuffer(found.raw, "<i4", count * 64, at).reshape(-1, 64)[:, 15]
        bench.holds(f"{what}: {count} steps of rows up to {costs.max()}", bool(count > 1 and costs.max() <= 4000000), True)
    b = Builder()
    x, y, z = (b.tensor("int8", (1, 8, 8, 4), 0.03, 0) for _ in range(3))
    b.op("ADD", [x, y], [z], "Add")
    found, kept = {}, COSTS.TABLE
    for figures in ((100, 100, 0), (100, 300, 0), (300, 100, 50), (50, 60, 300)):
        COSTS.TABLE = {**kept, "add_rows": dict(zip(COSTS.SETS, figures))}
        raw = bench.run(b.bytes([x, y], [z]), "--decoder", "none").raw
        found[figures] = int(np.frombuffer(raw, "<i4", 64, struct.unpack_from("<I", raw, 32)[0])[15])
    COSTS.TABLE = kept
    bench.holds("units are cut by the slowest set", [round(cost / found[100, 100, 0], 2) for cost in found.values()], [1, 3, 3, 3])
    path = os.path.join(bench.folder, "costs.txt")
    COSTS.write({**kept, "add_rows": dict(zip(COSTS.SETS, (7, 0, 9)))}, ["# by hand\n"], path)
    bench.holds("a table of costs is read as it was written", [COSTS.comment(path), list(COSTS.read(path)["add_rows"].values())] == [["# by hand\n"], [7, 0, 9]]
                and {w: f for w, f in COSTS.read(path).items() if w != "add_rows"} == {w: f for w, f in kept.items() if w != "add_rows"}, True)
    bench.holds("every kind of work was measured on SSE4 and AVX2", [w for w, f in kept.items() if not (f["sse4"] and f["avx2"])], [])


def zipped(names):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, text in names.items():
            archive.writestr(name, text)
    return file.getvalue()


def archived(bench):
    """Labels in the archive that a model may carry at its end."""
    model = network([(1, 7, 40)])
    for what, names in (("a list", {"note.txt": "of no use", "labelmap.txt": "cat\ndog\nowl\n"}),
                        ("a dictionary", {"temp_meta.txt": "{'names': {0: 'cat', 1: 'dog', 2: 'owl'}}"}),
                        ("JSON", {"metadata.json": '{"task": "detect", "names": {"0": "cat", "1": "dog", "2": "owl"}}'}),
                        ("JSON with a list", {"metadata.json": '{"end": true, "names": ["cat", "dog", "owl"]}'})):
        found = bench.run(model + zipped(names), *V8)
        bench.holds(f"labels in {what}", getattr(found, "labels", []) == [b"cat", b"dog", b"owl"], True)
    for what, text in (("no dictionary", "{ not one"), ("no text", b"\xff\xfe"), ("no names", "{}"), ("other names", '{"names": 3}')):
        found = bench.run(model + zipped({"labels.txt": text}), *V8)
        bench.holds(f"an archive with {what} gives none", getattr(found, "labels", None) == [], True)


def damaged(bench):
    """Models of which a few bytes are wrong: read all the same, or refused in one line."""
    draw = random.Random(3)
    models, results = [network([(1, 7, 40)]), network([(1, 6, 8, 4)], "SOFTMAX", "float32"), sound()], []
    b = Builder()
    x, y = b.tensor("int8", (1,) * 60, 0.1, 0), b.tensor("int8", (1,) * 60, 0.1, 0)
    b.op("ADD", [x, b.const("int8", np.zeros((1,) * 30), scale=0.1, zero=0)], [y], "Add")
    results.append(bench.run(b.bytes([x], [y]), "--decoder", "none"))  # shapes of many numbers
    for _ in range(150):
        model = bytearray(draw.choice(models))
        for _ in range(draw.randint(1, 3)):
            model[draw.randrange(8, len(model))] = draw.choice((0, 1, 127, 128, 255))
        found = bench.run(bytes(model), "--decoder", "none")
        results.append((0, "") if isinstance(found, Written) else found)
    odd = [line[-300:] for status, line in results if status and (status != 2 or line.count("\n") != 1 or len(line.split(": ", 1)[1]) > 201)]
    bench.holds(f"{sum(status == 2 for status, _ in results)} of 150 damaged models are refused, each in a line", odd[:3], [])


def unfinished(bench):
    """What a file and its folder hold after it could be written in part only, and what they should."""
    folder = os.path.join(bench.folder, "full")
    os.mkdir(folder)
    path = bench.file("full/m.fvm", "before")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        TOOL.put(path, bytes(5000))
    except OSError:
        pass
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    with open(path, "rb") as file:
        return f"{file.read(9)} {os.listdir(folder)}", "b'before' ['m.fvm']"


def files(bench):
    """What cannot be read or written; whatever was there stays."""
    model = network([(1, 7, 40)])
    bench.refused("no such folder", model, "/nowhere/m.fvm", "-o", "/nowhere/m.fvm", *V8)
    bench.refused("a full disk", model, "/dev/full", "-o", "/dev/full", *V8)
    path = os.path.join(bench.folder, "m.tflite")
    bench.refused("the model as output", model, "m.tflite", "-o", path, *V8)
    with open(path, "rb") as file:
        bench.holds("it stays", file.read() == model, True)
    bench.holds("what was there before a disk was full stays", *unfinished(bench))
    bench.refused("no labels there", model, "nowhere.txt", "--labels", "nowhere.txt")
    bench.refused("labels that are no text", model, "labels.bin", "--labels", bench.file("labels.bin", b"\xff\xfe"))
    bench.refused("labels with a zero", model, "labels.bin", "--labels", bench.file("labels.bin", b"cat\0\n"))
    bench.refused("too many labels", model, "4096", "--labels", bench.file("many.txt", "".join(f"l{i}\n" for i in range(5000))))
    for option, value in (("--mean", "nan"), ("--scale", "1e9")):
        bench.refused(f"{option} {value}", model, option, option, value, *V8)


def main():
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(folder)
        for test in (guesses, heads, planes, states, outputs, refusals, rests, beyond, thresholds, labels, anchors, unread, loaded, units, cuts, archived, files, damaged):
            test(bench)
    return 1 if bench.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
