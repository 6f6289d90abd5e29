"""Operators of MediaPipe's own, of networks of real numbers, as the standard ones that they equal: the quantiser and the reference know no others."""
import struct

import numpy as np

from graph import ImportProblem

TRANSPOSED = "Convolution2DTransposeBias"  # mediapipe/util/tflite/operations/transpose_conv_bias.cc: inputs, weights [oc, kh, kw, ic], bias
SAME, VALID = 1, 2  # TfLitePadding


def name_of(code):
    """Of an operator that is not of the standard; a library's version gives its bytes as such, or as numbers."""
    return "" if code.customCode is None else bytes(bytearray(code.customCode)).decode(errors="replace")


def standard(model, schema):
    """In place; other operators of this kind stay, and are refused by name later."""
    graph, names = model.subgraphs[0], [name_of(code) for code in model.operatorCodes]
    for number, op in enumerate(graph.operators):
        if names[op.opcodeIndex] == TRANSPOSED:
            transpose(model, schema, op, number)


def transpose(model, schema, op, number):
    graph = model.subgraphs[0]
    data = b"" if op.customOptions is None else bytes(bytearray(op.customOptions))
    if len(data) < 12 or len(op.inputs) != 3:
        raise ImportProblem(f"operator {number} {TRANSPOSED}: found {len(data)} bytes of options and {len(op.inputs)} inputs, expected 12 and 3")
    padding, down, right = struct.unpack_from("<iii", data)
    image, weights, out = ([int(n) for n in graph.tensors[int(t)].shape] for t in (op.inputs[0], op.inputs[1], op.outputs[0]))
    if len(image) != 4 or len(weights) != 4 or padding not in (SAME, VALID) or min(down, right) < 1:
        raise ImportProblem(f"operator {number} {TRANSPOSED}: found padding {padding}, strides {down} and {right}, "
                            "expected padding 1 or 2, strides from 1")
    sizes = [n * stride if padding == SAME else (n - 1) * stride + k for n, stride, k in zip(image[1:3], (down, right), weights[1:3])]
    if out != [image[0], *sizes, weights[0]]:
        raise ImportProblem(f"operator {number} {TRANSPOSED}: found an output of {out}, expected {[image[0], *sizes, weights[0]]}")
    code = schema.OperatorCodeT()
    code.builtinCode = code.deprecatedBuiltinCode = schema.BuiltinOperator.TRANSPOSE_CONV
    code.version = 3  # the first with a bias
    model.operatorCodes.append(code)
    op.opcodeIndex, op.customOptions = len(model.operatorCodes) - 1, None
    op.builtinOptionsType = schema.BuiltinOptions.TransposeConvOptions
    op.builtinOptions = options = schema.TransposeConvOptionsT()
    options.padding = schema.Padding.SAME if padding == SAME else schema.Padding.VALID
    options.strideH, options.strideW = down, right
    op.inputs = np.array([constant(model, schema, b"shape_of_%d" % number, out), op.inputs[1], op.inputs[0], op.inputs[2]], np.int32)


def constant(model, schema, name, numbers):
    buffer, tensor = schema.BufferT(), schema.TensorT()
    buffer.data = np.frombuffer(np.array(numbers, np.int32).tobytes(), np.uint8)
    model.buffers.append(buffer)
    tensor.name, tensor.shape, tensor.type, tensor.buffer = name, np.array([len(numbers)], np.int32), schema.TensorType.INT32, len(model.buffers) - 1
    model.subgraphs[0].tensors.append(tensor)
    return len(model.subgraphs[0].tensors) - 1
