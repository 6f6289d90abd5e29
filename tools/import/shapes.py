"""Shapes that a file leaves open (-1 in its shape signature): converters write 1 there and mean whatever comes at run time. The
shapes of the inputs are known, so the others follow, operator by operator."""
import numpy as np

import slices

SAME = ("QUANTIZE", "DEQUANTIZE", "CAST", "SOFTMAX", "LOGISTIC", "TANH", "RELU", "RELU6", "RELU_N1_TO_1", "RELU_0_TO_1",
        "LEAKY_RELU", "HARD_SWISH", "EXP", "LOG", "ABS", "GELU", "NEG", "SQRT", "RSQRT", "ELU", "L2_NORMALIZATION")
BROADCAST = ("ADD", "SUB", "MUL", "MAXIMUM", "MINIMUM", "PRELU", "DIV")


def _numbers(tensor):
    return [int(v) for v in np.ravel(tensor.data)]


def _window(o, size, kernel, dilation):
    """Rows and columns that come out; padding 0 is SAME."""
    if o.Padding() == 0:
        return [-(-n // s) for n, s in zip(size, (o.StrideH(), o.StrideW()))]
    return [(n - (k - 1) * d - 1) // s + 1 for n, k, d, s in zip(size, kernel, dilation, (o.StrideH(), o.StrideW()))]


def _conv(op, ins):
    batch, *size, _ = ins[0].shape
    kernel, o = ins[1].shape[1:3], op.options
    channels = ins[1].shape[0 if op.name == "CONV_2D" else 3]
    return [batch, *_window(o, size, kernel, (o.DilationHFactor(), o.DilationWFactor())), channels]


def _pool(op, ins):
    batch, *size, channels = ins[0].shape
    return [batch, *_window(op.options, size, (op.options.FilterHeight(), op.options.FilterWidth()), (1, 1)), channels]


def _reshape(op, ins):
    if len(ins) > 1:
        wanted = _numbers(ins[1])
    else:
        wanted = [int(v) for v in op.options.NewShapeAsNumpy()]
    known = int(np.prod([v for v in wanted if v >= 0], dtype=np.int64))
    return [ins[0].size // max(known, 1) if v < 0 else v for v in wanted]


def _squeeze(op, ins):
    shape, o = ins[0].shape, op.options
    gone = [int(a) % len(shape) for a in o.SqueezeDimsAsNumpy()] if o is not None and o.SqueezeDimsLength() else \
        [i for i, n in enumerate(shape) if n == 1]
    return [n for i, n in enumerate(shape) if i not in gone]


def _expand_dims(op, ins):
    shape, (axis,) = list(ins[0].shape), _numbers(ins[1])
    shape.insert(axis if axis >= 0 else len(shape) + 1 + axis, 1)
    return shape


def _fully_connected(op, ins):
    outputs, k = ins[1].shape[-2:]
    if op.options is not None and op.options.KeepNumDims():
        return ins[0].shape[:-1] + (outputs,)
    return ins[0].size // k, outputs


def _matmul(op, ins):
    a, b = ins[0].shape, ins[1].shape
    batch = np.broadcast_shapes(a[:-2], b[:-2])
    return batch + (a[-1] if op.options.AdjX() else a[-2], b[-2] if op.options.AdjY() else b[-1])


def _concatenation(op, ins):
    shape = list(ins[0].shape)
    axis = op.options.Axis() % len(shape)
    shape[axis] = sum(t.shape[axis] for t in ins)
    return shape


def _pack(op, ins):
    shape, axis = list(ins[0].shape), op.options.Axis()
    shape.insert(axis if axis >= 0 else len(shape) + 1 + axis, len(ins))
    return shape


def _unpack(op, ins):
    shape = list(ins[0].shape)
    del shape[op.options.Axis() % len(shape)]
    return shape


def _reduce(op, ins):
    shape = ins[0].shape
    axes = {a % len(shape) for a in _numbers(ins[1])}
    return [1 if i in axes else n for i, n in enumerate(shape) if op.options.KeepDims() or i not in axes]


def _arg_max(op, ins):
    shape = list(ins[0].shape)
    del shape[_numbers(ins[1])[0] % len(shape)]
    return shape


def _strided_slice(op, ins):
    return slices.box(op.options, *(_numbers(t) for t in ins[1:4]), ins[0].shape)[3]


def _slice(op, ins):
    return [n - first if size < 0 else size for first, size, n in zip(_numbers(ins[1]), _numbers(ins[2]), ins[0].shape)]


def _gather(op, ins):
    shape, axis = ins[0].shape, (op.options.Axis() if op.options else 0) % len(ins[0].shape)
    return [*shape[:axis], *ins[1].shape, *shape[axis + 1:]]


def _gather_nd(op, ins):
    places = ins[1].shape
    return [*places[:-1], *ins[0].shape[places[-1]:]]


def _pad(op, ins):
    return [n + sum(p) for n, p in zip(ins[0].shape, np.reshape(_numbers(ins[1]), (-1, 2)))]


def _space_to_depth(op, ins):
    (n, h, w, c), b = ins[0].shape, op.options.BlockSize()
    return [n, h // b, w // b, c * b * b] if op.name == "SPACE_TO_DEPTH" else [n, h * b, w * b, c // (b * b)]


def _batches(op, ins):
    (n, *size, c), block = ins[0].shape, _numbers(ins[1])
    margins = [sum(pair) for pair in np.reshape(_numbers(ins[2]), (-1, 2))]
    images = int(np.prod(block))
    if op.name == "SPACE_TO_BATCH_ND":
        return [n * images, *((s + m) // b for s, m, b in zip(size, margins, block)), c]
    return [n // images, *(s * b - m for s, m, b in zip(size, margins, block)), c]


def _split(op, ins):
    """Shapes of all outputs."""
    axis, x = ins if op.name == "SPLIT" else (ins[2], ins[0])
    at = _numbers(axis)[0] % len(x.shape)
    whole, count = x.shape[at], len(op.outputs)
    sizes = [whole // count] * count if op.name == "SPLIT" else _numbers(ins[1])
    rest = whole - sum(s for s in sizes if s >= 0)
    return [[*x.shape[:at], rest if s < 0 else s, *x.shape[at + 1:]] for s in sizes]


RULES = {"CONV_2D": _conv, "DEPTHWISE_CONV_2D": _conv, "MAX_POOL_2D": _pool, "AVERAGE_POOL_2D": _pool,
         "TRANSPOSE_CONV": lambda op, ins: _numbers(ins[0]), "FULLY_CONNECTED": _fully_connected, "BATCH_MATMUL": _matmul,
         "RESHAPE": _reshape, "SQUEEZE": _squeeze, "EXPAND_DIMS": _expand_dims, "CONCATENATION": _concatenation,
         "PACK": _pack, "UNPACK": _unpack, "STRIDED_SLICE": _strided_slice,
         "TRANSPOSE": lambda op, ins: [ins[0].shape[i] for i in _numbers(ins[1])],
         "PAD": _pad, "PADV2": _pad, "SLICE": _slice, "GATHER": _gather, "GATHER_ND": _gather_nd,
         "TILE": lambda op, ins: [n * k for n, k in zip(ins[0].shape, _numbers(ins[1]))],
         "MEAN": _reduce, "SUM": _reduce, "REDUCE_MAX": _reduce, "REDUCE_MIN": _reduce, "ARG_MAX": _arg_max, "ARG_MIN": _arg_max,
         "SPACE_TO_DEPTH": _space_to_depth, "DEPTH_TO_SPACE": _space_to_depth, "SPACE_TO_BATCH_ND": _batches,
         "BATCH_TO_SPACE_ND": _batches, "SHAPE": lambda op, ins: [len(ins[0].shape)]}
RULES.update({name: lambda op, ins: [ins[0].shape[0], *_numbers(ins[1]), ins[0].shape[3]]
              for name in ("RESIZE_BILINEAR", "RESIZE_NEAREST_NEIGHBOR")})
RULES.update({name: lambda op, ins: ins[0].shape for name in SAME})
RULES.update({name: lambda op, ins: np.broadcast_shapes(ins[0].shape, ins[1].shape) for name in BROADCAST})
CONSTANTS = {"RESHAPE": [1], "EXPAND_DIMS": [1], "TRANSPOSE": [1], "PAD": [1], "PADV2": [1], "SLICE": [1, 2], "TILE": [1], "MEAN": [1], "SUM": [1], "REDUCE_MAX": [1],
             "REDUCE_MIN": [1], "ARG_MAX": [1], "ARG_MIN": [1], "RESIZE_BILINEAR": [1], "RESIZE_NEAREST_NEIGHBOR": [1],
             "TRANSPOSE_CONV": [0], "STRIDED_SLICE": [1, 2, 3], "SPACE_TO_BATCH_ND": [1, 2], "BATCH_TO_SPACE_ND": [1, 2],
             "SPLIT": [0], "SPLIT_V": [1, 2]}  # inputs that the rules need to know


def settle(op, tensors):
    """Give an operator's open outputs their shapes where the operator's rule tells them. What does not fit stays as it is: the
    walk over the operators names it."""
    outs, ins = [tensors[t] for t in op.outputs], [tensors[t] for t in op.inputs if t >= 0]
    known = all(i >= len(ins) or ins[i].data is not None for i in CONSTANTS.get(op.name, ()))
    if not any(t.open for t in outs) or not known:
        return
    try:
        if op.name in ("SPLIT", "SPLIT_V"):
            made = _split(op, ins)
        elif op.name in RULES:
            made = [RULES[op.name](op, ins)] * len(outs)
        else:
            return
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
        return
    for out, shape in zip(outs, made):
        if out.open:
            out.shape, out.open = tuple(int(v) for v in shape), False
