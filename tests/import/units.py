"""The longest unit of each network, in milliseconds of processor time, the least of several runs, on every kernel set: of the models in
$FOVEA_DATA, and of operators alone in shapes that cost estimates get wrong. A unit is to take 0.25 ms at most on the machine that the
estimates of tools/import (`cost`) were made for; of another one it tells how far it is from that.

    python3 tests/import/units.py [--sets sse4,avx2,avx512] [--runs 7] [NAME...]      as a table; exit 1 where a unit takes longer"""
import argparse
import ctypes
import glob
import os
import sys
import tempfile
import time

import numpy as np

import operators  # noqa: F401  the paths of tools/import
import uses
from case import Case
from operators import Engine

MOST_MS = 0.25
MAP = (1, 160, 160, 32)


def two(name, shape, other):
    def make(c):
        x, y, z = c.q(shape, 0.03, 3), c.q(other, 0.04 if name in ("ADD", "SUB", "MUL") else 0.03, 3), c.q(shape, 0.03, 3)
        c.b.op(name, [x, y], [z], {"ADD": "Add", "SUB": "Sub", "MUL": "Mul"}.get(name, "MaximumMinimum"))
        return [x, y], [z]
    return make


def rows(name, depth, options, scale, zero):
    def make(c):
        shape = (1, 400000 // depth, depth)
        x, z = c.q(shape, 0.05, 3), c.q(shape, scale, zero)
        c.b.op(name, [x], [z], *options[:1], **(options[1] if options else {}))
        return [x], [z]
    return make


def pool(name, side, step, channels):
    def make(c):
        x, z = c.q((1, 160, 160, channels), 0.05, 3), c.q((1, -(-160 // step), -(-160 // step), channels), 0.05, 3)
        c.b.op(name, [x], [z], "Pool2D", StrideH=step, StrideW=step, FilterHeight=side, FilterWidth=side, Padding=0)
        return [x], [z]
    return make


def mean(axes):
    def make(c):
        x, z = c.q(MAP, 0.05, 3), c.q([n for i, n in enumerate(MAP) if i not in axes], 0.05, 3)
        c.b.op("MEAN", [x, c.b.const("int32", axes)], [z], "Reducer", KeepDims=False)
        return [x], [z]
    return make


def turned(order):
    def make(c):
        x, z = c.q(MAP, 0.05, 3), c.q([MAP[i] for i in order], 0.05, 3)
        c.b.op("TRANSPOSE", [x, c.b.const("int32", order)], [z], "Transpose")
        return [x], [z]
    return make


def resized(name, table):
    def make(c):
        x, z = c.q((1, 80, 80, 24), 0.05, 3), c.q((1, 353, 301, 24), 0.05, 3)
        c.b.op(name, [x, c.b.const("int32", [353, 301])], [z], table)
        return [x], [z]
    return make


def largest(c):
    x, z = c.q((1, 200, 200, 21), 0.05, 3), c.b.tensor("int32", (1, 200, 200))
    c.b.op("ARG_MAX", [x, c.b.const("int32", -1)], [z], "ArgMax", OutputType=2)
    return [x], [z]


def conv(side, ic, oc, kernel, step):
    def make(c):
        out = -(-side // step)
        x, z = c.q((1, side, side, ic), 0.03, 3), c.q((1, out, out, oc), 0.5, 3)
        weights, scales = c.weights((oc, kernel, kernel, ic), oc, 0)
        c.b.op("CONV_2D", [x, weights, c.bias(oc, 0.03, scales)], [z], "Conv2D", StrideH=step, StrideW=step, DilationHFactor=1,
               DilationWFactor=1, Padding=0, FusedActivationFunction=0)
        return [x], [z]
    return make


def depthwise(side, channels, kernel):
    def make(c):
        x, z = c.q((1, side, side, channels), 0.03, 3), c.q((1, side, side, channels), 0.3, 3)
        weights, scales = c.weights((1, kernel, kernel, channels), channels, 3)
        c.b.op("DEPTHWISE_CONV_2D", [x, weights, c.bias(channels, 0.03, scales)], [z], "DepthwiseConv2D", StrideH=1, StrideW=1,
               DilationHFactor=1, DilationWFactor=1, Padding=0, DepthMultiplier=1, FusedActivationFunction=0)
        return [x], [z]
    return make


def connected(count, n, k):
    def make(c):
        x, z = c.q((count, k), 0.03, 3), c.q((count, n), 0.3, 3)
        weights, scales = c.weights((n, k), n, 0)
        c.b.op("FULLY_CONNECTED", [x, weights, c.bias(n, 0.03, scales)], [z], "FullyConnected", FusedActivationFunction=0, KeepNumDims=False)
        return [x], [z]
    return make


NETWORKS = {f"{name}, {what}": two(name, MAP, other) for name in ("ADD", "SUB", "MUL", "MAXIMUM")
            for what, other in (("two maps", MAP), ("by channel", (1, 1, 1, 32)), ("by pixel", (1, 160, 160, 1)))}
NETWORKS["ADD, 3 channels by pixel"] = two("ADD", (1, 320, 320, 3), (1, 320, 320, 1))
NETWORKS.update({f"SOFTMAX of {d}": rows("SOFTMAX", d, ("Softmax", {"Beta": 1.0}), 1 / 256, -128) for d in (2, 3, 7, 21, 91, 1001)})
NETWORKS.update({f"L2_NORMALIZATION of {d}": rows("L2_NORMALIZATION", d, ("L2Norm", {}), 1 / 128, 0) for d in (4, 32, 1280)})
NETWORKS.update({f"{name[:-8].lower()} of {k} x {k}, {c} channels": pool(name, k, s, c) for name in ("AVERAGE_POOL_2D", "MAX_POOL_2D")
                 for k, s, c in ((2, 2, 3), (2, 2, 32), (3, 1, 32), (5, 1, 64), (7, 7, 3))})
NETWORKS.update({f"MEAN over {axes}": mean(axes) for axes in ([1, 2], [1], [3])})
NETWORKS.update({f"TRANSPOSE {order}": turned(order) for order in ([0, 3, 1, 2], [0, 2, 1, 3], [0, 3, 2, 1])})
NETWORKS["bilinear resize"] = resized("RESIZE_BILINEAR", "ResizeBilinear")
NETWORKS["nearest resize"] = resized("RESIZE_NEAREST_NEIGHBOR", "ResizeNearestNeighbor")
NETWORKS["ARG_MAX of 21"] = largest
NETWORKS.update({f"CONV {k} x {k}, {i} to {o}": conv(h, i, o, k, s) for h, i, o, k, s in ((320, 1, 1, 1, 1), (320, 8, 4, 1, 1), (512, 3, 16, 6, 2),
                                                                                        (160, 1, 16, 5, 1), (20, 256, 256, 3, 1))})
NETWORKS.update({f"DEPTHWISE {k} x {k}, {c} channels": depthwise(h, c, k) for h, c, k in ((224, 3, 3), (160, 32, 5), (20, 100, 9))})
NETWORKS.update({f"FULLY_CONNECTED {k} to {n}, {r} rows": connected(r, n, k) for r, n, k in ((400, 64, 64), (1, 4096, 4096))})


def longest(data, kernel_set, runs):
    """Units, and milliseconds of the longest: of each unit the least of all runs counts."""
    engine = Engine(data, kernel_set)
    least = []
    for _ in range(runs):
        engine.arena[:] = np.arange(len(engine.arena)) * 37 % 251
        progress, done, unit, status = operators.check.Progress(0, 0), ctypes.c_uint32(), 0, 1
        arguments = (engine.model, engine.kernels, ctypes.c_void_p(engine.arena.ctypes.data), ctypes.byref(progress), ctypes.c_uint32(1),
                     ctypes.byref(done))
        while status:
            before = time.thread_time_ns()
            status = engine.lib.fv_nn_run(*arguments)
            took = time.thread_time_ns() - before
            if unit == len(least):
                least.append(took)
            least[unit] = min(least[unit], took)
            unit += 1
    return len(least), max(least) * 1e-6


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sets", default="sse4,avx2,avx512")
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("names", nargs="*")
    arguments = parser.parse_args()
    sets, over = arguments.sets.split(","), 0
    with tempfile.TemporaryDirectory() as folder:
        bench = uses.Bench(folder)
        files = {}
        for name, make in NETWORKS.items():
            c = Case("int8", 1)
            files[name] = lambda c=c, made=make(c): c.b.bytes(*made)
        for path in sorted(glob.glob(os.path.join(os.environ.get("FOVEA_DATA", "../shared/data"), "models", "*.tflite"))):
            files[os.path.basename(path)[:-7]] = lambda path=path: open(path, "rb").read()
        print(f"| network | units | {' | '.join(sets)} |\n| --- | ---: |{' ---: |' * len(sets)}")
        for name, read in files.items():
            if arguments.names and not any(n in name for n in arguments.names):
                continue
            found = bench.run(read(), "--decoder", "none")
            if not isinstance(found, uses.Written):
                print(f"| {name} | not imported: {str(found)[:120]} |")
                over += 1
                continue
            results = [longest(found.raw, s, arguments.runs) for s in sets]
            over += any(ms > MOST_MS for _, ms in results)
            print(f"| {name} | {results[0][0]} | {' | '.join(f'{ms:.3f}' for _, ms in results)} |", flush=True)
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
