"""Shapes that a file leaves open (-1 in its shape signature): converters write 1 there and mean whatever comes at run time. The
shapes of the inputs are known, so the others follow, operator by operator."""
import numpy as np

SAME = ("QUANTIZE", "DEQUANTIZE", "CAST", "SOFTMAX", "LOGISTIC", "TANH", "RELU", "RELU6", "LEAKY_RELU", "HARD_SWISH")
BROADCAST = ("ADD", "SUB", "MUL", "MAXIMUM", "MINIMUM", "PRELU")


def _reshape(op, ins):
    if len(ins) > 1:
        wanted = None if ins[1].data is None else np.ravel(ins[1].data)
    else:
        wanted = op.options.NewShapeAsNumpy() if op.options and op.options.NewShapeLength() else None
    if wanted is None:
        return None
    wanted = [int(v) for v in wanted]
    known = int(np.prod([v for v in wanted if v >= 0], dtype=np.int64))
    return [ins[0].size // max(known, 1) if v < 0 else v for v in wanted]


def _fully_connected(op, ins):
    outputs, k = ins[1].shape[-2:]
    if op.options is not None and op.options.KeepNumDims():
        return ins[0].shape[:-1] + (outputs,)
    return ins[0].size // k, outputs


def _matmul(op, ins):
    a, b = ins[0].shape, ins[1].shape
    batch = np.broadcast_shapes(a[:-2], b[:-2])
    return batch + (a[-1] if op.options.AdjX() else a[-2], b[-2] if op.options.AdjY() else b[-1])


def _transpose(op, ins):
    return None if ins[1].data is None else [ins[0].shape[int(i)] for i in np.ravel(ins[1].data)]


RULES = {"RESHAPE": _reshape, "FULLY_CONNECTED": _fully_connected, "BATCH_MATMUL": _matmul, "TRANSPOSE": _transpose}
RULES.update({name: lambda op, ins: ins[0].shape for name in SAME})
RULES.update({name: lambda op, ins: np.broadcast_shapes(ins[0].shape, ins[1].shape) for name in BROADCAST})


def settle(op, tensors):
    """Give an operator's open output its shape where the operator's rule tells it."""
    out = tensors[op.outputs[0]]
    if not out.open or op.name not in RULES:
        return
    shape = RULES[op.name](op, [tensors[t] for t in op.inputs if t >= 0])
    if shape is not None:
        out.shape = tuple(int(v) for v in shape)
