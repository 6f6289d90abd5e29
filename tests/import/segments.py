"""Networks that label pixels in tools/import: which are recognised, which are not, their classes, labels, colours and whether their scores
are probabilities. Needs tflite, numpy and flatbuffers; no reference.

    python3 tests/import/segments.py"""
import os
import struct
import sys
import tempfile

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE]

from builder import Builder  # noqa: E402
from uses import Bench, DECODERS, ENGINE, Written, network  # noqa: E402

SIDE, CLASSES = 64, 4
NAMES = "floor\nwall\nobstacle\nmovable\n"


class Labeller:
    """A convolution of the picture at `side` pixels, with what follows it."""

    def __init__(self, classes=CLASSES, side=SIDE, noisy=False):
        self.b = b = Builder()
        self.image = b.tensor("int8", (1, SIDE, SIDE, 3), 1 / 255, -128)
        stride, draw = SIDE // side, np.random.default_rng(3)
        kernel = draw.normal(0, 1, (classes, stride, stride, 3))
        weights = np.round(kernel / np.abs(kernel).max() * 127)
        w = b.const("int8", weights, scale=[0.01] * classes, zero=0)
        bias = b.const("int32", np.zeros(classes), scale=[0.01 / 255] * classes, zero=0)
        self.t, self.shape = b.tensor("int8", (1, side, side, classes), 0.01, 0), (1, side, side, classes)
        b.op("CONV_2D", [self.image, w, bias], [self.t], "Conv2D", StrideH=stride, StrideW=stride, DilationHFactor=1, DilationWFactor=1,
             Padding=1)
        if noisy:
            table = np.arange(side * side * classes).reshape(self.shape) * 2654435761 >> 8
            self.then("ADD", "Add", extra=[b.const("int8", table % 256 - 128, scale=0.05, zero=0)], scale=0.05)

    def then(self, name, options=None, shape=None, scale=0.01, zero=0, extra=(), kind="int8", **more):
        self.shape = shape or self.shape
        out = self.b.tensor(kind, self.shape, scale, zero) if kind == "int8" else self.b.tensor(kind, self.shape)
        self.b.op(name, [self.t, *extra], [out], options, **more)
        self.t = out
        return self

    def softmax(self):
        return self.then("SOFTMAX", "Softmax", scale=1 / 256, zero=-128, Beta=1.0)

    def enlarged(self, side=SIDE):
        return self.then("RESIZE_BILINEAR", "ResizeBilinear", (1, side, side, self.shape[3]), extra=[self.b.const("int32", [side, side])],
                         AlignCorners=False, HalfPixelCenters=True)

    def numbers(self, kind="int32"):
        return self.then("ARG_MAX", "ArgMax", self.shape[:3], extra=[self.b.const("int32", -1)], kind=kind, OutputType=2)

    def bytes(self):
        return self.b.bytes([self.image], [self.t])


def numbered(count):
    return "".join(f"class{i}\n" for i in range(count))


def deeplab():
    return Labeller(side=8).enlarged().numbers()


def told(found):
    """Decoder, classes, labels, probabilities and colours of a file."""
    if not isinstance(found, Written):
        return found
    words = struct.unpack_from("<64i", found.raw, 224)
    at, count = words[40], words[41]
    return DECODERS[words[0]], words[1], len(found.labels), words[42], [tuple(found.raw[at + 3 * i:at + 3 * i + 3]) for i in range(count)]


def recognised(bench):
    names, one = bench.file("names.txt", NAMES), bench.file("one.txt", "cat\n")
    for what, made, labels, classes, share in (
            ("DeepLab with its ARG_MAX", deeplab(), None, 4, 0), ("the same with labels", deeplab(), names, 4, 0),
            ("the same with prose behind its labels", deeplab(), bench.file("more.txt", NAMES + "and 255 is ignored\n"), 4, 0),
            ("DeepLab without", Labeller(side=8).enlarged(), names, 4, 0), ("U-Net", Labeller().softmax(), names, 4, 1),
            ("U-Net before its SOFTMAX", Labeller(), names, 4, 0),
            ("a binary U-Net", Labeller(1).then("LOGISTIC", scale=1 / 256, zero=-128), one, 1, 1),
            ("Fast-SCNN, enlarged, then SOFTMAX", Labeller(side=8).enlarged().softmax(), names, 4, 1),
            ("Fast-SCNN's eighth, its first class no background", Labeller(side=8).softmax(), names, 4, 1),
            ("enlarged to half of the input", Labeller(side=8).enlarged(32), names, 4, 0),
            ("as many classes as masks tell apart", Labeller(255).softmax(), bench.file("most.txt", numbered(255)), 255, 1)):
        found = bench.run(made.bytes(), *(("--labels", labels) if labels else ()))
        bench.holds(what, str(told(found)), str(("segment", classes, classes if labels else 0, share, [])))


def not_recognised(bench):
    names, three = bench.file("names.txt", NAMES), bench.file("three.txt", "a\nb\nc\n")
    for what, made, options, text in (
            ("scores of each pixel without names", Labeller().softmax(), (), "needs 4 labels, found 0"),
            ("numbers of each pixel without names", Labeller(), (), "needs 4 labels, found 0"),
            ("a map of depth", Labeller(1), ("--labels", bench.file("one.txt", "depth\n")), "has a score from LOGISTIC"),
            ("numbers of cells", Labeller(side=16), ("--labels", names), "ends in SOFTMAX or LOGISTIC, or has the input's size"),
            ("an eighth that may be one of FOMO's cells", Labeller(side=8).softmax(), ("--labels", bench.file("b.txt", "background\na\nb\nc\n")),
             "fomo and segment both read"),
            ("fewer labels than classes", deeplab(), ("--labels", three), "tells 4 classes apart, found 3 labels"),
            ("another number of labels", Labeller().softmax(), ("--labels", three), "needs 4 labels, found 3"),
            ("more classes than masks tell apart", Labeller(256).softmax(), ("--labels", bench.file("over.txt", numbered(256))),
             "tells up to 255 classes apart, found 256"),
            ("a strip", Labeller(side=32).then("RESHAPE", "Reshape", (1, 16, 64, 4), NewShape=[1, 16, 64, 4]), ("--labels", names),
             "has the input's shape")):
        bench.refused(what, made.bytes(), text, *options)
    if ENGINE(bench.run(deeplab().bytes()).raw) is None:
        print("SKIPPED trials on pictures: the engine is not built for this machine")
        return
    bench.refused("neighbours that are all unlike", Labeller(noisy=True).bytes(), "of all neighbours", "--labels", names)
    found = bench.run(Labeller(noisy=True).bytes(), "--labels", names, "--decoder", "segment")
    bench.holds("the same where the user says so", told(found)[0], "segment")


def coloured(bench):
    for text in ("#000000\n#ff0001\n#00fe00\n#0000fd\n", "0 0 0\n255 0 1\n0 254 0\n0 0 253\n"):
        found = bench.run(deeplab().bytes(), "--colours", bench.file("colours.txt", text))
        bench.holds("colours in the file", told(found)[4], [(0, 0, 0), (255, 0, 1), (0, 254, 0), (0, 0, 253)])
    for what, text, why in (("three colours for four classes", "#000000\n" * 3, "found 3 colours, expected 4"),
                            ("a wrong colour", "#000000\n#12345\n", "line 2: found '#12345'"), ("a number too large", "0 0 256\n", "line 1"),
                            ("no colours", "\n", "found 0 colours")):
        bench.refused(what, deeplab().bytes(), why, "--colours", bench.file("colours.txt", text))
    bench.refused("colours of a classifier", network([(1, 20)], "SOFTMAX"), "expected segment", "--colours",
                  bench.file("colours.txt", "#000000\n"))


def main():
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(folder)
        for test in (recognised, not_recognised, coloured):
            test(bench)
    return 1 if bench.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
