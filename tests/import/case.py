"""What a case of operators.py draws from: shapes, quantisation and values of one small model."""
import numpy as np

from builder import Builder


class Case:
    """Draws shapes and quantisation; `kind` is int8 (per channel), int8t (per tensor) or uint8."""

    def __init__(self, kind, seed):
        self.r = np.random.default_rng(seed)
        self.kind = kind
        self.dtype = "uint8" if kind == "uint8" else "int8"
        self.b = Builder()

    def int(self, low, high):
        return int(self.r.integers(low, high + 1))

    def choose(self, *values):
        return values[self.int(0, len(values) - 1)]

    def zero(self):
        low = 0 if self.dtype == "uint8" else -128
        return self.choose(low, low + 128, self.int(low, low + 255))

    def q(self, shape, scale=None, zero=None, data=None):
        """A quantised tensor."""
        scale = float(np.exp(self.r.uniform(-5, 0))) if scale is None else scale
        zero = self.zero() if zero is None else zero
        return self.b.tensor(self.dtype, shape, scale, zero, data)

    def values(self, shape):
        info = np.iinfo(self.dtype)
        return self.r.integers(info.min, info.max + 1, shape).astype(self.dtype)

    def weights(self, shape, channels, axis, allow_channel=True):
        if self.kind == "int8" and allow_channel:
            scale = np.exp(self.r.uniform(-6, -3, channels))
            data = self.r.integers(-127, 128, shape).astype("int8")
            return self.b.tensor("int8", shape, scale, 0, data, axis), scale
        scale = np.exp(self.r.uniform(-6, -3, 1))
        if self.kind == "uint8":
            return self.b.tensor("uint8", shape, scale, self.int(0, 255),
                                 self.r.integers(0, 256, shape).astype("uint8")), scale
        return self.b.tensor("int8", shape, scale, 0, self.r.integers(-127, 128, shape).astype("int8")), scale

    def bias(self, channels, scale_in, scales):
        data = self.r.integers(-3000, 3000, channels).astype("int32")
        return self.b.tensor("int32", (channels,), np.float32(scale_in) * np.asarray(scales, np.float32), 0, data)
