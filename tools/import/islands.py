"""Functions of real numbers between 8-bit tensors, as quantisers leave them where they know no 8-bit form: DEQUANTIZE, functions of one number,
QUANTIZE become a table of 256 bytes, or of all pairs where a slope belongs to each channel or element. Arithmetic is that of the float kernels."""
import numpy as np

import quant
from constant import dequantize_table

f32 = np.float32
TABLE, TABLE_PAIR = "TABLE", "TABLE_PAIR"
ONE = {"RELU": lambda x: max(x, f32(0)), "RELU6": lambda x: min(max(x, f32(0)), f32(6)), "RELU_N1_TO_1": lambda x: min(max(x, f32(-1)), f32(1)),
       "RELU_0_TO_1": lambda x: min(max(x, f32(0)), f32(1)), "ABS": abs, "NEG": lambda x: -x, "EXP": quant.exp_f32, "LOG": quant.log,
       "LOGISTIC": quant.logistic, "TANH": quant.tanh, "ELU": quant.elu, "SQRT": np.sqrt}
TWO = {"ADD": lambda x, y: x + y, "SUB": lambda x, y: x - y, "MUL": lambda x, y: x * y, "DIV": lambda x, y: x / y, "MAXIMUM": max, "MINIMUM": min}
KINDS = 1024  # different slopes whose bytes are computed at a time
ACTIVATIONS = (lambda x: x, ONE["RELU"], ONE["RELU_N1_TO_1"], ONE["RELU6"])


def join(graph):
    made = {t: op for op in graph.ops for t in op.outputs}
    for op in graph.ops:
        if op.name != "QUANTIZE" or graph.tensors[op.inputs[0]].type != "FLOAT32":
            continue
        chain, t = [], op.inputs[0]
        while t in made and made[t].name != "DEQUANTIZE" and step_of(graph, made[t]) is not None:
            chain.append(made[t])
            t = chain[-1].inputs[source_of(graph, chain[-1])]
        if chain and t in made and made[t].name == "DEQUANTIZE" and graph.tensors[made[t].inputs[0]].is8:
            replace(graph, op, made[t].inputs[0], chain[::-1])
    drop_dead(graph)


def source_of(graph, op):
    """Which of an operator's inputs is the computed one."""
    return 1 if op.name in TWO and graph.tensors[op.inputs[0]].data is not None else 0


def step_of(graph, op):
    """What an operator does to a number, None: it is no function of one; of PRELU the slopes in order."""
    tensors = [graph.tensors[t] for t in op.inputs]
    if any(t.type != "FLOAT32" for t in tensors):
        return None
    if op.name in ONE:
        return ONE[op.name]
    if op.name == "LEAKY_RELU":
        alpha = f32(op.options.Alpha())
        return lambda x: x if x > 0 else f32(x * alpha)
    if op.name == "PRELU":
        alpha = tensors[1]
        fits = alpha.data is not None and len(alpha.shape) <= len(tensors[0].shape) and \
            all(a in (1, n) for a, n in zip(alpha.shape[::-1], tensors[0].shape[::-1]))
        return np.ravel(alpha.data).astype(f32) if fits else None
    if op.name in TWO:
        constants = [t for t in tensors if t.data is not None]
        activation = op.options.FusedActivationFunction() if hasattr(op.options, "FusedActivationFunction") else 0
        if len(tensors) != 2 or len(constants) != 1 or constants[0].size != 1 or activation >= len(ACTIVATIONS):
            return None
        k, after, function = f32(np.ravel(constants[0].data)[0]), ACTIVATIONS[activation], TWO[op.name]
        return (lambda x: after(f32(function(k, x)))) if source_of(graph, op) else (lambda x: after(f32(function(x, k))))
    return None


def to_bytes(values, tensor):
    """QUANTIZE of real numbers, in unsigned form; what is no number becomes 0."""
    scaled = (values / tensor.scale0).astype(f32).astype(np.float64)
    whole = np.trunc(scaled)
    rounded = whole + np.where(np.abs(scaled - whole) < 0.5, 0, np.copysign(1, scaled))
    rounded = np.where(np.isfinite(scaled), rounded, np.sign(scaled) * 1e9) + tensor.zero_u8
    return np.where(np.isnan(rounded), 0, np.clip(rounded, 0, 255)).astype(np.uint8)


def each(step, values):
    """A function of one number for all of them, which are many times the same."""
    numbers, where = np.unique(values.view(np.int32), return_inverse=True)  # by bits: zeros have signs
    return np.array([f32(step(x)) for x in numbers.view(f32)], f32)[where].reshape(values.shape)


def through(steps, x, slopes):
    """`x` [n] through all steps, of which one may be PRELU: [n][slopes], float32."""
    x = np.repeat(x.astype(f32)[:, None], len(slopes), 1)
    for step in steps:
        x = np.where(x >= 0, x, x * slopes) if isinstance(step, np.ndarray) else each(step, x)
    return x


def replace(graph, op, source, chain):
    """The QUANTIZE becomes a look-up of the bytes before the DEQUANTIZE."""
    ti, to = graph.tensors[source], graph.tensors[op.outputs[0]]
    steps, slopes = [step_of(graph, o) for o in chain], [o for o in chain if o.name == "PRELU"]
    if len(slopes) > 1 or not to.is8:
        return
    kinds = np.unique(step_of(graph, slopes[0])) if slopes else np.zeros(1, f32)
    table = np.zeros((256, max(len(kinds), 256)), np.uint8)
    with np.errstate(all="ignore"):
        for at in range(0, len(kinds), KINDS):
            some = kinds[at:at + KINDS]
            table[:, at:at + len(some)] = to_bytes(through(steps, dequantize_table(ti), some), to)
    op.inputs, op.options = [source], None
    if len(kinds) == 1:
        op.name, op.custom = TABLE, {"table": table[:, 0].copy(), "end": chain[-1].name}
        return
    few = len(kinds) <= 256
    which = np.searchsorted(kinds, step_of(graph, slopes[0])).astype(np.uint8 if few else np.int32)
    alpha = graph.tensors[slopes[0].inputs[1]]
    shape = (len(which),) if alpha.shape[-1] == len(which) else alpha.shape
    from graph import Tensor
    graph.tensors.append(Tensor(-1, "", "UINT8" if few else "INT32", shape, np.ones(1, f32), np.zeros(1, np.int64), 0, which.reshape(shape)))
    op.name, op.custom = TABLE_PAIR, {"table": table}
    op.inputs.append(len(graph.tensors) - 1)


def drop_dead(graph):
    """Operators that nobody reads any more."""
    needed, kept = set(graph.outputs), []
    for op in reversed(graph.ops):
        if needed & set(op.outputs) or op.name not in (*ONE, *TWO, "LEAKY_RELU", "PRELU", "DEQUANTIZE"):
            needed |= set(op.inputs)
            kept.append(op)
    graph.ops = kept[::-1]
