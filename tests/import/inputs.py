"""What tools/import makes of the range of a network's input, where calibration was on pictures of every kind and where it was on dull ones; and of
narrow ranges of outputs. Needs tflite, numpy and flatbuffers.

    python3 tests/import/inputs.py"""
import contextlib
import io
import os
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE]

from builder import Builder  # noqa: E402
from uses import Bench, TOOL, V8, Written, network, yolo  # noqa: E402


def ranges(bench):
    for scale, zero, mean, factor in ((1 / 255, -128, 0, 1 / 255), (2 / 255, -1, 127.5, 1 / 127.5), (0.99, -128, 0, 1),
                                      (0.02, -10, 118, 0.02)):
        found = bench.run(network([(1, 20)], "SOFTMAX", "float32", scale, zero_in=zero))
        bench.holds(f"real input quantised by {scale:.4f} and {zero}", (found.mean, found.scale), (mean, factor))
    found = bench.run(network([(1, 20)], "SOFTMAX", "int8", 0.02, zero_in=-10))
    bench.holds("8-bit input", (found.mean, found.scale), (118, 0.02))
    for ends in ("int8", "float32"):
        found = bench.run(network([(1, 7, 40)], None, ends, 1 / 255), *V8)
        bench.holds(f"boxes are fractions of the size, {ends}", found.normalised, 1)


def parts(bench):
    """A range that is a part of a usual one is that of dull pictures: the usual one is taken where it is certain, and nothing where it is not."""
    own = ("--mean", "127.5", "--scale", "0.01")
    for ends in ("int8", "float32"):
        for low, high, mean, factor in ((0, 0.6, 0, 1 / 255), (-1, 0.2, 127.5, 2 / 255), (-0.4, 1, 127.5, 2 / 255), (-0.5, 0.5, 127.5, 1 / 255),
                                        (-2.1, 2.6, 114, 4.7 / 255), (0, 4.4, 0, 4.4 / 255), (-30, 90, 64, 120 / 255)):
            found = bench.run(network([(1, 20)], "SOFTMAX", ends, (high - low) / 255, zero_in=round(-low / (high - low) * 255) - 128))
            off = abs(found.mean - mean) if isinstance(found, Written) else found
            bench.holds(f"pictures of {low} to {high} in {ends}", bool(off <= 0.5 and abs(found.scale - factor) < 1e-5 * factor), True)
        dull = network([(1, 20)], "SOFTMAX", ends, 0.8 / 255, zero_in=42)
        bench.refused(f"pictures of -0.53 to 0.27 in {ends}", dull, "a part of -1 to 1 or of another range: expected --mean and --scale (here 127.5 and 0.00784314)")
        found = bench.run(dull, *own)
        bench.holds("as the user says", (found.mean, found.scale), (127.5, 0.01))
        bench.holds("raw outputs are of use all the same", getattr(bench.run(dull, "--decoder", "none"), "decoder", ""), "none")
    with contextlib.redirect_stdout(io.StringIO()) as text:
        TOOL.print_notes(TOOL.convert(bench.file("m.tflite", network([(1, 20)], "SOFTMAX", scale_in=0.6 / 255)))[1])
    bench.holds("what was taken is said", text.getvalue(), "input 't0' holds 0 to 0.6, a part of 0 to 1, which is taken: --mean and --scale say otherwise\n")
    bench.holds("scores of a narrow range are scores", getattr(bench.run(narrow_scores()), "decoder", ""), "classifier")
    for named in ((), V8):
        bench.refused("boxes of a narrow range", yolo("yolov8", 3, 84, step=0.4 / 255), "has boxes over the whole picture, found numbers to 0.4", *named)


def narrow_scores():
    """SOFTMAX, then bytes of 0 to 0.3."""
    b = Builder()
    x, flat = b.tensor("int8", (1, 24, 32, 3), 1 / 255, -128), b.tensor("int8", (1, 2304), 1 / 255, -128)
    b.op("RESHAPE", [x, b.const("int32", [1, 2304])], [flat], "Reshape", NewShape=[1, 2304])
    soft, out = b.tensor("int8", (1, 2304), 1 / 256, -128), b.tensor("int8", (1, 2304), 0.3 / 255, -128)
    b.op("SOFTMAX", [flat], [soft], "Softmax", Beta=1.0)
    b.op("QUANTIZE", [soft], [out], "Quantize")
    return b.bytes([x], [out])


def main():
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(folder)
        for test in (ranges, parts):
            test(bench)
    return 1 if bench.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
