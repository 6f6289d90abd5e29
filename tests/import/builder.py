"""Builds small .tflite files, operator by operator, with the packages tflite and flatbuffers."""
import flatbuffers
import numpy as np
import tflite

TYPES = {"uint8": tflite.TensorType.UINT8, "int8": tflite.TensorType.INT8, "int32": tflite.TensorType.INT32,
         "int64": tflite.TensorType.INT64, "float32": tflite.TensorType.FLOAT32,
         "float16": tflite.TensorType.FLOAT16}


class Builder:
    def __init__(self):
        self.tensors, self.ops, self.codes = [], [], []
        self.subgraphs = 1  # all the same
        self.signatures = {}  # tensor: shape with -1 where the file leaves it open and writes 1

    def tensor(self, dtype, shape, scale=None, zero=0, data=None, axis=0):
        """Returns the tensor's index. `scale` may be a list (per channel along `axis`)."""
        scales = [] if scale is None else list(np.atleast_1d(scale))
        zeros = list(np.atleast_1d(zero)) * (len(scales) if np.ndim(zero) == 0 else 1)
        self.tensors.append((dtype, tuple(shape), scales, zeros, data, axis))
        return len(self.tensors) - 1

    def const(self, dtype, data, **keys):
        data = np.asarray(data, dtype)
        return self.tensor(dtype, data.shape, data=data, **keys)

    def op(self, name, inputs, outputs, options=None, custom=None, **fields):
        """`options`: name of the options table, e.g. "Conv2D", fields by their schema names."""
        self.ops.append((name, list(inputs), list(outputs), options, fields, custom))

    def _vector(self, b, values, start, prepend):
        start(b, len(values))
        for v in reversed(values):
            prepend(v)
        return b.EndVector()

    def _ints(self, b, values):
        return b.CreateNumpyVector(np.asarray(values, np.int32))

    def _options(self, b, name, fields):
        prefix = name + "Options"
        vectors = {k: self._ints(b, v) for k, v in fields.items() if isinstance(v, (list, tuple))}
        getattr(tflite, prefix + "Start")(b)
        for key, value in fields.items():
            getattr(tflite, f"{prefix}Add{key}")(b, vectors.get(key, value))
        return getattr(tflite, prefix + "End")(b)

    def _operator(self, b, codes, entry):
        name, inputs, outputs, options, fields, custom = entry
        ins, outs = self._ints(b, inputs), self._ints(b, outputs)
        table = self._options(b, options, fields) if options else None
        blob = b.CreateByteVector(custom) if custom else None
        tflite.OperatorStart(b)
        tflite.OperatorAddOpcodeIndex(b, codes.index(name))
        tflite.OperatorAddInputs(b, ins)
        tflite.OperatorAddOutputs(b, outs)
        if table is not None:
            tflite.OperatorAddBuiltinOptionsType(b, getattr(tflite.BuiltinOptions, options + "Options"))
            tflite.OperatorAddBuiltinOptions(b, table)
        if blob is not None:
            tflite.OperatorAddCustomOptions(b, blob)
        return tflite.OperatorEnd(b)

    def _tensor(self, b, number, entry):
        dtype, shape, scales, zeros, data, axis = entry
        signature = self.signatures.get(number)
        dims = self._ints(b, shape if signature is None else [n if n >= 0 else 1 for n in signature])
        signed_dims = None if signature is None else self._ints(b, signature)
        name = b.CreateString(f"t{number}")
        q = None
        if scales:
            s = b.CreateNumpyVector(np.asarray(scales, np.float32))
            z = b.CreateNumpyVector(np.asarray(zeros, np.int64))
            tflite.QuantizationParametersStart(b)
            tflite.QuantizationParametersAddScale(b, s)
            tflite.QuantizationParametersAddZeroPoint(b, z)
            tflite.QuantizationParametersAddQuantizedDimension(b, axis)
            q = tflite.QuantizationParametersEnd(b)
        tflite.TensorStart(b)
        tflite.TensorAddShape(b, dims)
        if signed_dims is not None:
            tflite.TensorAddShapeSignature(b, signed_dims)
        tflite.TensorAddType(b, TYPES[dtype])
        tflite.TensorAddBuffer(b, number + 1)
        tflite.TensorAddName(b, name)
        if q is not None:
            tflite.TensorAddQuantization(b, q)
        return tflite.TensorEnd(b)

    def bytes(self, inputs, outputs):
        b = flatbuffers.Builder(1 << 16)
        codes = list(dict.fromkeys(op[0] for op in self.ops))
        buffers = [None] + [t[4] for t in self.tensors]
        buffer_offsets = []
        for data in buffers:
            vector = None
            if data is not None:
                raw = np.ascontiguousarray(data).tobytes()
                b.StartVector(1, len(raw), 16)
                b.head = b.head - len(raw)
                b.Bytes[b.head:b.head + len(raw)] = raw
                vector = b.EndVector()
            tflite.BufferStart(b)
            if vector is not None:
                tflite.BufferAddData(b, vector)
            buffer_offsets.append(tflite.BufferEnd(b))
        tensors = [self._tensor(b, i, t) for i, t in enumerate(self.tensors)]
        ops = [self._operator(b, codes, op) for op in self.ops]
        code_offsets = []
        for name in codes:
            number = getattr(tflite.BuiltinOperator, name, tflite.BuiltinOperator.CUSTOM)
            custom = b.CreateString(name) if number == tflite.BuiltinOperator.CUSTOM else None
            tflite.OperatorCodeStart(b)
            tflite.OperatorCodeAddDeprecatedBuiltinCode(b, min(number, 127))
            tflite.OperatorCodeAddBuiltinCode(b, number)
            tflite.OperatorCodeAddVersion(b, VERSIONS.get(name, 1))
            if custom is not None:
                tflite.OperatorCodeAddCustomCode(b, custom)
            code_offsets.append(tflite.OperatorCodeEnd(b))

        def offsets(values):
            b.StartVector(4, len(values), 4)
            for v in reversed(values):
                b.PrependUOffsetTRelative(v)
            return b.EndVector()
        t, o = offsets(tensors), offsets(ops)
        i, u = self._ints(b, inputs), self._ints(b, outputs)
        tflite.SubGraphStart(b)
        tflite.SubGraphAddTensors(b, t)
        tflite.SubGraphAddOperators(b, o)
        tflite.SubGraphAddInputs(b, i)
        tflite.SubGraphAddOutputs(b, u)
        subgraphs = offsets([tflite.SubGraphEnd(b)] * self.subgraphs)
        c, f = offsets(code_offsets), offsets(buffer_offsets)
        tflite.ModelStart(b)
        tflite.ModelAddVersion(b, 3)
        tflite.ModelAddOperatorCodes(b, c)
        tflite.ModelAddSubgraphs(b, subgraphs)
        tflite.ModelAddBuffers(b, f)
        b.Finish(tflite.ModelEnd(b), b"TFL3")
        return bytes(b.Output())


# Versions that make the reference take int8 (its checks read them).
VERSIONS = {"CONV_2D": 3, "DEPTHWISE_CONV_2D": 3, "FULLY_CONNECTED": 4, "ADD": 2, "SUB": 2, "MUL": 2, "MAXIMUM": 2,
            "MINIMUM": 2, "CONCATENATION": 2, "SPLIT": 2, "PACK": 2, "UNPACK": 2, "PAD": 2, "MAX_POOL_2D": 2,
            "AVERAGE_POOL_2D": 2, "MEAN": 2, "SUM": 2, "L2_NORMALIZATION": 2, "REDUCE_MAX": 2, "RESIZE_NEAREST_NEIGHBOR": 3, "RESIZE_BILINEAR": 3,
            "TRANSPOSE": 2, "STRIDED_SLICE": 2, "TILE": 2, "LOGISTIC": 2, "TANH": 2, "SOFTMAX": 2, "RELU": 2,
            "RELU6": 2, "LEAKY_RELU": 2, "QUANTIZE": 2, "DEQUANTIZE": 2, "BATCH_MATMUL": 2, "ARG_MAX": 2,
            "SPACE_TO_DEPTH": 2, "SLICE": 2, "GATHER": 2, "PADV2": 2, "TRANSPOSE_CONV": 3, "PRELU": 1}
