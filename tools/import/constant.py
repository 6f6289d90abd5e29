"""Operators on shapes and other whole numbers that are known at import: converters leave them where a size was open
(SHAPE, STRIDED_SLICE, PACK before a RESHAPE or TRANSPOSE_CONV). Their results become constants."""
import numpy as np

import shapes
import slices

DTYPES = {"INT32": np.int32, "INT64": np.int64, "FLOAT32": np.float32}
WHOLE = ("INT32", "INT64")


def _strided_slice(op, values):
    x, *spec = values
    first, counts, steps, out = slices.box(op.options, *([int(v) for v in np.ravel(s)] for s in spec), x.shape)
    return x[np.ix_(*(f + s * np.arange(n) for f, n, s in zip(first, counts, steps)))].reshape(out)


EVALUATE = {
    "STRIDED_SLICE": _strided_slice,
    "PACK": lambda op, v: np.stack(v, op.options.Axis()),
    "CONCATENATION": lambda op, v: np.concatenate(v, op.options.Axis()),
    "RESHAPE": lambda op, v: v[0],
    "SQUEEZE": lambda op, v: v[0],
    "EXPAND_DIMS": lambda op, v: v[0],
    "CAST": lambda op, v: v[0],
    "GATHER": lambda op, v: np.take(v[0], v[1], op.options.Axis() if op.options else 0),
    "ADD": lambda op, v: v[0] + v[1],
    "SUB": lambda op, v: v[0] - v[1],
    "MUL": lambda op, v: v[0] * v[1],
    "FLOOR_DIV": lambda op, v: v[0] // v[1],
    "MAXIMUM": lambda op, v: np.maximum(*v),
    "MINIMUM": lambda op, v: np.minimum(*v),
    "REDUCE_PROD": lambda op, v: np.prod(v[0], axis=tuple(np.ravel(v[1])), keepdims=bool(op.options.KeepDims())),
}


def dequantize_table(tensor):
    """Real numbers by byte, multiplied in double as the reference does."""
    return np.array([np.float32(float(tensor.scale0) * (v - tensor.zero_u8)) for v in range(256)], np.float32)


def fold(graph):
    """Evaluate what can be; the operators that stay keep their numbers."""
    left = []
    for op in graph.ops:
        shapes.settle(op, graph.tensors)
        tensors = [graph.tensors[t] for t in op.inputs if t >= 0]
        out = graph.tensors[op.outputs[0]]
        value = None
        if op.name == "SHAPE":
            value = np.array(tensors[0].shape)
        elif op.name == "DEQUANTIZE" and tensors[0].is8 and tensors[0].data is not None:
            value = dequantize_table(tensors[0])[tensors[0].unsigned()]
        elif op.name in EVALUATE and out.type in WHOLE and all(t.data is not None and t.type in WHOLE for t in tensors):
            value = EVALUATE[op.name](op, [t.data for t in tensors])
        if value is None or np.size(value) != out.size:
            left.append(op)
        else:
            out.data = np.asarray(value, DTYPES[out.type]).reshape(out.shape)
    graph.ops = left
