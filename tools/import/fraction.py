"""Which elements of a network's tensors are fractions, numbers from 0 to 1 whatever the picture: those that LOGISTIC or SOFTMAX made, followed
through the operators that only move them. A score is one; a coordinate, a coefficient of a mask or an angle is not."""
import numpy as np

import slices
from graph import FAULTS

SAME = ("QUANTIZE", "DEQUANTIZE", "RELU", "RELU6")  # element by element
SHAPED = ("RESHAPE", "SQUEEZE", "EXPAND_DIMS")
BOTH = ("MUL", "MAXIMUM", "MINIMUM")


def _constants(graph, tensors):
    return [[int(v) for v in np.ravel(graph.tensors[t].data)] for t in tensors]


def _split(graph, op, known, mask):
    t_axis, t_in = (op.inputs[0], op.inputs[1]) if op.name == "SPLIT" else (op.inputs[2], op.inputs[0])
    axis = _constants(graph, [t_axis])[0][0] % mask(t_in).ndim
    ends = np.cumsum([graph.tensors[t].shape[axis] for t in op.outputs])[:-1]
    known.update(zip(op.outputs, np.split(mask(t_in), ends, axis)))


def _moved(graph, op, mask):
    """The mask of the first output of an operator that moves elements; None: it does more."""
    ins = op.inputs
    if op.name in ("LOGISTIC", "SOFTMAX") or op.custom.get("end") == "LOGISTIC":
        return np.ones(graph.tensors[op.outputs[0]].shape, bool)
    if op.name in SAME:
        return mask(ins[0])
    if op.name in SHAPED:
        return mask(ins[0]).reshape(graph.tensors[op.outputs[0]].shape)
    if op.name in BOTH:
        return np.logical_and(*np.broadcast_arrays(mask(ins[0]), mask(ins[1])))
    if op.name == "CONCATENATION":
        return np.concatenate([mask(t) for t in ins], op.options.Axis())
    if op.name == "PACK":
        return np.stack([mask(t) for t in ins], op.options.Axis())
    if op.name == "TRANSPOSE":
        return mask(ins[0]).transpose(_constants(graph, ins[1:2])[0])
    if op.name == "STRIDED_SLICE":
        m = mask(ins[0])
        first, counts, steps, out = slices.box(op.options, *_constants(graph, ins[1:4]), m.shape)
        return m[np.ix_(*(f + s * np.arange(n) for f, n, s in zip(first, counts, steps)))].reshape(out)
    if op.name == "SLICE":
        first, counts = _constants(graph, ins[1:3])
        return mask(ins[0])[tuple(slice(f, None if n < 0 else f + n) for f, n in zip(first, counts))]
    if op.name == "GATHER":
        return np.take(mask(ins[0]), graph.tensors[ins[1]].data, op.options.Axis() if op.options else 0)
    if op.name == "GATHER_ND":
        places = graph.tensors[ins[1]].data
        return mask(ins[0])[tuple(np.moveaxis(places, -1, 0))]
    return None


def of(graph):
    """For each tensor a boolean array of its shape."""
    known = {}

    def mask(t):
        return known[t] if t in known else np.zeros(graph.tensors[t].shape, bool)
    for op in graph.ops:
        if op.name not in ("LOGISTIC", "SOFTMAX", "TABLE") and not any(t in known for t in op.inputs):
            continue
        try:
            if op.name in ("SPLIT", "SPLIT_V"):
                _split(graph, op, known, mask)
                continue
            found = _moved(graph, op, mask)
            if found is not None and found.shape == tuple(graph.tensors[op.outputs[0]].shape):
                known[op.outputs[0]] = found
        except FAULTS:  # what does not fit is named when the operators are translated
            continue
    return mask
