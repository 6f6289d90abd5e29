"""Arithmetic on 8-bit tensors other than convolutions: element-wise, pooling, reduction, resizing, softmax, heads."""
import numpy as np

import costs
import quant
from constant import dequantize_table
from fold import activation_of, binary_params, is_refused
from graph import ImportProblem
from layout import BINARY, CONV_PIXELS, REDUCE_LANES, TYPE_BYTES, UNIT_COST
from lower_conv import check8, image, same_padding
from lower_data import coalesce, dense_strides, emit_strided, value_strides
from net import pad_to
from slopes import find

f32 = np.float32
SOFTMAX_DEPTH = 8191  # what the sum holds
NORMALISE_DEPTH = 32768
SLOPES_ROW, SLOPES_VALUE = 64, 8  # work in multiply-accumulates or their like
SLOPES_JOINED = 128  # values in a row of joined pixels, at most
VECTORS = ((1, 1, 1), (0, 1, 1), (1, 0, 1))  # strides along rows of which kernels make vectors
SLOPES_PIECE, SLOPES_MISSING = 1 << 15, 64  # elements of a step, where each has a slope; of those without one, at most
POOL_COLUMNS = 16  # of a window whose neighbours share the largest of each column
PACKED_BLOCKS = 8  # blocks of 16 columns whose product with a row takes as long as to pack one
REDUCE_ROW = 256  # results of a slice, where there are more


def float_bits(value):
    return int(f32(value).view(np.int32))


def binary(low, op):
    a, b, t_out = op.inputs[0], op.inputs[1], op.outputs[0]
    check8(low, op, a, b, t_out)
    found = low.folder.unary_table(op)
    if found is not None and low.fold:
        low.apply_table(op, found[0], t_out, found[1])
        return
    ta, tb, to = low.tensor(a), low.tensor(b), low.tensor(t_out)
    if is_refused(op, ta):
        raise ImportProblem(low.describe_missing(op, why="of uint8 alone"))
    p = binary_params(op.name, ta, tb, to, activation_of(op))
    emit_binary(low, op, p, quant.div_table(p) if op.name == "DIV" else None)


def pair(low, op):
    """Any function of two bytes, by its table (islands.py)."""
    emit_binary(low, op, {}, op.custom["table"])


def binary_cost(dims, last, pairs, table):
    """`last`: strides along the rows, which are whole vectors, and longer to begin where one operand is the same for all of a row."""
    rows, count = int(np.prod(dims[:5], dtype=np.int64)), dims[5]
    if pairs is not None:
        return rows * count * 24
    if last not in VECTORS:
        return rows * count * 96
    return rows * ((160 if all(last) else 480) + pad_to(count, 16) * (32 if table else 20))


def binary_work(name, last, pairs):
    if pairs is not None:
        return "pairs"
    name = "extreme" if name in ("MAXIMUM", "MINIMUM") else name.lower()
    return f"{name}_{'alone' if last not in VECTORS else 'rows' if all(last) else 'spread'}"


def slopes_of(low, op, pairs, dims, sa, sb, so):
    """A function of two bytes as slopes, the second of which is a constant that tells the channels of packed pixels apart; None: it is none."""
    kinds = low.tensor(op.inputs[1]).data
    if kinds is None or (sa[5], so[5]) != (1, 1) or sb != [0, 0, 0, 0, 0, kinds.itemsize] or dims[5] != kinds.size:
        return None
    return find(pairs, np.ravel(kinds), low.tensor(op.inputs[0]).zero_u8)


def element_slopes(low, op, pairs):
    """The same where the second operand tells elements apart: the kinds and slopes of all elements of the axes that it has, of which few may have
    no slope; None: it is no such function."""
    kinds, shape = low.tensor(op.inputs[1]).data, low.tensor(op.inputs[0]).shape
    if op.name != "TABLE_PAIR" or kinds is None or kinds.ndim == 1:
        return None
    axes = kinds.ndim - next(i for i, n in enumerate(kinds.shape) if n > 1)
    which = np.ravel(np.broadcast_to(kinds.reshape(kinds.shape[-axes:]), shape[-axes:]))
    found = find(pairs, which, low.tensor(op.inputs[0]).zero_u8, SLOPES_MISSING)
    return None if found is None else (which, *found)


def emit_elements(low, op, out, pairs, found):
    """Pieces of all elements, each with its part of the slopes; elements without one, some in a million, each by a table of pairs."""
    net, (which, zero_out, slopes) = low.net, found
    missing = np.flatnonzero(np.isnan(slopes))
    slopes = np.nan_to_num(slopes)
    source, size = low.dense_input(op.inputs[0]), len(slopes) - 1
    rows = net.values[source].count // size
    for at in range(0, size, SLOPES_PIECE):
        count = min(SLOPES_PIECE, size - at)
        values = [net.derive(v, net.values[v].offset + at, (rows, count), size) for v in (source, out)]
        emit_slopes(low, op, *values, [1, 1, 1, 1, rows, count], *[[0, 0, 0, 0, size, 1]] * 2, (zero_out, np.append(slopes[at:at + count], slopes[-1:])), False)
    if len(missing):
        table, first = net.blob(np.pad(pairs[:, which[missing]], ((0, 0), (0, 256 - len(missing))))), net.storage(len(missing), bytes(range(len(missing))))
    for i, at in enumerate(missing):
        values = [net.derive(v, net.values[v].offset + int(at), (rows, 1), size) for v in (source, out)]
        kind = net.derive(values[0], i, (1,), 1)
        net.values[kind].storage, net.values[kind].source = first, -1
        q = {"function": BINARY["DIV"], "act_max": 255, "table": table, "dim0": 1, "dim1": 1, "dim2": 1, "dim3": 1, "dim4": rows, "dim5": 1, "a4": size, "a5": 1, "o4": size, "o5": 1}
        net.step("BINARY", op, [values[0], kind], [values[1]], q, rows, cost=rows * 96, work="pairs")


def join_pixels(dims, sa, so, slopes):
    """Rows of few channels that follow each other become longer ones, whose whole vectors leave no rest if possible."""
    pixels, channels = dims[4:]
    if sa[4] != channels or so[4] != channels or channels >= SLOPES_JOINED:
        return dims, sa, so, slopes
    counts = [k for k in range(1, SLOPES_JOINED // channels + 1) if pixels % k == 0]
    k = min(counts, key=lambda n: (n * channels % 16 != 0, -n))
    joined = np.append(np.tile(slopes[:-1], k), slopes[-1:])
    sa, so = ([*s[:4], channels * k, 1] for s in (sa, so))
    return [*dims[:4], pixels // k, channels * k], sa, so, joined


def emit_slopes(low, op, va, out, d, sa, so, found, in_place):
    zero_out, slopes = found
    d, sa, so, slopes = join_pixels(d, sa, so, slopes)
    rows = int(np.prod(d[:5], dtype=np.int64))
    q = {"function": BINARY["SLOPES"], "zero_a": low.tensor(op.inputs[0]).zero_u8, "zero_out": zero_out, "act_max": 255, "table": low.net.blob(slopes)}
    q.update({f"{name}{i}": n for name, numbers in (("dim", d), ("a", sa), ("o", so)) for i, n in enumerate(numbers)})
    low.net.step("BINARY", op, [va], [out], q, rows, cost=rows * (SLOPES_ROW + pad_to(d[5], 16) * SLOPES_VALUE), in_place=in_place,
                 work="slopes")


def emit_binary(low, op, p, pairs):
    """`pairs`: the table of a function that has no kernel; what follows is merged into it."""
    a, b = op.inputs[:2]
    to = low.tensor(op.outputs[0])
    va, vb = low.input(a), low.input(b)
    last, after = low.merged_after(op.outputs[0])
    if pairs is not None:
        after, p = pairs if after is None else after[pairs], dict(act_max=255)
    out = low.output(last)
    net = low.net
    shape = to.shape

    def strides(index):
        v = net.values[index]
        full = (1,) * (len(shape) - len(v.shape)) + v.shape
        real = (0,) * (len(shape) - len(v.shape)) + value_strides(v)
        return [0 if n == 1 else s for n, s in zip(full, real)]
    vo = net.values[out]
    d, sa, sb, so = coalesce(shape or (1,), strides(va) or [0], strides(vb) or [0], value_strides(vo) or [1])
    rows, same = int(np.prod(d[:5], dtype=np.int64)), vo.dense and sa == so
    slopes = slopes_of(low, op, after, d, sa, sb, so) if pairs is not None else None
    if slopes is not None:
        emit_slopes(low, op, va, out, d, sa, so, slopes, bool(same))
        return
    slopes = element_slopes(low, op, after) if pairs is not None else None
    if slopes is not None:
        emit_elements(low, op, out, after, slopes)
        return
    if pairs is not None and after.shape[1] > 256:
        raise ImportProblem(low.describe_missing(op, why=f"{np.max(low.tensor(b).data) + 1} different slopes that no product of float32 equals, at most 256 work"))
    table = 0 if after is None else net.blob(after)
    q = {f"dim{i}": d[i] for i in range(6)}
    q.update({f"a{i}": sa[i] for i in range(6)})
    q.update({f"b{i}": sb[i] for i in range(6)})
    q.update({f"o{i}": so[i] for i in range(6)})
    q.update(p, function=BINARY["DIV" if pairs is not None else op.name], table=table)
    along = (sa[5], sb[5], so[5])
    net.step("BINARY", op, [va, vb], [out], q, rows, cost=binary_cost(d, along, pairs, table), in_place=bool(same),
             work=binary_work(op.name, along, pairs))


def pool_cost(name, kh, kw, by_column, channels):
    """Of a pixel; the largest of neighbouring windows is found by columns."""
    if name == "AVERAGE_POOL_2D":
        return 300 + 38 * kh * kw + channels * (38 + 1.4 * kh * kw)
    taps = kh + kw if by_column else kh * kw
    return 200 + 90 * taps + channels * (2 + taps / 2)


def pool(low, op):
    t_in, t_out = op.inputs[0], op.outputs[0]
    check8(low, op, t_in, t_out)
    ti, to = low.tensor(t_in), low.tensor(t_out)
    o = op.options
    kh, kw, sy, sx = o.FilterHeight(), o.FilterWidth(), o.StrideH(), o.StrideW()
    top = left = 0
    if o.Padding() == 0:
        top = same_padding(ti.shape[1], to.shape[1], kh, sy, 1)
        left = same_padding(ti.shape[2], to.shape[2], kw, sx, 1)
    source = low.input(t_in)
    out = low.output(t_out)
    lo, hi = quant.activation_range(activation_of(op), to.scale0, to.zero_u8)
    p = image(low, source, out)
    p.update(kh=kh, kw=kw, stride_y=sy, stride_x=sx, dilation_y=1, dilation_x=1, pad_top=top, pad_left=left,
             average=int(op.name == "AVERAGE_POOL_2D"), is_signed=int(ti.signed), act_min=lo, act_max=hi)
    work, rows = "average" if p["average"] else "largest", p["batch"] * p["out_h"]
    cost = p["out_w"] * pool_cost(op.name, kh, kw, sx == 1 and kw <= POOL_COLUMNS, to.shape[3])
    if costs.parts(work, cost):  # which know no columns
        cost = p["out_w"] * pool_cost(op.name, kh, kw, False, to.shape[3])
        p["parts"] = min(costs.parts(work, cost), p["out_w"] * kh * kw)
    low.net.step("POOL", op, [source], [out], p, rows * (p.get("parts") or 1), cost=rows * cost, work=work,
                 scratch=to.shape[3] * 4 if p.get("parts") and p["average"] else 0)


def reduce(low, op):
    t_in, t_out = op.inputs[0], op.outputs[0]
    check8(low, op, t_in, t_out)
    ti, to = low.tensor(t_in), low.tensor(t_out)
    axes = low.const_int(op.inputs[1], op, "the axes")
    source = low.dense_input(t_in)
    out = low.output(t_out)
    shape = ti.shape
    chosen = {a % len(shape) for a in axes}
    strides = dense_strides(shape)
    keep = [(shape[i], strides[i]) for i in range(len(shape)) if i not in chosen and shape[i] != 1]
    drop = [(shape[i], strides[i]) for i in range(len(shape)) if i in chosen and shape[i] != 1]

    def four(axes_left, name, stride_name, p):
        merged = []
        for n, s in axes_left:
            if merged and merged[-1][1] == n * s:
                merged[-1] = (merged[-1][0] * n, s)
            else:
                merged.append((n, s))
        if name == "dim" and merged and len(merged) < 4 and merged[-1][0] > REDUCE_ROW:  # rows that units can tell apart
            n, s = merged.pop()
            part = next(d for d in range(REDUCE_ROW, 0, -1) if n % d == 0)
            merged += [(n // part, part * s), (part, s)] if part >= 16 else [(n, s)]
        if len(merged) > 4:
            raise ImportProblem(low.describe_missing(op, why="more than 4 separate axes"))
        merged = [(1, 0)] * (4 - len(merged)) + merged
        for i, (n, s) in enumerate(merged):
            p[f"{name}{i}"], p[f"{stride_name}{i}"] = n, s
        return merged
    p = {}
    kept = four(keep, "dim", "outer", p)
    four(drop, "count", "inner", p)
    elements = int(np.prod([n for n, _ in drop], dtype=np.int64)) if drop else 1
    p.update(elements=elements, zero_in=ti.zero_u8, zero_out=to.zero_u8, multiplier=0, shift=0, function=0)
    if op.name == "MEAN":
        mult, shift = quant.quantize_multiplier(float(ti.scale0) / float(to.scale0))
        drop_bits = min(elements.bit_length() - 1, 32, 31 + shift)
        p.update(function=0, multiplier=(mult << drop_bits) // elements, shift=shift - drop_bits)
    elif op.name == "SUM":
        p["multiplier"], p["shift"] = quant.quantize_multiplier(float(ti.scale0) / float(to.scale0))
    else:
        p["function"] = {"REDUCE_MAX": 1, "REDUCE_MIN": 2}[op.name]
    rows = kept[0][0] * kept[1][0] * kept[2][0]
    together = kept[3][1] == 1  # neighbours are reduced at once
    cost = ti.size * (4 if kept[3][0] >= 16 else 8) + to.size * 56 if together else ti.size * 24 + to.size * 96
    work, walks = ("reduce_together", -(-kept[3][0] // REDUCE_LANES)) if together else ("reduce_alone", kept[3][0])
    p["parts"] = min(costs.parts(work, -(-cost // rows)), walks * elements)
    low.net.step("REDUCE", op, [source], [out], p, rows * (p["parts"] or 1), cost=cost, work=work, scratch=REDUCE_LANES * 4 if p["parts"] else 0)


def resize(low, op):
    t_in, t_out = op.inputs[0], op.outputs[0]
    check8(low, op, t_in, t_out)
    ti, to = low.tensor(t_in), low.tensor(t_out)
    o = op.options
    align, half = bool(o.AlignCorners()), bool(o.HalfPixelCenters())
    source = low.input(t_in)
    out = low.output(t_out)
    p = image(low, source, out)
    nearest = op.name == "RESIZE_NEAREST_NEIGHBOR"
    p["mode"] = 0 if nearest else (2 if ti.signed else 1)
    make = nearest_entries if nearest else (fixed_entries if ti.signed else float_entries)
    tables = [make(ti.shape[i], to.shape[i], align, half) for i in (1, 2)]
    if not nearest:
        exact_weights(p, tables)
    p["rows_table"], p["columns_table"] = (low.net.blob(table) for table in tables)
    low.net.step("RESIZE", op, [source], [out], p, p["batch"] * p["out_h"], cost=to.size * (2 if nearest else 28),
                 work="nearest" if nearest else "bilinear")


def scale_of(n_in, n_out, align):
    return f32(f32(n_in - 1) / f32(n_out - 1)) if align and n_out > 1 else f32(f32(n_in) / f32(n_out))


def nearest_entries(n_in, n_out, align, half):
    """Index of the source for each target (GetNearestNeighbor), three words each for one layout with bilinear."""
    scale, offset, out = scale_of(n_in, n_out, align), f32(0.5 if half else 0.0), []
    for i in range(n_out):
        x = f32(f32(f32(i) + offset) * scale)
        k = int(quant.round_away_f32(x)) if align else int(np.floor(x))
        k = min(k, n_in - 1)
        out.append((max(0, k) if half else k, 0, 0))
    return np.array(out, np.int32)


def float_entries(n_in, n_out, align, half):
    """Lower and upper neighbour and the float weight of the upper one, as its bits."""
    scale, out = scale_of(n_in, n_out, align), []
    for i in range(n_out):
        x = f32(f32(f32(f32(i) + f32(0.5)) * scale) - f32(0.5)) if half else f32(f32(i) * scale)
        low, high = max(int(np.floor(x)), 0), min(int(np.ceil(x)), n_in - 1)
        out.append((low, high, float_bits(f32(x - f32(low)))))
    return np.array(out, np.int32)


def exact_weights(p, tables):
    """Weights as multiples of 2^-b with the smallest b that holds them, which fixed point always has. With b up to 7 no float
    operation of the reference rounds (8 + 2 b bits), so integers give the same result there too."""
    fixed = p["mode"] == 2
    reals = [t[:, 2] / 1024 if fixed else np.ascontiguousarray(t[:, 2]).view(np.float32).astype(float) for t in tables]
    every = np.concatenate(reals)
    for b in range(11 if fixed else 8):
        if (every * (1 << b) == np.floor(every * (1 << b))).all():
            p.update(mode=2 if fixed else 3, bits=b)
            for table, w in zip(tables, reals):  # between a pixel and itself all weights do the same
                table[:, 2] = np.where(table[:, 0] == table[:, 1], 0, w * (1 << b)).astype(np.int32)
            return


def fixed_entries(n_in, n_out, align, half):
    """The same with 10 fractional bits (ResizeBilinearInteger)."""
    scale = (((1 << 10) * (n_in - 1) + (n_out - 1) // 2) // (n_out - 1)) if align and n_out > 1 else \
        ((1 << 10) * n_in + n_out // 2) // n_out
    out = []
    for i in range(n_out):
        x = i * scale + (scale // 2 - (1 << 9) if half else 0)
        low = max(int(x / 1024), 0)
        high = min(int((x + 1023) / 1024), n_in - 1)
        out.append((low, high, x - 1024 * low))
    return np.array(out, np.int32)


def softmax(low, op):
    t_in, t_out = op.inputs[0], op.outputs[0]
    check8(low, op, t_in, t_out)
    ti = low.tensor(t_in)
    source = low.dense_input(t_in)
    out = low.output(t_out)
    depth = ti.shape[-1]
    outer = ti.size // depth
    if depth > SOFTMAX_DEPTH:
        raise ImportProblem(low.describe_missing(op, why=f"over more than {SOFTMAX_DEPTH} values"))
    exps = quant.softmax_table(op.options.Beta(), ti.scale0)
    low.net.step("SOFTMAX", op, [source], [out], dict(outer=outer, depth=depth, table=low.net.blob(exps)), outer,
                 cost=ti.size * 12 + outer * 330)


def normalise(low, op):
    """L2_NORMALIZATION along the last axis; the reference demands an output in 1/128."""
    t_in, t_out = op.inputs[0], op.outputs[0]
    check8(low, op, t_in, t_out)
    ti, to = low.tensor(t_in), low.tensor(t_out)
    depth = ti.shape[-1]
    if to.scale0 != f32(1 / 128) or to.zero_u8 != 128 or activation_of(op) or depth > NORMALISE_DEPTH:
        raise ImportProblem(low.describe_missing(op, why=f"of at most {NORMALISE_DEPTH} values, in 1/128, no activation"))
    source = low.dense_input(t_in)
    out = low.output(t_out)
    outer = ti.size // depth
    low.net.step("NORMALISE", op, [source], [out], dict(outer=outer, depth=depth, zero_in=ti.zero_u8, is_signed=int(ti.signed)), outer,
                 cost=ti.size * 28 + outer * 512)


def arg_max(low, op):
    ti, to = low.tensor(op.inputs[0]), low.tensor(op.outputs[0])
    check8(low, op, op.inputs[0])
    axis = low.const_int(op.inputs[1], op, "the axis")[0] % len(ti.shape)
    source = low.dense_input(op.inputs[0])
    out = low.output(op.outputs[0])
    outer = int(np.prod(ti.shape[:axis], dtype=np.int64))
    inner = int(np.prod(ti.shape[axis + 1:], dtype=np.int64))
    if inner > 1:  # along the last axis a row is a pixel, so that units can be small
        source = turned(low, op, low.net.derive(source, shape=(outer, ti.shape[axis], inner)))
    p = dict(outer=outer * inner, axis=ti.shape[axis], inner=1, element_bytes=TYPE_BYTES[to.type],
             minimum=int(op.name == "ARG_MIN"))
    low.net.step("ARG_MAX", op, [source], [out], p, outer * inner, cost=ti.size * 8)


def batch_matmul(low, op):
    a, b, t_out = op.inputs[0], op.inputs[1], op.outputs[0]
    check8(low, op, a, b, t_out)
    ta, tb, to = low.tensor(a), low.tensor(b), low.tensor(t_out)
    va, vb = low.dense_input(a), low.dense_input(b)
    if op.options.AdjX():
        va = turned(low, op, va)
    out = low.output(t_out)
    m, n = to.shape[-2:]
    k = low.net.values[va].shape[-1]
    mult, shift = quant.quantize_multiplier(float(f32(f32(ta.scale0 * tb.scale0)) / f32(1)) / float(to.scale0))
    batch = to.shape[:-2]

    def batch_strides(shape):
        s = list(dense_strides(shape))[:-2]
        n_axes = [1] * (len(batch) - len(s)) + list(shape[:-2])
        s = [0] * (len(batch) - len(s)) + s
        return [0 if n == 1 else v for n, v in zip(n_axes, s)]
    axes = [(n_, x, y) for n_, x, y in zip(batch, batch_strides(low.net.values[va].shape), batch_strides(tb.shape)) if n_ != 1]
    merged = []
    for axis in axes:
        if merged and merged[-1][1] == axis[0] * axis[1] and merged[-1][2] == axis[0] * axis[2]:
            merged[-1] = (merged[-1][0] * axis[0], axis[1], axis[2])
        else:
            merged.append(axis)
    if len(merged) > 2:
        raise ImportProblem(low.describe_missing(op, why="more than 2 separate batch axes"))
    merged = [(1, 0, 0)] * (2 - len(merged)) + merged
    b_row, b_col = (1, tb.shape[-1]) if op.options.AdjY() else (tb.shape[-1], 1)
    p = dict(batch0=merged[0][0], batch1=merged[1][0], a_batch0=merged[0][1], a_batch1=merged[1][1],
             b_batch0=merged[0][2], b_batch1=merged[1][2], m=m, k=k, n=n, a_row=k, b_row=b_row, b_column=b_col,
             zero_a=ta.zero_u8, zero_b=tb.zero_u8, zero_out=to.zero_u8, multiplier=mult, shift=shift)
    emit_product(low, op, va, vb, out, p)


def pack_cost(k, columns):
    """Of `columns` columns of k rows, which may lie pages apart."""
    return k * (48 + 10 * columns)


def emit_product(low, op, va, vb, out, p):
    m, k, n, batches = p["m"], p["k"], p["n"], p["batch0"] * p["batch1"]
    n16, k4 = pad_to(n, 16), pad_to(k, 4)
    product, packing = n16 * (k4 + 16), pack_cost(k, 16)
    if costs.parts("batch_matmul", product):
        blocks = min(max(costs.room("batch_matmul") // (16 * (k4 + 16)), 1), PACKED_BLOCKS)
        p["parts"], product = -(-n16 // (16 * blocks)), 16 * blocks * (k4 + 16)
    if costs.parts("batch_matmul", packing):
        p["pack"] = next(n for n in (8, 4, 2, 1) if n == 1 or not costs.parts("batch_matmul", pack_cost(k, n)))
        packing = pack_cost(k, p["pack"])
    rows = batches * (n16 // (p.get("pack") or 16) + m * (p.get("parts") or 1))  # packing columns is a row as well
    sums = n16 * 4 * CONV_PIXELS if p.get("single_rounding") else 0
    low.net.step("BATCH_MATMUL", op, [va, vb], [out], p, rows, batches * m * n * k, cost=rows * max(product, packing),
                 scratch=n16 * (k4 + 12) + sums)


def turned(low, op, index):
    """The last two axes exchanged, in a value of its own."""
    v = low.net.values[index]
    *batch, rows, columns = v.shape
    out = low.net.derive(index, 0, (*batch, columns, rows))
    low.net.values[out].storage, low.net.values[out].source = low.net.storage(v.count), -1
    src, dst = dense_strides(v.shape), dense_strides((*batch, columns, rows))
    emit_strided(low, op, index, out, (*batch, columns, rows), (*src[:-2], src[-1], src[-2]), dst)
    return out


def detection_postprocess(low, op):
    """TFLite_Detection_PostProcess: boxes from anchors, then class-wise suppression, four float outputs."""
    t_boxes, t_scores = (low.before_dequantize.get(t, t) for t in op.inputs[:2])
    boxes, scores, anchors = (low.tensor(t) for t in (t_boxes, t_scores, op.inputs[2]))
    check8(low, op, t_boxes, t_scores)
    if anchors.data is None or not (anchors.is8 or anchors.type == "FLOAT32"):
        raise ImportProblem(f"operator {op.index} {op.name}: anchors are computed at run time")
    o = op.custom
    count = low.tensor(op.inputs[0]).shape[1]
    limit = int(o["max_detections"])
    per_anchor = int(o.get("max_classes_per_detection", 1))
    slots = limit * per_anchor
    shapes = [(1, slots, 4), (1, slots), (1, slots), (1,)]
    outs = [low.output(t, shape) for t, shape in zip(op.outputs, shapes)]
    vb, vs = low.dense_input(t_boxes), low.dense_input(t_scores)
    columns = scores.shape[-1]
    classes = int(o["num_classes"])

    def floats(t, number):
        if number in low.before_dequantize:  # DEQUANTIZE multiplies in double
            return dequantize_table(t)
        scale, zero = f32(t.scale0), f32(t.zero_u8)
        return np.array([f32(f32(f32(v) - zero) * scale) for v in range(256)], np.float32)
    data = floats(anchors, -1)[anchors.unsigned()] if anchors.is8 else np.asarray(anchors.data, np.float32)
    p = dict(anchors=count, classes=classes, class_offset=columns - classes, max_detections=limit,
             max_per_anchor=per_anchor, per_class=int(o.get("detections_per_class", 100)),
             regular_nms=int(bool(o.get("use_regular_nms", False))),
             score_threshold=float_bits(o["nms_score_threshold"]), iou_threshold=float_bits(o["nms_iou_threshold"]),
             y_scale=float_bits(o["y_scale"]), x_scale=float_bits(o["x_scale"]), h_scale=float_bits(o["h_scale"]),
             w_scale=float_bits(o["w_scale"]), anchor_data=low.net.blob(data), box_table=low.net.blob(floats(boxes, op.inputs[0])),
             score_table=low.net.blob(floats(scores, op.inputs[1])))
    p["parts"] = min(costs.parts("detection", 24 * count), count)
    rows, step_cost = detection_steps(p)
    low.net.step("DETECTION", op, [vb, vs], outs, p, rows, cost=rows * step_cost, scratch=count * 32 + slots * 64 + 64)


def detection_steps(p):
    """Steps as src/nn/op_detection.c makes them, and the cost of one: 24 multiply-accumulates per pair of boxes. Of regular suppression
    each step of a class selects as many boxes as a unit has time for."""
    anchors, decode, parts = p["anchors"], (p["anchors"] - 1) // 64 + 1, p["parts"] or 1
    if not p["regular_nms"]:
        return decode + p["max_detections"] * parts + 2, max(-(-24 * anchors // parts), 64 * (1200 + 8 * p["classes"]))
    limit, selections = max(min(p["per_class"], anchors), 1), 1 if parts > 1 else max(UNIT_COST // costs.scaled("detection", 24 * anchors), 1)
    steps = (limit - 1) // selections + 1
    return decode + p["classes"] * steps * parts + 1, max(24 * ((limit - 1) // steps + 1) * -(-anchors // parts), 64 * 1200)


OPERATORS = {name: binary for name in BINARY}
OPERATORS["TABLE_PAIR"] = pair
OPERATORS.update({"MAX_POOL_2D": pool, "AVERAGE_POOL_2D": pool, "MEAN": reduce, "SUM": reduce, "REDUCE_MAX": reduce,
                  "REDUCE_MIN": reduce, "RESIZE_NEAREST_NEIGHBOR": resize, "RESIZE_BILINEAR": resize,
                  "SOFTMAX": softmax, "L2_NORMALIZATION": normalise, "ARG_MAX": arg_max, "ARG_MIN": arg_max, "BATCH_MATMUL": batch_matmul,
                  "TFLite_Detection_PostProcess": detection_postprocess})
