"""SPACE_TO_BATCH_ND, a convolution and BATCH_TO_SPACE_ND: how some converters write a dilated convolution. One again here, with
the padding taken over by the convolution as it is for PAD."""
import numpy as np


class Dilated:
    """A convolution's options with another dilation."""

    def __init__(self, options, block):
        self.options, self.block = options, block

    def DilationHFactor(self):
        return int(self.block[0])

    def DilationWFactor(self):
        return int(self.block[1])

    def __getattr__(self, name):
        return getattr(self.options, name)


def _margins(graph, op):
    """(block, [[top, bottom], [left, right]]) where both are constants over two axes, else None."""
    block, margins = (graph.tensors[t].data for t in op.inputs[1:3])
    if block is None or margins is None or np.size(block) != 2 or np.size(margins) != 4:
        return None
    return [int(v) for v in np.ravel(block)], np.reshape(margins, (2, 2)).astype(int)


def _plain(op):
    o = op.options
    return op.name in ("CONV_2D", "DEPTHWISE_CONV_2D") and o.Padding() == 1 and \
        (o.StrideH(), o.StrideW(), o.DilationHFactor(), o.DilationWFactor()) == (1, 1, 1, 1)


def _alike(a, b):
    return a.type == b.type and np.array_equal(a.scale, b.scale) and np.array_equal(a.zero, b.zero)


def join(graph):
    """Merge every such three; the first stays, with the margins it leaves to the convolution in `custom`."""
    readers = {}
    for op in graph.ops:
        for t in op.inputs:
            readers.setdefault(t, []).append(op)
    gone = set()
    for first in graph.ops:
        if first.name != "SPACE_TO_BATCH_ND":
            continue
        chain, t = [first], first.outputs[0]
        while len(chain) < 3 and len(readers.get(t, [])) == 1 and t not in graph.outputs:
            chain.append(readers[t][0])
            t = chain[-1].outputs[0]
        if len(chain) < 3 or not _plain(chain[1]) or chain[2].name != "BATCH_TO_SPACE_ND":
            continue
        conv, last = chain[1:]
        before, after = _margins(graph, first), _margins(graph, last)
        values = [graph.tensors[i] for i in (first.inputs[0], first.outputs[0], conv.outputs[0], last.outputs[0])]
        if before is None or after is None or before[0] != after[0] or (before[1][:, 0] < after[1][:, 0]).any() or \
                not _alike(*values[:2]) or not _alike(*values[2:]) or conv.inputs[0] != first.outputs[0]:
            continue
        first.custom = {"margins": tuple(int(v) for v in before[1][:, 0] - after[1][:, 0])}
        conv.options = Dilated(conv.options, before[0])
        conv.outputs = [last.outputs[0]]
        gone.add(last.index)
    graph.ops = [op for op in graph.ops if op.index not in gone]
