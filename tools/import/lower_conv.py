"""Convolutions and fully connected layers: weights packed for the kernels, everything constant put into the bias.

The engine multiplies unsigned activations x by signed weights w. With zero points zx, zw the reference sums
(x - zx)(w - zw). Weights are stored as ws = w - 128 (uint8) or w (int8); zw' is the zero point in that form. Then
sum (x - zx)(ws - zw') = sum x ws - zw' sum x - zx sum (ws - zw'): the last term goes into the bias, the second is a
row sum, needed only where zw' is not 0 (legacy uint8 models). Padding contributes zx, thus nothing."""
import numpy as np

import costs
import quant
from fold import activation_of
from graph import ImportProblem
from layout import CONV_PIXELS, DEPTHWISE_COLUMNS, UNIT_COST
from net import pad_to


def signed_weights(tensor, symmetric=True):
    """Weights as int32 in signed form, and their zero point in that form. The reference takes int8 weights of convolutions as
    symmetric, whatever zero point the file gives them; those of fully connected layers it does not."""
    data = tensor.data.astype(np.int32)
    zero = int(tensor.zero[0]) if len(tensor.zero) else 0
    return (data - 128, zero - 128) if tensor.type == "UINT8" else (data, 0 if symmetric else zero)


def channel_multipliers(ti, tw, to, channels):
    """Multiplier and shift per output channel (PopulateConvolutionQuantizationParams)."""
    if tw.type == "UINT8":
        product = np.float32(ti.scale0 * tw.scale0)
        pairs = [quant.quantize_multiplier(float(product) / float(to.scale0))] * channels
    else:
        scales = tw.scale if len(tw.scale) == channels else np.repeat(tw.scale[:1], channels)
        pairs = [quant.quantize_multiplier(float(ti.scale0) * float(s) / float(to.scale0)) for s in scales]
    return np.array([p[0] for p in pairs], np.int64), np.array([p[1] for p in pairs], np.int32)


def same_padding(size, out, kernel, stride, dilation):
    return max((out - 1) * stride + (kernel - 1) * dilation + 1 - size, 0) // 2


def pack_gemm(weights, k4):
    """[n][k] int8 -> [n / 16][k / 4][16][4], zero filled."""
    n, k = weights.shape
    full = np.zeros((pad_to(n, 16), k4 * 4), np.int8)
    full[:n, :k] = weights
    return full.reshape(-1, 16, k4, 4).transpose(0, 2, 1, 3)


def padded(values, count, dtype=np.int32):
    out = np.zeros(count, np.int64)
    out[:len(values)] = values
    return ((out + (1 << 31)) % (1 << 32) - (1 << 31)).astype(dtype)


def check8(low, op, *tensors):
    for t in tensors:
        if not low.tensor(t).is8:
            raise ImportProblem(low.describe_missing(op))


def window(low, op, t_in, kh, kw, out_shape):
    """Stride, dilation and padding of the operator with a folded PAD before it."""
    o = op.options
    sy, sx = o.StrideH(), o.StrideW()
    dy = o.DilationHFactor() if hasattr(o, "DilationHFactor") else 1
    dx = o.DilationWFactor() if hasattr(o, "DilationWFactor") else 1
    height, width = low.tensor(t_in).shape[1:3]
    top = left = 0
    if o.Padding() == 0:
        top = same_padding(height, out_shape[1], kh, sy, dy)
        left = same_padding(width, out_shape[2], kw, sx, dx)
    extra = low.pads.get(t_in, (0, 0))
    return dict(kh=kh, kw=kw, stride_y=sy, stride_x=sx, dilation_y=dy, dilation_x=dx, pad_top=top + extra[0],
                pad_left=left + extra[1])


def image(low, index_in, index_out):
    vi, vo = low.net.values[index_in], low.net.values[index_out]
    n, h, w, c = vi.shape
    _, oh, ow, oc = vo.shape
    return dict(batch=n, in_h=h, in_w=w, in_c=c, in_stride=vi.pixel, out_h=oh, out_w=ow, out_c=oc,
                out_stride=vo.pixel)


def bias_of(low, op, channels, place=2):
    if len(op.inputs) <= place or op.inputs[place] < 0:
        return np.zeros(channels, np.int64)
    tensor = low.tensor(op.inputs[place])
    if tensor.data is None:
        raise ImportProblem(f"operator {op.index} {op.name}: the bias is computed at run time; only constants work")
    return np.ravel(tensor.data).astype(np.int64)


COLUMNS_LEAST = 16  # of a piece: it reads all weights


def gemm_cost(rows, width, n, k, kh, single):
    """Of rows of `width` pixels, in sixteenths of a nanosecond: products, the rounding of results, windows of `kh` rows that are gathered (0: none are),
    and the weights, which each unit reads anew."""
    n16, k4 = pad_to(n, 16), pad_to(k, 4)
    row, weights = width * (n16 * (7 * k4 // 10 + 14) + 60 * kh + (32 * n if single else 0)), 2 * n16 * k4
    together = min(rows, max((costs.room(gemm_work(single)) - weights) // row, 1))
    return rows * row + rows * weights // together


def gemm_work(single):
    return "fully_connected" if single else "conv"


def emit_gemm(low, op, index_in, index_out, weights, w_zero, bias, mult, shift, geometry, act, table, single=0):
    """A convolution as a matrix product: weights [n][k] in signed form. One of which a row is more than a unit's work becomes several, of fewer
    columns where these are many, else of fewer output channels, 64 at least where that is enough: with fewer the
    kernels are slow."""
    vo, (n, k) = low.net.values[index_out], weights.shape
    batch, height, width = (geometry.get(name, vo.shape[i]) for i, name in enumerate(("batch", "out_h", "out_w")))
    rows, work, gathered = batch * height, gemm_work(single), 0 if is_pointwise(geometry) else geometry["kh"]
    count = -(-costs.scaled(work, gemm_cost(rows, width, n, k, gathered, single)) // (rows * UNIT_COST))
    pieces = column_pieces(low, index_in, index_out, geometry, width, count) if not single and width >= COLUMNS_LEAST * count > COLUMNS_LEAST else []
    for piece in pieces:
        emit_gemm(low, op, index_in, index_out, weights, w_zero, bias, mult, shift, {**geometry, **piece}, act, table)
    if pieces:
        return
    fits = [rows * UNIT_COST // costs.scaled(work, gemm_cost(rows, width, channels, k, gathered, single)) for channels in (64, 32)]
    step = 64 if fits[0] else 32
    size = pad_to(-(-n // -(-n // (max(fits[step == 32], 1) * step))), step)
    for first in range(0, n, size):
        part = slice(first, min(first + size, n))
        out = index_out if size >= n else \
            low.net.derive(index_out, vo.offset + first, vo.shape[:3] + (part.stop - first,), vo.pixel)
        emit_part(low, op, index_in, out, weights[part], w_zero, bias[part], mult[part], shift[part], geometry, act, table, single)


def column_pieces(low, index_in, index_out, geometry, width, count):
    """What differs in the geometry of `count` pieces, each of some columns. Where each pixel is its own window shorter rows do the same."""
    p = {**image(low, index_in, index_out), "out_first": 0, "out_row": 0, **geometry}
    same = is_pointwise(p) and not p["pad_top"] and not p["pad_left"] and (p["in_h"], p["in_w"]) == (p["out_h"], p["out_w"])
    parts = next((f for f in range(count, width + 1) if width % f == 0), 1)
    if same and not p["out_row"] and width // parts >= COLUMNS_LEAST // 2:
        return [{name: p[name] * parts if name[-1] == "h" else width // parts for name in ("in_h", "in_w", "out_h", "out_w")}]
    ends = [width * i // count for i in range(count + 1)]
    return [{"out_w": end - at, "pad_left": p["pad_left"] - at * p["stride_x"], "out_first": p["out_first"] + at * p["out_stride"],
             "out_row": p["out_row"] or width * p["out_stride"]} for at, end in zip(ends, ends[1:])]


def is_pointwise(p):
    return all(p[x] == 1 for x in ("kh", "kw", "stride_x", "stride_y"))


def emit_part(low, op, index_in, index_out, weights, w_zero, bias, mult, shift, geometry, act, table, single):
    net = low.net
    vi = net.values[index_in]
    n, k = weights.shape
    k4, n16 = pad_to(k, 4) // 4, pad_to(n, 16)
    total = bias - vi.zero * (weights.astype(np.int64) - w_zero).sum(axis=1)
    p = image(low, index_in, index_out)
    p.update(geometry)
    p.update(k=k, k4=k4, zero_in=vi.zero, zero_out=act[2], act_min=act[0], act_max=act[1], row_sum_factor=-w_zero,
             single_rounding=single, weights=net.blob(pack_gemm(weights.astype(np.int8), k4)),
             bias=net.blob(padded(total, n16)), multiplier=net.blob(padded(mult, n16)),
             shift=net.blob(padded(shift, n16)), table=table)
    pointwise = is_pointwise(p) and not p["pad_top"] and not p["pad_left"] and p["in_h"] == p["out_h"] and p["in_w"] == p["out_w"]
    rows = p["batch"] * p["out_h"]
    pixels = rows * p["out_w"]
    if single:  # too many products for a unit however few the channels
        p["parts"] = min(costs.parts(gemm_work(single), gemm_cost(1, 1, n, k, 0, single)), k4)
    macs = pixels * n * k
    scratch = 0 if pointwise else CONV_PIXELS * pad_to(k4 * 4 + 15, 64) + 64
    if single:
        scratch += n16 * 4 * CONV_PIXELS
    net.step("CONV", op, [index_in], [index_out], p, rows * (p.get("parts") or 1), macs, cost=gemm_cost(rows, p["out_w"], n, k, 0 if is_pointwise(p) else p["kh"], single),
             scratch=scratch, work=gemm_work(single))


def conv_2d(low, op):
    t_in, t_w, t_out = op.inputs[0], op.inputs[1], op.outputs[0]
    check8(low, op, t_in, t_w, t_out)
    ti, tw, to = low.tensor(t_in), low.tensor(t_w), low.tensor(t_out)
    if tw.data is None:
        raise ImportProblem(f"operator {op.index} CONV_2D: the weights are computed at run time; only constants work")
    oc, kh, kw, wc = tw.shape
    geometry = window(low, op, t_in, kh, kw, to.shape)
    act = quant.activation_range(activation_of(op), to.scale0, to.zero_u8) + (to.zero_u8,)
    weights, w_zero = signed_weights(tw)
    mult, shift = channel_multipliers(ti, tw, to, oc)
    bias = bias_of(low, op, oc)
    source = low.input(t_in)
    last, table = low.merge_after(t_out)
    out = low.output(last)
    groups = ti.shape[3] // wc
    if groups == 1:
        emit_gemm(low, op, source, out, weights.reshape(oc, -1), w_zero, bias, mult, shift, geometry, act, table)
        return
    per = oc // groups
    vi, vo = low.net.values[source], low.net.values[out]
    for g in range(groups):
        part = slice(g * per, (g + 1) * per)
        a = low.net.derive(source, vi.offset + g * wc, vi.shape[:3] + (wc,), vi.pixel)
        b = low.net.derive(out, vo.offset + g * per, vo.shape[:3] + (per,), vo.pixel)
        emit_gemm(low, op, a, b, weights[part].reshape(per, -1), w_zero, bias[part], mult[part], shift[part],
                  geometry, act, table)


def depthwise_conv_2d(low, op):
    t_in, t_w, t_out = op.inputs[0], op.inputs[1], op.outputs[0]
    check8(low, op, t_in, t_w, t_out)
    ti, tw, to = low.tensor(t_in), low.tensor(t_w), low.tensor(t_out)
    if tw.data is None:
        raise ImportProblem(f"operator {op.index} DEPTHWISE_CONV_2D: weights are computed at run time")
    _, kh, kw, oc = tw.shape
    multiplier = oc // ti.shape[3]
    geometry = window(low, op, t_in, kh, kw, to.shape)
    act = quant.activation_range(activation_of(op), to.scale0, to.zero_u8) + (to.zero_u8,)
    weights, w_zero = signed_weights(tw)
    mult, shift = channel_multipliers(ti, tw, to, oc)
    bias = bias_of(low, op, oc)
    source = low.input(t_in)
    last, table = low.merge_after(t_out)
    out = low.output(last)
    if ti.shape[3] == 1:
        emit_gemm(low, op, source, out, weights.reshape(kh * kw, oc).T, w_zero, bias, mult, shift, geometry, act,
                  table)
        return
    if multiplier > 1:
        source = repeat_channels(low, op, source, multiplier)
    emit_depthwise(low, op, source, out, weights.reshape(kh * kw, oc) - w_zero, bias, mult, shift, geometry, act,
                   table)


def repeat_channels(low, op, source, times):
    import lower_data
    v = low.net.values[source]
    n, h, w, c = v.shape
    storage = low.net.storage(n * h * w * c * times)
    wide = low.net.derive(source, 0, (n, h, w, c * times))
    low.net.values[wide].storage = storage
    axes = [(n * h * w, v.pixel, c * times), (times, 0, 1), (c, 1, times)]  # length, step of the source, step of the target
    if times > c:  # the longest runs last
        axes[1:] = axes[:0:-1]
    lower_data.emit_strided(low, op, source, wide, *zip(*axes))
    return wide


def depthwise_cost(pixels, channels, taps):
    return pixels * max(channels, 8) * (taps * 4 + 60)


def emit_depthwise(low, op, source, out, weights, bias, mult, shift, geometry, act, table, whole=True):
    """`weights` [taps][channels] without zero point, up to +-255: split into planes of int8 that add up to them. A layer of which a row is
    more than a unit's work becomes several, of fewer channels."""
    net = low.net
    vi, vo = net.values[source], net.values[out]
    taps, channels = weights.shape
    if whole and channels > 16 and costs.parts("depthwise", depthwise_cost(vo.shape[2], channels, taps)):
        fit = max(costs.room("depthwise") // depthwise_cost(vo.shape[2], 16, taps), 1)
        size = pad_to(-(-channels // -(-channels // (16 * fit))), 16)
        for part in (slice(first, min(first + size, channels)) for first in range(0, channels, size)):
            a, b = (net.derive(i, v.offset + part.start, v.shape[:3] + (part.stop - part.start,), v.pixel) for i, v in ((source, vi), (out, vo)))
            emit_depthwise(low, op, a, b, weights[:, part], bias[part], mult[part], shift[part], geometry, act, table, whole=False)
        return
    c16 = pad_to(channels, 16)
    planes, rest = [], weights.copy()
    while rest.any() or not planes:
        plane = np.clip(rest, -128, 127)
        full = np.zeros((taps, c16), np.int8)
        full[:, :channels] = plane
        planes.append(full)
        rest = rest - plane
    total = bias - vi.zero * weights.astype(np.int64).sum(axis=0)
    p = image(low, source, out)
    p.update(geometry)
    p.update(zero_in=vi.zero, zero_out=act[2], act_min=act[0], act_max=act[1], planes=len(planes), c16=c16,
             weights=net.blob(np.stack(planes)), bias=net.blob(padded(total, c16)),
             multiplier=net.blob(padded(mult, c16)), shift=net.blob(padded(shift, c16)), table=table)
    pixels = p["batch"] * p["out_h"] * p["out_w"]
    columns = min((p["out_w"] - 1) * p["stride_x"] + (p["kw"] - 1) * p["dilation_x"] + 1,
                  max(DEPTHWISE_COLUMNS, (p["kw"] - 1) * p["dilation_x"] + 1))
    net.step("DEPTHWISE", op, [source], [out], p, p["batch"] * p["out_h"], pixels * taps * channels,
             cost=depthwise_cost(pixels, channels, taps), scratch=columns * 256 * ((p["kh"] + 3) // 4))


def fully_connected(low, op):
    t_in, t_w, t_out = op.inputs[0], op.inputs[1], op.outputs[0]
    check8(low, op, t_in, t_w, t_out)
    ti, tw, to = low.tensor(t_in), low.tensor(t_w), low.tensor(t_out)
    oc, k = tw.shape[-2:]
    if tw.data is None:
        computed_weights(low, op, ti.size // k, oc, k)
        return
    batch = ti.size // k
    act = quant.activation_range(activation_of(op), to.scale0, to.zero_u8) + (to.zero_u8,)
    weights, w_zero = signed_weights(tw, symmetric=False)
    source = low.dense_input(t_in)
    source = low.net.derive(source, shape=(1, batch, 1, k))
    last, table = low.merge_after(t_out)
    out = low.output(last)
    wide = low.net.derive(out, shape=(1, batch, 1, oc))
    mult, shift = fully_connected_scale(ti, tw, to, oc)
    geometry = dict(kh=1, kw=1, stride_y=1, stride_x=1, dilation_y=1, dilation_x=1, pad_top=0, pad_left=0)
    emit_gemm(low, op, source, wide, weights.reshape(oc, k), w_zero, bias_of(low, op, oc), mult, shift, geometry, act,
              table, single=1)


def computed_weights(low, op, rows, columns, k):
    """A fully connected layer whose weights an operator makes: a product of two computed matrices."""
    import lower_data
    import lower_math
    (t_in, t_w), t_out = op.inputs[:2], op.outputs[0]
    ti, tw, to = low.tensor(t_in), low.tensor(t_w), low.tensor(t_out)
    mult, shift = fully_connected_scale(ti, tw, to, 1)
    bias = bias_of(low, op, columns)
    out = low.output(t_out)
    p = dict(batch0=1, batch1=1, a_batch0=0, a_batch1=0, b_batch0=0, b_batch1=0, m=rows, k=k, n=columns, a_row=k, b_row=1, b_column=k,
             zero_a=ti.zero_u8, zero_b=tw.zero_u8, zero_out=to.zero_u8, multiplier=mult[0], shift=shift[0], single_rounding=1,
             bias=low.net.blob(padded(bias, columns)) if bias.any() else 0)
    lower_math.emit_product(low, op, low.dense_input(t_in), low.dense_input(t_w), out, p)
    first, last = quant.activation_range(activation_of(op), to.scale0, to.zero_u8)
    if (first, last) != (0, 255):
        low.val[t_out] = low.copy_dense(out, to, quant.table(lambda v: min(max(v, first), last)))


def fully_connected_scale(ti, tw, to, channels):
    """LiteRT rounds acc * (double scale) once; the double's bits travel as two words (low in multiplier). Unlike in convolutions
    the product of the scales is a double for uint8 too."""
    scales = tw.scale if len(tw.scale) == channels else np.repeat(tw.scale[:1], channels)
    real = np.array([float(ti.scale0) * float(s) / float(to.scale0) for s in scales])
    bits = real.astype("<f8").view("<i4").reshape(-1, 2)
    return bits[:, 0].astype(np.int64), bits[:, 1]


def transpose_conv(low, op):
    """Output pixels y with the same (y + padding) % stride see the same taps: each such phase is an ordinary convolution whose
    output pixels lie a stride apart."""
    t_w, t_in, t_out = op.inputs[1], op.inputs[2], op.outputs[0]
    check8(low, op, t_in, t_w, t_out)
    ti, tw, to = low.tensor(t_in), low.tensor(t_w), low.tensor(t_out)
    if tw.data is None:
        raise ImportProblem(f"operator {op.index} TRANSPOSE_CONV: weights are computed at run time")
    oc, kh, kw, ic = tw.shape
    o = op.options
    sy, sx, top, left = o.StrideH(), o.StrideW(), 0, 0
    if o.Padding() == 0:
        top, left = same_padding(to.shape[1], ti.shape[1], kh, sy, 1), same_padding(to.shape[2], ti.shape[2], kw, sx, 1)
    act = quant.activation_range(activation_of(op), to.scale0, to.zero_u8) + (to.zero_u8,)
    weights, w_zero = signed_weights(tw)
    mult, shift = channel_multipliers(ti, tw, to, oc)
    bias = bias_of(low, op, oc, 3)
    source = low.input(t_in)
    last, table = low.merge_after(t_out)
    out = low.output(last)
    vi, vo = low.net.values[source], low.net.values[out]
    batch, h, w, _ = vi.shape
    _, oh, ow, _ = to.shape
    for n, r, s in np.ndindex(batch, min(sy, oh), min(sx, ow)):
        image_in = low.net.derive(source, vi.offset + n * h * w * vi.pixel, (1, h, w, ic), vi.pixel)
        taps_y, pad_y = phase_taps(kh, sy, r + top)
        taps_x, pad_x = phase_taps(kw, sx, s + left)
        part = np.full((oc, len(taps_y), len(taps_x), ic), w_zero, np.int32)
        for i, j in np.ndindex(len(taps_y), len(taps_x)):
            if taps_y[i] is not None and taps_x[j] is not None:
                part[:, i, j] = weights[:, taps_y[i], taps_x[j]]
        geometry = dict(kh=len(taps_y), kw=len(taps_x), stride_y=1, stride_x=1, dilation_y=1, dilation_x=1, pad_top=pad_y,
                        pad_left=pad_x, batch=1, out_h=(oh - r - 1) // sy + 1, out_w=(ow - s - 1) // sx + 1,
                        out_stride=sx * vo.pixel, out_first=((n * oh + r) * ow + s) * vo.pixel, out_row=sy * ow * vo.pixel)
        emit_gemm(low, op, image_in, out, part.reshape(oc, -1), w_zero, bias, mult, shift, geometry, act, table)


def phase_taps(kernel, stride, at):
    """Taps that meet output pixel `at` (padding included), by rising distance of the input pixel from pixel 0, None where a place
    has no tap; and how far before pixel 0 the first lies."""
    found = {(at - k) // stride: k for k in range(kernel) if (at - k) % stride == 0}
    first, last = min([0, *found]), max([0, *found])
    return [found.get(d) for d in range(first, last + 1)], -first


OPERATORS = {"CONV_2D": conv_2d, "DEPTHWISE_CONV_2D": depthwise_conv_2d, "FULLY_CONNECTED": fully_connected,
             "TRANSPOSE_CONV": transpose_conv}
