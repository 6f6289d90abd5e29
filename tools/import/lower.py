"""From the .tflite graph to the engine's operators: the walk, views, and the table of operators."""
import numpy as np

import quant
from fold import Folder
from graph import FAULTS, ImportProblem, REFUSAL_MAX
from layout import ARENA_SLACK, TYPE_BYTES
from net import Net

UNARY = ("LOGISTIC", "TANH", "RELU", "RELU6", "RELU_N1_TO_1", "RELU_0_TO_1", "LEAKY_RELU", "HARD_SWISH", "EXP", "LOG", "GELU", "ABS", "NEG", "SQRT", "RSQRT", "ELU", "TABLE")


REAL = ("FLOAT32", "INT16")
REMEDY = ": export without it, or end before it: --outputs NAME"


def shortened(text, most=REFUSAL_MAX):
    return text if len(text) <= most else text[:most - 3] + "..."


class Lowering:
    """Holds the walk's state: which engine value stands for each tensor of the file."""

    def __init__(self, graph, fold=True):
        self.g = graph
        self.net = Net()
        self.known = set()       # names of the operators that there are
        self.folder = Folder(graph)
        self.fold = fold
        self.val = {}            # tensor -> value
        self.pads = {}           # tensor -> (top, left) taken over by its consumers
        self.skip = set()        # operators merged into others
        self.place = {}          # tensor -> (concat tensor, channel offset)
        self.concat_storage = {}
        self.before_dequantize, self.unread = self.detection_inputs()

    def detection_inputs(self):
        """Real inputs of detection post-processing with the 8-bit tensors that they are made of, which it reads itself; and the
        operators between, where nothing else needs them."""
        made = {op.outputs[0]: op for op in self.g.ops if op.outputs}
        found, between = {}, []
        for op in self.g.ops:
            for t in op.inputs[:2] if op.name == "TFLite_Detection_PostProcess" else ():
                path = [t]
                while path[-1] in made and made[path[-1]].name in ("RESHAPE", "SQUEEZE", "EXPAND_DIMS"):
                    path.append(made[path[-1]].inputs[0])
                if path[-1] in made and made[path[-1]].name == "DEQUANTIZE":
                    found[t] = made[path[-1]].inputs[0]
                    between += path
        needed = set(self.g.outputs)
        for op in reversed(self.g.ops):
            if op.name != "TFLite_Detection_PostProcess" and (needed.intersection(op.outputs) or not set(op.outputs) <= set(between)):
                needed.update(op.inputs)
        return found, {made[t].index for t in between if t not in needed}

    # ---- values ------------------------------------------------------------------------------------------------
    def tensor(self, t):
        return self.g.tensors[t]

    def const_int(self, t, op, what):
        tensor = self.tensor(t)
        if tensor.data is None:
            raise ImportProblem(f"operator {op.index} {op.name}: {what} is computed at run time; only constants work")
        return [int(v) for v in np.ravel(tensor.data)]

    def input(self, t):
        """The value of tensor t, wherever it lies."""
        if t not in self.val:
            tensor = self.tensor(t)
            if tensor.data is None:
                raise ImportProblem(f"tensor {t} {tensor.name!r} is read before any operator writes it")
            raw = tensor.unsigned() if tensor.is8 else tensor.data
            raw = np.ascontiguousarray(raw).tobytes()
            self.val[t] = self.net.value(self.net.storage(len(raw), raw), tensor)
        return self.val[t]

    def dense_input(self, t):
        """The same, packed: copies once when the value is a slice of another."""
        index = self.input(t)
        value = self.net.values[index]
        if not value.dense:
            self.val[t] = self.copy_dense(index, self.tensor(t))
        return self.val[t]

    def copy_dense(self, index, tensor, table=None):
        import lower_data
        out = self.net.value(self.net.storage(max(1, tensor.size)), tensor)
        lower_data.emit_copy(self, None, index, out, table=table)
        return out

    def output(self, t, shape=None):
        """A new packed value for tensor t, or its place inside a concatenation."""
        tensor = self.tensor(t)
        if t in self.place and shape is None:
            target, channel = self.place[t]
            final = self.tensor(target)
            if target not in self.concat_storage:
                self.concat_storage[target] = self.net.storage(final.size)
            pixel = final.shape[-1]
            self.val[t] = self.net.value(self.concat_storage[target], tensor, offset=channel, pixel=pixel)
        else:
            size = tensor.size if shape is None else int(np.prod(shape, dtype=np.int64))
            self.val[t] = self.net.value(self.net.storage(size * TYPE_BYTES[tensor.type]), tensor, shape=shape)
        return self.val[t]

    def alias(self, t_out, index):
        """Tensor t_out is the same bytes as a value that exists (a slice of another keeps its shape)."""
        v = self.net.values[index]
        self.val[t_out] = self.net.derive(index, shape=self.tensor(t_out).shape or v.shape, source=t_out,
                                          pixel=None if v.dense else v.pixel)
        out = self.net.values[self.val[t_out]]
        tensor = self.tensor(t_out)
        out.scale, out.zero, out.signed, out.type = float(tensor.scale0), tensor.zero_u8 if tensor.is8 else 0, \
            tensor.signed, tensor.type
        return self.val[t_out]

    # ---- the walk ------------------------------------------------------------------------------------------------
    def run(self):
        import lower_conv
        import lower_data
        import lower_math
        table = {}
        for module in (lower_conv, lower_data, lower_math):
            table.update(module.OPERATORS)
        self.known = {*table, *UNARY}
        self.refuse_real()
        missing = sorted({op.name for op in self.g.ops if op.name not in self.known})
        if missing:
            first = next(op for op in self.g.ops if op.name in missing)
            others = [name for name in missing if name != first.name]
            beside = shortened(f"; nor {', '.join(others)}", 50) if others else ""
            raise ImportProblem(self.describe_missing(first, beside))
        for t in self.g.inputs:
            if self.tensor(t).data is None:
                self.net.inputs.append(self.taken(t))
        self.load_states()
        if self.fold:
            self.plan_concats()
        for op in self.g.ops:
            if op.index in self.skip or op.index in self.unread:
                continue
            try:
                with np.errstate(divide="raise", invalid="raise"):
                    table.get(op.name, Lowering.unary)(self, op)
            except ImportProblem as problem:
                raise self.explained(op, problem) from problem
            except FAULTS as problem:
                raise ImportProblem(f"{self.describe(op)}: {self.fault(op, problem)}") from problem
        self.save_states()
        self.g.outputs = [t for t in self.g.outputs if t not in self.g.unseen]
        for t in self.g.outputs:
            self.net.outputs.append(self.dense_input(t))
            self.net.names[self.net.values[self.net.outputs[-1]].source] = self.tensor(t).name
        self.finish_lifetimes()
        return self.net

    def taken(self, t):
        """The value of an input of the network."""
        try:
            return self.output(t)
        except ImportProblem as problem:
            reader = next((op for op in self.g.ops if t in op.inputs), None)
            raise self.explained(reader, problem) if reader else problem from problem

    def load_states(self):
        """A state holds values minus their zero point: zeroed memory is the real zero."""
        import lower_data
        for t, _ in self.g.states:
            tensor = self.tensor(t)
            state = self.net.value(self.net.storage(tensor.size * TYPE_BYTES[tensor.type]), tensor)
            self.net.values[state].source = -1
            self.net.states.append(state)
            table = (np.arange(256) + tensor.zero_u8).astype(np.uint8) if tensor.is8 else None
            lower_data.emit_copy(self, None, state, self.output(t), table=table)

    def save_states(self):
        """After all other operators, so that a run that is given up before leaves the states as they were."""
        import lower_data
        for (t_in, t_out), state in zip(self.g.states, self.net.states):
            into, source = self.tensor(t_in), self.tensor(t_out)
            value = self.net.derive(self.dense_input(t_out), shape=into.shape)
            table = (quant.between(source, into).astype(np.int64) - into.zero_u8).astype(np.uint8) if into.is8 else None
            lower_data.emit_copy(self, None, value, state, table=table)

    def refuse_real(self):
        """Layers that multiply real numbers: a file of floats, or of the dynamic range kind."""
        for op in self.g.ops:
            if op.name not in ("CONV_2D", "DEPTHWISE_CONV_2D", "FULLY_CONNECTED", "TRANSPOSE_CONV"):
                continue
            tensors = [self.tensor(t) for t in op.inputs if t >= 0]
            data = tensors[2 if op.name == "TRANSPOSE_CONV" else 0]
            if data.type in REAL:
                raise ImportProblem(self.describe_real(op, "dynamic range quantisation" if any(t.is8 for t in tensors) else data.type.lower()))

    def real(self, op):
        """The type of real numbers that an operator computes with, None: it does not."""
        kinds = [self.tensor(t).type for t in [*op.inputs, *op.outputs] if t >= 0 and self.tensor(t).data is None]
        return next((kind.lower() for kind in kinds if kind in REAL), None)

    def describe_real(self, op, kind):
        """What is said where an operator would do in 8 bits: how to export it so."""
        computed = {*self.g.inputs, *(t for other in self.g.ops for t in other.outputs)}
        if any(self.tensor(t).is8 and self.tensor(t).data is None for t in computed):
            how = "or end before it: --outputs NAME"
        elif any(t.is8 for t in self.g.tensors if t.data is not None):
            how = "with a representative data set"
        else:
            how = "or let --quantise do it on pictures"
        return f"operator {op.index} {op.name[:40]}: found {kind}, expected int8 or uint8 throughout: export full integer quantisation, {how}"

    def describe(self, op, what=""):
        def shapes(indices):
            return " ".join(f"{self.tensor(t).type.lower()}{list(self.tensor(t).shape)}" for t in indices if t >= 0)
        return f"operator {op.index} {op.name}{what}; inputs {shapes(op.inputs)}, outputs {shapes(op.outputs)}"

    def describe_missing(self, op, beside="", why=""):
        """`why`: what of it is not supported, where the operator itself is."""
        if not beside and op.name in self.known and self.real(op):
            return self.describe_real(op, self.real(op))
        head = f"operator {op.index} {op.name[:40]}: not supported" + (f" ({why})" if why else "")
        return shortened(head + self.describe(op).split(op.name, 1)[1], REFUSAL_MAX - len(beside + REMEDY)) + beside + REMEDY

    def explained(self, op, problem):
        """A line that names the operator and says what to export instead."""
        text = str(problem)
        head = "" if text.startswith("operator ") else f"operator {op.index} {op.name[:40]}: "
        remedy = "" if "export" in text or "--" in text else REMEDY
        return ImportProblem(shortened(head + text, REFUSAL_MAX - len(remedy)) + remedy)

    def fault(self, op, problem):
        """Why an operator's numbers cannot be worked with."""
        for t in op.inputs + op.outputs:
            if t >= 0 and self.tensor(t).is8 and not self.tensor(t).scale0 > 0:
                return f"tensor {t} {self.tensor(t).name!r} has scale {self.tensor(t).scale0:g}, expected above 0"
        return f"its shapes or options do not fit each other ({problem})"

    def plan_concats(self):
        """Let producers write straight into a concatenation along the last axis where nothing must be rescaled."""
        direct = ("CONV_2D", "DEPTHWISE_CONV_2D", "TRANSPOSE_CONV", "ADD", "MUL", "SUB", "MAX_POOL_2D", "AVERAGE_POOL_2D")
        ends = {self.folder.chain(op.outputs[0])[0] for op in self.g.ops if op.name in direct}
        seen = set()
        for op in self.g.ops:
            if op.name != "CONCATENATION":
                continue
            out = self.tensor(op.outputs[0])
            axis = op.options.Axis() % max(1, len(out.shape))
            if len(out.shape) != 4 or axis != 3 or not out.is8 or out.shape[3] % 8:
                continue
            channel = 0
            for t in op.inputs:
                tensor = self.tensor(t)
                same = tensor.scale0 == out.scale0 and tensor.zero_u8 == out.zero_u8 and tensor.type == out.type
                if t in ends and same and t not in self.g.outputs and t not in seen and op.inputs.count(t) == 1:
                    self.place[t] = (op.outputs[0], channel)
                    seen.add(t)
                channel += tensor.shape[3]

    def unary(self, op):
        found = self.folder.unary_table(op)
        if found is None:
            raise ImportProblem(self.describe_missing(op))
        self.apply_table(op, found[0], op.outputs[0], found[1])

    def apply_table(self, op, t_in, t_out, table):
        import lower_data
        if self.fold:
            last, more, merged = self.folder.chain(t_out)
            if more is not None:
                table, t_out = more[table], last
                self.skip.update(o.index for o in merged)
        if np.array_equal(table, quant.IDENTITY) and t_out not in self.place and t_in not in self.g.inputs:
            self.alias(t_out, self.input(t_in))
            return
        source = self.input(t_in)
        lower_data.emit_copy(self, op, source, self.output(t_out), table=table)

    def merged_after(self, t):
        """Tensor that a convolution (or other 8-bit producer) of t ends with, and the table that leads there or None."""
        if not self.fold:
            return t, None
        last, table, merged = self.folder.chain(t)
        self.skip.update(o.index for o in merged)
        return last, None if table is None or np.array_equal(table, quant.IDENTITY) else table

    def merge_after(self, t):
        """The same with the table's place in the file, 0: none."""
        last, table = self.merged_after(t)
        return last, 0 if table is None else self.net.blob(table)

    def finish_lifetimes(self):
        net = self.net
        for i in net.inputs:
            net.storages[net.values[i].storage].first = -1
        for i in net.states:
            whole = net.storages[net.values[i].storage]
            whole.first, whole.last = -1, len(net.steps)
        for i in net.outputs:
            net.storages[net.values[i].storage].last = len(net.steps)
        self.arena_slack = ARENA_SLACK
