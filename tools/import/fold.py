"""What can be merged without changing a bit: 8-bit functions of one value, and padding before a convolution."""
import numpy as np

import quant

CONVOLUTIONS = ("CONV_2D", "DEPTHWISE_CONV_2D")
RELU_BOUNDS = {"RELU": (0.0, None), "RELU6": (0.0, 6.0), "RELU_N1_TO_1": (-1.0, 1.0), "RELU_0_TO_1": (0.0, 1.0)}
REAL = {"LOGISTIC": quant.logistic, "TANH": quant.tanh, "EXP": quant.exp_f32, "LOG": quant.log}  # tables by float arithmetic
ROOTS = {"SQRT": quant.square_root, "RSQRT": quant.rsqrt}
BINARIES = ("ADD", "SUB", "MUL", "MAXIMUM", "MINIMUM", "PRELU", "DIV")


def binary_params(name, ta, tb, to, activation):
    low, high = quant.activation_range(activation, to.scale0, to.zero_u8)
    p = {"zero_a": ta.zero_u8, "zero_b": tb.zero_u8, "zero_out": to.zero_u8, "act_min": low, "act_max": high}
    if name in ("ADD", "SUB"):
        (p["m_a"], p["s_a"]), (p["m_b"], p["s_b"]), (p["m_out"], p["s_out"]) = \
            quant.add_params(ta.scale0, tb.scale0, to.scale0)
    elif name == "MUL":
        p["m_out"], p["s_out"] = quant.mul_params(ta.scale0, tb.scale0, to.scale0)
    elif name == "DIV":
        p["m_out"], p["s_out"] = quant.div_params(ta.scale0, tb.scale0, to.scale0)
    elif name == "PRELU":
        p["m_a"], p["s_a"] = quant.quantize_multiplier(float(np.float32(ta.scale0 / to.scale0)))
        p["m_out"], p["s_out"] = quant.mul_params(ta.scale0, tb.scale0, to.scale0)
    return p


def is_refused(op, ta):
    """DIV is for uint8 alone: LiteRT has no other to compare with."""
    return op.name == "DIV" and ta.type != "UINT8"


def activation_of(op):
    return op.options.FusedActivationFunction() if op.options is not None and \
        hasattr(op.options, "FusedActivationFunction") else 0


class Folder:
    def __init__(self, graph):
        self.g = graph
        self.consumers = {}
        for op in graph.ops:
            for t in op.inputs:
                if t >= 0:
                    self.consumers.setdefault(t, []).append(op)

    def const(self, t):
        return t >= 0 and self.g.tensors[t].data is not None

    def unary_table(self, op):
        """Input tensor and table when the operator is an 8-bit function of one 8-bit value, else None."""
        g = self.g
        if not op.outputs or not op.inputs or op.inputs[0] < 0:
            return None
        ti, to = g.tensors[op.inputs[0]], g.tensors[op.outputs[0]]
        if op.name in BINARIES:
            return self._constant_operand(op)
        if not (ti.is8 and to.is8):
            return None
        s_in, z_in, s_out, z_out = ti.scale0, ti.zero_u8, to.scale0, to.zero_u8
        if op.name == "TABLE":  # islands.py
            return op.inputs[0], op.custom["table"]
        if op.name in REAL:
            return op.inputs[0], quant.float_table(ti, to, REAL[op.name])
        if op.name == "GELU":
            approximate = op.options is not None and op.options.Approximate()
            return op.inputs[0], quant.float_table(ti, to, quant.gelu_approximate if approximate else quant.gelu)
        if op.name == "ELU" and ti.signed:
            return op.inputs[0], quant.float_table(ti, to, quant.elu)
        if op.name == "ABS" and ti.signed:
            return op.inputs[0], quant.absolute(s_in, z_in, s_out, z_out)
        if op.name == "NEG" and ti.signed:
            return op.inputs[0], quant.negative()
        if op.name in ROOTS and ti.signed:
            return op.inputs[0], ROOTS[op.name](s_in, z_in, s_out, z_out)
        if op.name in RELU_BOUNDS:
            return op.inputs[0], quant.relu(s_in, z_in, s_out, z_out, *RELU_BOUNDS[op.name])
        if op.name == "LEAKY_RELU":
            return op.inputs[0], quant.leaky_relu(s_in, z_in, s_out, z_out, np.float32(op.options.Alpha()))
        if op.name == "HARD_SWISH":
            return op.inputs[0], quant.hard_swish(s_in, z_in, s_out, z_out)
        if op.name == "QUANTIZE":
            return op.inputs[0], quant.requantize(s_in, z_in, s_out, z_out)
        if op.name == "CAST":
            shift = to.bias8 - ti.bias8
            return op.inputs[0], ((np.arange(256) + shift) % 256).astype(np.uint8)
        return None

    def _constant_operand(self, op):
        g = self.g
        a, b = op.inputs[:2]
        ta, tb, to = g.tensors[a], g.tensors[b], g.tensors[op.outputs[0]]
        if not (ta.is8 and tb.is8 and to.is8) or is_refused(op, ta):
            return None
        p = binary_params(op.name, ta, tb, to, activation_of(op))
        if a == b:
            return a, quant.table(lambda v: quant.binary(op.name, p, v, v))
        if tb.data is not None and tb.size == 1 and ta.data is None and ta.size == to.size:
            k = int(tb.unsigned().ravel()[0])
            return a, quant.table(lambda v: quant.binary(op.name, p, v, k))
        if ta.data is not None and ta.size == 1 and tb.data is None and tb.size == to.size and op.name != "PRELU":
            k = int(ta.unsigned().ravel()[0])
            return b, quant.table(lambda v: quant.binary(op.name, p, k, v))
        return None

    def chain(self, t):
        """Follow 8-bit functions from tensor t as long as nothing else looks at it.
        Returns the last tensor, the table (None when nothing was merged) and the operators merged."""
        table, merged = None, []
        while t not in self.g.outputs:
            users = self.consumers.get(t, [])
            step = None
            if len(users) == 1:
                found = self.unary_table(users[0])
                if found is not None and found[0] == t:
                    step = users[0].outputs[0], found[1], [users[0]]
            elif len(users) == 2:
                step = self._gate(t, users)
            if step is None:
                break
            t, next_table, ops = step
            table = next_table if table is None else next_table[table]
            merged += ops
        return t, table, merged

    def _gate(self, t, users):
        """x f(x) with f an 8-bit function, as in SiLU and hard-swish written out."""
        gate, mul = users if users[1].name in BINARIES else users[::-1]
        found = self.unary_table(gate)
        if found is None or mul.name not in BINARIES or mul.name == "PRELU":
            return None
        inner = gate.outputs[0]
        if sorted(mul.inputs[:2]) != sorted([t, inner]) or self.consumers.get(inner, []) != [mul] or \
                inner in self.g.outputs or gate is mul:
            return None
        ta, tb, to = (self.g.tensors[i] for i in (mul.inputs[0], mul.inputs[1], mul.outputs[0]))
        if not (ta.is8 and tb.is8 and to.is8) or is_refused(mul, ta):
            return None
        p = binary_params(mul.name, ta, tb, to, activation_of(mul))
        f = found[1]
        if mul.inputs[0] == t:
            table = quant.table(lambda v: quant.binary(mul.name, p, v, int(f[v])))
        else:
            table = quant.table(lambda v: quant.binary(mul.name, p, int(f[v]), v))
        return mul.outputs[0], table, [gate, mul]

    def padding(self, op):
        """(top, left) of a PAD that every consumer can take over, else None. The pad value is the zero point."""
        g = self.g
        if op.name != "PAD" or not self.const(op.inputs[1]) or op.outputs[0] in g.outputs:
            return None
        ti, to = g.tensors[op.inputs[0]], g.tensors[op.outputs[0]]
        pads = g.tensors[op.inputs[1]].data
        if len(ti.shape) != 4 or not ti.is8 or ti.zero_u8 != to.zero_u8 or ti.scale0 != to.scale0:
            return None
        if pads[0].any() or pads[3].any():
            return None
        users = self.consumers.get(op.outputs[0], [])
        if not users or any(u.name not in CONVOLUTIONS or u.inputs[0] != op.outputs[0] for u in users):
            return None
        return int(pads[1][0]), int(pads[2][0])
