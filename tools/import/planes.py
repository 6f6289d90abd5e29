"""Pictures in planes, [1, channels, height, width]: the engine takes them as [1, height, width, channels], so the input is turned, and
with it every TRANSPOSE that did so in the network."""
from dataclasses import replace

import numpy as np

SIDE_MIN = 8
TO_IMAGE, TO_PLANES = (0, 2, 3, 1), (0, 3, 1, 2)


def is_planes(shape):
    return len(shape) == 4 and shape[0] == 1 and shape[1] in (1, 3) and shape[3] not in (1, 3) and min(shape[2:]) >= SIDE_MIN


def to_image(array):
    return np.ascontiguousarray(np.transpose(array, TO_IMAGE))


def turn(graph):
    first = next((t for t in graph.inputs if graph.tensors[t].data is None), None)
    if first is None or not is_planes(graph.tensors[first].shape):
        return
    at, image, place = first, as_image(graph, first), 0
    graph.inputs[graph.inputs.index(first)] = image
    readers = [op for op in graph.ops if at in op.inputs]
    if len(readers) == 1 and readers[0].name == "QUANTIZE" and at not in graph.outputs:
        quantise, place = readers[0], graph.ops.index(readers[0]) + 1
        at = quantise.outputs[0]
        quantise.inputs, image = [image], as_image(graph, at)
        quantise.outputs = [image]
        readers = [op for op in graph.ops if at in op.inputs]
    for op in readers:
        if op.name == "TRANSPOSE" and order_of(graph, op) == TO_IMAGE:
            op.name, op.inputs = "RESHAPE", [image, op.inputs[1]]
    if at in graph.outputs or any(at in op.inputs for op in graph.ops):
        graph.ops.insert(place, back(graph, image, at))


def as_image(graph, t):
    """A tensor for the same picture with its channels last; no tensor of the file is it."""
    tensor = graph.tensors[t]
    batch, channels, height, width = tensor.shape
    graph.tensors.append(replace(tensor, index=-1, shape=(batch, height, width, channels)))
    return len(graph.tensors) - 1


def order_of(graph, op):
    data = graph.tensors[op.inputs[1]].data
    return None if data is None else tuple(int(v) for v in np.ravel(data))


def back(graph, image, planes):
    """For what else reads the planes; with one channel the bytes lie in the same order."""
    from graph import Op, Tensor
    graph.tensors.append(Tensor(-1, "", "INT32", (4,), np.zeros(0, np.float32), np.zeros(0, np.int64), 0, np.array(TO_PLANES, np.int32)))
    kind = "RESHAPE" if graph.tensors[image].shape[3] == 1 else "TRANSPOSE"
    return Op(-1, kind, 0, [image, len(graph.tensors) - 1], [planes], None)
