"""One small model for each operator of the list, drawn at random: its inputs and outputs. operators.py compares them."""
import numpy as np


def out_size(size, kernel, stride, dilation, padding):
    return -(-size // stride) if padding == 0 else (size - (kernel - 1) * dilation - 1) // stride + 1


def window(c, kernel_max=5):
    kh, kw = c.int(1, kernel_max), c.int(1, kernel_max)
    stride = c.int(1, 3)
    dilation = c.int(1, 3) if stride == 1 else 1
    h, w = (kh - 1) * dilation + 1 + c.int(0, 9), (kw - 1) * dilation + 1 + c.int(0, 9)
    padding = c.int(0, 1)
    return kh, kw, stride, c.int(1, 3) if stride > 1 else stride, dilation, h, w, padding


def conv_2d(c):
    kh, kw, sy, sx, d, h, w, padding = window(c)
    groups = c.choose(1, 1, 1, 2)
    ic, oc = c.int(1, 40) * groups, c.int(1, 40) * groups
    if c.int(0, 2) == 0:
        kh = kw = sy = sx = d = 1
    scale_in = 0.03
    x = c.q((c.int(1, 2), h, w, ic), scale_in)
    weights, scales = c.weights((oc, kh, kw, ic // groups), oc, 0)
    oh, ow = out_size(h, kh, sy, d, padding), out_size(w, kw, sx, d, padding)
    batch = c.b.tensors[x][1][0]
    y = c.q((batch, oh, ow, oc), scale_in * float(np.mean(scales)) * 60 * np.sqrt(kh * kw * ic))
    c.b.op("CONV_2D", [x, weights, c.bias(oc, scale_in, scales)], [y], "Conv2D", StrideH=sy, StrideW=sx,
           DilationHFactor=d, DilationWFactor=d, Padding=padding, FusedActivationFunction=c.choose(0, 1, 3))
    return [x], [y]


def depthwise_conv_2d(c):
    kh, kw, sy, sx, d, h, w, padding = window(c)
    sx = sy
    ic, multiplier = c.int(1, 70), c.choose(1, 1, 2, 4)
    if c.int(0, 3) == 0:
        ic, multiplier = 1, c.int(1, 9)
    oc = ic * multiplier
    scale_in = 0.03
    x = c.q((1, h, w, ic), scale_in)
    weights, scales = c.weights((1, kh, kw, oc), oc, 3)
    y = c.q((1, out_size(h, kh, sy, d, padding), out_size(w, kw, sx, d, padding), oc),
            scale_in * float(np.mean(scales)) * 60 * np.sqrt(kh * kw))
    c.b.op("DEPTHWISE_CONV_2D", [x, weights, c.bias(oc, scale_in, scales)], [y], "DepthwiseConv2D", StrideH=sy,
           StrideW=sx, DilationHFactor=d, DilationWFactor=d, Padding=padding, DepthMultiplier=multiplier,
           FusedActivationFunction=c.choose(0, 1, 3))
    return [x], [y]


def pad_conv(c):
    """PAD merged into the convolution, and a SiLU after it."""
    ic, oc = c.int(1, 20), c.int(1, 20)
    h, w = c.int(3, 12), c.int(3, 12)
    x = c.q((1, h, w, ic), 0.03)
    zero = c.b.tensors[x][3][0]
    p = [c.int(0, 2) for _ in range(4)]
    mid = c.q((1, h + p[0] + p[1], w + p[2] + p[3], ic), 0.03, zero)
    c.b.op("PAD", [x, c.b.const("int32", [[0, 0], p[:2], p[2:], [0, 0]])], [mid], "Pad")
    weights, scales = c.weights((oc, 3, 3, ic), oc, 0)
    shape = (1, h + p[0] + p[1] - 2, w + p[2] + p[3] - 2, oc)
    y = c.q(shape, 0.06)
    c.b.op("CONV_2D", [mid, weights, c.bias(oc, 0.03, scales)], [y], "Conv2D", StrideH=1, StrideW=1,
           DilationHFactor=1, DilationWFactor=1, Padding=1)
    s = c.q(shape, 1 / 256, 0 if c.dtype == "uint8" else -128)
    c.b.op("LOGISTIC", [y], [s])
    z = c.q(shape, 0.04)
    c.b.op("MUL", [y, s], [z], "Mul")
    return [x], [z]


def fully_connected(c):
    batch, k, oc = c.int(1, 5), c.int(1, 200), c.int(1, 60)
    x = c.q((batch, k), 0.03)
    weights, scales = c.weights((oc, k), oc, 0)
    y = c.q((batch, oc), 0.03 * float(np.mean(scales)) * 60 * np.sqrt(k))
    c.b.op("FULLY_CONNECTED", [x, weights, c.bias(oc, 0.03, scales)], [y], "FullyConnected",
           FusedActivationFunction=c.choose(0, 1, 3))
    return [x], [y]


def broadcast_shapes(c):
    full = [c.int(1, 9) for _ in range(c.int(1, 4))]
    other = list(full)
    if c.int(0, 1):
        for i in range(len(other)):
            if c.int(0, 1):
                other[i] = 1
    if c.int(0, 3) == 0:
        other = other[c.int(0, len(other) - 1):]
    return full, other


def arithmetic(name):
    def build(c):
        full, other = broadcast_shapes(c)
        if c.int(0, 1) and name != "SUB":
            full, other = other, full
        shape = np.broadcast_shapes(full, other)
        a = c.q(full, 0.05)
        b = c.q(other, 0.03, data=c.values(other) if c.int(0, 1) else None)
        y = c.q(shape, 0.07 if name != "MUL" else 0.05)
        c.b.op(name, [a, b], [y], name.capitalize(), FusedActivationFunction=c.choose(0, 1, 3))
        return ([a] if c.b.tensors[b][4] is not None else [a, b]), [y]
    return build


def extreme(name):
    def build(c):
        full, other = broadcast_shapes(c)
        a = c.q(full, 0.05, 3)
        b = c.q(other, 0.05, 3)
        y = c.q(np.broadcast_shapes(full, other), 0.05, 3)
        c.b.op(name, [a, b], [y], "MaximumMinimum")
        return [a, b], [y]
    return build


def concatenation(c):
    rank, n = c.int(2, 4), c.int(2, 4)
    shape = [c.int(1, 7) for _ in range(rank)]
    axis = c.int(0, rank - 1)
    ins, total = [], 0
    for _ in range(n):
        part = list(shape)
        part[axis] = c.int(1, 6)
        total += part[axis]
        ins.append(c.q(part) if c.dtype == "uint8" else c.q(part, 0.05, 3))
    shape[axis] = total
    y = c.q(shape, 0.05, 3)
    c.b.op("CONCATENATION", ins, [y], "Concatenation", Axis=axis - c.choose(0, rank))
    return ins, [y]


def split(c):
    parts, each = c.int(1, 4), c.int(1, 5)
    rank = c.int(1, 4)
    shape = [c.int(1, 6) for _ in range(rank)]
    axis = c.int(0, rank - 1)
    shape[axis] = parts * each
    x = c.q(shape, 0.05, 3)
    shape[axis] = each
    outs = [c.q(shape, 0.05, 3) for _ in range(parts)]
    c.b.op("SPLIT", [c.b.const("int32", [axis]), x], outs, "Split", NumSplits=parts)
    return [x], outs


def pack(c):
    n, rank = c.int(1, 4), c.int(1, 3)
    shape = [c.int(1, 6) for _ in range(rank)]
    axis = c.int(0, rank)
    ins = [c.q(shape, 0.05, 3) for _ in range(n)]
    y = c.q(shape[:axis] + [n] + shape[axis:], 0.05, 3)
    c.b.op("PACK", ins, [y], "Pack", ValuesCount=n, Axis=axis)
    return ins, [y]


def unpack(c):
    rank = c.int(2, 4)
    shape = [c.int(1, 6) for _ in range(rank)]
    axis = c.int(0, rank - 1)
    x = c.q(shape, 0.05, 3)
    outs = [c.q(shape[:axis] + shape[axis + 1:], 0.05, 3) for _ in range(shape[axis])]
    c.b.op("UNPACK", [x], outs, "Unpack", Num=shape[axis], Axis=axis)
    return [x], outs


def pad(c):
    rank = c.int(1, 4)
    shape = [c.int(1, 7) for _ in range(rank)]
    pads = [[c.int(0, 3), c.int(0, 3)] for _ in range(rank)]
    x = c.q(shape, 0.05, 3)
    y = c.q([n + a + b for n, (a, b) in zip(shape, pads)], 0.05, 3)
    c.b.op("PAD", [x, c.b.const("int32", pads)], [y], "Pad")
    return [x], [y]


def pad_value(c):
    (x,), (y,) = pad(c)
    name, inputs, outputs, _, fields, custom = c.b.ops.pop()
    value = c.b.tensor(c.dtype, (1,), 0.05, 3, c.values((1,)))
    c.b.op("PADV2", inputs + [value], outputs, "PadV2")
    return [x], [y]


def slice_(c):
    rank = c.int(1, 4)
    shape = [c.int(1, 20) for _ in range(rank)]
    first = [c.int(0, n - 1) for n in shape]
    sizes = [c.int(1, n - f) for n, f in zip(shape, first)]
    x, y = c.q(shape, 0.05, 3), c.q(sizes, 0.05, 3)
    said = [-1 if f + n == m and c.int(0, 1) else n for f, n, m in zip(first, sizes, shape)]
    c.b.op("SLICE", [x, c.b.const("int32", first), c.b.const("int32", said)], [y], "Slice")
    return [x], [y]


def gather(c):
    rank = c.int(1, 4)
    shape = [c.int(1, 12) for _ in range(rank)]
    axis, count = c.int(0, rank - 1), c.int(1, 20)
    indices = c.choose([c.int(0, shape[axis] - 1) for _ in range(count)], list(range(shape[axis])))
    x = c.q(shape, 0.05, 3)
    y = c.q([*shape[:axis], len(indices), *shape[axis + 1:]], 0.05, 3)
    c.b.op("GATHER", [x, c.b.const("int32", indices)], [y], "Gather", Axis=axis)
    return [x], [y]


def gather_nd(c):
    """Places in the first axes, in order, apart, or twice; what lies behind them may be a number or a row."""
    shape = [c.int(2, 5) for _ in range(c.int(2, 4))]
    depth = c.int(1, len(shape))
    rows = [[c.int(0, n - 1) for n in shape[:depth]] for _ in range(c.int(1, 9))]
    x, y = c.q(shape), None
    _, _, scales, zeros, _, _ = c.b.tensors[x]
    y = c.q([len(rows), *shape[depth:]], scales[0], zeros[0])
    c.b.op("GATHER_ND", [x, c.b.const("int32", rows)], [y], "GatherNd")
    return [x], [y]


def signed(build):
    """Operators that the reference has for int8 alone."""
    def built(c):
        c.kind = c.dtype = "int8"
        return build(c)
    return built


def unsigned(build):
    """Operators that the reference has for uint8 alone."""
    def built(c):
        c.kind = c.dtype = "uint8"
        return build(c)
    return built


def pool(name):
    def build(c):
        kh, kw, sy, sx, _, h, w, padding = window(c)
        h, w = max(h, kh), max(w, kw)
        ch = c.int(1, 80)
        scale, zero = 0.05, c.zero()
        x = c.q((c.int(1, 2), h, w, ch), scale, zero)
        y = c.q((c.b.tensors[x][1][0], out_size(h, kh, sy, 1, padding), out_size(w, kw, sx, 1, padding), ch), scale,
                zero)
        c.b.op(name, [x], [y], "Pool2D", StrideH=sy, StrideW=sx, FilterHeight=kh, FilterWidth=kw, Padding=padding,
               FusedActivationFunction=c.choose(0, 1, 3))
        return [x], [y]
    return build


def reduction(name):
    def build(c):
        rank = c.int(2, 4)
        shape = [c.int(1, 9) for _ in range(rank)]
        axes = sorted(set(c.int(0, rank - 1) for _ in range(c.int(1, rank))))
        keep = c.int(0, 1)
        out = [1 if i in axes else n for i, n in enumerate(shape) if keep or i not in axes]
        same = name not in ("MEAN", "SUM")
        x = c.q(shape, 0.05, 3)
        coarse = 0.05 * c.choose(1, float(np.exp(c.r.uniform(-1, 6)))) if name == "SUM" else None
        y = c.q(out, 0.05 if same else coarse, 3 if same or coarse == 0.05 else None)
        c.b.op(name, [x, c.b.const("int32", axes)], [y], "Reducer", KeepDims=bool(keep))
        return [x], [y]
    return build


def resize(name):
    def build(c):
        h, w, oh, ow, ch = (c.int(1, 12) for _ in range(5))
        align = c.int(0, 1)
        half = 0 if align else c.int(0, 1)
        x = c.q((1, h, w, ch), 0.05, 3)
        y = c.q((1, oh, ow, ch), 0.05, 3)
        options = "ResizeBilinear" if name == "RESIZE_BILINEAR" else "ResizeNearestNeighbor"
        c.b.op(name, [x, c.b.const("int32", [oh, ow])], [y], options, AlignCorners=bool(align),
               HalfPixelCenters=bool(half))
        return [x], [y]
    return build


def reshape(c):
    shape = [c.int(1, 6) for _ in range(3)]
    x = c.q(shape, 0.05, 3)
    new = [shape[0] * shape[1], shape[2]]
    y = c.q(new, 0.05, 3)
    c.b.op("RESHAPE", [x, c.b.const("int32", new)], [y], "Reshape", NewShape=new)
    return [x], [y]


def transpose(c):
    rank = c.int(2, 5)
    shape = [c.int(1, 7) for _ in range(rank)]
    order = [int(v) for v in c.r.permutation(rank)]
    x = c.q(shape, 0.05, 3)
    y = c.q([shape[i] for i in order], 0.05, 3)
    c.b.op("TRANSPOSE", [x, c.b.const("int32", order)], [y], "Transpose")
    return [x], [y]


def strided_slice(c):
    rank = c.int(1, 4)
    shape = [c.int(1, 9) for _ in range(rank)]
    begin, end, stride, out = [], [], [], []
    for n in shape:
        s = c.choose(1, 1, 2, 3, -1, -2)
        a, b = sorted((c.int(0, n - 1), c.int(0, n - 1)))
        if s > 0:
            begin.append(a), end.append(b + 1)
            out.append(len(range(a, b + 1, s)))
        else:
            begin.append(b), end.append(a - 1 if a > 0 else -n - 1)
            out.append(len(range(b, a - 1, s)))
        stride.append(s)
    mask = c.choose(0, 0, 1)
    if mask:
        begin[0] = 0 if stride[0] > 0 else shape[0] - 1
        stop = end[0] if end[0] >= -shape[0] else -1
        out[0] = len(range(begin[0], stop, stride[0]))
        begin[0] = c.int(0, 3)
    shrink = c.choose(0, 0, 1) if rank > 1 else 0
    final = list(out)
    if shrink:
        stride[-1], end[-1] = 1, begin[-1] + 1
        final.pop()
    x = c.q(shape, 0.05, 3)
    y = c.q(final, 0.05, 3)
    c.b.op("STRIDED_SLICE", [x] + [c.b.const("int32", v) for v in (begin, end, stride)], [y], "StridedSlice",
           BeginMask=mask, EndMask=0, EllipsisMask=0, NewAxisMask=0, ShrinkAxisMask=shrink << (rank - 1))
    return [x], [y]


def tile(c):
    rank = c.int(1, 3)
    shape = [c.int(1, 6) for _ in range(rank)]
    times = [c.int(1, 3) for _ in range(rank)]
    x = c.q(shape, 0.05, 3)
    y = c.q([a * b for a, b in zip(shape, times)], 0.05, 3)
    c.b.op("TILE", [x, c.b.const("int32", times)], [y], "Tile")
    return [x], [y]


def unary(name, options=None, out=None, **fields):
    def build(c):
        shape = [c.int(1, 9) for _ in range(c.int(1, 4))]
        x = c.q(shape, float(np.exp(c.r.uniform(-4, -1.5))))
        low = 0 if c.dtype == "uint8" else -128
        scale, zero = {"unit": (1 / 256, low), "sign": (1 / 128, low + 128), None: (None, None)}[out]
        if name == "HARD_SWISH":
            scale = c.b.tensors[x][2][0] * 0.9
        y = c.q(shape, scale, zero)
        c.b.op(name, [x], [y], options, **{k: (float(np.float32(c.r.uniform(0.01, 0.4))) if v is None else v)
                                           for k, v in fields.items()})
        return [x], [y]
    return build


def root(name):
    """Of what is not below zero: the reference stops there."""
    def build(c):
        shape = [c.int(1, 9) for _ in range(c.int(1, 4))]
        x, y = c.q(shape, float(np.exp(c.r.uniform(-5, -2))), -128), c.q(shape)
        c.b.op(name, [x], [y])
        return [x], [y]
    return build


def divide(c):
    """Divisors of either sign but not 0, which stops the reference. Quotients of 1 step by 1 step are 64 steps and more: below, its
    shifts may pass 31 bits, which C leaves undefined."""
    full, other = broadcast_shapes(c)
    if c.int(0, 1):
        full, other = other, full
    scales, fine = [float(np.exp(c.r.uniform(-5, -1))) for _ in range(2)], float(np.exp(c.r.uniform(4.2, 8)))
    zero = c.int(0, 255)
    drawn = c.values(other)
    data = np.where(drawn == zero, drawn ^ 1, drawn) if c.int(0, 2) else None
    a, b = c.q(full, scales[0]), c.q(other, scales[1], zero if data is not None else c.choose(0, 255), data=data)
    y = c.q(np.broadcast_shapes(full, other), scales[0] / scales[1] / fine)
    c.b.op("DIV", [a, b], [y], "Div", FusedActivationFunction=c.choose(0, 1, 3))
    return ([a] if data is not None else [a, b]), [y]


def normalisation(c):
    """Rows of zeros and of one value among them."""
    shape = [c.int(1, 5) for _ in range(c.int(0, 3))] + [c.choose(1, 3, c.int(2, 200), c.int(300, 3000))]
    low = 0 if c.dtype == "uint8" else -128
    x, y = c.q(shape), c.q(shape, 1 / 128, low + 128)
    c.b.op("L2_NORMALIZATION", [x], [y], "L2Norm", FusedActivationFunction=0)
    return [x], [y]


def softmax(c):
    shape = [c.int(1, 5) for _ in range(c.int(0, 2))] + [c.int(1, 60)]
    x = c.q([1] + shape, float(np.exp(c.r.uniform(-4, 0))))
    y = c.q([1] + shape, 1 / 256, 0 if c.dtype == "uint8" else -128)
    c.b.op("SOFTMAX", [x], [y], "Softmax", Beta=c.choose(1.0, 1.0, 0.5))
    return [x], [y]


def prelu(c):
    h, w, ch = c.int(1, 9), c.int(1, 9), c.int(1, 30)
    x = c.q((1, h, w, ch), 0.05)
    alpha_shape = c.choose((1, 1, ch), (1, 1, 1), (h, w, ch))
    alpha = c.q(alpha_shape, 0.01, data=c.values(alpha_shape))
    y = c.q((1, h, w, ch), 0.04)
    c.b.op("PRELU", [x, alpha], [y])
    return [x], [y]


def quantize(c):
    shape = [c.int(1, 9), c.int(1, 9)]
    if c.int(0, 1):
        x = c.b.tensor("float32", shape)
        y = c.q(shape, 0.01)
    else:
        x = c.q(shape, 0.05)
        c.dtype = c.choose("uint8", "int8")
        y = c.q(shape, 0.03)
    c.b.op("QUANTIZE", [x], [y], "Quantize")
    return [x], [y]


def dequantize(c):
    shape = [c.int(1, 9), c.int(1, 9)]
    x = c.q(shape)
    y = c.b.tensor("float32", shape)
    c.b.op("DEQUANTIZE", [x], [y], "Dequantize")
    return [x], [y]


def batch_matmul(c):
    batch = [c.int(1, 3) for _ in range(c.int(0, 2))]
    m, k, n = c.int(1, 9), c.int(1, 30), c.int(1, 9)
    adj_x, adj_y = c.int(0, 1), c.int(0, 1)
    a = c.q(batch + ([k, m] if adj_x else [m, k]), 0.05)
    b = c.q(batch + ([n, k] if adj_y else [k, n]), 0.04)
    y = c.q(batch + [m, n], 0.05 * 0.04 * 60 * np.sqrt(k))
    c.b.op("BATCH_MATMUL", [a, b], [y], "BatchMatMul", AdjX=bool(adj_x), AdjY=bool(adj_y))
    return [a, b], [y]


def computed_weights(c):
    """Fully connected layers whose weights are computed: products of matrices as older converters write them."""
    m, k, n = c.int(1, 60), c.int(1, 70), c.int(1, 40)
    a, b = c.q((m, k), 0.05), c.q((k, n), 0.04)
    turned = c.q((n, k), 0.04, c.b.tensors[b][3][0])
    c.b.op("TRANSPOSE", [b, c.b.const("int32", [1, 0])], [turned], "Transpose")
    y = c.q((m, n), 0.05 * 0.04 * c.choose(3, 60, 900) * np.sqrt(k))
    c.b.op("FULLY_CONNECTED", [a, turned, c.bias(n, 0.05, [0.04]) if c.int(0, 1) else -1], [y], "FullyConnected",
           FusedActivationFunction=c.choose(0, 1, 2, 3))
    s = c.q((m, n), 1 / 256, 0 if c.dtype == "uint8" else -128)
    c.b.op("SOFTMAX", [y], [s], "Softmax", Beta=1.0)
    z = c.q((m, k), 0.04)
    c.b.op("FULLY_CONNECTED", [s, b, -1], [z], "FullyConnected")
    return [a, b], [y, z]


def arg_max(c):
    rank = c.int(1, 4)
    shape = [c.int(1, 9) for _ in range(rank)]
    axis = c.int(0, rank - 1)
    out = c.choose("int32", "int64")
    x = c.q(shape)
    y = c.b.tensor(out, shape[:axis] + shape[axis + 1:])
    c.b.op("ARG_MAX", [x, c.b.const("int32", axis)], [y], "ArgMax",
           OutputType=2 if out == "int32" else 4)
    return [x], [y]


def cast(c):
    shape = [c.int(1, 9), c.int(1, 9)]
    x = c.b.tensor(c.dtype, shape)
    out = c.choose("float32", "int32", "uint8" if c.dtype == "int8" else "int8", "int64")
    types = {"float32": 0, "int32": 2, "uint8": 3, "int64": 4, "int8": 9}
    y = c.b.tensor(out, shape)
    c.b.op("CAST", [x], [y], "Cast", InDataType=types[c.dtype], OutDataType=types[out])
    return [x], [y]


def space_to_depth(c):
    block = c.int(1, 3)
    h, w, ch = c.int(1, 4), c.int(1, 4), c.int(1, 6)
    x = c.q((c.int(1, 2), h * block, w * block, ch), 0.05, 3)
    y = c.q((c.b.tensors[x][1][0], h, w, ch * block * block), 0.05, 3)
    c.b.op("SPACE_TO_DEPTH", [x], [y], "SpaceToDepth", BlockSize=block)
    return [x], [y]


def transpose_conv(c):
    kh, kw, stride = c.int(1, 4), c.int(1, 4), c.int(1, 3)
    h, w, ic, oc = c.int(1, 6), c.int(1, 6), c.int(1, 12), c.int(1, 12)
    padding = c.int(0, 1)
    shape = (1, h * stride, w * stride, oc) if padding == 0 else \
        (1, h * stride + max(kh - stride, 0), w * stride + max(kw - stride, 0), oc)
    x = c.q((1, h, w, ic), 0.03)
    weights, scales = c.weights((oc, kh, kw, ic), oc, 0)
    y = c.q(shape, 0.03 * float(np.mean(scales)) * 60 * np.sqrt(kh * kw * ic))
    ins = [c.b.const("int32", shape), weights, x]
    if c.int(0, 1):
        ins.append(c.bias(oc, 0.03, scales))
    c.b.op("TRANSPOSE_CONV", ins, [y], "TransposeConv", StrideH=stride, StrideW=stride, Padding=padding)
    return [x], [y]


def detection(c):
    from flatbuffers import flexbuffers
    n, classes = c.int(5, 60), c.int(1, 8)
    per, limit = 1, c.int(1, 20)  # with more, the reference's order of equal scores is that of its partial sort
    regular = bool(c.int(0, 1))
    box = c.q((1, n, 4), 0.08)
    score = c.q((1, n, classes + 1), 1 / 256, 0 if c.dtype == "uint8" else -128)
    anchors = c.q((n, 4), 1 / 256, 0 if c.dtype == "uint8" else -128, data=c.values((n, 4)))
    slots = limit * per
    outs = [c.b.tensor("float32", s) for s in ((1, slots, 4), (1, slots), (1, slots), (1,))]
    options = flexbuffers.Dumps({"max_detections": limit, "max_classes_per_detection": per, "num_classes": classes,
                                 "detections_per_class": 10, "nms_score_threshold": 0.3, "nms_iou_threshold": 0.5,
                                 "y_scale": 10.0, "x_scale": 10.0, "h_scale": 5.0, "w_scale": 5.0,
                                 "use_regular_nms": regular})
    c.b.op("TFLite_Detection_PostProcess", [box, score, anchors], outs, custom=bytes(options))
    return [box, score], outs


CASES = {
    "CONV_2D": conv_2d, "DEPTHWISE_CONV_2D": depthwise_conv_2d, "PAD+CONV+SILU": pad_conv,
    "FULLY_CONNECTED": fully_connected, "ADD": arithmetic("ADD"), "SUB": arithmetic("SUB"), "MUL": arithmetic("MUL"),
    "MAXIMUM": extreme("MAXIMUM"), "MINIMUM": extreme("MINIMUM"), "CONCATENATION": concatenation, "SPLIT": split,
    "PACK": pack, "UNPACK": unpack, "PAD": pad, "MAX_POOL_2D": pool("MAX_POOL_2D"),
    "AVERAGE_POOL_2D": pool("AVERAGE_POOL_2D"), "MEAN": reduction("MEAN"), "REDUCE_MAX": reduction("REDUCE_MAX"),
    "RESIZE_NEAREST_NEIGHBOR": resize("RESIZE_NEAREST_NEIGHBOR"), "RESIZE_BILINEAR": resize("RESIZE_BILINEAR"),
    "RESHAPE": reshape, "TRANSPOSE": transpose, "STRIDED_SLICE": strided_slice, "TILE": tile,
    "LOGISTIC": unary("LOGISTIC", out="unit"), "TANH": unary("TANH", out="sign"), "SOFTMAX": softmax,
    "RELU": unary("RELU"), "RELU6": unary("RELU6"), "PRELU": prelu,
    "LEAKY_RELU": unary("LEAKY_RELU", "LeakyRelu", Alpha=None), "HARD_SWISH": unary("HARD_SWISH"),
    "QUANTIZE": quantize, "DEQUANTIZE": dequantize, "BATCH_MATMUL": batch_matmul, "ARG_MAX": arg_max, "CAST": cast,
    "SPACE_TO_DEPTH": space_to_depth, "TRANSPOSE_CONV": transpose_conv, "TFLite_Detection_PostProcess": detection,
    "FULLY_CONNECTED, computed": computed_weights, "SLICE": slice_, "GATHER": gather, "PADV2": pad_value,
    "EXP": signed(unary("EXP", "Exp")), "LOG": signed(unary("LOG")), "ABS": signed(unary("ABS", "Abs")), "GELU": unary("GELU", "Gelu"),
    "NEG": signed(unary("NEG", "Neg")), "SQRT": signed(root("SQRT")), "RSQRT": signed(root("RSQRT")),
    "ELU": signed(unary("ELU")), "GATHER_ND": gather_nd, "GELU, approximate": unary("GELU", "Gelu", Approximate=True),
    "SUM": reduction("SUM"), "DIV": unsigned(divide), "L2_NORMALIZATION": normalisation,
}
