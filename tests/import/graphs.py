"""Networks drawn at random from the operators of the list: branches, joins, several inputs and outputs, intermediate results that are
outputs as well, odd and wide sizes. The same proof as in operators.py: every output bit for bit against the reference interpreter.

    python3 tests/import/graphs.py [--set c|avx2|...] [--rounds N] [NAME...]"""
import sys

import numpy as np

import operators
from operator_cases import out_size

LIMIT = 60000  # bytes of a tensor: the reference is slow


class Drawing:
    """A graph under construction: `open` holds the images that operators may read next, `used` those that some have read."""

    def __init__(self, c, wide):
        self.c, self.wide = c, wide
        self.inputs, self.open, self.used, self.ends = [], [], set(), []
        for _ in range(c.choose(1, 1, 2)):
            side = c.int(40, 150) if wide else c.int(1, 24)
            self.inputs.append(self.new((1, side, c.int(40, 200) if wide else c.int(1, 24), c.choose(1, 3, 4) if wide else c.int(1, 40)), 0.03))
            self.open.append(self.inputs[-1])

    def shape(self, t):
        return self.c.b.tensors[t][1]

    def scale(self, t):
        return self.c.b.tensors[t][2][0]

    def zero(self, t):
        return self.c.b.tensors[t][3][0]

    def low(self):
        return 0 if self.c.dtype == "uint8" else -128

    def new(self, shape, scale, zero=None):
        return self.c.q([int(n) for n in shape], float(scale), zero)

    def like(self, t, shape=None):
        return self.new(shape or self.shape(t), self.scale(t), self.zero(t))

    def pick(self, fits=lambda shape: True):
        """An image to read, mostly a late one; None when none fits."""
        good = [t for t in self.open if fits(self.shape(t))]
        if not good:
            return None
        t = good[-1] if self.c.int(0, 2) else self.c.choose(*good)
        self.used.add(t)
        return t

    def op(self, name, ins, out, options=None, **fields):
        self.c.b.op(name, ins, [out], options, **fields)
        return out

    def ints(self, values):
        return self.c.b.const("int32", [int(v) for v in values])

    def as_scale(self, t, scale, zero):
        """The tensor brought to another scale by QUANTIZE where it has another."""
        if (self.scale(t), self.zero(t)) == (scale, zero):
            return t
        return self.op("QUANTIZE", [t], self.new(self.shape(t), scale, zero), "Quantize")


def window_of(d, h, w):
    """Kernel, strides, dilations and padding that leave at least one pixel."""
    c = d.c
    padding = c.int(0, 1)
    kh, kw = c.choose((1, 1), (1, 1), (3, 3), (3, 3), (2, 2), (5, 5), (1, c.int(1, 7)), (c.int(1, 7), 1), (c.int(1, 6), c.int(1, 6)))
    sy, sx = c.choose((1, 1), (1, 1), (2, 2), (c.int(1, 4), c.int(1, 4)))
    dy, dx = (c.int(1, 4), c.int(1, 4)) if (sy, sx) == (1, 1) and c.int(0, 4) == 0 else (1, 1)
    if padding and (h < (kh - 1) * dy + 1 or w < (kw - 1) * dx + 1):
        padding = 0
    return kh, kw, sy, sx, dy, dx, padding


def conv(d, x):
    c = d.c
    _, h, w, ic = d.shape(x)
    kh, kw, sy, sx, dy, dx, padding = window_of(d, h, w)
    oh, ow = out_size(h, kh, sy, dy, padding), out_size(w, kw, sx, dx, padding)
    oc = min(c.choose(c.int(1, 20), 8 * c.int(1, 12), c.int(1, 150)), max(1, LIMIT // (oh * ow)))
    weights, scales = c.weights((oc, kh, kw, ic), oc, 0)
    y = d.new((1, oh, ow, oc), d.scale(x) * float(np.mean(scales)) * 60 * np.sqrt(kh * kw * ic))
    return d.op("CONV_2D", [x, weights, c.bias(oc, d.scale(x), scales)], y, "Conv2D", StrideH=sy, StrideW=sx, DilationHFactor=dy,
                DilationWFactor=dx, Padding=padding, FusedActivationFunction=c.choose(0, 0, 1, 3))


def depthwise(d, x):
    c = d.c
    _, h, w, ic = d.shape(x)
    kh, kw, sy, sx, dy, dx, padding = window_of(d, h, w)
    oh, ow = out_size(h, kh, sy, dy, padding), out_size(w, kw, sx, dx, padding)
    multiplier = c.choose(1, 1, 1, 2, 3) if ic * oh * ow * 3 < LIMIT else 1
    oc = ic * multiplier
    weights, scales = c.weights((1, kh, kw, oc), oc, 3)
    y = d.new((1, oh, ow, oc), d.scale(x) * float(np.mean(scales)) * 60 * np.sqrt(kh * kw))
    return d.op("DEPTHWISE_CONV_2D", [x, weights, c.bias(oc, d.scale(x), scales)], y, "DepthwiseConv2D", StrideH=sy, StrideW=sx,
                DilationHFactor=dy, DilationWFactor=dx, Padding=padding, DepthMultiplier=multiplier,
                FusedActivationFunction=c.choose(0, 0, 1, 3))


def padded(d, x):
    c = d.c
    _, h, w, ch = d.shape(x)
    p = [[c.int(0, 2), c.int(0, 3)] for _ in range(2)]
    y = d.like(x, (1, h + sum(p[0]), w + sum(p[1]), ch))
    c.b.op("PAD", [x, c.b.const("int32", [[0, 0], *p, [0, 0]])], [y], "Pad")
    return conv(d, y) if c.int(0, 1) else depthwise(d, y) if c.int(0, 1) else y


def pool(d, x):
    c = d.c
    _, h, w, ch = d.shape(x)
    kh, kw, sy, sx, _, _, padding = window_of(d, h, w)
    y = d.like(x, (1, out_size(h, kh, sy, 1, padding), out_size(w, kw, sx, 1, padding), ch))
    return d.op(c.choose("MAX_POOL_2D", "AVERAGE_POOL_2D"), [x], y, "Pool2D", StrideH=sy, StrideW=sx, FilterHeight=kh, FilterWidth=kw,
                Padding=padding, FusedActivationFunction=c.choose(0, 0, 0, 1, 3))


def arithmetic(d, x):
    """With another image, one that broadcasts, a constant, a scalar or itself."""
    c = d.c
    name, shape = c.choose("ADD", "ADD", "SUB", "MUL", "MAXIMUM", "MINIMUM"), d.shape(x)
    other = [t for t in d.open if t != x and len(d.shape(t)) == 4 and
             all(a in (1, b) for a, b in zip(d.shape(t), shape))]
    extreme = name in ("MAXIMUM", "MINIMUM")
    if other and c.int(0, 3):
        b = c.choose(*other)
        d.used.add(b)
        if extreme:
            b = d.as_scale(b, d.scale(x), d.zero(x))
    elif c.int(0, 4) == 0:
        b = x
    else:
        form = c.choose((), (1,), (shape[3],), (1, 1, 1, shape[3]), (1, shape[1], 1, 1), shape)
        same = (d.scale(x), d.zero(x)) if extreme else (d.scale(x) * float(np.exp(c.r.uniform(-1, 1))), None)
        b = c.q(form, *same, data=c.values(form))
    scale = d.scale(x) if extreme else 100 * d.scale(x) * d.scale(b) if name == "MUL" else max(d.scale(x), d.scale(b)) * 1.3
    y = d.new(shape, scale, d.zero(x) if extreme else None)
    ins = [x, b] if name == "SUB" or c.int(0, 1) else [b, x]
    if extreme:
        return d.op(name, ins, y, "MaximumMinimum")
    return d.op(name, ins, y, name.capitalize(), FusedActivationFunction=c.choose(0, 0, 1, 3))


def function(d, x):
    c = d.c
    name = c.choose("LOGISTIC", "TANH", "RELU", "RELU6", "LEAKY_RELU", "HARD_SWISH", "QUANTIZE")
    if name in ("LOGISTIC", "TANH"):
        y = d.new(d.shape(x), *((1 / 256, d.low()) if name == "LOGISTIC" else (1 / 128, d.low() + 128)))
    else:
        y = d.new(d.shape(x), d.scale(x) * float(np.exp(c.r.uniform(-0.7, 0.3))))
    if name == "LEAKY_RELU":
        return d.op(name, [x], y, "LeakyRelu", Alpha=float(np.float32(c.r.uniform(0.01, 0.4))))
    return d.op(name, [x], y, "Quantize" if name == "QUANTIZE" else None)


def gate(d, x):
    """x sigmoid(x), or x hard-sigmoid of its mean."""
    c = d.c
    g = x
    if c.int(0, 1):
        g = d.new((1, 1, 1, d.shape(x)[3]), d.scale(x) * 0.3)
        c.b.op("MEAN", [x, d.ints([1, 2])], [g], "Reducer", KeepDims=True)
        g = conv(d, g) if c.int(0, 1) else g
        if d.shape(g)[3] != d.shape(x)[3]:
            return g
    s = d.op("LOGISTIC", [g], d.new(d.shape(g), 1 / 256, d.low()))
    return d.op("MUL", c.choose([x, s], [s, x]), d.new(d.shape(x), d.scale(x) * 0.8), "Mul")


def prelu(d, x):
    c = d.c
    _, _, w, ch = d.shape(x)
    form = c.choose((1, 1, ch), (ch,), (1, w, ch))
    return d.op("PRELU", [x, c.q(form, 0.004, data=c.values(form))], d.new(d.shape(x), d.scale(x) * 0.8))


def join(d, x):
    """Concatenation over channels, or over rows, of what lies at hand."""
    c = d.c
    axis = c.choose(3, 3, 3, 1)
    fits = [t for t in d.open if len(d.shape(t)) == 4 and all(a == b for i, (a, b) in enumerate(zip(d.shape(t), d.shape(x))) if i != axis)]
    parts = [x] + [c.choose(*fits) for _ in range(c.int(1, 3))]
    d.used.update(parts)
    if c.dtype == "int8" or c.int(0, 1):
        parts = [d.as_scale(t, d.scale(x), d.zero(x)) for t in parts]
    shape = list(d.shape(x))
    shape[axis] = sum(d.shape(t)[axis] for t in parts)
    if np.prod(shape) > 2 * LIMIT:
        return None
    return d.op("CONCATENATION", parts, d.like(x, shape), "Concatenation", Axis=axis, FusedActivationFunction=0)


def divided(d, x):
    c = d.c
    axis = c.choose(3, 3, 1, 2)
    n = d.shape(x)[axis]
    ways = [k for k in (2, 3, 4, n) if n % k == 0 and 1 < k <= 8]
    if not ways:
        return None
    k, part = c.choose(*ways), list(d.shape(x))
    part[axis] //= k
    outs = [d.like(x, part) for _ in range(k)]
    c.b.op("SPLIT", [d.ints([axis]), x], outs, "Split", NumSplits=k)
    d.open += outs[1:]
    return outs[0]


def sliced(d, x):
    c = d.c
    begin, end, stride, out = [0], [1], [1], [1]
    for n in d.shape(x)[1:]:
        a, b = sorted((c.int(0, n - 1), c.int(0, n - 1))) if c.int(0, 2) == 0 else (0, n - 1)
        s = c.choose(1, 1, 2)
        begin.append(a), end.append(c.choose(b + 1, b + 1 - n) if b + 1 < n else n), stride.append(s)
        out.append(len(range(a, b + 1, s)))
    return d.op("STRIDED_SLICE", [x] + [d.ints(v) for v in (begin, end, stride)], d.like(x, out), "StridedSlice", BeginMask=c.int(0, 1),
                EndMask=c.int(0, 1), EllipsisMask=0, NewAxisMask=0, ShrinkAxisMask=0)


def resized(d, x):
    c = d.c
    _, h, w, ch = d.shape(x)
    oh, ow = c.choose((2 * h, 2 * w), (h + c.int(0, 5), w + c.int(0, 5)), (c.int(1, 2 * h), c.int(1, 2 * w)), (4 * h, 3 * w))
    if oh * ow * ch > LIMIT:
        return None
    name, align = c.choose("ResizeBilinear", "ResizeNearestNeighbor"), c.int(0, 3) == 0
    return d.op({"ResizeBilinear": "RESIZE_BILINEAR"}.get(name, "RESIZE_NEAREST_NEIGHBOR"), [x, d.ints([oh, ow])],
                d.like(x, (1, oh, ow, ch)), name, AlignCorners=align, HalfPixelCenters=bool(not align and c.int(0, 1)))


def up(d, x):
    c = d.c
    _, h, w, ic = d.shape(x)
    kh, kw, sy, sx, padding = c.int(1, 5), c.int(1, 5), c.int(1, 3), c.int(1, 3), c.int(0, 1)
    oh, ow = (h * sy, w * sx) if padding == 0 else (h * sy + max(kh - sy, 0), w * sx + max(kw - sx, 0))
    oc = min(c.int(1, 70), LIMIT // (oh * ow))
    if oc < 1 or oh * ow * oc * ic * kh * kw > 2e7:
        return None
    weights, scales = c.weights((oc, kh, kw, ic), oc, 0)
    y = d.new((1, oh, ow, oc), d.scale(x) * float(np.mean(scales)) * 60 * np.sqrt(ic * max(1, kh * kw / sy / sx)))
    return d.op("TRANSPOSE_CONV", [d.ints((1, oh, ow, oc)), weights, x] + ([c.bias(oc, d.scale(x), scales)] if c.int(0, 1) else []), y,
                "TransposeConv", StrideH=sy, StrideW=sx, Padding=padding, FusedActivationFunction=c.choose(0, 1))


def to_depth(d, x):
    c = d.c
    _, h, w, ch = d.shape(x)
    ways = [b for b in (2, 3) if h % b == 0 and w % b == 0]
    if not ways:
        return None
    b = c.choose(*ways)
    return d.op("SPACE_TO_DEPTH", [x], d.like(x, (1, h // b, w // b, ch * b * b)), "SpaceToDepth", BlockSize=b)


def turned(d, x):
    """Axes exchanged, or channels shuffled through five axes."""
    c = d.c
    shape = d.shape(x)
    if shape[3] % 2 or c.int(0, 1):
        order = [0] + [1 + int(v) for v in c.r.permutation(3)]
        return d.op("TRANSPOSE", [x, d.ints(order)], d.like(x, [shape[i] for i in order]), "Transpose")
    parts = d.like(x, (*shape[:3], 2, shape[3] // 2))
    mixed = d.like(x, (*shape[:3], shape[3] // 2, 2))
    d.op("RESHAPE", [x, d.ints(d.shape(parts))], parts, "Reshape", NewShape=list(d.shape(parts)))
    d.op("TRANSPOSE", [parts, d.ints([0, 1, 2, 4, 3])], mixed, "Transpose")
    return d.op("RESHAPE", [mixed, d.ints(shape)], d.like(x), "Reshape", NewShape=list(shape))


def tiled(d, x):
    c = d.c
    times = [1] + [c.choose(1, 1, 2, 3) for _ in range(3)]
    if np.prod(d.shape(x)) * np.prod(times) > LIMIT:
        return None
    return d.op("TILE", [x, d.ints(times)], d.like(x, [a * b for a, b in zip(d.shape(x), times)]), "Tile")


def stacked(d, x):
    """UNPACK of rows or columns and PACK of some of them."""
    c = d.c
    axis, shape = c.choose(1, 2), d.shape(x)
    if shape[axis] > 30:
        return None
    part = [n for i, n in enumerate(shape) if i != axis]
    outs = [d.like(x, part) for _ in range(shape[axis])]
    c.b.op("UNPACK", [x], outs, "Unpack", Num=len(outs), Axis=axis)
    some = [c.choose(*outs) for _ in range(c.int(1, 4))]
    at = c.int(1, 3)
    return d.op("PACK", some, d.like(x, part[:at] + [len(some)] + part[at:]), "Pack", ValuesCount=len(some), Axis=at)


def reduced(d, x):
    c = d.c
    axes = c.choose([1, 2], [1, 2], [1], [2], [3], [-1])
    shape = [1 if i in axes or i - 4 in axes else n for i, n in enumerate(d.shape(x))]
    if c.int(0, 1):
        return d.op("REDUCE_MAX", [x, d.ints(axes)], d.like(x, shape), "Reducer", KeepDims=True)
    return d.op("MEAN", [x, d.ints(axes)], d.new(shape, d.scale(x) * c.choose(1, 0.5, 0.13)), "Reducer", KeepDims=True)


# ---- ends: what makes no image any more ------------------------------------------------------------------------------

def connected(d, x):
    c = d.c
    shape = d.shape(x)
    k = shape[3] if c.int(0, 1) else int(np.prod(shape))
    if k > 20000:
        k = shape[3]
    rows, oc = int(np.prod(shape)) // k, c.int(1, 50)
    if rows * oc > LIMIT:
        return None
    flat = d.op("RESHAPE", [x, d.ints((rows, k))], d.like(x, (rows, k)), "Reshape", NewShape=[rows, k])
    weights, scales = c.weights((oc, k), oc, 0)
    y = d.new((rows, oc), d.scale(x) * float(np.mean(scales)) * 60 * np.sqrt(k))
    return d.op("FULLY_CONNECTED", [flat, weights, c.bias(oc, d.scale(x), scales)], y, "FullyConnected",
                FusedActivationFunction=c.choose(0, 1, 3))


def softmax(d, x):
    shape = d.shape(x)
    bent = d.like(x, (shape[1] * shape[2], shape[3]))
    d.op("RESHAPE", [x, d.ints(d.shape(bent))], bent, "Reshape", NewShape=list(d.shape(bent)))
    y = d.op("SOFTMAX", [bent], d.new(d.shape(bent), 1 / 256, d.low()), "Softmax", Beta=1.0)
    if d.c.int(0, 1):
        return y
    real = d.c.b.tensor("float32", d.shape(y))
    return d.op("DEQUANTIZE", [y], real, "Dequantize")


def attention(d, x):
    """Rows against rows: transpose, product, softmax, product. The reference's product is for int8."""
    c, shape = d.c, d.shape(x)
    n, k = shape[1] * shape[2], shape[3]
    if c.dtype == "uint8" or n > 150 or k < 2:
        return None
    bent = d.op("RESHAPE", [x, d.ints((1, n, k))], d.like(x, (1, n, k)), "Reshape", NewShape=[1, n, k])
    turned_ = d.op("TRANSPOSE", [bent, d.ints([0, 2, 1])], d.like(x, (1, k, n)), "Transpose")
    product = d.op("BATCH_MATMUL", [bent, turned_], d.new((1, n, n), d.scale(x) ** 2 * 60 * np.sqrt(k)), "BatchMatMul", AdjX=False, AdjY=False)
    share = d.op("SOFTMAX", [product], d.new((1, n, n), 1 / 256, -128), "Softmax", Beta=1.0)
    return d.op("BATCH_MATMUL", [share, bent], d.new((1, n, k), d.scale(x)), "BatchMatMul", AdjX=False, AdjY=False)


def largest(d, x):
    c, shape = d.c, d.shape(x)
    axis, kind = c.choose(3, 3, 1, 2), c.choose("int32", "int64")
    y = c.b.tensor(kind, [n for i, n in enumerate(shape) if i != axis])
    return d.op("ARG_MAX", [x, c.b.const("int32", axis)], y, "ArgMax", OutputType=2 if kind == "int32" else 4)


def flat_mean(d, x):
    c, shape = d.c, d.shape(x)
    return d.op(c.choose("MEAN", "REDUCE_MAX") if c.int(0, 1) else "MEAN", [x, d.ints([1, 2])], d.like(x, (1, shape[3])), "Reducer",
                KeepDims=False)


STEPS = (conv, conv, conv, depthwise, depthwise, padded, pool, arithmetic, arithmetic, arithmetic, function, gate, prelu, join, join,
         divided, sliced, resized, up, to_depth, turned, tiled, stacked, reduced)
ENDS = (connected, softmax, attention, largest, flat_mean)


def graph(c, wide=False):
    """Eight to forty operators; what no operator reads is an output, and now and then something that one does read."""
    d = Drawing(c, wide)
    for _ in range(c.int(3, 10) if wide else c.int(5, 30)):
        x = d.pick()
        y = STEPS[c.int(0, len(STEPS) - 1)](d, x)
        if y is not None:
            d.open.append(y)
    for _ in range(c.int(0, 3)):
        y = ENDS[c.int(0, len(ENDS) - 1)](d, d.pick())
        if y is not None:
            d.ends.append(y)
    read = {t for op in c.b.ops for t in op[1]}
    written = [t for op in c.b.ops for t in op[2]]
    outputs = [t for t in written if t not in read or (c.int(0, 9) == 0 and c.b.tensors[t][0] == c.dtype)][-15:]
    inputs = [t for t in d.inputs if t in read]
    return inputs, outputs


def wide(c):
    """Large images and many channels, where kernels work in their full blocks."""
    return graph(c, True)


operators.CASES.clear()
operators.CASES.update({"graph": graph, "wide": wide})

if __name__ == "__main__":
    sys.exit(operators.main())
