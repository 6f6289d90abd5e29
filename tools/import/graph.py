"""Reading a .tflite file into plain Python objects.

All 8-bit tensors are shown in unsigned form: an int8 value q is held as q + 128, with its zero point moved by 128 as
well. Quantised arithmetic only ever sees (value - zero point), so both forms describe the same numbers and the engine
needs one set of kernels. `signed` remembers the original form for the few operators that round around zero."""
import struct
from dataclasses import dataclass, field

import numpy as np
import tflite

import constant
import dilate
import islands
import planes

CODE_NAMES = {v: k for k, v in vars(tflite.BuiltinOperator).items() if isinstance(v, int)}
TYPE_NAMES = {v: k for k, v in vars(tflite.TensorType).items() if isinstance(v, int)}
DTYPES = {"UINT8": np.uint8, "INT8": np.int8, "INT32": np.int32, "INT64": np.int64, "FLOAT32": np.float32,
          "BOOL": np.uint8, "INT16": np.int16}
STATES_MAX = 16  # of a model file
REFUSAL_MAX = 200  # characters

# What numbers that fit nothing end in, wherever they are first used.
FAULTS = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError, struct.error)


class ImportProblem(Exception):
    """Something that stops the import; its text is the one line for the user."""


@dataclass
class Tensor:
    index: int
    name: str
    type: str
    shape: tuple
    scale: np.ndarray          # float32, empty when not quantised
    zero: np.ndarray           # int64, in the file's own form
    axis: int
    data: np.ndarray = None    # constant in the file's own form
    open: bool = False         # the file leaves some of the shape to the run

    @property
    def signed(self):
        return self.type == "INT8"

    @property
    def is8(self):
        return self.type in ("INT8", "UINT8")

    @property
    def bias8(self):
        return 128 if self.signed else 0

    @property
    def zero_u8(self):
        return (int(self.zero[0]) if len(self.zero) else 0) + self.bias8

    @property
    def scale0(self):
        return np.float32(self.scale[0]) if len(self.scale) else np.float32(0)

    @property
    def size(self):
        return int(np.prod(self.shape, dtype=np.int64)) if len(self.shape) else 1

    def unsigned(self):
        """The constant as uint8 in unsigned form."""
        return (self.data.astype(np.int16) + self.bias8).astype(np.uint8)


@dataclass
class Op:
    index: int
    name: str
    code: int
    inputs: list
    outputs: list
    options: object
    custom: dict = field(default_factory=dict)


@dataclass
class Graph:
    tensors: list
    ops: list
    inputs: list
    outputs: list
    metadata: dict
    states: list = field(default_factory=list)  # (input, tensor that it is in the next run)
    unseen: list = field(default_factory=list)  # outputs that are there for states alone
    notes: list = field(default_factory=list)  # lines for the user


def _options(op):
    table = op.BuiltinOptions()
    if table is None:
        return None
    kinds = {v: k for k, v in vars(tflite.BuiltinOptions).items() if isinstance(v, int)}
    cls = getattr(tflite, kinds[op.BuiltinOptionsType()], None)
    if cls is None:
        return None
    options = cls()
    options.Init(table.Bytes, table.Pos)
    return options


def _custom(op):
    if op.CustomOptionsLength() == 0:
        return {}
    from flatbuffers import flexbuffers
    try:
        found = flexbuffers.Loads(bytes(op.CustomOptionsAsNumpy().tobytes()))
    except (LookupError, ValueError, struct.error):  # some operators keep bytes of their own there
        return {}
    return found if isinstance(found, dict) else {}


def _builtin_code(code):
    """The field itself: the package gives the deprecated one of 8 bits where a writer left that at 0."""
    from flatbuffers.number_types import Int32Flags
    at = code._tab.Offset(10)
    return code._tab.Get(Int32Flags, at + code._tab.Pos) if at else 0


def _bytes_of(buffer):
    """Of large models they lie behind the tables, at an offset from the file's start; 0 and 1 mean that they do not."""
    if buffer.DataLength():
        return buffer.DataAsNumpy().tobytes()
    at = buffer.Offset()
    return bytes(buffer._tab.Bytes[at:at + buffer.Size()]) if at > 1 else b""


def _tensor(model, index, t, user):
    """`user`: an operator that reads or writes it, None: there is none."""
    kind = TYPE_NAMES[t.Type()]
    name = t.Name().decode("utf-8", "replace") if t.Name() else ""
    if kind not in DTYPES:
        asked = "export full integer quantisation, or let --quantise do it on pictures" if kind in ("FLOAT16", "BFLOAT16") else \
            "no operator here can hold others: export without it"
        where = f"in tensor {index} {name[:40]!r}"
        raise ImportProblem(f"operator {user.index} {user.name[:40]}: found {kind.lower()} {where}, expected int8 or uint8: {asked}" if user else
                            f"found {kind.lower()} {where}, expected int8 or uint8: {asked}")
    q = t.Quantization()
    scale = np.zeros(0, np.float32)
    zero = np.zeros(0, np.int64)
    axis = 0
    if q is not None and q.ScaleLength():
        scale = q.ScaleAsNumpy().astype(np.float32)
        zero = q.ZeroPointAsNumpy().astype(np.int64) if q.ZeroPointLength() else np.zeros(len(scale), np.int64)
        axis = q.QuantizedDimension()
    shape = tuple(int(v) for v in t.ShapeAsNumpy()) if t.ShapeLength() else ()
    data = None
    buffer = model.Buffers(t.Buffer())
    raw = _bytes_of(buffer)
    if raw or 0 in shape:
        count = int(np.prod(shape, dtype=np.int64)) if shape else 1
        dtype = np.dtype(DTYPES[kind])
        if len(raw) < count * dtype.itemsize:
            raise ImportProblem(f"tensor {index}: {len(raw)} bytes of data, expected {count * dtype.itemsize}")
        data = np.frombuffer(raw, dtype, count).reshape(shape)
    is_open = t.ShapeSignatureLength() > 0 and bool((t.ShapeSignatureAsNumpy() < 0).any())
    return Tensor(index, name, kind, shape, scale, zero, axis, data, is_open)


def cut(graph, names):
    """The graph that ends in these tensors; what only others need is left out. Raises ImportProblem for a name that it does not have."""
    made = {t: op for op in graph.ops for t in op.outputs}
    by_name = {t.name: t.index for t in graph.tensors if t.index in made}
    for name in names:
        if name not in by_name:
            raise ImportProblem(f"--outputs: found no computed tensor {name[:60]!r}, expected names as --names lists them")
    graph.outputs = [by_name[name] for name in names] + [t for t in graph.outputs if t in graph.unseen]
    needed, kept = set(graph.outputs), []
    for op in reversed(graph.ops):
        if needed & set(op.outputs):
            needed |= set(op.inputs)
            kept.append(op)
    graph.ops = kept[::-1]


def keep_states(graph, pairs, shown):
    """`pairs`: texts IN=OUT. Takes each IN from the inputs and each OUT from the outputs, but for those that `shown` names or that are
    all there are."""
    by_name = {tensor.name: tensor.index for tensor in graph.tensors}
    made = {t for op in graph.ops for t in op.outputs}
    for pair in pairs:
        name, _, target = pair.partition("=")
        source, result = by_name.get(name, -1), by_name.get(target, -1)
        if source not in graph.inputs or graph.tensors[source].data is not None:
            inputs = ", ".join(graph.tensors[t].name for t in graph.inputs)
            raise ImportProblem(f"--state {pair[:60]}: found no input {name[:40]!r}, expected IN=OUT with one of {inputs[:60]}")
        if result not in made:
            raise ImportProblem(f"--state {pair[:60]}: found no computed tensor {target[:40]!r}, expected a name as --names lists it")
        a, b = graph.tensors[source], graph.tensors[result]
        if a.shape != b.shape or (a.type != b.type and not (a.is8 and b.is8)):
            raise ImportProblem(f"--state {pair[:60]}: found {a.type.lower()}{list(a.shape)} and {b.type.lower()}{list(b.shape)}, "
                                "expected one shape, and one type or 8 bits")
        if a.type == "INT16":
            raise ImportProblem(f"--state {pair[:60]}: found int16, expected a state of 8 bits")
        if len(graph.inputs) == 1:
            raise ImportProblem(f"--state {pair[:60]}: found the only input, expected another one beside it")
        if len(graph.states) == STATES_MAX:
            raise ImportProblem(f"--state {pair[:60]}: found more than {STATES_MAX} states")
        graph.inputs.remove(source)
        graph.states.append((source, result))
    results = list(dict.fromkeys(result for _, result in graph.states))
    others = [t for t in graph.outputs if t not in results]
    hidden = results if shown or others else [t for t in results if t not in graph.outputs]
    graph.unseen = [t for t in hidden if graph.tensors[t].name not in shown]
    graph.outputs += [t for t in graph.unseen if t not in graph.outputs]


def read(path):
    with open(path, "rb") as file:
        raw = file.read()
    if path.lower().endswith(".onnx"):
        raise ImportProblem("an ONNX file holds real numbers: expected --quantise MODEL.onnx PICTURES, which makes bytes of them")
    return parse(raw)


def parse(raw):
    """The graph of a file's bytes."""
    if raw[4:8] != b"TFL3":
        raise ImportProblem(f"byte 4: found {raw[4:8]!r}, expected b'TFL3': not a .tflite file")
    try:
        return _parse(tflite.Model.GetRootAs(raw, 0))
    except FAULTS as problem:
        raise ImportProblem(f"{len(raw)} bytes that are not a whole .tflite file: {problem}") from problem


def _operators(model, g):
    ops = []
    for i in range(g.OperatorsLength()):
        op = g.Operators(i)
        code = model.OperatorCodes(op.OpcodeIndex())
        number = max(_builtin_code(code), code.DeprecatedBuiltinCode())
        name = CODE_NAMES.get(number, f"with code {number}")
        if name == "CUSTOM":
            name = code.CustomCode().decode()
        ops.append(Op(i, name, number, [int(v) for v in op.InputsAsNumpy()],
                      [int(v) for v in op.OutputsAsNumpy()], _options(op),
                      _custom(op) if number == tflite.BuiltinOperator.CUSTOM else {}))
    return ops


CALLS = {"IF": "export the branch that is taken", "WHILE": "export with the loop unrolled", "CALL_ONCE": "export with each variable as an input and "
         "an output, for --state IN=OUT", "CALL": "export one function"}


def single(model):
    """The operators of the only subgraph; one that runs another is named."""
    if model.SubgraphsLength() < 1:
        raise ImportProblem("0 subgraphs, expected 1")
    ops = _operators(model, model.Subgraphs(0))
    if model.SubgraphsLength() == 1:
        return ops
    caller = next((op for op in ops if op.name in CALLS), None)
    raise ImportProblem(f"operator {caller.index} {caller.name}: runs another of {model.SubgraphsLength()} subgraphs, expected 1: {CALLS[caller.name]}"
                        if caller else f"{model.SubgraphsLength()} subgraphs, expected 1: export a single signature")


def _parse(model):
    ops, g = single(model), model.Subgraphs(0)
    users = {t: op for op in reversed(ops) for t in [*op.outputs, *op.inputs]}
    tensors = [_tensor(model, i, g.Tensors(i), users.get(i)) for i in range(g.TensorsLength())]
    metadata = {}
    for i in range(model.MetadataLength()):
        entry = model.Metadata(i)
        data = model.Buffers(entry.Buffer())
        metadata[entry.Name().decode()] = data.DataAsNumpy().tobytes() if data.DataLength() else b""
    graph = Graph(tensors, ops, [int(v) for v in g.InputsAsNumpy()], [int(v) for v in g.OutputsAsNumpy()], metadata)
    constant.fold(graph)
    dilate.join(graph)
    planes.turn(graph)
    islands.join(graph)
    return graph


def origin(graph, t, names=("QUANTIZE", "DEQUANTIZE")):
    """The tensor that t is another form of, and the operator that made it (None: an input)."""
    made = {out: op for op in graph.ops for out in op.outputs}
    while t in made and made[t].name in names:
        t = made[t].inputs[0]
    return t, made.get(t)
