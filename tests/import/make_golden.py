"""Write tests/golden/nn_operators.bin and detector.fvm, or the same files into another folder: make_golden.py [FOLDER].

nn_operators.bin holds one small model for each operator with inputs and the reference's outputs.

Records, each part at a multiple of 64 bytes: a head of 64 bytes (name of 40 bytes, then the byte counts of model, inputs
and outputs as 32-bit words, and how many of the leading outputs' bytes count), the model file, the inputs, the outputs, in
the order of the model's own lists and in unsigned form. Needs what tests/import/operators.py needs."""
import os
import struct
import sys
import tempfile

import numpy as np
from flatbuffers import flexbuffers

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)

import operators  # noqa: E402
import costs  # noqa: E402
import states  # noqa: E402
import use  # noqa: E402
from operators import Case, CASES, Lowering, Writer, check, graph_module, plan_module  # noqa: E402


def raw(array):
    array = np.ascontiguousarray(array)
    return (array.view(np.uint8) ^ 128).tobytes() if array.dtype == np.int8 else array.tobytes()


def padded(data):
    return data + bytes(-len(data) % 64)


def is_regular(seed):
    """Suppression class by class of more boxes than a class may have, as the reference does it."""
    case = Case("uint8", seed)
    boxes = CASES["TFLite_Detection_PostProcess"](case)[0][0]
    options = flexbuffers.Loads(case.b.ops[0][5])
    return options["use_regular_nms"] and options["num_classes"] > 1 and case.b.tensors[boxes][1][1] > 20 and \
        operators.run("TFLite_Detection_PostProcess", "uint8", seed, "c") == ""


class Units:
    """While work is cut into units of another cost."""

    def __init__(self, cost):
        self.cost = cost

    def __enter__(self):
        costs.UNIT_COST, self.cost = self.cost, costs.UNIT_COST

    def __exit__(self, *_):
        costs.UNIT_COST, self.cost = self.cost, costs.UNIT_COST


def is_in_parts(name, kind, seed):
    """Whether the only operator that there is has more parts than one."""
    case = Case(kind, seed)
    made = CASES[name](case)
    with tempfile.NamedTemporaryFile(suffix=".tflite") as file:
        file.write(case.b.bytes(*made[:2]))
        file.flush()
        steps = Lowering(graph_module.read(file.name)).run().steps
    return len(steps) == 1 and steps[0].params.get("parts", 0) > 1 and operators.run(name, kind, seed, "c") == ""


def in_parts():
    """Operators in as many parts as there can be."""
    out = b""
    with Units(1):
        for name, kind in (("MEAN", "int8"), ("SUM", "uint8"), ("REDUCE_MAX", "int8"), ("AVERAGE_POOL_2D", "int8"),
                           ("MAX_POOL_2D", "uint8"), ("FULLY_CONNECTED", "uint8"), ("TFLite_Detection_PostProcess", "uint8")):
            seed = next(s for s in range(200) if is_in_parts(name, kind, s))
            out += record(name, kind, seed, f"{name[:24]} in parts")
        seed = next(s for s in range(200) if is_regular(s))
        out += record("TFLite_Detection_PostProcess", "uint8", seed, "regular suppression in parts")
        out += drawn("BATCH_MATMUL in parts", False, product)
    return out


def record(name, kind, seed, called=None):
    case = Case(kind, seed)
    inputs, outputs = CASES[name](case)
    with tempfile.NamedTemporaryFile(suffix=".tflite") as file:
        file.write(case.b.bytes(inputs, outputs))
        file.flush()
        interpreter = operators.reference_of(name, case, inputs, outputs, file.name)
        graph = graph_module.read(file.name)
    net = Lowering(graph).run()
    arena, _ = plan_module.plan(net)
    model = Writer(net, arena).bytes(name, [], [0], [0])
    details = interpreter.get_input_details()
    values = [check.noise_input(d, seed + i) for i, d in enumerate(details)]
    for detail, value in zip(details, values):
        interpreter.set_tensor(detail["index"], value)
    interpreter.invoke()
    results = [interpreter.get_tensor(d["index"]) for d in interpreter.get_output_details()]
    if name == "TFLite_Detection_PostProcess":
        count = int(results[3].ravel()[0])
        for i in range(3):  # the reference leaves unused entries as they were, the engine clears them
            results[i][:, count:] = 0
    ins, outs = b"".join(raw(v) for v in values), b"".join(raw(v) for v in results)
    head = struct.pack("<40s3I12x", (called or f"{name} {kind}").encode()[:39], len(model), len(ins), len(outs))
    return padded(head) + padded(model) + padded(ins) + padded(outs)


def spread(case, name, swapped):
    """One operand has one value per pixel; rows are longer than what is spread at once."""
    one, many, out = case.q((1, 2, 3, 1)), case.q((1, 2, 3, 300)), case.q((1, 2, 3, 300))
    case.b.op(name, [one, many] if swapped else [many, one], [out], name.title(), FusedActivationFunction=0)
    return [one, many] if swapped else [many, one], [out], []


def channel_slopes(case):
    """PRELU in real numbers, for two channels, whose pixels are joined, and for 19, which leave a rest of a vector."""
    inputs, outputs = [], []
    for height, channels in ((2, 2), (3, 19)):
        shape = (1, height, 5, channels)
        x, y = case.q(shape), case.q(shape)
        real, sloped = case.b.tensor("float32", shape), case.b.tensor("float32", shape)
        case.b.op("DEQUANTIZE", [x], [real], "Dequantize")
        slopes = case.r.uniform(-0.5, 1.5, (1, 1, channels)).astype("float32")
        case.b.op("PRELU", [real, case.b.const("float32", slopes)], [sloped])
        case.b.op("QUANTIZE", [sloped], [y], "Quantize")
        inputs.append(x)
        outputs.append(y)
    return inputs, outputs, []


def product(case):
    a, b, out = case.q((2, 3, 37)), case.q((2, 37, 50)), case.q((2, 3, 50), 4)
    case.b.op("BATCH_MATMUL", [a, b], [out], "BatchMatMul", AdjX=False, AdjY=False)
    return [a, b], [out], []


def drawn(name, kept, network, *options):
    """A network of states.py or of this page, its states kept or left as inputs and outputs, from which tests of states compute what keeping them gives."""
    case = Case("int8", 4)
    inputs, outputs, pairs = network(case, *options)
    with tempfile.NamedTemporaryFile(suffix=".tflite") as file:
        file.write(case.b.bytes(inputs, outputs))
        file.flush()
        interpreter = check.reference(file.name)
        graph = graph_module.read(file.name)
    if kept:
        graph_module.keep_states(graph, [f"t{held}=t{new}" for held, new in pairs], [])
    net = Lowering(graph).run()
    arena, _ = plan_module.plan(net)
    shape = graph.tensors[graph.inputs[0]].shape
    picture = [0, shape[2], shape[1], shape[3], 0, *[use.bits(0)] * 3, *[use.bits(1 / 50)] * 3, 114] if len(shape) == 4 and shape[3] == 3 else [0]
    model = Writer(net, arena).bytes("recurrent", [], picture, [0])
    values = {d["index"]: check.noise_input(d, 4) for d in interpreter.get_input_details()}
    for index, value in values.items():
        if index in [held for held, _ in pairs]:
            value[:] = graph.tensors[index].zero[0]
        interpreter.set_tensor(index, value)
    interpreter.invoke()
    ins = b"".join(raw(values[t]) for t in graph.inputs)
    outs = b"".join(raw(interpreter.get_tensor(t)) for t in graph.outputs)
    head = struct.pack("<40s3I12x", name.encode(), len(model), len(ins), len(outs))
    return padded(head) + padded(model) + padded(ins) + padded(outs)


def detector(target):
    """A small network of random weights with a FOMO head, for tests of preprocessing, slicing and decoding."""
    case = Case("int8", 5)
    x = case.q((1, 48, 64, 3), 1 / 255, -128)
    shape, source, scale = (48, 64), x, 1 / 255
    for channels in (8, 16, 3):
        weights, scales = case.weights((channels, 3, 3, case.b.tensors[source][1][3]), channels, 0)
        shape = (shape[0] // 2, shape[1] // 2)
        k = 9 * case.b.tensors[source][1][3]
        out_scale = scale * float(np.mean(scales)) * 40 * np.sqrt(k)
        y = case.q((1, *shape, channels), out_scale, 0)
        case.b.op("CONV_2D", [source, weights, case.bias(channels, scale, scales)], [y], "Conv2D", StrideH=2, StrideW=2,
                  DilationHFactor=1, DilationWFactor=1, Padding=0, FusedActivationFunction=1 if channels > 3 else 0)
        source, scale = y, out_scale
    z = case.q((1, *shape, 3), 1 / 256, -128)
    case.b.op("SOFTMAX", [source], [z], "Softmax", Beta=1.0)
    with tempfile.NamedTemporaryFile(suffix=".tflite") as file:
        file.write(case.b.bytes([x], [z]))
        file.flush()
        graph = graph_module.read(file.name)
        net = Lowering(graph).run()
        arena, _ = plan_module.plan(net)
        with open(target, "wb") as out:
            out.write(Writer(net, arena).bytes("detector", *use.describe(file.name, graph, net, None)[0]))


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else os.path.join(HERE, "..", "golden")
    out = bytearray()
    for number, name in enumerate(CASES):
        kinds = ["uint8"] if name == "TFLite_Detection_PostProcess" else ["int8"] if name == "BATCH_MATMUL" else \
            ["int8", "uint8"] if "CONV" in name or name in ("FULLY_CONNECTED", "FULLY_CONNECTED, computed", "ADD", "SOFTMAX") else \
            [["int8", "uint8"][number % 2]]
        for kind in kinds:
            seed = next(s for s in range(100) if operators.run(name, kind, s, "c") == "")
            out += record(name, kind, seed)
    out += record("TFLite_Detection_PostProcess", "uint8", next(s for s in range(100) if is_regular(s)), "regular suppression")
    for kept in (True, False):  # the state's scale is half the next value's: the step between them is a multiplication by 2
        out += drawn("recurrent kept" if kept else "recurrent open", kept, states.elman, 12, 1 / 256, 5)
    out += drawn("recurrent picture", True, states.pictures)
    for name in ("ADD", "MUL"):
        for swapped in (False, True):
            out += drawn(f"{name} by pixel{' first' if swapped else ''}", False, spread, name, swapped)
    out += drawn("channel slopes", False, channel_slopes)
    out += in_parts()
    detector(os.path.join(folder, "detector.fvm"))
    target = os.path.join(folder, "nn_operators.bin")
    with open(target, "wb") as file:
        file.write(out)
    print(f"{target}: {len(out)} bytes")


if __name__ == "__main__":
    main()
