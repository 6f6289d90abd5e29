"""Decoders that the user names, and those that tools/import proposes: what a network's outputs cannot be is refused, and no decoder is proposed
that could not read them. Needs tflite, numpy and flatbuffers, and the engine.

    python3 tests/import/named.py"""
import os
import sys
import tempfile

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE]

from builder import Builder  # noqa: E402
from uses import Bench, ENGINE, centres, network, zipped  # noqa: E402

SHARE = {"scale": 1 / 256, "zero": -128}


def head(parts, step=1 / 256):
    """A network of 64 x 64 whose output joins parts of [1, rows, 84]: "scores", from LOGISTIC, of the picture; or numbers [84][rows].
    `step`: of the bytes of the numbers and the output."""
    b, pieces, rows = Builder(), [], 0
    x, flat = b.tensor("int8", (1, 64, 64, 3), 0.03, 127), b.tensor("int8", (1, 12288), 0.03, 127)
    b.op("RESHAPE", [x, b.const("int32", [1, 12288])], [flat], "Reshape", NewShape=[1, 12288])
    for part, count in parts:
        rows += count
        if not isinstance(part, str):
            pieces.append(b.const("int8", np.clip(np.round(part.T[None] / step - 128), -128, 127), scale=step, zero=-128))
            continue
        cut, raw, share = b.tensor("int8", (1, count * 84), 0.03, 127), b.tensor("int8", (1, count, 84), 0.03, 127), b.tensor("int8", (1, count, 84), **SHARE)
        b.op("STRIDED_SLICE", [flat] + [b.const("int32", v) for v in ([0, 0], [1, count * 84], [1, 1])], [cut], "StridedSlice", BeginMask=0,
             EndMask=0, EllipsisMask=0, NewAxisMask=0, ShrinkAxisMask=0)
        b.op("RESHAPE", [cut, b.const("int32", [1, count, 84])], [raw], "Reshape", NewShape=[1, count, 84])
        b.op("LOGISTIC", [raw], [share])
        pieces.append(share)
    out = b.tensor("int8", (1, rows, 84), step, -128)
    b.op("CONCATENATION", pieces, [out], "Concatenation", Axis=1)
    return b.bytes([x], [out])


def boxes():
    return (centres(84) + 128) / 256


def quiet(rows):
    """Scores that no LOGISTIC shows, as an operator makes them that is not followed: 0 but in a few cells."""
    found = np.zeros((84, rows))
    found[::9] = 0.4
    return found


def decided(bench, what, model, decoder, *options):
    found = bench.run(model, *options)
    bench.holds(what, getattr(found, "decoder", found[1] if isinstance(found, tuple) else ""), decoder)


def poses(bench):
    """Keypoints lie around the cells of their boxes, and their x and y are no scores."""
    named = ("--decoder", "yolov8_pose")
    places = np.stack([boxes()[:, 0], boxes()[:, 1], 0.3 + 0 * boxes()[:, 0]], 1)
    plain = head([(boxes(), 4), ("scores", 17)])
    bench.refused("a plain head as poses", plain, "in all rows after the box", *named)
    bench.refused("a plain head as poses of five keypoints", plain, "in 10 of 10 rows of x and y", *named, "--points", "5,3")
    bench.refused("as poses of more numbers than there are", plain, "expected 4 numbers, classes and 6 keypoints", *named, "--points", "6,3")
    hidden = head([(boxes(), 4), (quiet(17), 17)])
    bench.refused("a plain head whose LOGISTIC is not seen", hidden, "keypoints that do not lie around their cells", *named, "--points", "5,3")
    real = head([(boxes(), 4), ("scores", 2), (np.concatenate([places] * 5, 1), 15)])
    decided(bench, "poses", real, "yolov8_pose", *named, "--points", "5,3")
    names = bench.file("names.txt", "a\nb\nc\nd\n")
    bench.refused("poses with other labels", real, "tell 2 classes apart, found 4 labels", *named, "--points", "5,3", "--labels", names)


def angles(bench):
    """The last row of oriented boxes is an angle."""
    named = ("--decoder", "yolov8_obb")
    bench.refused("a plain head as oriented boxes", head([(boxes(), 4), ("scores", 17)]), "in the last row, expected the angle", *named)
    bench.refused("a plain head whose LOGISTIC is not seen", head([(boxes(), 4), (quiet(17), 17)]), "0 nearly everywhere", *named)
    turned = np.abs(np.sin(np.arange(84.0)))[:, None]
    decided(bench, "oriented boxes", head([(boxes(), 4), ("scores", 3), (turned, 1)]), "yolov8_obb", *named)
    bench.refused("with as many labels as a plain head has classes", head([(boxes(), 4), ("scores", 3), (turned, 1)]), "found 4 labels", *named,
                  "--labels", bench.file("names.txt", "a\nb\nc\nd\n"))


def others(bench):
    """What the outputs' shapes, scores or places exclude."""
    decided(bench, "boxes in another order of cells are believed", head([(boxes()[::-1], 4), ("scores", 3)]), "yolov8", "--decoder", "yolov8")
    bench.refused("scores beyond 1", head([(boxes(), 4), (quiet(3) * 4, 3)], step=1 / 128), "have scores from 0 to 1.6", "--decoder", "yolov8")
    bench.refused("rows as a mask", network([(1, 9, 84)], image=(1, 64, 64, 3)), "of the input's proportions", "--decoder", "segment")


def anchors(bench):
    """--anchors alone make no YOLOv2: its cells hold five numbers and the classes for each anchor, all before LOGISTIC and SOFTMAX."""
    one, two, wide = ("--anchors", "1,2"), ("--anchors", "1,2,3,4"), (1, 96, 96, 3)
    for what, numbers, last, pairs, text in (("three numbers", 3, None, one, "has 1 x (5 + classes) numbers for each cell, found 3"),
                                             ("seven numbers of two anchors", 7, None, two, "has 2 x (5 + classes) numbers for each cell, found 7"),
                                             ("ten numbers of two anchors", 10, None, two, "has 2 x (5 + classes) numbers for each cell, found 10"),
                                             ("from SOFTMAX", 6, "SOFTMAX", one, "found scores that they made"),
                                             ("from LOGISTIC", 12, "LOGISTIC", two, "found scores that they made")):
        model = network([(1, 12, 12, numbers)], last, image=wide)
        bench.refused(f"yolov2, chosen: {what}", model, text, *pairs)
        bench.refused(f"yolov2, named: {what}", model, text, "--decoder", "yolov2", *pairs)
    found = bench.run(network([(1, 12, 12, 12)], image=wide), *two)
    bench.holds("yolov2 of two anchors", (getattr(found, "decoder", "") == "yolov2", getattr(found, "classes", 0)), (1, 1))


def numbers(bench):
    """Classes' numbers are no scores, and a row of scores is no map."""
    labelled = network([(1, 24, 32, 4)], "ARG_MAX")
    for name in ("yolov5", "yolov8", "yolov8_obb"):
        bench.refused(f"classes' numbers as {name}", labelled, "found int32 numbers in outputs float32[1, 24, 32], expected scores", "--decoder", name)
    for shape in ((1, 2), (1, 1, 1, 2), (1, 1, 2)):
        bench.refused(f"scores of {shape} as a map", network([shape], "SOFTMAX", image=(1, 96, 96, 3)), "of the input's proportions", "--decoder", "segment")


def proposals(bench):
    """Decoders are proposed that the outputs' shapes permit, with what else they need."""
    wide = (1, 96, 96, 3)
    for what, shapes, last, text in (
            ("heads of YOLOv3", [(1, 12, 12, 18), (1, 6, 6, 18)], None, "--decoder yolov3 --anchors PAIRS if it is that"),
            ("a head of YOLOv2", [(1, 12, 12, 30)], None, "--decoder segment or --decoder yolov2 --anchors PAIRS if it is that"),
            ("boxes and scores", [(1, 108, 4), (1, 108, 3)], "SOFTMAX", "; ssd_raw needs its anchors: "),
            ("their option", [(1, 108, 4), (1, 108, 3)], "SOFTMAX", "or --decoder ssd_raw --anchors FILE if it is that"),
            ("poses of several", [(1, 6, 56)], None, "or --decoder movenet if it is that"),
            ("nine corners and a score", [(1, 18), (1, 1)], None, "or --decoder landmarks --points COUNT,VALUES if it is that"),
            ("two lists of points", [(1, 213), (1, 15)], None, "which no decoder reads together: expected --decoder none for the raw outputs, or --outputs NAME"),
            ("two lists of scores", [(1, 63), (1, 5)], "SOFTMAX", "which no decoder reads together")):
        model = network(shapes, last, image=wide)
        bench.refused(what, model, text)
        line = bench.run(model)[1]
        bench.holds("in 200 characters", len(line.strip().split(": ", 1)[1]) <= 200, True)
    bench.refused("logits beside boxes", network([(1, 108, 4), (1, 108, 3)], scale_in=0.1, image=wide), "ssd_raw has scores from 0 to 1, found 0 to 25.5")


def people(bench):
    """Seventeen rows of three numbers are keypoints where two of three are no scores, or metadata say so."""
    all_scores = network([(1, 1, 17, 3)], "LOGISTIC", scale_in=0.03, image=(1, 64, 64, 3))
    bench.refused("three scores of 17", all_scores, "movenet has coordinates in two of three numbers, found all from LOGISTIC")
    bench.refused("three scores of 17: the option", all_scores, "or --decoder movenet if it is that")
    decided(bench, "as the user says", all_scores, "movenet", "--decoder", "movenet")
    said = zipped({"metadata.json": '{"task": "pose", "kpt_shape": [17, 3]}'})
    decided(bench, "as the metadata say", all_scores + said, "movenet")
    for several in (False, True):
        b = Builder()
        x, n = b.tensor("int8", (1, 64, 64, 3), 0.03, 127), 6 if several else 1
        flat = b.tensor("int8", (1, 12288), 0.03, 127)
        b.op("RESHAPE", [x, b.const("int32", [1, 12288])], [flat], "Reshape", NewShape=[1, 12288])
        cut, share = b.tensor("int8", (1, n), 0.03, 127), b.tensor("int8", (1, n), **SHARE)
        b.op("STRIDED_SLICE", [flat] + [b.const("int32", v) for v in ([0, 0], [1, n], [1, 1])], [cut], "StridedSlice", BeginMask=0,
             EndMask=0, EllipsisMask=0, NewAxisMask=0, ShrinkAxisMask=0)
        b.op("LOGISTIC", [cut], [share])
        column, place = b.tensor("int8", (1, n, 1), **SHARE), b.const("int8", np.full((1, n, 2), 10), **SHARE)
        b.op("RESHAPE", [share, b.const("int32", [1, n, 1])], [column], "Reshape", NewShape=[1, n, 1])
        rows = b.tensor("int8", (1, n, 56 if several else 51), **SHARE)
        b.op("CONCATENATION", [place, column] * 17 + ([place, place, column] if several else []), [rows], "Concatenation", Axis=2)
        out = rows
        if not several:
            out = b.tensor("int8", (1, 1, 17, 3), **SHARE)
            b.op("RESHAPE", [rows, b.const("int32", [1, 1, 17, 3])], [out], "Reshape", NewShape=[1, 1, 17, 3])
        decided(bench, f"keypoints of {'several people' if several else 'one person'}", b.bytes([x], [out]), "movenet")


def main():
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(folder)
        if ENGINE(bench.run(network([(1, 20)], "SOFTMAX")).raw) is None:
            print("SKIPPED decoders that are named: the engine is not built for this machine")
            return 0
        for test in (poses, angles, others, anchors, numbers, proposals, people):
            test(bench)
    return 1 if bench.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
