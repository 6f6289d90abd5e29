"""Constants of half precision, and sparse ones, as plain tensors of real numbers: the quantiser takes no others. Files keep them so behind operators
DEQUANTIZE and DENSIFY, which go."""
import numpy as np

from graph import ImportProblem


def elements(tensor, stored):
    """The dense array of a sparse tensor (schema.fbs, SparsityParameters): its dimensions, then those of its blocks, in the order of traversal; of
    each either all indices are there, or those that are listed."""
    sparsity, shape = tensor.sparsity, [int(n) for n in tensor.shape]
    order, kinds = [int(d) for d in sparsity.traversalOrder], sparsity.dimMetadata
    blocked = [] if sparsity.blockMap is None else [int(d) for d in sparsity.blockMap]
    if sorted(order) != list(range(len(shape) + len(blocked))) or len(kinds) != len(order):
        raise ImportProblem(f"--quantise: found sparse constants {tensor.name.decode()[:40]!r} of {len(kinds)} dimensions, expected {len(shape)}")
    block = [1] * len(shape)
    for level, d in enumerate(order):
        if d >= len(shape):
            block[blocked[d - len(shape)]] = int(kinds[level].denseSize)
    places, index = np.zeros(1, np.int64), np.zeros((1, len(order)), np.int64)  # of what was met so far: where it is stored, its indices
    for d, kind in zip(order, kinds):
        if kind.format == 0:
            counts, starts = np.full(len(places), int(kind.denseSize)), None
        else:
            segments = listed(kind.arraySegments)
            counts, starts = segments[places + 1] - segments[places], segments[places]
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        index = np.repeat(index, counts, 0)
        if starts is None:
            index[:, d], places = within, np.repeat(places, counts) * int(kind.denseSize) + within
        else:
            places = np.repeat(starts, counts) + within
            index[:, d] = listed(kind.arrayIndices)[places]
    at = index[:, :len(shape)] * block
    for n, d in enumerate(blocked):
        at[:, d] += index[:, len(shape) + n]
    full = np.zeros(shape, stored.dtype)
    full[tuple(at.T)] = stored[places]
    return full


def listed(vector):
    return np.asarray(vector.values, np.int64)


def constants(model, schema):
    """Into the operators' inputs, in place."""
    graph, codes, kinds = model.subgraphs[0], [c.builtinCode for c in model.operatorCodes], schema.BuiltinOperator
    kept, known, constant = [], {}, {i for i, t in enumerate(graph.tensors) if model.buffers[t.buffer].data is not None}
    for op in graph.operators:
        code, source = codes[op.opcodeIndex], int(op.inputs[0]) if len(op.inputs) else -1
        if source in constant and (code == kinds.DENSIFY or code == kinds.DEQUANTIZE and (source in known or graph.tensors[source].type == schema.TensorType.FLOAT16)):
            t, out = graph.tensors[source], graph.tensors[int(op.outputs[0])]
            stored = np.frombuffer(bytes(model.buffers[t.buffer].data), np.float16 if t.type == schema.TensorType.FLOAT16 else np.float32)
            found = known[source] if source in known else stored if t.sparsity is None else elements(t, stored)
            known[int(op.outputs[0])] = found
            buffer = schema.BufferT()
            buffer.data = np.frombuffer(found.astype(np.float32).tobytes(), np.uint8)
            model.buffers.append(buffer)
            out.buffer, out.type = len(model.buffers) - 1, schema.TensorType.FLOAT32
            constant.add(int(op.outputs[0]))
        else:
            kept.append(op)
    graph.operators = kept
