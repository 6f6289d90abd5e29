"""The engine's view of a network while it is being built: storages, values in them, operators, constant data."""
from dataclasses import dataclass, field

import numpy as np

import costs
from graph import ImportProblem
from layout import ALIGN, TYPE_BYTES


@dataclass
class Storage:
    bytes: int
    data: bytes = None          # constant
    first: int = 1 << 30        # operator that writes it first
    last: int = -1              # operator that reads it last
    offset: int = -1
    joined: int = -1            # shares the place of another storage (in-place operators)


@dataclass
class Value:
    """One tensor inside a storage. `pixel` is the distance in bytes of neighbouring pixels (last axis packed)."""
    storage: int
    offset: int
    shape: tuple
    type: str
    signed: bool
    scale: float
    zero: int
    source: int
    pixel: int

    @property
    def dense(self):
        return not self.shape or self.pixel == self.shape[-1] * TYPE_BYTES[self.type]

    @property
    def count(self):
        return int(np.prod(self.shape, dtype=np.int64)) if self.shape else 1

    @property
    def extent(self):
        if self.dense:
            return self.count * TYPE_BYTES[self.type]
        return (self.count // self.shape[-1] - 1) * self.pixel + self.shape[-1]


@dataclass
class Step:
    kind: str
    inputs: list
    outputs: list
    params: dict
    rows: int
    macs: int
    source: int
    code: int
    name: str
    scratch: int = -1           # storage
    in_place: bool = False
    cost: int = 0
    work: str = ""              # of which kind (costs.txt)
    formula: int = 0            # its cost before the table of measured costs


@dataclass
class Net:
    storages: list = field(default_factory=list)
    values: list = field(default_factory=list)
    steps: list = field(default_factory=list)
    data: bytearray = field(default_factory=bytearray)
    blobs: dict = field(default_factory=dict)
    inputs: list = field(default_factory=list)
    outputs: list = field(default_factory=list)
    states: list = field(default_factory=list)  # values that keep their bytes from run to run
    names: dict = field(default_factory=dict)  # of output tensors in the .tflite file

    def blob(self, array):
        """Place constant data; returns its offset in the data section plus 1 (0 means none). Equal data is shared."""
        raw = np.ascontiguousarray(array).tobytes()
        if raw in self.blobs:
            return self.blobs[raw]
        self.data.extend(b"\0" * (-len(self.data) % ALIGN))
        offset = len(self.data) + 1
        self.data.extend(raw)
        self.blobs[raw] = offset
        return offset

    def storage(self, size, data=None):
        self.storages.append(Storage(max(int(size), 1), data))
        return len(self.storages) - 1

    def value(self, storage, tensor, offset=0, pixel=None, shape=None):
        shape = tuple(tensor.shape if shape is None else shape)
        if len(shape) > 6 or min(shape, default=1) < 1:
            raise ImportProblem(f"tensor {tensor.index} {tensor.name!r} has shape {list(shape)}, expected at most 6 axes, none empty")
        size = TYPE_BYTES[tensor.type]
        dense = (shape[-1] if shape else 1) * size
        self.values.append(Value(storage, offset, shape, tensor.type, tensor.signed, float(tensor.scale0),
                                 tensor.zero_u8 if tensor.is8 else 0, tensor.index, dense if pixel is None else pixel))
        return len(self.values) - 1

    def derive(self, index, offset=None, shape=None, pixel=None, source=None):
        v = self.values[index]
        shape = v.shape if shape is None else tuple(shape)
        dense = (shape[-1] if shape else 1) * TYPE_BYTES[v.type]
        self.values.append(Value(v.storage, v.offset if offset is None else offset, shape, v.type, v.signed, v.scale,
                                 v.zero, v.source if source is None else source, dense if pixel is None else pixel))
        return len(self.values) - 1

    def step(self, kind, op, inputs, outputs, params, rows, macs=0, cost=0, scratch=0, in_place=False, work=None):
        """`rows`: independent slices, `cost`: work of all of them in multiply-accumulates or their like, of the kind `work` in costs.txt."""
        work, cost = work or kind.lower(), max(int(cost), 1)
        number = len(self.steps)
        for i in inputs:
            s = self.storages[self.values[i].storage]
            s.last = max(s.last, number)
        for i in outputs:
            s = self.storages[self.values[i].storage]
            s.first = min(s.first, number)
            s.last = max(s.last, number)
        piece = -1
        if scratch:
            piece = self.storage(scratch)
            self.storages[piece].first = self.storages[piece].last = number
        self.steps.append(Step(kind, list(inputs), list(outputs), params, int(rows), int(macs), op.index, op.code,
                               op.name, piece, in_place, costs.scaled(work, cost), work, cost))


def pad_to(value, multiple):
    return (value + multiple - 1) // multiple * multiple
