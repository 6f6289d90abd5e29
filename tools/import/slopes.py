"""Functions of two bytes that are one slope for values of at least the zero point and, below it, a slope for each channel or element."""
import numpy as np

f32 = np.float32
SLOPE_MAX = 16384.0  # what the loader takes: the kernels round products of a byte below 2^22
KINDS = 1024  # looked at together


def slopes_of(x, bytes_, zero_out):
    """For each column y of `bytes_` the slope of which zero_out + x slope, rounded and clamped to a byte, is y for all x; no number: there is none. In the
    middle of those that are."""
    if not x.size:
        return np.zeros(bytes_.shape[1], f32)
    y, x = bytes_.astype(np.int64), x[:, None]
    low = np.where(y == 0, -np.inf, y - 0.5 - zero_out) / x
    high = np.where(y == 255, np.inf, y + 0.5 - zero_out) / x
    low, high = np.maximum(np.minimum(low, high).max(0), -SLOPE_MAX), np.minimum(np.maximum(low, high).min(0), SLOPE_MAX)
    slopes = ((low + high) / 2).astype(f32)
    found = np.clip(np.rint(x.astype(f32) * slopes) + zero_out, 0, 255)
    return np.where((low <= high) & (found == y).all(0), slopes, f32(np.nan))


def find(pairs, which, zero_in, missing=0):
    """`pairs`: the byte for each byte and kind of channel; `which`: the kind of each channel, or element. Returns the output's zero point and
    the slopes of all of them, then that of the other values, no number for at most `missing` that have none; None where these do not give the
    same bytes."""
    kinds = pairs[:, :int(which.max()) + 1]
    x = np.arange(256) - zero_in
    zero_out, rises, falls = int(kinds[zero_in, 0]), x > 0, x < 0
    if np.any(kinds[zero_in:] != kinds[zero_in:, :1]):
        return None
    slopes = np.concatenate([slopes_of(x[falls], kinds[falls, at:at + KINDS], zero_out) for at in range(0, kinds.shape[1], KINDS)])
    rising = slopes_of(x[rises], kinds[rises, :1], zero_out)
    found = np.append(slopes[which], rising)
    return None if np.isnan(rising[0]) or np.isnan(found).sum() > missing else (zero_out, found)
