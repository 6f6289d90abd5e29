"""Writing the .fvm file. src/nn/model.h documents the format; both sides check each other through the tests."""
import struct
import zlib

import numpy as np

from layout import (ALIGN, ARENA_SLACK, BINARY, FLAG_CONST, FLAG_SIGNED, HEADER_BYTES, KIND, MAGIC, OP_WORDS, PARAMS,
                    PARAM_WORDS, TENSOR_WORDS, TYPES, VERSION, VERSION_SLOPES, VERSION_STATELESS, VERSION_STATES)

BLOB_KINDS = {"CONV": {"weights", "bias", "multiplier", "shift", "table"},
              "DEPTHWISE": {"weights", "bias", "multiplier", "shift", "table"},
              "BINARY": {"table"}, "COPY": {"table"},
              "RESIZE": {"rows_table", "columns_table"}, "SOFTMAX": {"table"}, "DEQUANTIZE": {"table"}, "BATCH_MATMUL": {"bias"},
              "DETECTION": {"anchor_data", "box_table", "score_table"}}
DECODER_BLOBS = (26, 27, 40)  # thresholds, anchor_data, colours


ONE = 0x3f800000  # 1.0f: the scale of what has none


def align(n):
    return (n + ALIGN - 1) // ALIGN * ALIGN


def i32(value):
    value = int(value)
    return value - (1 << 32) if value >= 1 << 31 else value


class Writer:
    def __init__(self, net, arena_bytes):
        self.net, self.arena_bytes = net, arena_bytes
        self.tensors, self.tensor_of_storage = [], {}

    def storage_tensor(self, s):
        """The record of a whole storage, which values in it refer to."""
        if s not in self.tensor_of_storage:
            storage = self.net.storages[s]
            index = len(self.tensors)
            self.tensor_of_storage[s] = index
            const = storage.data is not None
            offset = self.net.blob(np.frombuffer(storage.data, np.uint8)) - 1 if const else storage.offset
            self.tensors.append([0, FLAG_CONST if const else 0, 1, storage.bytes, 0, 0, 0, 0, 0, storage.bytes, offset,
                                 ONE, 0, -1, index, storage.bytes])
        return self.tensor_of_storage[s]

    def value_tensor(self, i):
        v = self.net.values[i]
        if ("v", i) in self.tensor_of_storage:
            return self.tensor_of_storage["v", i]
        base = self.storage_tensor(v.storage)
        const = self.tensors[base][1] & FLAG_CONST
        if len(v.shape) > 6:
            raise ValueError("a tensor has more than 6 axes")
        dims = list(v.shape) + [0] * (6 - len(v.shape))
        scale = struct.unpack("<i", struct.pack("<f", v.scale if v.scale > 0 else 1.0))[0]
        self.tensor_of_storage["v", i] = len(self.tensors)
        self.tensors.append([TYPES[v.type], const | (FLAG_SIGNED if v.signed else 0), len(v.shape), *dims, v.extent,
                             self.tensors[base][10] + v.offset, scale, v.zero, v.source, base, v.pixel])
        return self.tensor_of_storage["v", i]

    def op_words(self, step, data_offset):
        names = PARAMS[step.kind]
        unknown = set(step.params) - set(names)
        assert not unknown, (step.kind, unknown)
        words = []
        for name in names:
            value = step.params.get(name, 0)
            if name in BLOB_KINDS.get(step.kind, ()) and value:
                value += data_offset - 1
            words.append(i32(value))
        assert len(words) <= PARAM_WORDS, step.kind
        ins = [self.value_tensor(i) for i in step.inputs]
        outs = [self.value_tensor(i) for i in step.outputs]
        scratch = self.storage_tensor(step.scratch) if step.scratch >= 0 else -1
        cost = min((step.cost + step.rows - 1) // step.rows, (1 << 31) - 1)
        return [KIND[step.kind], step.code, step.source, len(ins), len(outs), *(ins + [-1] * (4 - len(ins))),
                *(outs + [-1] * (4 - len(outs))), step.rows, scratch, cost] + \
            words + [0] * (PARAM_WORDS - len(words))

    def output_name(self, i):
        """Of the .tflite file, at most 63 bytes, without what an encoding cuts in two."""
        return self.net.names.get(self.net.values[i].source, "").replace("\0", "").encode()[:63].decode(errors="ignore").encode()

    def version(self):
        """The least that a reader must know."""
        if any(s.params.get(name) for s in self.net.steps for name in ("pack", "parts")):
            return VERSION
        if any(s.kind == "BINARY" and s.params["function"] == BINARY["SLOPES"] for s in self.net.steps):
            return VERSION_SLOPES
        return VERSION_STATES if self.net.states else VERSION_STATELESS

    def bytes(self, name, labels, preprocess, decoder):
        net = self.net
        for step in net.steps:
            for i in step.inputs + step.outputs:
                self.value_tensor(i)
            if step.scratch >= 0:
                self.storage_tensor(step.scratch)
        for i in net.inputs + net.outputs:
            self.value_tensor(i)
        label_data = b"".join(label.encode() + b"\0" for label in labels)
        count_t, count_o = len(self.tensors), len(net.steps)
        at_tensors = HEADER_BYTES
        at_ops = align(at_tensors + count_t * TENSOR_WORDS * 4)
        at_io = align(at_ops + count_o * OP_WORDS * 4)
        at_labels = align(at_io + 4 * (len(net.inputs) + len(net.outputs) + len(net.states)))
        name_data = b"".join(self.output_name(i) + b"\0" for i in net.outputs)
        at_names = at_labels + len(label_data)
        at_data = align(at_names + len(name_data))
        total = align(at_data + len(net.data)) + ALIGN
        out = bytearray(total)
        for t in self.tensors:
            if t[1] & FLAG_CONST:
                t[10] += at_data
        ops = [self.op_words(step, at_data) for step in net.steps]
        struct.pack_into(f"<{count_t * TENSOR_WORDS}i", out, at_tensors, *[w for t in self.tensors for w in t])
        struct.pack_into(f"<{count_o * OP_WORDS}i", out, at_ops, *[w for o in ops for w in o])
        io = [self.value_tensor(i) for i in net.inputs + net.outputs + net.states]
        struct.pack_into(f"<{len(io)}i", out, at_io, *io)
        out[at_labels:at_labels + len(label_data)] = label_data
        out[at_names:at_names + len(name_data)] = name_data
        out[at_data:at_data + len(net.data)] = net.data
        decoder = [w + at_data - 1 if i in DECODER_BLOBS and w else w for i, w in enumerate(decoder)]
        macs = sum(s.macs for s in net.steps)
        head = [self.version(), total, 0, 0, count_t, at_tensors, count_o, at_ops, len(net.inputs), at_io, len(net.outputs),
                at_io + 4 * len(net.inputs), len(labels), at_labels, len(label_data), at_data, len(net.data),
                self.arena_bytes + ARENA_SLACK, macs & 0xffffffff, macs >> 32, at_names, len(name_data)]
        struct.pack_into("<4s22I", out, 0, MAGIC, *head)
        struct.pack_into("<64s", out, 96, name.encode()[:63])
        struct.pack_into("<16i", out, 160, *(preprocess + [0] * (16 - len(preprocess))))
        struct.pack_into("<64i", out, 224, *(decoder + [0] * (64 - len(decoder))))
        if net.states:
            struct.pack_into("<2I", out, 480, len(net.states), at_io + 4 * (len(net.inputs) + len(net.outputs)))
        struct.pack_into("<I", out, 12, zlib.crc32(bytes(out[16:])))
        return bytes(out)
