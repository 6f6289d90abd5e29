"""A network of real numbers from an int8 one: weights and biases by their scales, QUANTIZE and DEQUANTIZE left out. For trying the quantiser
on networks whose int8 form is known.

    build/quantiser-venv/bin/python tests/import/real.py INT8.tflite FLOAT.tflite

Needs ai-edge-litert."""
import sys

import numpy as np

MOVES = ("QUANTIZE", "DEQUANTIZE")


def real_values(model, tensor):
    """A constant's real numbers, None: it is computed."""
    data = model.buffers[tensor.buffer].data
    if data is None or len(data) == 0:
        return None
    q = tensor.quantization
    raw = np.frombuffer(bytes(data), {9: np.int8, 3: np.uint8, 2: np.int32}[tensor.type]).reshape(tensor.shape)
    scale, zero = np.asarray(q.scale, np.float64), np.asarray(q.zeroPoint, np.float64)
    if len(scale) > 1:
        shape = [1] * raw.ndim
        shape[min(q.quantizedDimension, raw.ndim - 1)] = -1
        scale, zero = scale.reshape(shape), zero.reshape(shape)
    return ((raw - zero) * scale).astype(np.float32)


def real(data):
    """The bytes of the model of real numbers."""
    from ai_edge_litert.tools import flatbuffer_utils
    model = flatbuffer_utils.read_model_from_bytearray(bytearray(data))
    graph = model.subgraphs[0]
    codes = [max(c.builtinCode, c.deprecatedBuiltinCode) for c in model.operatorCodes]
    names = {number: name for name, number in vars(flatbuffer_utils.schema_fb.BuiltinOperator).items() if isinstance(number, int)}
    alias = {}
    for op in graph.operators:
        op.inputs = np.array([alias.get(int(t), int(t)) for t in op.inputs], np.int32)
        if names[codes[op.opcodeIndex]] in MOVES:
            alias[int(op.outputs[0])] = int(op.inputs[0])
    graph.operators = [op for op in graph.operators if names[codes[op.opcodeIndex]] not in MOVES]
    graph.outputs = np.array([alias.get(int(t), int(t)) for t in graph.outputs], np.int32)
    for tensor in graph.tensors:
        q = tensor.quantization
        if tensor.type not in (2, 3, 9) or q is None or q.scale is None or not len(q.scale):
            continue
        values = real_values(model, tensor)
        if values is not None:
            model.buffers.append(flatbuffer_utils.schema_fb.BufferT())
            model.buffers[-1].data = np.frombuffer(values.tobytes(), np.uint8)
            tensor.buffer = len(model.buffers) - 1
        tensor.type, tensor.quantization = 0, None
    model.signatureDefs, model.metadata = None, None
    return bytes(flatbuffer_utils.convert_object_to_bytearray(model))


if __name__ == "__main__":
    with open(sys.argv[1], "rb") as source:
        made = real(source.read())
    with open(sys.argv[2], "wb") as target:
        target.write(made)
