"""Fixed-point parameters and exact 8-bit functions, as the reference kernels (LiteRT BUILTIN_REF) compute them.

Every 8-bit function of one 8-bit value becomes a table of 256 bytes, indexed and filled in unsigned form."""
import math

import numpy as np

f32 = np.float32


def round_away(value):
    """C's round(): halves go away from zero."""
    return int(math.floor(abs(value) + 0.5)) * (1 if value >= 0 else -1) if abs(value) < 2**52 else int(value)


def round_away_f32(value):
    value = float(f32(value))
    if not math.isfinite(value):
        return value
    whole = math.trunc(value)
    return float(whole + (0 if abs(value - whole) < 0.5 else math.copysign(1, value)))


def quantize_multiplier(real):
    """real = multiplier * 2^(shift - 31), multiplier in [2^30, 2^31)."""
    if real == 0.0:
        return 0, 0
    fraction, shift = math.frexp(real)
    fixed = round_away(fraction * (1 << 31))
    if fixed == 1 << 31:
        fixed //= 2
        shift += 1
    if shift < -31:
        return 0, 0
    if shift > 30:
        return (1 << 31) - 1, 30
    return fixed, shift


def srdhm(a, b):
    """gemmlowp's saturating rounding doubling high multiply, 32 bits: floor((a b + 2^30) / 2^31)."""
    if a == b == -(1 << 31):
        return (1 << 31) - 1
    return (a * b + (1 << 30)) >> 31


def rdpot(x, exponent):
    """gemmlowp's rounding divide by a power of two: halves go away from zero."""
    if exponent == 0:
        return x
    mask = (1 << exponent) - 1
    return (x >> exponent) + (1 if (x & mask) > (mask >> 1) + (1 if x < 0 else 0) else 0)


def wrap32(x):
    return (x + (1 << 31)) % (1 << 32) - (1 << 31)


def mbqm(x, multiplier, shift):
    left = max(shift, 0)
    return rdpot(srdhm(wrap32(x << left), multiplier), max(-shift, 0))


def activation_range(name_of_activation, scale, zero_u8):
    """Range of the output in unsigned form: 0 none, 1 relu, 2 relu to [-1, 1], 3 relu6."""
    def q(value):
        return zero_u8 + int(round_away_f32(f32(value) / f32(scale)))
    low, high = 0, 255
    if name_of_activation in (1, 3):
        low = max(low, q(0.0))
    if name_of_activation == 3:
        high = min(high, q(6.0))
    if name_of_activation == 2:
        low, high = max(low, q(-1.0)), min(high, q(1.0))
    return low, high


def table(function):
    return np.array([min(255, max(0, function(v))) for v in range(256)], np.uint8)


IDENTITY = np.arange(256, dtype=np.uint8)


def requantize(s_in, z_in, s_out, z_out):
    m, s = quantize_multiplier(float(s_in) / float(s_out))
    return table(lambda v: mbqm(v - z_in, m, s) + z_out)


def between(t_in, t_out):
    """From one 8-bit tensor's form to another's, as QUANTIZE does it."""
    if t_in.scale0 == t_out.scale0 and t_in.zero_u8 == t_out.zero_u8:
        return IDENTITY
    return requantize(t_in.scale0, t_in.zero_u8, t_out.scale0, t_out.zero_u8)


def float_table(t_in, t_out, function):
    """Tables of LOGISTIC and TANH: float arithmetic as in the reference, on the tensor's own form."""
    inverse = f32(1) / f32(t_out.scale0)
    zero_in = t_in.zero_u8 - t_in.bias8
    zero_out = t_out.zero_u8 - t_out.bias8

    def one(v):
        x = f32(t_in.scale0 * f32(v - t_in.bias8 - zero_in))
        with np.errstate(over="ignore"):
            rescaled = f32(round_away_f32(f32(function(x) * inverse)))
        return int(min(max(float(f32(rescaled + f32(zero_out))), -1e9), 1e9)) + t_out.bias8
    return table(one)


def exp_f32(x):
    x = float(x)
    return f32(math.exp(x)) if x < 88.72283 else f32(np.inf)


def logistic(x):
    return f32(f32(1) / f32(f32(1) + exp_f32(-x)))


def tanh(x):
    return f32(math.tanh(float(x)))


def elu(x):
    """As the reference does for int8: std::expm1 of a float."""
    return f32(math.expm1(float(x))) if x < 0 else x


def gelu(x):
    """x times the fraction of the normal distribution below it, by the error function."""
    return f32(f32(f32(0.5) * x) * f32(f32(1) + f32(math.erf(float(f32(x * f32(math.sqrt(0.5))))))))


def gelu_approximate(x):
    cubed = f32(f32(f32(f32(0.044715) * x) * x) * x)
    return f32(f32(f32(0.5) * x) * f32(f32(1) + tanh(f32(f32(math.sqrt(2 / math.pi)) * f32(x + cubed)))))


def log(x):
    return f32(math.log(float(x))) if x > 0 else f32(-np.inf)


def absolute(s_in, z_in, s_out, z_out):
    m, s = quantize_multiplier(float(s_in) / float(s_out))
    same = s_in == s_out
    return table(lambda v: (abs(v - z_in) if same else mbqm(abs(v - z_in), m, s)) + z_out)


def negative():
    """NEG of int8: the reference negates the byte whatever its zero point, and -128 stays."""
    return np.array([((128 - v) % 256 + 128) % 256 for v in range(256)], np.uint8)


def inverse_root(value):
    """1 / sqrt(value) as a multiplier and a shift, by five steps of Newton's method in fixed point (LiteRT's
    GetInvSqrtQuantizedMultiplierExp)."""
    if value <= 1:
        return (1 << 31) - 1, 0
    pairs = (31 - value.bit_length()) // 2 - 1
    shift, value = 11 - pairs, value << 2 * pairs

    def widened(x, bits):
        return max(-(1 << 31), min((1 << 31) - 1, x << bits))
    half, one_and_half, x = rdpot(value >> 1, 1), (1 << 28) + (1 << 27), 1 << 28
    for _ in range(5):
        cubed = widened(srdhm(srdhm(x, x), x), 6)
        x = widened(srdhm(one_and_half, x) - srdhm(half, cubed), 3)
    x = srdhm(x, 1518500250)
    return (x << -shift, 0) if shift < 0 else (x, -shift)


def rsqrt(s_in, z_in, s_out, z_out):
    m, s = quantize_multiplier(1 / (math.sqrt(float(s_in)) * float(s_out)))

    def one(v):
        if v <= z_in:  # below zero the reference stops
            return 255
        multiplier, shift = inverse_root(v - z_in)
        return mbqm(mbqm(1, multiplier, shift + 20), m, s - 20) + z_out
    return table(one)


def square_root(s_in, z_in, s_out, z_out):
    """Cut, not rounded."""
    return table(lambda v: int(f32(f32(np.sqrt(f32(s_in * f32(max(v - z_in, 0))))) / f32(s_out))) + z_out)


def relu(s_in, z_in, s_out, z_out, low, high):
    """RELU, RELU6, RELU_N1_TO_1: `low` and `high` are real bounds, high may be None."""
    m, s = quantize_multiplier(float(f32(s_in) / f32(s_out)))
    qmin = max(0, z_out + int(round_away_f32(f32(low) / f32(s_out))))
    qmax = 255 if high is None else min(255, z_out + int(round_away_f32(f32(high) / f32(s_out))))
    return table(lambda v: min(qmax, max(qmin, z_out + mbqm(v - z_in, m, s))))


def leaky_relu(s_in, z_in, s_out, z_out, alpha):
    m1, s1 = quantize_multiplier(float(f32(f32(s_in) * f32(alpha)) / f32(s_out)))
    m0, s0 = quantize_multiplier(float(f32(s_in) / f32(s_out)))
    return table(lambda v: z_out + (mbqm(v - z_in, m0, s0) if v >= z_in else mbqm(v - z_in, m1, s1)))


def _sat16(x):
    return max(-32768, min(32767, x))


def _srdhm16(a, b):
    return 32767 if a == b == -32768 else (a * b + (1 << 14)) >> 15


def _down16(m):
    return 32767 if m >= (1 << 31) - 1 - (1 << 15) else (m + (1 << 15)) >> 16


def hard_swish(s_in, z_in, s_out, z_out):
    """x relu6(x + 3) / 6 in 16-bit fixed point (LiteRT's reference_ops::HardSwish)."""
    hires = f32(f32(1.0 / 128.0) * f32(s_in))
    m_out, e_out = quantize_multiplier(float(f32(hires / f32(s_out))))
    m_relu, e_relu = quantize_multiplier(float(f32(hires / f32(f32(3.0) / f32(32768.0)))))
    m_out, m_relu = _down16(m_out), _down16(m_relu)

    def one(v):
        x = (v - z_in) * 128
        scaled = _srdhm16(x, m_out)
        r = x
        if e_relu > 0:
            r = _sat16(r << (e_relu - 1))
        r = _srdhm16(r, m_relu)
        if e_relu > 0:
            r = _sat16(r << 1)
        if e_relu < 0:
            r = rdpot(r, -e_relu)
        r = (r + (1 << 15)) >> 1
        product = r * scaled
        high = 32767 if r == scaled == -32768 else int(math.trunc(product / (1 << 15)))
        return rdpot(high, -e_out) + z_out
    return table(one)


def add_params(s_a, s_b, s_out):
    """Multipliers of ADD and SUB: both inputs shifted left by 20 and brought to twice the larger scale."""
    twice = 2 * max(float(s_a), float(s_b))
    return (quantize_multiplier(float(s_a) / twice), quantize_multiplier(float(s_b) / twice),
            quantize_multiplier(twice / ((1 << 20) * float(s_out))))


def mul_params(s_a, s_b, s_out):
    return quantize_multiplier(float(f32(f32(f32(s_a) * f32(s_b)) / f32(s_out))))


def div_params(s_a, s_b, s_out):
    return quantize_multiplier(float(f32(f32(s_a) / f32(f32(s_b) * f32(s_out)))))


def one_over_one_plus(x):
    """1 / (1 + x) in Q0.31 by three steps of Newton's method, as gemmlowp has it; nn_softmax.h is the same in C."""
    total = x + (1 << 31) - 1
    half = (total + (1 if total >= 0 else -1)) // 2 if total >= 0 else -((1 - total) // 2)
    y = 1515870810 + srdhm(half, -1010580540)
    for _ in range(3):
        error = (1 << 29) - srdhm(half, y)
        y = wrap32(y + max(-(1 << 31), min((1 << 31) - 1, srdhm(y, error) * 4)))
    return max(-(1 << 31), min((1 << 31) - 1, 2 * y))


def reciprocal(value):
    """1 / value as a number in Q0.31 and how many bits value exceeds one by."""
    zeros = 32 - value.bit_length()
    return one_over_one_plus(wrap32((value << zeros) - (1 << 31))), 31 - zeros


def quotient(p, x, y, inverse):
    """x / y with the reciprocal of the size of y."""
    x = -x if y < 0 else x
    headroom = 31 - (x if x >= 0 else ~x).bit_length()
    whole = srdhm(x << headroom, inverse[0])
    exponent = inverse[1] + headroom - p["s_out"]
    return rdpot(srdhm(whole, p["m_out"]), exponent)


def div_table(p):
    """DIV for every pair of bytes."""
    out = np.zeros((256, 256), np.uint8)
    for b in range(256):
        y = b - p["zero_b"]
        inverse = reciprocal(abs(y))
        for a in range(256):
            out[a, b] = min(p["act_max"], max(p["act_min"], quotient(p, a - p["zero_a"], y, inverse) + p["zero_out"]))
    return out


def binary(kind, p, a, b):
    """One element of a binary operator, in unsigned form; p as written into the file."""
    x, y = a - p["zero_a"], b - p["zero_b"]
    if kind in ("ADD", "SUB"):
        x = mbqm(x << 20, p["m_a"], p["s_a"])
        y = mbqm(y << 20, p["m_b"], p["s_b"])
        v = mbqm(x + y if kind == "ADD" else x - y, p["m_out"], p["s_out"])
    elif kind == "MUL":
        v = mbqm(x * y, p["m_out"], p["s_out"])
    elif kind == "PRELU":
        v = mbqm(x, p["m_a"], p["s_a"]) if x >= 0 else mbqm(x * y, p["m_out"], p["s_out"])
    elif kind == "DIV":
        v = quotient(p, x, y, reciprocal(abs(y)))
    elif kind == "MAXIMUM":
        return max(a, b)
    else:
        return min(a, b)
    return min(p["act_max"], max(p["act_min"], v + p["zero_out"]))


# ---- softmax: exponentials of (value - maximum), gemmlowp fixed point with 5 integer bits ---------------------------

def _fp_mul(a, b):
    return srdhm(a, b)


def _exp_on_interval(a):
    """exp(a) for a in [-1/4, 0), Q0.31 (gemmlowp's exp_on_interval_between_negative_one_quarter_and_0_excl)."""
    constant = 1895147668
    third = 715827883
    x = a + (1 << 28)
    x2 = _fp_mul(x, x)
    x3 = _fp_mul(x2, x)
    x4 = _fp_mul(x2, x2)
    x4_4 = rdpot(x4, 2)
    inner = rdpot(wrap32(_fp_mul(wrap32(x4_4 + x3), third) + x2), 1)
    return min((1 << 31) - 1, constant + _fp_mul(constant, wrap32(x + inner)))


_EXP_STEPS = [(24, 1672461947), (25, 1302514674), (26, 790015084), (27, 290630308), (28, 39332535), (29, 720401),
              (30, 242)]


def exp_on_negative_values(a):
    """exp(a), a <= 0 in Q5.26, result Q0.31."""
    if a == 0:
        return (1 << 31) - 1
    quarter = 1 << 24
    mask = quarter - 1
    remainder_mod = (a & mask) - quarter
    result = _exp_on_interval(remainder_mod << 5)
    remainder = remainder_mod - a
    for bit, multiplier in _EXP_STEPS:
        if remainder & (1 << bit):
            result = _fp_mul(result, multiplier)
    return result


def softmax_table(beta, scale):
    """exp((d) beta scale) in Q0.31 by d = maximum - value; -1 where the reference skips the term."""
    integer_bits = 5
    real = min(float(f32(beta)) * float(f32(scale)) * (1 << (31 - integer_bits)), float((1 << 31) - 1))
    m, left = quantize_multiplier(real)
    radius = math.floor(((1 << integer_bits) - 1) * float(1 << (31 - integer_bits)) / float(1 << left))
    out = np.full(256, -1, np.int32)
    for d in range(256):
        if -d >= -radius:
            x = max(-(1 << 31), min((1 << 31) - 1, -d << left))
            out[d] = exp_on_negative_values(srdhm(wrap32(-d << left), m) if x else 0)
    return out
