"""Odd forms of operators: unequal strides and dilations, wide ranges of scales, masks of slices, broadcasting of more axes,
constant operands, several images. The same proof as in operators.py: bit for bit against the reference interpreter.

    python3 tests/import/odd.py [--set c|avx2|...] [--rounds N] [NAME...]"""
import sys

import numpy as np

import operators  # it sets the paths of tools/import
import lower_math
from operator_cases import out_size
from variants import conv, image, like
from wide import wide_depthwise, wide_images, wide_layers


def conv_uneven(c):
    """Strides and dilations that differ by axis, all activations, accumulators from tiny to saturating."""
    kh, kw = c.int(1, 4), c.int(1, 4)
    sy, sx = c.int(1, 3), c.int(1, 3)
    dy, dx = (c.int(1, 3), c.int(1, 3)) if sy == sx == 1 else (1, 1)
    h, w, padding = (kh - 1) * dy + c.int(1, 9), (kw - 1) * dx + c.int(1, 9), c.int(0, 1)
    ic, oc = c.int(1, 30), c.int(1, 40)
    x = c.q((c.int(1, 3), h, w, ic), 0.03)
    weights, scales = c.weights((oc, kh, kw, ic), oc, 0)
    size = (c.b.tensors[x][1][0], out_size(h, kh, sy, dy, padding), out_size(w, kw, sx, dx, padding), oc)
    y = c.q(size, 0.03 * float(np.mean(scales)) * c.choose(0.4, 5, 60, 2000) * np.sqrt(kh * kw * ic))
    c.b.op("CONV_2D", [x, weights, c.bias(oc, 0.03, scales)], [y], "Conv2D", StrideH=sy, StrideW=sx, DilationHFactor=dy, DilationWFactor=dx, Padding=padding,
           FusedActivationFunction=c.choose(0, 1, 2, 3))
    return [x], [y]


def depthwise_uneven(c):
    kh, kw = c.int(1, 7), c.int(1, 7)
    sy, sx = c.int(1, 3), c.int(1, 3)
    dy, dx = (c.int(1, 3), c.int(1, 3)) if sy == sx == 1 else (1, 1)
    h, w, padding = (kh - 1) * dy + c.int(1, 12), (kw - 1) * dx + c.int(1, 12), c.int(0, 1)
    ic, multiplier = c.int(1, 40), c.choose(1, 1, 2, 3, 5)
    oc = ic * multiplier
    x = c.q((c.int(1, 3), h, w, ic), 0.03)
    weights, scales = c.weights((1, kh, kw, oc), oc, 3)
    y = c.q((c.b.tensors[x][1][0], out_size(h, kh, sy, dy, padding), out_size(w, kw, sx, dx, padding), oc),
            0.03 * float(np.mean(scales)) * c.choose(0.4, 5, 60, 2000) * np.sqrt(kh * kw))
    c.b.op("DEPTHWISE_CONV_2D", [x, weights, c.bias(oc, 0.03, scales)], [y], "DepthwiseConv2D", StrideH=sy, StrideW=sx,
           DilationHFactor=dy, DilationWFactor=dx, Padding=padding, DepthMultiplier=multiplier,
           FusedActivationFunction=c.choose(0, 1, 2, 3))
    return [x], [y]


def connected_axes(c):
    """Inputs of one to four axes."""
    shape, k, oc = [c.int(1, 4) for _ in range(c.int(0, 3))], c.int(1, 90), c.int(1, 40)
    keep = len(shape) > 1 and c.int(0, 1)
    x = c.q(shape + [k], 0.03)
    weights, scales = c.weights((oc, k), oc, 0)
    rows = int(np.prod(shape)) if shape else 1
    y = c.q(shape + [oc] if keep else [rows, oc], 0.03 * float(np.mean(scales)) * c.choose(3, 60, 900) * np.sqrt(k))
    c.b.op("FULLY_CONNECTED", [x, weights, c.bias(oc, 0.03, scales)], [y], "FullyConnected", KeepNumDims=bool(keep),
           FusedActivationFunction=c.choose(0, 1, 2, 3))
    return [x], [y]


def arithmetic_scales(c):
    """Sums, differences and products of up to six axes whose scales lie far apart, with activations."""
    full = [c.int(1, 4) for _ in range(c.int(1, c.choose(4, 4, 6)))]
    other = [1 if c.int(0, 2) == 0 else n for n in full][c.int(0, len(full) - 1):]
    name = c.choose("ADD", "SUB", "MUL")
    scale = [float(np.exp(c.r.uniform(-8, 1))) for _ in range(3)]
    if name != "MUL":
        scale[2] = max(scale[0], scale[1]) * float(np.exp(c.r.uniform(-1, 2)))
    a, b = c.q(full, scale[0]), c.q(other, scale[1], data=c.values(other) if c.int(0, 1) else None)
    y = c.q(full, scale[2])
    ins = [a, b] if c.int(0, 1) else [b, a]
    c.b.op(name, ins, [y], name.capitalize(), FusedActivationFunction=c.choose(0, 1, 2, 3))
    return [t for t in ins if c.b.tensors[t][4] is None], [y]


def extreme_constant(c):
    full = [c.int(1, 5) for _ in range(c.int(1, 5))]
    other = [1 if c.int(0, 1) else n for n in full][c.int(0, len(full) - 1):]
    zero = c.zero()
    a, b = c.q(full, 0.05, zero), c.q(other, 0.05, zero, data=c.values(other))
    y = c.q(full, 0.05, zero)
    c.b.op(c.choose("MAXIMUM", "MINIMUM"), [a, b] if c.int(0, 1) else [b, a], [y], "MaximumMinimum")
    return [a], [y]


def slice_masks(c):
    """STRIDED_SLICE with every mask."""
    rank = c.int(2, 4)
    shape = [c.int(1, 7) for _ in range(rank)]
    begin, end, stride, begin_mask, end_mask, shrink, out = [], [], [], 0, 0, 0, []
    for i, n in enumerate(shape):
        a, b = sorted((c.int(0, n - 1), c.int(0, n - 1)))
        kind = c.int(0, 4)
        if kind == 0:
            begin.append(c.choose(a, a - n)), end.append(a + 1), stride.append(1)
            shrink |= 1 << i
            continue
        s = c.choose(1, 2, -1)
        if s < 0:
            a, b = b, a - 1
        else:
            b += 1
        lo, hi = a, b
        if kind & 1:
            begin_mask |= 1 << i
            lo = 0 if s > 0 else n - 1
            a = c.int(-9, 9)
        if kind & 2 or b < 0:
            end_mask |= 1 << i
            hi = n if s > 0 else -1
            b = c.int(-9, 9)
        begin.append(a), end.append(b), stride.append(s)
        out.append(len(range(lo, hi, s)))
    if not out or 0 in out:
        return slice_masks(c)
    x = c.q(shape, 0.05, 3)
    y = c.q(out, 0.05, 3)
    c.b.op("STRIDED_SLICE", [x] + [c.b.const("int32", v) for v in (begin, end, stride)], [y], "StridedSlice",
           BeginMask=begin_mask, EndMask=end_mask, EllipsisMask=0, NewAxisMask=0, ShrinkAxisMask=shrink)
    return [x], [y]


def slice_ellipsis(c):
    """[..., a:b] and [new axis, ...]."""
    shape = [c.int(1, 5) for _ in range(3)]
    a, b = sorted((c.int(0, shape[2] - 1), c.int(0, shape[2] - 1)))
    x = c.q(shape, 0.05, 3)
    if c.int(0, 1):
        y, spec, masks = c.q(shape[:2] + [b + 1 - a], 0.05, 3), ([0, a], [0, b + 1], [1, 1]), (1, 0)
    else:
        y, spec, masks = c.q([1] + shape, 0.05, 3), ([0, 0], [0, 0], [1, 1]), (2, 1)
    c.b.op("STRIDED_SLICE", [x] + [c.b.const("int32", v) for v in spec], [y], "StridedSlice", BeginMask=0, EndMask=0,
           EllipsisMask=masks[0], NewAxisMask=masks[1], ShrinkAxisMask=0)
    return [x], [y]


def pool_wide(c):
    """Windows as wide as the image and wider, unequal strides; global pooling of many pixels."""
    name = c.choose("MAX_POOL_2D", "AVERAGE_POOL_2D")
    h, w, ch, padding = c.int(1, 20), c.int(1, 20), c.int(1, 40), c.int(0, 1)
    kh, kw = (h, w) if c.int(0, 1) else (c.int(1, h if padding else h + 3), c.int(1, w if padding else w + 3))
    sy, sx = c.int(1, 4), c.int(1, 4)
    zero = c.zero()
    x = c.q((c.int(1, 2), h, w, ch), 0.05, zero)
    y = c.q((c.b.tensors[x][1][0], out_size(h, kh, sy, 1, padding), out_size(w, kw, sx, 1, padding), ch), 0.05, zero)
    c.b.op(name, [x], [y], "Pool2D", StrideH=sy, StrideW=sx, FilterHeight=kh, FilterWidth=kw, Padding=padding,
           FusedActivationFunction=c.choose(0, 1, 2, 3))
    return [x], [y]


def reduce_axes(c):
    """Up to five axes, negative ones, all of them; scales far apart; a number instead of a list."""
    rank = c.int(1, c.choose(4, 5))
    shape = [c.int(1, 6) for _ in range(rank)]
    axes = sorted(set(c.int(0, rank - 1) for _ in range(c.int(1, rank))))
    keep = c.int(0, 1)
    out = [1 if i in axes else n for i, n in enumerate(shape) if keep or i not in axes]
    name = c.choose("MEAN", "REDUCE_MAX")
    zero = c.zero()
    x = c.q(shape, 0.05, zero)
    y = c.q(out, c.choose(0.05, 0.01, 0.3), None) if name == "MEAN" else c.q(out, 0.05, zero)
    spec = [a - rank if c.int(0, 1) else a for a in axes]
    c.b.op(name, [x, c.b.const("int32", spec[0] if len(spec) == 1 and c.int(0, 1) else spec)], [y], "Reducer",
           KeepDims=bool(keep))
    return [x], [y]


def resize_images(c):
    """Several images, up and down by any factor, the centre rules."""
    bilinear = c.int(0, 1)
    h, w, oh, ow = c.int(1, 9), c.int(1, 9), c.int(1, 40), c.int(1, 40)
    x = c.q((c.int(1, 3), h, w, c.int(1, 40)), 0.05, 3)
    b, _, _, ch = c.b.tensors[x][1]
    y = c.q((b, oh, ow, ch), 0.05, 3)
    align = c.int(0, 1)
    c.b.op("RESIZE_BILINEAR" if bilinear else "RESIZE_NEAREST_NEIGHBOR", [x, c.b.const("int32", [oh, ow])], [y],
           "ResizeBilinear" if bilinear else "ResizeNearestNeighbor", AlignCorners=bool(align),
           HalfPixelCenters=bool(0 if align else c.int(0, 1)))
    return [x], [y]


def reshape_forms(c):
    """The new shape only in the options, or only in the input, with -1."""
    shape = [c.int(1, 5) for _ in range(3)]
    x = c.q(shape, 0.05, 3)
    new = [shape[0], shape[1] * shape[2]]
    y = c.q(new, 0.05, 3)
    if c.int(0, 1):
        c.b.op("RESHAPE", [x], [y], "Reshape", NewShape=new)
    else:
        c.b.op("RESHAPE", [x, c.b.const("int32", c.choose([-1, new[1]], new))], [y])
    return [x], [y]


def tile_long(c):
    shape = [c.int(1, 5) for _ in range(c.int(1, 4))]
    times = [c.int(1, 3) for _ in shape]
    x = c.q(shape, 0.05, 3)
    y = c.q([a * b for a, b in zip(shape, times)], 0.05, 3)
    c.b.op("TILE", [x, c.b.const("int64", times)], [y], "Tile")
    return [x], [y]


def tile_every_axis(c):
    shape = [c.int(1, 4) for _ in range(c.int(3, 5))]
    times = [c.int(2, 3) for _ in shape]
    x = c.q(shape, 0.05, 3)
    y = c.q([a * b for a, b in zip(shape, times)], 0.05, 3)
    c.b.op("TILE", [x, c.b.const("int32", times)], [y], "Tile")
    return [x], [y]


def offset_weights(c):
    """int8 weights with a zero point, which the reference leaves out in convolutions and counts in fully connected layers."""
    x = c.q((1, 4, 5, c.int(2, 9)), 0.03)
    channels, zero = c.b.tensors[x][1][3], c.int(-9, 9) if c.dtype == "int8" else c.int(0, 255)

    def weights(shape):
        return c.b.tensor(c.dtype, shape, 0.02, zero, c.values(shape))
    deep, up, flat = c.q((1, 4, 5, channels), 0.1), c.q((1, 8, 10, 7), 0.1), c.q((20, 7), 0.1)
    c.b.op("FULLY_CONNECTED", [x, weights((7, channels)), -1], [flat], "FullyConnected")
    c.b.op("DEPTHWISE_CONV_2D", [x, weights((1, 3, 3, channels)), c.bias(channels, 0.03, [0.02])], [deep], "DepthwiseConv2D", StrideH=1,
           StrideW=1, DilationHFactor=1, DilationWFactor=1, Padding=0, DepthMultiplier=1)
    c.b.op("TRANSPOSE_CONV", [c.b.const("int32", [1, 8, 10, 7]), weights((7, 3, 3, channels)), x], [up], "TransposeConv", StrideH=2,
           StrideW=2, Padding=0)
    return [x], [deep, up, flat]


def constant_functions(c):
    """Functions of constants, of no axes, and moves of them, before they meet a computed tensor."""
    x = image(c, 4, 5, 6)
    k = c.q((6,), 0.02, data=c.values((6,)))
    steps = [c.q((6,), 0.03), c.q((6,), 1 / 256, 0 if c.dtype == "uint8" else -128)]
    c.b.op("QUANTIZE", [k], [steps[0]], "Quantize")
    c.b.op("LOGISTIC", [steps[0]], [steps[1]])
    bent = like(c, steps[1], (1, 1, 1, 6))
    c.b.op("RESHAPE", [steps[1], c.b.const("int32", [1, 1, 1, 6])], [bent], "Reshape", NewShape=[1, 1, 1, 6])
    y = c.q((1, 4, 5, 6), 0.05)
    c.b.op(c.choose("ADD", "MUL"), [x, bent], [y])
    z = c.q((1, 4, 5, 6), 0.05)
    c.b.op("MEAN", [y, c.b.const("int32", [])], [z], "Reducer", KeepDims=False)
    return [x], [z]


def unary_ranges(c):
    """Functions at scales from very fine to very coarse."""
    name = c.choose("LOGISTIC", "TANH", "RELU", "RELU6", "LEAKY_RELU", "HARD_SWISH")
    shape = [c.int(1, 90), c.int(1, 7)]
    x = c.q(shape, float(np.exp(c.r.uniform(-9, 1))))
    low = 0 if c.dtype == "uint8" else -128
    if name == "LOGISTIC":
        y = c.q(shape, 1 / 256, low)
    elif name == "TANH":
        y = c.q(shape, 1 / 128, low + 128)
    else:
        y = c.q(shape, c.b.tensors[x][2][0] * float(np.exp(c.r.uniform(-1, 1))))
    if name == "LEAKY_RELU":
        c.b.op(name, [x], [y], "LeakyRelu", Alpha=float(np.float32(c.choose(0.0, 0.01, 0.3, 1.0, 1.7, -0.2))))
    else:
        c.b.op(name, [x], [y])
    return [x], [y]


def softmax_axes(c):
    shape = [c.int(1, 4) for _ in range(c.int(1, 3))] + [c.choose(1, 2, 17, c.int(100, 1100))]
    many = c.int(0, 4) == 0  # the reference stops where the sum of exponentials reaches 512: at fine scales
    if many:
        shape = [1, c.int(4000, 8191)]
    x = c.q(shape, float(np.exp(c.r.uniform(-1 if many else -5, 1))))
    y = c.q(shape, 1 / 256, 0 if c.dtype == "uint8" else -128)
    c.b.op("SOFTMAX", [x], [y], "Softmax", Beta=c.choose(1.0, 0.3, 2.0))
    return [x], [y]


def prelu_forms(c):
    h, w, ch = c.int(1, 5), c.int(1, 5), c.int(1, 20)
    x = c.q((c.int(1, 2), h, w, ch), float(np.exp(c.r.uniform(-4, 0))))
    shape = c.choose((ch,), (1, 1, ch), (1, w, ch), (1, 1, 1, ch))
    alpha = c.q(shape, 0.01, data=c.values(shape))
    y = c.q(c.b.tensors[x][1], float(np.exp(c.r.uniform(-4, 0))))
    c.b.op("PRELU", [x, alpha], [y])
    return [x], [y]


def matmul_forms(c):
    """Batches that are broadcast, a constant second operand."""
    batch = [c.int(1, 3) for _ in range(c.int(1, 2))]
    other = [1 if c.int(0, 1) else n for n in batch][c.int(0, len(batch)):]
    m, k, n = c.int(1, 20), c.int(1, 40), c.int(1, 20)
    adj_x, adj_y = c.int(0, 1), c.int(0, 1)
    a = c.q(batch + ([k, m] if adj_x else [m, k]), 0.05)
    shape = other + ([n, k] if adj_y else [k, n])
    b = c.q(shape, 0.04, data=c.values(shape) if c.int(0, 1) else None)
    y = c.q(batch + [m, n], 0.05 * 0.04 * 60 * np.sqrt(k))
    c.b.op("BATCH_MATMUL", [a, b], [y], "BatchMatMul", AdjX=bool(adj_x), AdjY=bool(adj_y))
    return ([a] if c.b.tensors[b][4] is not None else [a, b]), [y]


def arg_max_cast(c):
    """The usual ends of segmenters: ARG_MAX along the last axis, then a cast; negative axes."""
    shape = [1, c.int(1, 9), c.int(1, 9), c.int(1, 40)]
    first, last = c.choose("int32", "int64"), c.choose("float32", "int32", "int64")
    x = c.q(shape)
    mid, y = c.b.tensor(first, shape[:3]), c.b.tensor(last, shape[:3])
    c.b.op("ARG_MAX", [x, c.b.const(c.choose("int32", "int64"), [-1] if c.int(0, 1) else -1)], [mid], "ArgMax",
           OutputType=2 if first == "int32" else 4)
    types = {"float32": 0, "int32": 2, "int64": 4}
    c.b.op("CAST", [mid], [y], "Cast", InDataType=types[first], OutDataType=types[last])
    return [x], [y]


def up_uneven(c):
    """TRANSPOSE_CONV of several images with strides and kernels that differ by axis."""
    kh, kw, sy, sx = c.int(1, 5), c.int(1, 5), c.int(1, 3), c.int(1, 3)
    b, h, w, ic, oc, padding = c.int(1, 2), c.int(1, 6), c.int(1, 6), c.int(1, 20), c.int(1, 20), c.int(0, 1)
    shape = (b, h * sy, w * sx, oc) if padding == 0 else (b, h * sy + max(kh - sy, 0), w * sx + max(kw - sx, 0), oc)
    x = c.q((b, h, w, ic), 0.03)
    weights, scales = c.weights((oc, kh, kw, ic), oc, 0)
    y = c.q(shape, 0.03 * float(np.mean(scales)) * c.choose(5, 60, 900) * np.sqrt(kh * kw * ic))
    c.b.op("TRANSPOSE_CONV", [c.b.const("int32", shape), weights, x] + ([c.bias(oc, 0.03, scales)] if c.int(0, 1) else []),
           [y], "TransposeConv", StrideH=sy, StrideW=sx, Padding=padding)
    return [x], [y]


def pad_long(c):
    shape = [c.int(1, 5) for _ in range(c.int(1, 5))]
    pads = [[c.int(0, 2), c.int(0, 2)] for _ in shape]
    x = c.q(shape)
    t = c.b.tensors[x]
    y = c.q([n + a + b for n, (a, b) in zip(shape, pads)], t[2][0], t[3][0])
    c.b.op("PAD", [x, c.b.const("int64", pads)], [y], "Pad")
    return [x], [y]


def join_scales(c):
    """Parts of different scales (uint8: requantised by the reference), one of them twice."""
    shape = [1, c.int(1, 5), c.int(1, 5)]
    zero = c.zero()
    parts = [c.q(shape + [c.int(1, 20)]) if c.dtype == "uint8" else c.q(shape + [c.int(1, 20)], 0.05, zero) for _ in range(3)]
    ins = parts + [parts[0]]
    y = c.q(shape + [sum(c.b.tensors[t][1][3] for t in ins)], 0.05, zero)
    c.b.op("CONCATENATION", ins, [y], "Concatenation", Axis=-1, FusedActivationFunction=0)
    return parts, [y]


def detection_many(c):
    """The usual sizes of detectors, with and without a background class, all detections allowed."""
    from flatbuffers import flexbuffers
    n, classes, limit = c.int(100, 400), c.int(1, 20), c.int(10, 100)
    low = 0 if c.dtype == "uint8" else -128
    box, score = c.q((1, n, 4), 0.03, low + 128), c.q((1, n, classes + c.int(0, 1)), 1 / 256, low)
    anchors = c.q((n, 4), 1 / 256, low, data=c.values((n, 4)))
    outs = [c.b.tensor("float32", s) for s in ((1, limit, 4), (1, limit), (1, limit), (1,))]
    options = flexbuffers.Dumps({"max_detections": limit, "max_classes_per_detection": 1, "num_classes": classes,
                                 "nms_score_threshold": c.choose(1e-8, 0.6), "nms_iou_threshold": 0.6,
                                 "y_scale": 10.0, "x_scale": 10.0, "h_scale": 5.0, "w_scale": 5.0,
                                 "use_regular_nms": False})
    c.b.op("TFLite_Detection_PostProcess", [box, score, anchors], outs, custom=bytes(options))
    return [box, score], outs


def one_by_one_chain(c):
    """Convolutions over one pixel, as after global pooling."""
    x = image(c, 1, 1, c.int(1, 90))
    ic, oc = c.b.tensors[x][1][3], c.int(1, 90)
    weights, scales = c.weights((oc, 1, 1, ic), oc, 0)
    y = c.q((1, 1, 1, oc), 0.03 * float(np.mean(scales)) * 60 * np.sqrt(ic))
    c.b.op("CONV_2D", [x, weights, c.bias(oc, 0.03, scales)], [y], "Conv2D", StrideH=1, StrideW=1, DilationHFactor=1,
           DilationWFactor=1, Padding=c.int(0, 1))
    z = like(c, y, (1, oc))
    c.b.op("RESHAPE", [y, c.b.const("int32", [1, oc])], [z], "Reshape", NewShape=[1, oc])
    return [x], [z]


def open_sizes(c):
    """Sizes that the file leaves open, as dense layers over several axes have them."""
    h, k, oc = c.int(2, 9), c.int(2, 30), c.int(2, 20)
    x = c.q((1, h, k), 0.03)
    flat = like(c, x, (h, k))
    weights, scales = c.weights((oc, k), oc, 0)
    y = c.q((h, oc), 0.03 * float(np.mean(scales)) * 60 * np.sqrt(k), 3)
    bent, total = like(c, y, (1, h, oc)), c.q((1, h, oc), c.b.tensors[y][2][0] * 1.7)
    turned = like(c, total, (1, oc, h))
    product = c.q((1, h, h), c.b.tensors[y][2][0] ** 2 * 300)
    s = c.q((1, h, h), 1 / 256, 0 if c.dtype == "uint8" else -128)
    c.b.op("RESHAPE", [x, c.b.const("int32", [-1, k])], [flat], "Reshape", NewShape=[-1, k])
    c.b.op("FULLY_CONNECTED", [flat, weights, -1], [y], "FullyConnected")
    c.b.op("RESHAPE", [y, c.b.const("int32", [1, -1, oc])], [bent], "Reshape", NewShape=[1, -1, oc])
    c.b.op("ADD", [bent, bent], [total], "Add")
    c.b.op("TRANSPOSE", [total, c.b.const("int32", [0, 2, 1])], [turned], "Transpose")
    if c.dtype == "uint8":  # the reference's matrix product is for int8
        c.b.signatures.update({flat: (-1, -1), y: (-1, oc), bent: (1, -1, oc), total: (1, -1, oc), turned: (1, oc, -1)})
        return [x], [turned]
    c.b.op("BATCH_MATMUL", [bent, turned], [product], "BatchMatMul", AdjX=False, AdjY=False)
    c.b.op("SOFTMAX", [product], [s], "Softmax", Beta=1.0)
    for t in (flat, y, bent, total, turned, product, s):
        c.b.signatures[t] = tuple(-1 for _ in c.b.tensors[t][1])
    return [x], [s]


def dilated_by_batches(c):
    """A dilated convolution, or a depthwise one, as SPACE_TO_BATCH_ND, VALID, BATCH_TO_SPACE_ND."""
    k, ch, oc, deep = c.int(1, 3), c.int(1, 20), c.int(1, 20), c.int(0, 1)
    block, size = (c.int(1, 4), c.int(1, 4)), (c.int(4, 14), c.int(4, 14))
    x = c.q((1, *size, ch), 0.03)
    oc = ch if deep else oc
    pads, crops, inner, out = [], [], [], []
    for b, n in zip(block, size):
        reach = (k - 1) * b
        before = c.choose(0, reach // 2)
        valid = n + 2 * before - reach
        if valid < 1:
            before, valid = reach, n + reach
        extra = -(n + 2 * before) % b
        pads.append([before, before + extra]), crops.append([0, extra]), inner.append((n + 2 * before + extra) // b)
        out.append(valid)
    images = block[0] * block[1]
    a = like(c, x, (images, *inner, ch))
    c.b.op("SPACE_TO_BATCH_ND", [x, c.b.const("int32", block), c.b.const("int32", pads)], [a])
    weights, scales = c.weights((1, k, k, ch) if deep else (oc, k, k, ch), oc, 3 if deep else 0)
    y = c.q((images, *(n - k + 1 for n in inner), oc), 0.03 * float(np.mean(scales)) * 60 * k * (1 if deep else np.sqrt(ch)))
    more = {"DepthMultiplier": 1} if deep else {}
    c.b.op("DEPTHWISE_CONV_2D" if deep else "CONV_2D", [a, weights, c.bias(oc, 0.03, scales)], [y],
           "DepthwiseConv2D" if deep else "Conv2D", StrideH=1, StrideW=1, DilationHFactor=1, DilationWFactor=1, Padding=1,
           FusedActivationFunction=c.choose(0, 1), **more)
    z = like(c, y, (1, *out, oc))
    c.b.op("BATCH_TO_SPACE_ND", [y, c.b.const("int32", block), c.b.const("int32", crops)], [z])
    return [x], [z]


def picture_in_planes(c):
    """[1, channels, h, w] as PyTorch has pictures: turned at once, after a QUANTIZE, or read in planes too."""
    channels, h, w = c.choose(1, 3), c.int(8, 14), c.int(8, 14)
    real = c.int(0, 2) == 0
    x = c.b.tensor("float32", (1, channels, h, w)) if real else c.q((1, channels, h, w), 0.03)
    planes = c.q((1, channels, h, w), 0.03) if real else x
    if real:
        c.b.op("QUANTIZE", [x], [planes], "Quantize")
    turned = like(c, planes, (1, h, w, channels))
    if channels == 1 and c.int(0, 1):
        c.b.op("RESHAPE", [planes, c.b.const("int32", [1, h, w, 1])], [turned], "Reshape", NewShape=[1, h, w, 1])
    else:
        c.b.op("TRANSPOSE", [planes, c.b.const("int32", [0, 2, 3, 1])], [turned], "Transpose")
    y = conv(c, turned, c.int(1, 9), 3)
    if c.int(0, 1):
        return [x], [y]
    z = c.q((1, channels), 0.03)
    c.b.op("MEAN", [planes, c.b.const("int32", [2, 3])], [z], "Reducer", KeepDims=False)
    return [x], [y, z] + ([planes] if real and c.int(0, 1) else [])


def float_islands(c):
    """Functions of real numbers between DEQUANTIZE and QUANTIZE: one, or several in a row; a slope for each channel."""
    shape = (1, c.int(1, 6), c.int(1, 6), c.int(1, 40))
    x = c.q(shape)
    reals = [c.b.tensor("float32", shape)]
    c.b.op("DEQUANTIZE", [x], [reals[0]], "Dequantize")
    for _ in range(c.int(1, 3)):
        name = c.choose("RELU", "RELU6", "LEAKY_RELU", "PRELU", "ABS", "NEG", "MINIMUM", "MAXIMUM", "MUL", "ADD", "SUB", "DIV", "TANH")
        if name == "PRELU" and any(op[0] == "PRELU" for op in c.b.ops):
            name = "ABS"
        y = c.b.tensor("float32", shape)
        if name == "LEAKY_RELU":
            c.b.op(name, [reals[-1]], [y], "LeakyRelu", Alpha=float(np.float32(c.r.uniform(0, 0.5))))
        elif name == "PRELU":
            c.b.op(name, [reals[-1], c.b.const("float32", c.r.uniform(-0.5, 0.5, (1, 1, shape[3])).astype("float32"))], [y])
        elif name in ("RELU", "RELU6", "ABS", "NEG", "TANH"):
            c.b.op(name, [reals[-1]], [y])
        else:
            k = c.b.const("float32", np.float32(c.r.uniform(0.2, 2) * c.choose(-1, 1)))
            ins = [reals[-1], k] if name == "DIV" or c.int(0, 1) else [k, reals[-1]]
            options = "MaximumMinimum" if name in ("MINIMUM", "MAXIMUM") else name.capitalize()
            c.b.op(name, ins, [y], options, **({} if "M" in options[1:] else {"FusedActivationFunction": c.choose(0, 1, 3)}))
        reals.append(y)
    y = c.q(shape, float(np.exp(c.r.uniform(-4, -1))))
    c.b.op("QUANTIZE", [reals[-1]], [y], "Quantize")
    if c.int(0, 1):
        return [x], [y]
    z = c.q(shape, 0.05)
    c.b.op("ADD", [x, y], [z], "Add")
    return [x], [z]


def channel_slopes(c):
    """PRELU in real numbers, as quantisers leave it: slopes of one kind or many, none, steep ones; then an exact table or an addition."""
    shape = (c.int(1, 2), c.int(1, 6), c.int(1, 6), c.choose(c.int(2, 70), c.int(2, 70), c.int(2, 70), 300))
    x = c.q(shape)
    real, sloped = c.b.tensor("float32", shape), c.b.tensor("float32", shape)
    slopes = c.r.uniform(-0.5, 0.5, (1, 1, c.choose(shape[3], shape[3], shape[3], 1))) * (1 if shape[3] > 256 else c.choose(1, 1, 4, 30))
    slopes[c.r.uniform(0, 1, slopes.shape) < 0.1] = c.choose(0, 1, 0.25)
    c.b.op("DEQUANTIZE", [x], [real], "Dequantize")
    c.b.op("PRELU", [real, c.b.const("float32", slopes.astype("float32"))], [sloped])
    y = c.q(shape, float(np.exp(c.r.uniform(-4, -1))))
    c.b.op("QUANTIZE", [sloped], [y], "Quantize")
    if c.int(0, 1):
        return [x], [y]
    z = c.q(shape, 0.05)
    c.b.op("ADD", [x, y], [z], "Add")
    return [x], [z]


def some_without(pairs, which, zero_in, missing=0, find=lower_math.find):
    """Elements without a slope are some in a million: up to 16 others lose theirs, for the table by which these go gives the same bytes."""
    found = find(pairs, which, zero_in, missing)
    if found is not None and missing:
        slopes = found[1]
        slopes[:-1:len(slopes) // 16 + 1] = np.nan
    return found


lower_math.find = some_without


def element_slopes(c):
    """PRELU in real numbers with a slope for each element, row, column or picture, as Keras makes them; then nothing, a table, a part of a larger map."""
    shape = (c.int(1, 2), c.int(1, 6), c.int(2, 6), c.int(1, 20)) if c.int(0, 5) else (c.int(1, 2), 30, c.int(37, 40), 30)
    x = c.q(shape)
    real, sloped, y = c.b.tensor("float32", shape), c.b.tensor("float32", shape), c.q(shape, float(np.exp(c.r.uniform(-4, -1))))
    _, h, w, ch = shape
    form = c.choose((h, w, ch), (h, w, ch), (h, w, 1), (h, 1, 1), (1, w, 1), (1, w, ch), (w, ch), shape)
    few = c.int(0, 3) == 0
    slopes = c.r.choice([-0.25, 0, 0.1, 40], form) if few else c.r.uniform(-0.5, 0.5, form)
    c.b.op("DEQUANTIZE", [x], [real], "Dequantize")
    c.b.op("PRELU", [real, c.b.const("float32", slopes)], [sloped])
    last = sloped
    if few and c.int(0, 1):  # no product: pairs of bytes
        last = c.b.tensor("float32", shape)
        c.b.op("ABS", [sloped], [last])
    c.b.op("QUANTIZE", [last], [y], "Quantize")
    end = c.int(0, 2)
    if end == 0:
        return [x], [y]
    z = c.q(shape[:3] + (2 * ch,) if end == 1 else shape, *c.b.tensors[y][2], *c.b.tensors[y][3])
    if end == 1:
        other = c.q(shape, *c.b.tensors[y][2], *c.b.tensors[y][3])
        c.b.op("CONCATENATION", [y, other], [z], "Concatenation", Axis=3)
        return [x, other], [z]
    else:
        c.b.op("RELU", [y], [z])
    return [x], [z]


operators.CASES.clear()
operators.CASES.update({f.__name__: f for f in (
    conv_uneven, depthwise_uneven, connected_axes, arithmetic_scales, extreme_constant, slice_masks, slice_ellipsis,
    pool_wide, reduce_axes, resize_images, reshape_forms, tile_long, tile_every_axis, offset_weights, constant_functions, wide_layers, wide_images, wide_depthwise,
    unary_ranges, softmax_axes, prelu_forms, matmul_forms, arg_max_cast, up_uneven, pad_long, join_scales, detection_many, one_by_one_chain,
    open_sizes, dilated_by_batches, picture_in_planes, float_islands, channel_slopes, element_slopes)})

if __name__ == "__main__":
    sys.exit(operators.main())
