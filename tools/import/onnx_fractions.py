"""Heads of ONNX files that join boxes in pixels with scores from 0 to 1 in one output. In bytes such an output has one scale: at 640 pixels a step
is 2.5, and every score is lost. The boxes are therefore divided by the input's width and height before they are joined, as exporters
to .tflite do; decoders know both units by the output's range."""
import numpy as np

PASSED = {"Concat", "Reshape", "Transpose", "Squeeze", "Unsqueeze", "Identity"}  # what moves numbers between a head and its output
CUT = {"Split", "Slice", "Gather", *PASSED} - {"Concat"}                          # what takes numbers out of a tensor
PIXELS_MIN = 2.0  # scores never reach it, fractions of a picture hardly
REACH = 0.5  # of the input's size: boxes of all cells in pixels reach beyond it, numbers before their decoding do not
DEPTH_MAX = 24


def is_score(made, name):
    """Whether the numbers of a tensor are a Sigmoid's, taken out of its output or moved."""
    for _ in range(DEPTH_MAX):
        node = made.get(name)
        if node is None or node.op_type in ("Sigmoid", "HardSigmoid"):
            return node is not None
        if node.op_type not in CUT:
            return False
        name = node.input[0]
    return False


def joins(graph):
    """(node, place of an input): what a Concat joins with scores, of the Concats that outputs are made of by moves alone."""
    made = {o: node for node in graph.node for o in node.output}
    found, seen, waiting = [], set(), [o.name for o in graph.output]
    while waiting:
        node = made.get(waiting.pop())
        if node is None or node.op_type not in PASSED or id(node) in seen:
            continue
        seen.add(id(node))
        scores = [is_score(made, i) for i in node.input] if node.op_type == "Concat" else []
        if any(scores):
            found += [(node, k) for k, score in enumerate(scores) if not score]
        waiting += node.input if node.op_type == "Concat" else node.input[:1]
    return found


def values_of(model, names, name, value):
    """Tensors inside the network, on one picture."""
    import onnx
    import onnxruntime
    probe = onnx.ModelProto()
    probe.CopyFrom(model)
    there = {o.name for o in probe.graph.output}
    probe.graph.output.extend(onnx.helper.make_empty_tensor_value_info(n) for n in names if n not in there)
    session = onnxruntime.InferenceSession(probe.SerializeToString(), providers=["CPUExecutionProvider"])
    return dict(zip(names, session.run(names, {name: value})))


def in_pixels(found, values, size):
    """Of what is joined, what is in pixels: where some of a join reaches over the picture, all of it that scores cannot be. YOLOX and others that
    are decoded later join numbers in cells."""
    def most(node, k):
        array = values[node.input[k]]
        axis = next(a.i for a in node.attribute if a.name == "axis")
        return np.abs(array).max() if array.ndim >= 2 and array.dtype == np.float32 and array.shape[axis] in (2, 4) else 0
    reach = {}
    for node, k in found:
        reach[id(node)] = max(reach.get(id(node), 0), most(node, k))
    return [(node, k) for node, k in found if most(node, k) > PIXELS_MIN and reach[id(node)] > REACH * max(size)]


def apply(model, name, shape, planar, value):
    """Changes the model; returns how many tensors are divided."""
    import onnx
    graph = model.graph
    found = joins(graph)
    if not found:
        return 0
    values = values_of(model, sorted({node.input[k] for node, k in found}), name, value)
    size, count = shape[:1:-1] if planar else shape[2:0:-1], 0
    for node, k in in_pixels(found, values, size):
        axis, array = next(a.i for a in node.attribute if a.name == "axis"), values[node.input[k]]
        factors = np.ones(array.ndim, int)
        factors[axis] = array.shape[axis]
        constant, result = f"fovea_fraction_{count}", f"fovea_fractions_{count}"
        graph.initializer.append(onnx.numpy_helper.from_array(np.resize(1 / np.array(size, np.float32), array.shape[axis]).reshape(factors), constant))
        place = list(graph.node).index(node)
        graph.node.insert(place, onnx.helper.make_node("Mul", [node.input[k], constant], [result], name=result))
        graph.node[place + 1].input[k] = result
        count += 1
    return count
