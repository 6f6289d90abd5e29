"""Forms of operators that real models have and tests/import/operators.py does not draw: an absent bias, open sizes, scalars,
five axes, whole blocks, several outputs. The same proof: bit for bit against the reference interpreter.

    python3 tests/import/variants.py [--set c|avx2|...] [--rounds N] [NAME...]"""
import sys

import numpy as np

import operators
from operator_cases import out_size


def conv(c, x, oc, k=3, stride=1, dilation=1, padding=0, activation=0):
    """A convolution whose output uses its range; returns its output tensor."""
    b, h, w, ic = c.b.tensors[x][1]
    scale = c.b.tensors[x][2][0]
    weights, scales = c.weights((oc, k, k, ic), oc, 0)
    y = c.q((b, out_size(h, k, stride, dilation, padding), out_size(w, k, stride, dilation, padding), oc),
            scale * float(np.mean(scales)) * 60 * np.sqrt(k * k * ic))
    c.b.op("CONV_2D", [x, weights, c.bias(oc, scale, scales)], [y], "Conv2D", StrideH=stride,
           StrideW=stride, DilationHFactor=dilation, DilationWFactor=dilation, Padding=padding,
           FusedActivationFunction=activation)
    return y


def depthwise(c, x, k=3, stride=1, dilation=1, padding=0, activation=0, bias=True):
    b, h, w, ch = c.b.tensors[x][1]
    scale = c.b.tensors[x][2][0]
    weights, scales = c.weights((1, k, k, ch), ch, 3)
    y = c.q((b, out_size(h, k, stride, dilation, padding), out_size(w, k, stride, dilation, padding), ch),
            scale * float(np.mean(scales)) * 60 * k)
    c.b.op("DEPTHWISE_CONV_2D", [x, weights] + ([c.bias(ch, scale, scales)] if bias else []), [y], "DepthwiseConv2D",
           StrideH=stride, StrideW=stride, DilationHFactor=dilation, DilationWFactor=dilation, Padding=padding,
           DepthMultiplier=1, FusedActivationFunction=activation)
    return y


def like(c, x, shape=None, scale=None):
    """A tensor quantised as x is."""
    t = c.b.tensors[x]
    return c.q(shape or t[1], t[2][0] if scale is None else scale, t[3][0])


def image(c, h=None, w=None, ch=None):
    return c.q((1, h or c.int(3, 13), w or c.int(3, 13), ch or c.int(1, 24)), 0.03)


def biasless_depthwise(c):
    x = image(c)
    return [x], [depthwise(c, x, c.choose(1, 3, 5), bias=False)]


def batched_strides(c):
    """SAME and VALID at even and odd sizes, several images, large strides and kernels wider than the image."""
    k, s = c.int(1, 7), c.int(1, 4)
    h, w = c.int(k, 15), c.int(k, 15)
    padding = c.int(0, 1)
    if padding == 0:
        h, w = c.int(1, 15), c.int(1, 15)
    x = c.q((c.int(1, 3), h, w, c.int(1, 20)), 0.03)
    y = conv(c, x, c.int(1, 33), k, s, 1, padding, c.choose(0, 1, 3))
    return [x], [y, depthwise(c, x, k, s, 1, padding)]


def dilated(c):
    d, k = c.int(2, 4), c.choose(2, 3)
    x = c.q((1, c.int(3, 16), c.int(3, 16), c.int(1, 40)), 0.03)
    y = conv(c, x, c.int(1, 20), k, 1, d, 0)
    return [x], [y, depthwise(c, x, k, 1, d, 0)]


def connected(c):
    """Fully connected over an image, without bias, keeping the leading axes or not."""
    h, w, ch, oc = c.int(1, 4), c.int(1, 4), c.int(1, 30), c.int(1, 30)
    keep = c.int(0, 1)
    k = ch if keep else h * w * ch
    x = c.q((1, h, w, ch), 0.03)
    weights, scales = c.weights((oc, k), oc, 0)
    y = c.q((1, h, w, oc) if keep else (1, oc), 0.03 * float(np.mean(scales)) * 60 * np.sqrt(k))
    ins = [x, weights, c.bias(oc, 0.03, scales)] if c.int(0, 1) else [x, weights, -1]
    c.b.op("FULLY_CONNECTED", ins, [y], "FullyConnected", KeepNumDims=bool(keep))
    return [x], [y]


def scalar(c):
    """Arithmetic with one number, of no axis or of one."""
    x = image(c)
    shape = c.choose((), (1,))
    name = c.choose("ADD", "SUB", "MUL")
    s = c.q(shape, 0.02, data=c.values(shape))
    y = c.q(c.b.tensors[x][1], 0.05)
    c.b.op(name, [x, s] if c.int(0, 1) or name == "SUB" else [s, x], [y], name.capitalize())
    return [x], [y]


def five_axes(c):
    shape = [1] + [c.int(1, 5) for _ in range(4)]
    x = c.q(shape, 0.05, 3)
    order = [0] + [1 + int(v) for v in c.r.permutation(4)]
    y = like(c, x, [shape[i] for i in order])
    c.b.op("TRANSPOSE", [x, c.b.const("int32", order)], [y], "Transpose")
    z = like(c, x, [shape[order[1]] * shape[order[2]], -1])
    flat = [shape[order[0]] * shape[order[1]] * shape[order[2]], shape[order[3]] * shape[order[4]]]
    c.b.tensors[z] = (*c.b.tensors[z][:1], tuple(flat), *c.b.tensors[z][2:])
    c.b.op("RESHAPE", [y, c.b.const("int32", [flat[0], -1])], [z], "Reshape", NewShape=[flat[0], -1])
    return [x], [z]


def open_size(c):
    """RESHAPE to a size that SHAPE, STRIDED_SLICE and PACK make at run time."""
    x = image(c)
    b, h, w, ch = c.b.tensors[x][1]
    shape, first = c.b.tensor("int32", (4,)), c.b.tensor("int32", ())
    c.b.op("SHAPE", [x], [shape], "Shape", OutType=2)
    c.b.op("STRIDED_SLICE", [shape] + [c.b.const("int32", v) for v in ([0], [1], [1])], [first], "StridedSlice",
           BeginMask=0, EndMask=0, EllipsisMask=0, NewAxisMask=0, ShrinkAxisMask=1)
    size = c.b.tensor("int32", (2,))
    c.b.op("PACK", [first, c.b.const("int32", h * w * ch)], [size], "Pack", ValuesCount=2, Axis=0)
    y = like(c, x, (b, h * w * ch))
    c.b.op("RESHAPE", [x, size], [y], "Reshape", NewShape=[b, h * w * ch])
    return [x], [y]


def mean_of_image(c):
    x = image(c)
    ch = c.b.tensors[x][1][3]
    keep = c.int(0, 1)
    y = c.q((1, 1, 1, ch) if keep else (1, ch), 0.02)
    c.b.op("MEAN", [x, c.b.const("int32", [-3, -2] if c.int(0, 1) else [1, 2])], [y], "Reducer", KeepDims=bool(keep))
    return [x], [y]


def squeeze_excite(c):
    """MobileNetV3's block: mean, two convolutions, hard sigmoid by MUL and ADD, broadcast product."""
    x = image(c, ch=16)
    shape = c.b.tensors[x][1]
    mean = c.q((1, 1, 1, 16), 0.02)
    c.b.op("MEAN", [x, c.b.const("int32", [1, 2])], [mean], "Reducer", KeepDims=True)
    gate = conv(c, conv(c, mean, 8, 1, activation=1), 16, 1)
    t = c.b.tensors[gate]
    three = c.q((), 3 / 255, 0 if c.dtype == "uint8" else -128, data=np.array(255 if c.dtype == "uint8" else 127, c.dtype))
    shifted = c.q((1, 1, 1, 16), t[2][0])
    c.b.op("ADD", [gate, three], [shifted], "Add", FusedActivationFunction=3)
    scaled = c.q((1, 1, 1, 16), 1 / 256, 0 if c.dtype == "uint8" else -128)
    sixth = c.q((), 1 / 6 / 255, 0 if c.dtype == "uint8" else -128, data=np.array(255 if c.dtype == "uint8" else 127, c.dtype))
    c.b.op("MUL", [shifted, sixth], [scaled], "Mul")
    y = c.q(shape, 0.03)
    c.b.op("MUL", [x, scaled], [y], "Mul")
    return [x], [y]


def residual(c):
    """An inverted bottleneck with its sum, of which a part in the middle is an output as well."""
    x = image(c, ch=c.choose(8, 16, 24))
    ch = c.b.tensors[x][1][3]
    wide = conv(c, x, 4 * ch, 1, activation=3)
    deep = depthwise(c, wide, 3, activation=3)
    narrow = conv(c, deep, ch, 1)
    y = c.q(c.b.tensors[x][1], 0.04)
    c.b.op("ADD", [x, narrow], [y], "Add")
    return [x], [y, deep]


def shared_weights(c):
    """One set of weights over two sizes, as heads of detectors have it; results reshaped and joined."""
    a, b = c.q((1, 6, 5, 12), 0.03, 3), c.q((1, 3, 4, 12), 0.03, 3)
    weights, scales = c.weights((6, 3, 3, 12), 6, 0)
    bias = c.bias(6, 0.03, scales)
    scale, flat = 0.03 * float(np.mean(scales)) * 600, []
    for x in (a, b):
        _, h, w, _ = c.b.tensors[x][1]
        y = c.q((1, h, w, 6), scale, 3)
        c.b.op("CONV_2D", [x, weights, bias], [y], "Conv2D", StrideH=1, StrideW=1, DilationHFactor=1, DilationWFactor=1,
               Padding=0)
        flat.append(c.q((1, h * w * 2, 3), scale, 3))
        c.b.op("RESHAPE", [y, c.b.const("int32", [1, -1, 3])], [flat[-1]], "Reshape", NewShape=[1, -1, 3])
    z = c.q((1, 84, 3), scale, 3)
    c.b.op("CONCATENATION", flat, [z], "Concatenation", Axis=1)
    s = c.q((1, 84, 3), 1 / 256, 0 if c.dtype == "uint8" else -128)
    c.b.op("LOGISTIC", [z], [s])
    return [a, b], [z, s]


def pyramid(c):
    """Features of a coarse level doubled and added to those of a finer one, then pooled."""
    fine, coarse = image(c, 8, 6, 16), image(c, 4, 3, 16)
    doubled = like(c, coarse, (1, 8, 6, 16))
    c.b.op("RESIZE_NEAREST_NEIGHBOR", [coarse, c.b.const("int32", [8, 6])], [doubled], "ResizeNearestNeighbor",
           AlignCorners=False, HalfPixelCenters=bool(c.int(0, 1)))
    total = c.q((1, 8, 6, 16), 0.05)
    c.b.op("ADD", [fine, doubled], [total], "Add", FusedActivationFunction=c.choose(0, 1))
    y = like(c, total, (1, 4, 3, 16))
    c.b.op("MAX_POOL_2D", [total], [y], "Pool2D", StrideH=2, StrideW=2, FilterHeight=3, FilterWidth=3, Padding=0)
    return [fine, coarse], [y]


def shuffle(c):
    """Channels of two groups mixed: five axes, one transposed."""
    x = image(c, ch=12)
    _, h, w, ch = c.b.tensors[x][1]
    parts, mixed, y = like(c, x, (1, h, w, 2, 6)), like(c, x, (1, h, w, 6, 2)), like(c, x, (1, h, w, ch))
    c.b.op("RESHAPE", [x, c.b.const("int32", [1, h, w, 2, 6])], [parts], "Reshape", NewShape=[1, h, w, 2, 6])
    c.b.op("TRANSPOSE", [parts, c.b.const("int32", [0, 1, 2, 4, 3])], [mixed], "Transpose")
    c.b.op("RESHAPE", [mixed, c.b.const("int32", [1, h, w, ch])], [y], "Reshape", NewShape=[1, h, w, ch])
    halves = [like(c, x, (1, h, w, 6)) for _ in range(2)]
    c.b.op("SPLIT", [c.b.const("int32", -1), y], halves, "Split", NumSplits=2)
    z = conv(c, halves[1], 9, 3)
    return [x], [halves[0], z]


def up_convolution(c):
    """TRANSPOSE_CONV of stride 2 with a fused activation, joined with a skip connection."""
    x, skip = image(c, 4, 5, 12), image(c, 8, 10, 6)
    weights, scales = c.weights((10, 3, 3, 12), 10, 0)
    y = c.q((1, 8, 10, 10), 0.03 * float(np.mean(scales)) * 600, c.b.tensors[skip][3][0])
    c.b.op("TRANSPOSE_CONV", [c.b.const("int32", [1, 8, 10, 10]), weights, x, c.bias(10, 0.03, scales)], [y],
           "TransposeConv", StrideH=2, StrideW=2, Padding=0, FusedActivationFunction=c.choose(0, 1))
    same = c.q((1, 8, 10, 10), 0.03, c.b.tensors[skip][3][0])
    c.b.op("QUANTIZE", [y], [same], "Quantize")
    z = like(c, skip, (1, 8, 10, 16))
    c.b.op("CONCATENATION", [same, skip], [z], "Concatenation", Axis=3)
    return [x, skip], [conv(c, z, 3, 1)]


def float_ends(c):
    """Real numbers in and out, 8 bits between."""
    x = c.b.tensor("float32", (1, 6, 7, 3))
    q = c.q((1, 6, 7, 3), 1 / 128, 0 if c.dtype == "int8" else 128)
    c.b.op("QUANTIZE", [x], [q], "Quantize")
    y = conv(c, q, 5, 3, 2, activation=1)
    z = c.b.tensor("float32", c.b.tensors[y][1])
    c.b.op("DEQUANTIZE", [y], [z], "Dequantize")
    return [x], [z]


def float_detection(c):
    """TFLite_Detection_PostProcess behind DEQUANTIZE, with real anchors: what post-training quantisation leaves."""
    from flatbuffers import flexbuffers
    n, classes, limit = c.int(5, 60), c.int(1, 6), c.int(1, 20)
    low = 0 if c.dtype == "uint8" else -128
    box, score = c.q((1, n, 4), 0.07), c.q((1, n, classes + 1), 1 / 256, low)
    reals = []
    for t in (box, score):
        reals.append(c.b.tensor("float32", c.b.tensors[t][1]))
        c.b.op("DEQUANTIZE", [t], [reals[-1]], "Dequantize")
    if c.int(0, 1):  # boxes of one axis too many, as convolutions give them
        shape = c.b.tensors[box][1]
        c.b.tensors[box] = (c.b.tensors[box][0], (1, n, 1, 4), *c.b.tensors[box][2:])
        c.b.tensors[reals[0]] = (c.b.tensors[reals[0]][0], (1, n, 1, 4), *c.b.tensors[reals[0]][2:])
        bent = c.b.tensor("float32", shape)
        c.b.op("SQUEEZE", [reals[0]], [bent], "Squeeze", SqueezeDims=[2])
        reals[0] = bent
    anchors = c.b.const("float32", c.r.uniform(0.05, 0.95, (n, 4)))
    if c.int(0, 2) == 0:
        packed, anchors = c.q((n, 4), 1 / 256, low, data=c.values((n, 4))), c.b.tensor("float32", (n, 4))
        c.b.op("DEQUANTIZE", [packed], [anchors], "Dequantize")
    outs = [c.b.tensor("float32", s) for s in ((1, limit, 4), (1, limit), (1, limit), (1,))]
    options = flexbuffers.Dumps({"max_detections": limit, "max_classes_per_detection": 1, "num_classes": classes,
                                 "detections_per_class": 10, "nms_score_threshold": 0.3, "nms_iou_threshold": 0.5,
                                 "y_scale": 10.0, "x_scale": 10.0, "h_scale": 5.0, "w_scale": 5.0,
                                 "use_regular_nms": bool(c.int(0, 1))})
    c.b.op("TFLite_Detection_PostProcess", reals + [anchors], outs, custom=bytes(options))
    order = c.choose((0, 1, 2, 3), (2, 0, 3, 1), (3, 2, 1, 0))  # the TensorFlow 2 detection API lists the scores first
    return [box, score], [outs[i] for i in order]


def passed_through(c):
    """An output that another operator reads, one that is only reshaped, one that occurs twice on the way."""
    x = image(c, ch=8)
    shape = c.b.tensors[x][1]
    r = c.q(shape, c.b.tensors[x][2][0], c.b.tensors[x][3][0])
    c.b.op("RELU", [x], [r])
    y = c.q(shape, 0.05)
    c.b.op("ADD", [r, r], [y], "Add")
    flat = like(c, y, (shape[1] * shape[2], 8))
    c.b.op("RESHAPE", [y, c.b.const("int32", list(c.b.tensors[flat][1]))], [flat], "Reshape",
           NewShape=list(c.b.tensors[flat][1]))
    return [x], [r, flat, y]


operators.CASES.clear()
operators.CASES.update({f.__name__: f for f in (
    biasless_depthwise, batched_strides, dilated, connected, scalar, five_axes, open_size, mean_of_image,
    squeeze_excite, residual, shared_weights, pyramid, shuffle, up_convolution, float_ends, float_detection,
    passed_through)})

if __name__ == "__main__":
    sys.exit(operators.main())
