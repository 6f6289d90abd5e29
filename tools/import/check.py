"""Comparing the engine with the reference interpreter (LiteRT, BUILTIN_REF): outputs, and layers one by one.

Needs the packages ai-edge-litert and pillow. Inputs are the photographs, resized, and noise."""
import numpy as np

import planes
import quant
from engine import Engine, Progress
from layout import KIND

DETECTION = KIND["DETECTION"]


def mended(path):
    """The file with quantised dimensions that its tensors do not have set to 0: the reference refuses them, though
    they mean nothing where a tensor has one scale or one axis. TILE gets version 2, the last one in the reference's list,
    whose kernel computes the bytes of version 3 all the same."""
    import tflite
    with open(path, "rb") as file:
        raw = bytearray(file.read())
    model = tflite.Model.GetRootAs(raw, 0)
    graph = model.Subgraphs(0)
    for i in range(model.OperatorCodesLength()):
        code = model.OperatorCodes(i)
        if code.BuiltinCode() == tflite.BuiltinOperator.TILE and code.Version() > 2:
            at = code._tab.Pos + code._tab.Offset(8)
            raw[at:at + 4] = bytes([2, 0, 0, 0])
    for i in range(graph.TensorsLength()):
        tensor = graph.Tensors(i)
        q = tensor.Quantization()
        if q is None or q.QuantizedDimension() < max(1, tensor.ShapeLength()):
            continue
        at = q._tab.Pos + q._tab.Offset(16)
        raw[at:at + 4] = bytes(4)
    return bytes(raw)


class CheckProblem(Exception):
    """Why nothing can be compared, in one line."""


def reference(path, plain=True):
    """`plain` False: the other kernels, for operators that the reference ones leave out."""
    from ai_edge_litert.interpreter import Interpreter, OpResolverType
    interpreter = Interpreter(model_content=mended(path), num_threads=1, experimental_preserve_all_tensors=True,
                              experimental_op_resolver_type=OpResolverType.BUILTIN_REF if plain else
                              OpResolverType.BUILTIN_WITHOUT_DEFAULT_DELEGATES)
    interpreter.allocate_tensors()
    return interpreter


def image_input(path, detail):
    from PIL import Image
    shape = detail["shape"]
    try:
        image = Image.open(path)
    except OSError as problem:
        raise CheckProblem(f"{path}: not a picture that can be read ({problem})") from problem
    planar = planes.is_planes(shape)
    channels, height, width = (int(n) for n in (shape[1:] if planar else (*shape[3:], *shape[1:3]))) if len(shape) == 4 else (0, 0, 0)
    if channels not in (1, 3):
        raise CheckProblem(f"the input has shape {[int(n) for n in shape]}, images need [1, h, w, 1 or 3] or [1, 1 or 3, h, w]")
    image = image.convert("L" if channels == 1 else "RGB").resize((width, height))
    pixels = np.asarray(image, np.uint8).reshape(1, height, width, channels)
    return as_type(np.transpose(pixels, planes.TO_PLANES) if planar else pixels, detail)


def as_type(pixels, detail):
    if detail["dtype"] == np.int8:
        return (pixels.astype(np.int16) - 128).astype(np.int8)
    if detail["dtype"] == np.float32:
        return (pixels.astype(np.float32) / np.float32(127.5) - np.float32(1)).astype(np.float32)
    return pixels.astype(detail["dtype"])


def noise_input(detail, seed):
    random = np.random.default_rng(seed)
    return as_type(random.integers(0, 256, detail["shape"]).astype(np.uint8), detail)


def difference(found, expected):
    """'' when equal; floats may differ by 1e-5."""
    if found.shape != expected.shape:
        return f"shape {list(found.shape)}, expected {list(expected.shape)}"
    if found.dtype == np.float32:
        worst = float(np.max(np.abs(found - expected), initial=0))
        return "" if worst <= 1e-5 else f"floats differ by up to {worst:g}"
    wrong = found != expected
    if not wrong.any():
        return ""
    at = tuple(int(i) for i in np.argwhere(wrong)[0])
    return f"{int(wrong.sum())} of {wrong.size} values differ, first at {list(at)}: found {found[at]}, " \
           f"expected {expected[at]}"


class States:
    """What the reference gets as its states: the engine keeps its own. `graph`: the one that was lowered, None: without states."""

    def __init__(self, interpreter, graph=None):
        self.pairs = graph.states if graph is not None else []
        self.graph, self.interpreter = graph, interpreter
        inputs = {t for t, _ in self.pairs}
        details = interpreter.get_input_details()
        self.inputs = [d for d in details if d["index"] not in inputs]
        self.held = {d["index"]: np.full(d["shape"], d["quantization"][1], d["dtype"]) for d in details if d["index"] in inputs}
        self.outputs = interpreter.get_output_details()
        if self.pairs:
            self.outputs = [d for t in graph.outputs for d in interpreter.get_tensor_details() if d["index"] == t]

    def set(self):
        for t, value in self.held.items():
            self.interpreter.set_tensor(t, value)

    def take(self):
        """The run's results become the next run's states, requantised where the two differ."""
        results = {t: self.interpreter.get_tensor(result) for t, result in self.pairs}
        for t, result in self.pairs:
            into, source = self.graph.tensors[t], self.graph.tensors[result]
            value = results[t]
            if into.is8:
                unsigned = quant.between(source, into)[(value.astype(np.int16) + source.bias8).astype(np.uint8)]
                value = (unsigned.astype(np.int16) - into.bias8).astype(self.held[t].dtype)
            self.held[t] = value


def compare(interpreter, engine, inputs, layers, states=None):
    """Run both; returns lines of what differs."""
    states = states or States(interpreter)
    states.set()
    for number, (detail, value) in enumerate(zip(states.inputs, inputs)):
        interpreter.set_tensor(detail["index"], value)
        engine.set_input(number, planes.to_image(value) if number == 0 and planes.is_planes(value.shape) else value)
    interpreter.invoke()
    problems = []
    progress = Progress(0, 0)
    for number in range(len(engine.ops)):
        engine.run_op(progress)
        if not layers:
            continue
        op = engine.ops[number]
        for t in op[9:9 + op[4]]:
            source = int(engine.tensors[t][13])
            if source < 0 or op[2] < 0:
                continue
            try:
                expected = interpreter.get_tensor(source)
            except ValueError:
                continue
            found = engine.tensor(t)
            if found.size != expected.size or complete(engine, number, t) is False:
                continue
            text = difference(found.reshape(expected.shape), expected)  # steps may see a tensor in other axes
            if text:
                problems.append(f"operator {int(op[2])} (step {number}, tensor {source}): {text}")
    for number, detail in enumerate(states.outputs):
        found = engine.tensor(engine.outputs[number])
        expected = interpreter.get_tensor(detail["index"])
        if len(engine.ops) and engine.ops[-1][0] == DETECTION and engine.outputs[number] in engine.ops[-1][9:12]:
            count = detections_given(engine, interpreter)
            found, expected = found[:, :count], expected[:, :count]
        text = difference(found, expected)
        if text:
            problems.append(f"output {number} ({detail['name']}): {text}")
    states.take()
    return problems


def detections_given(engine, interpreter):
    """Entries of the detection outputs that the reference wrote; it leaves the rest as it was."""
    per = int(engine.ops[-1][16 + 4]) if not engine.ops[-1][16 + 6] else 1
    count = interpreter.get_tensor(int(engine.tensors[engine.ops[-1][12]][13]))
    return int(count.ravel()[0]) * min(per, int(engine.ops[-1][16 + 1]))


def complete(engine, number, tensor):
    """Whether no later operator writes the same tensor (fills and pieces of concatenations come first)."""
    storage = engine.tensors[tensor][14]
    span = (engine.tensors[tensor][10], engine.tensors[tensor][10] + engine.tensors[tensor][9])
    source = engine.ops[number][2]
    for later in engine.ops[number + 1:]:
        if later[2] != source and later[2] >= 0:
            break
        for t in later[9:9 + later[4]]:
            if engine.tensors[t][14] == storage and engine.tensors[t][10] < span[1]:
                return False
    return True


def check(path, data, images, layers, kernel_set=None, noise=3, graph=None):
    """Print one line per input; returns the number of inputs that differ. States go from each to the next."""
    try:
        interpreter = reference(path)
    except (RuntimeError, ValueError) as problem:
        raise CheckProblem(f"{path}: the reference interpreter refuses it: {str(problem).splitlines()[0]}") from problem
    engine = Engine(data, kernel_set)
    states = States(interpreter, graph)
    details = states.inputs
    if states.pairs:
        print(f"{len(states.pairs)} state{'s' if len(states.pairs) > 1 else ''}, zero before the first input, kept from each to the next")
    cases = [(image, [image_input(image, d) for d in details]) for image in images]
    cases += [(f"noise {seed}", [noise_input(d, seed + 17 * i) for i, d in enumerate(details)])
              for seed in range(noise)]
    wrong = 0
    for name, inputs in cases:
        problems = compare(interpreter, engine, inputs, layers, states)
        print(f"{'DIFFERS' if problems else 'equal  '} {name}")
        for line in problems[:20]:
            print(f"    {line}")
        wrong += bool(problems)
    return wrong
