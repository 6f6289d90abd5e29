"""Operators alone for units.py, in shapes that estimates of work get wrong, and at least one of each kind of work in tools/import/costs.txt."""
import numpy as np

MAP = (1, 160, 160, 32)


TWO = {"ADD": "Add", "SUB": "Sub", "MUL": "Mul", "DIV": "Div", "PRELU": None}


def two(name, shape, other):
    def make(c):
        x, y, z = c.q(shape, 0.03, 3), c.q(other, 0.04 if name in TWO else 0.03, 3), c.q(shape, 0.03, 3)
        c.b.op(name, [x, y], [z], TWO.get(name, "MaximumMinimum"))
        return [x, y], [z]
    return make


def apart(name):
    """The operands are every second byte of a larger tensor."""
    def make(c):
        wide = c.q((1, 500, 500, 2), 0.03, 3)
        x, y, z = (c.q((1, 500, 500, 1), 0.03, 3) for _ in range(3))
        c.b.op("SPLIT", [c.b.const("int32", 3), wide], [x, y], "Split", NumSplits=2)
        c.b.op(name, [x, y], [z], TWO.get(name, "MaximumMinimum"))
        return [wide], [z]
    return make


def joined(channels):
    def make(c):
        x, y = c.q((1, 320, 320, channels[0]), 0.03, 3), c.q((1, 320, 320, channels[1]), 0.03, 3)
        z = c.q((1, 320, 320, sum(channels)), 0.03, 3)
        c.b.op("CONCATENATION", [x, y], [z], "Concatenation", Axis=3)
        return [x, y], [z]
    return make


def padded(side, larger, channels):
    def make(c):
        x, z = c.q((1, side, side, channels), 0.03, 3), c.q((1, larger, larger, channels), 0.03, 3)
        before = (larger - side) // 2
        pads = [[0, 0], [before, larger - side - before], [before, larger - side - before], [0, 0]]
        c.b.op("PAD", [x, c.b.const("int32", pads)], [z], "Pad")
        return [x], [z]
    return make


def by_table(shape):
    def make(c):
        x, z = c.q(shape, 0.03, 3), c.q(shape, 1 / 128, 0)
        c.b.op("TANH", [x], [z])
        return [x], [z]
    return make


def converted(name, before, after):
    def make(c):
        shape = (1, 640, 640, 16)
        x, z = (c.q(shape, 0.03, 3) if t == "q" else c.b.tensor(t, shape) for t in (before, after))
        types = {"float32": 0, "int32": 2, "int8": 9}
        c.b.op(name, [x], [z], name.title(), **({"InDataType": types[before], "OutDataType": types[after]} if name == "CAST" else {}))
        return [x], [z]
    return make


def real_slopes(shape, form):
    """PRELU between DEQUANTIZE and QUANTIZE."""
    def make(c):
        x, z = c.q(shape, 0.03, 3), c.q(shape, 0.03, 3)
        real, sloped = c.b.tensor("float32", shape), c.b.tensor("float32", shape)
        c.b.op("DEQUANTIZE", [x], [real], "Dequantize")
        c.b.op("PRELU", [real, c.b.const("float32", c.r.uniform(0, 0.4, form))], [sloped])
        c.b.op("QUANTIZE", [sloped], [z], "Quantize")
        return [x], [z]
    return make


def product(batch, m, k, n):
    def make(c):
        x, y, z = c.q((batch, m, k), 0.05, 3), c.q((batch, k, n), 0.04, 3), c.q((batch, m, n), 0.5, 3)
        c.b.op("BATCH_MATMUL", [x, y], [z], "BatchMatMul", AdjX=False, AdjY=False)
        return [x, y], [z]
    return make


def boxes(count, classes, regular):
    def make(c):
        from flatbuffers import flexbuffers
        box, score, anchors = c.q((1, count, 4), 0.08, 3), c.q((1, count, classes + 1), 1 / 256, -128), c.q((count, 4), 1 / 256, -128, data=c.values((count, 4)))
        outs = [c.b.tensor("float32", s) for s in ((1, 100, 4), (1, 100), (1, 100), (1,))]
        options = flexbuffers.Dumps({"max_detections": 100, "max_classes_per_detection": 1, "num_classes": classes, "detections_per_class": 100,
                                     "nms_score_threshold": 0.01, "nms_iou_threshold": 0.6, "y_scale": 10.0, "x_scale": 10.0, "h_scale": 5.0,
                                     "w_scale": 5.0, "use_regular_nms": regular})
        c.b.op("TFLite_Detection_PostProcess", [box, score, anchors], outs, custom=bytes(options))
        return [box, score], outs
    return make


def rows(name, depth, options, scale, zero):
    def make(c):
        shape = (1, 400000 // depth, depth)
        x, z = c.q(shape, 0.05, 3), c.q(shape, scale, zero)
        c.b.op(name, [x], [z], *options[:1], **(options[1] if options else {}))
        return [x], [z]
    return make


def pool(name, side, step, channels, image=160):
    def make(c):
        out = -(-image // step)
        x, z = c.q((1, image, image, channels), 0.05, 3), c.q((1, out, out, channels), 0.05, 3)
        c.b.op(name, [x], [z], "Pool2D", StrideH=step, StrideW=step, FilterHeight=side, FilterWidth=side, Padding=0)
        return [x], [z]
    return make


def reduced(name, axes, shape=MAP):
    def make(c):
        x, z = c.q(shape, 0.05, 3), c.q([n for i, n in enumerate(shape) if i not in axes], 0.05, 3)
        c.b.op(name, [x, c.b.const("int32", axes)], [z], "Reducer", KeepDims=False)
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


def largest(axis, shape):
    def make(c):
        x, z = c.q(shape, 0.05, 3), c.b.tensor("int32", [n for i, n in enumerate(shape) if i != axis])
        c.b.op("ARG_MAX", [x, c.b.const("int32", axis)], [z], "ArgMax", OutputType=2)
        return [x], [z]
    return make


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


NETWORKS = {f"{name}, {what}": two(name, MAP, other) for name in ("ADD", "SUB", "MUL", "PRELU", "MAXIMUM")
            for what, other in (("two maps", MAP), ("by channel", (1, 1, 1, 32)), ("by pixel", (1, 160, 160, 1)))}
NETWORKS["ADD, 3 channels by pixel"] = two("ADD", (1, 320, 320, 3), (1, 320, 320, 1))
NETWORKS.update({f"SOFTMAX of {d}": rows("SOFTMAX", d, ("Softmax", {"Beta": 1.0}), 1 / 256, -128) for d in (2, 3, 7, 21, 91, 1001)})
NETWORKS.update({f"L2_NORMALIZATION of {d}": rows("L2_NORMALIZATION", d, ("L2Norm", {}), 1 / 128, 0) for d in (4, 32, 1280)})
NETWORKS.update({f"{name[:-8].lower()} of {k} x {k}, {c} channels": pool(name, k, s, c) for name in ("AVERAGE_POOL_2D", "MAX_POOL_2D")
                 for k, s, c in ((2, 2, 3), (2, 2, 32), (3, 1, 32), (5, 1, 64), (7, 7, 3))})
NETWORKS.update({f"{name}, operands apart": apart(name) for name in ("ADD", "SUB", "MUL", "PRELU", "MAXIMUM")})
NETWORKS["DIV, two maps (uint8)"] = two("DIV", MAP, MAP)
NETWORKS.update({f"PRELU of real numbers, {c} channels": real_slopes((1, 160, 160, c), (1, 1, c)) for c in (2, 19, 64)})
NETWORKS["PRELU of real numbers, by element"] = real_slopes(MAP, MAP[1:])
NETWORKS.update({f"{name} over {axes}": reduced(name, axes) for name in ("MEAN", "SUM", "REDUCE_MAX") for axes in ([1, 2], [1], [3])})
NETWORKS.update({f"{name} over all axes": reduced(name, [0, 1, 2, 3]) for name in ("MEAN", "SUM", "REDUCE_MAX")})
NETWORKS["MEAN over 2 and 3 of planes"] = reduced("MEAN", [2, 3], (1, 2, 1024, 1024))
NETWORKS["MEAN over 0 of two images"] = reduced("MEAN", [0], (2, 1, 1, 409597))
NETWORKS.update({f"{name[:-8].lower()} of {k} x {k}, {c} channels": pool(name, k, s, c, i) for name in ("AVERAGE_POOL_2D", "MAX_POOL_2D")
                 for k, s, c, i in ((160, 160, 32, 160), (640, 640, 16, 640), (64, 64, 16, 640), (31, 1, 64, 80), (2, 2, 256, 320))})
NETWORKS.update({f"CONCATENATION of {a} and {b} channels": joined((a, b)) for a, b in ((3, 1), (16, 8), (64, 64))})
NETWORKS.update({f"PAD of {a} to {b}": padded(a, b, c) for a, b, c in ((100, 300, 32), (300, 302, 32), (700, 702, 3))})
NETWORKS["TANH"] = by_table((1, 320, 320, 16))
NETWORKS.update({f"{name}, {a} to {b}": converted(name, a, b) for name, a, b in (("CAST", "int8", "float32"), ("QUANTIZE", "float32", "q"),
                                                                               ("DEQUANTIZE", "q", "float32"))})
NETWORKS.update({f"BATCH_MATMUL {m} x {k} x {n}, {b} of them": product(b, m, k, n) for b, m, k, n in ((1, 400, 256, 400), (4, 400, 16, 400), (8, 49, 32, 49),
                                                                            (1, 1, 4096, 4096), (1, 16, 65536, 16), (2, 6, 512, 3000))})
NETWORKS.update({f"detections of {n} boxes, {c} classes{', regular' if r else ''}": boxes(n, c, r) for n, c, r in ((1917, 90, False), (8000, 2, False), (1917, 20, True), (49104, 90, False))})
NETWORKS.update({f"TRANSPOSE {order}": turned(order) for order in ([0, 3, 1, 2], [0, 2, 1, 3], [0, 3, 2, 1])})
NETWORKS["bilinear resize"] = resized("RESIZE_BILINEAR", "ResizeBilinear")
NETWORKS["nearest resize"] = resized("RESIZE_NEAREST_NEIGHBOR", "ResizeNearestNeighbor")
NETWORKS.update({f"ARG_MAX of 21, axis {axis}": largest(axis, shape) for axis, shape in ((3, (1, 200, 200, 21)), (1, (1, 21, 200, 200)))})
NETWORKS["ARG_MAX of 1000000"] = largest(1, (1, 1000000))
NETWORKS.update({f"CONV {k} x {k}, {i} to {o}": conv(h, i, o, k, s) for h, i, o, k, s in ((320, 1, 1, 1, 1), (320, 8, 4, 1, 1), (512, 3, 16, 6, 2),
                                                                                        (160, 1, 16, 5, 1), (20, 256, 256, 3, 1), (480, 64, 64, 3, 1), (7, 1024, 1024, 3, 1))})
NETWORKS.update({f"DEPTHWISE {k} x {k}, {c} channels{', wide' if h == 320 else ''}": depthwise(h, c, k) for h, c, k in ((224, 3, 3), (160, 32, 5), (20, 100, 9), (160, 192, 7), (320, 192, 7))})
NETWORKS.update({f"FULLY_CONNECTED {k} to {n}, {r} rows": connected(r, n, k) for r, n, k in ((400, 64, 64), (1, 4096, 4096), (1, 64, 262144))})
