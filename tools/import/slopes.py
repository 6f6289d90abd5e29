"""Functions of two bytes that are one slope for values of at least the zero point and, below it, a slope for each channel."""
import numpy as np

f32 = np.float32
SLOPE_MAX = 16384.0  # what the loader takes: the kernels round products of a byte below 2^22


def slope_of(x, y, zero_out):
    """The slope of which zero_out + x slope, rounded and clamped to a byte, is y for all x; None: there is none. In the middle of those that are."""
    if not x.size:
        return f32(0)
    low = np.where(y == 0, -np.inf, y - 0.5 - zero_out) / x
    high = np.where(y == 255, np.inf, y + 0.5 - zero_out) / x
    low, high = np.maximum(np.minimum(low, high).max(), -SLOPE_MAX), np.minimum(np.maximum(low, high).min(), SLOPE_MAX)
    if low > high:
        return None
    slope = f32((low + high) / 2)
    found = np.clip(np.rint(x.astype(f32) * slope) + zero_out, 0, 255)
    return slope if np.array_equal(found, y) else None


def find(pairs, which, zero_in):
    """`pairs`: the byte for each byte and kind of channel; `which`: the kind of each channel. Returns the output's zero point and the slopes
    of all channels, then that of the other values; None where these do not give the same bytes."""
    kinds = pairs[:, :int(which.max()) + 1].astype(np.int64)
    x = np.arange(256) - zero_in
    zero_out, rises, falls = int(kinds[zero_in, 0]), x > 0, x < 0
    if np.any(kinds[zero_in:] != kinds[zero_in:, :1]):
        return None
    slopes = [slope_of(x[falls], kinds[falls, k], zero_out) for k in range(kinds.shape[1])]
    rising = slope_of(x[rises], kinds[rises, 0], zero_out)
    if rising is None or any(s is None for s in slopes):
        return None
    return zero_out, np.array([slopes[k] for k in which] + [rising], f32)
