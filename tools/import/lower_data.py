"""Operators that only move bytes (some through a table), all as strided copies of up to six axes."""
import numpy as np

import quant
import slices
from constant import dequantize_table
from graph import ImportProblem
from layout import TYPE_BYTES

CHUNK = 16384
COPY_ROW = 64  # work in multiply-accumulates or their like, beside that of its elements


def dense_strides(shape, element=1):
    out, step = [], element
    for n in reversed(shape):
        out.append(step)
        step *= n
    return tuple(reversed(out))


def value_strides(v):
    """Byte strides of a value's axes; the last axis is packed, the others count pixels."""
    size = TYPE_BYTES[v.type]
    if v.dense:
        return dense_strides(v.shape, size)
    return tuple(s * v.pixel for s in dense_strides(v.shape[:-1])) + (size,)


def coalesce(dims, *strides):
    """Merge neighbouring axes that every operand walks without a jump; drop axes of length 1."""
    axes = [(n, *[s[i] for s in strides]) for i, n in enumerate(dims) if n != 1]
    out = []
    for axis in axes:
        if out and all(p == s * axis[0] for p, s in zip(out[-1][1:], axis[1:])):
            out[-1] = (out[-1][0] * axis[0], *axis[1:])
        else:
            out.append(axis)
    if not out:
        out = [(1, *[1] * len(strides))]
    n = out[-1][0]
    if n > CHUNK and len(out) < 6:
        part = next((d for d in range(CHUNK, 255, -1) if n % d == 0), 0)
        if part:
            last = out.pop()
            out += [(n // part, *[s * part for s in last[1:]]), (part, *last[1:])]
    if len(out) > 6:
        raise ImportProblem(f"a copy needs {len(out)} axes, at most 6 work")
    while len(out) < 6:
        out.insert(0, (1, *[0] * len(strides)))
    return [list(column) for column in zip(*out)]


def emit_strided(low, op, source, out, dims, src, dst, src_first=0, dst_first=0, table=None):
    net = low.net
    size = TYPE_BYTES[net.values[source].type]
    d, s, t = coalesce(dims, src, dst)
    p = {f"dim{i}": d[i] for i in range(6)}
    p.update({f"src{i}": s[i] for i in range(6)})
    p.update({f"dst{i}": t[i] for i in range(6)})
    blob = net.blob(table) if table is not None and not np.array_equal(table, quant.IDENTITY) else 0
    p.update(src_first=src_first, dst_first=dst_first, element_bytes=size, table=blob)
    count = int(np.prod(dims, dtype=np.int64))
    packed = s[5] == size and t[5] == size
    same = s == t and src_first == dst_first
    rows = int(np.prod(d[:5], dtype=np.int64))
    net.step("COPY", op or NOTHING, [source], [out], p, rows,
             cost=rows * COPY_ROW + count * (2 if packed and not blob else 16 if packed else 20), in_place=same,
             work="copy_packed" if packed and not blob else "copy_table" if packed else "copy_strided")


class _Nothing:
    index, code, name = -1, 0, "COPY"


NOTHING = _Nothing()


def emit_copy(low, op, source, out, table=None):
    """Same shape, whatever the strides."""
    vs, vo = low.net.values[source], low.net.values[out]
    emit_strided(low, op, source, out, vs.shape, value_strides(vs), value_strides(vo) if vo.shape == vs.shape
                 else dense_strides(vs.shape, TYPE_BYTES[vo.type]), table=table)


def reshape(low, op):
    low.alias(op.outputs[0], low.dense_input(op.inputs[0]))


def transpose(low, op):
    permutation = low.const_int(op.inputs[1], op, "the permutation")
    source = low.input(op.inputs[0])
    v = low.net.values[source]
    out = low.output(op.outputs[0])
    shape = [v.shape[i] for i in permutation]
    src = [value_strides(v)[i] for i in permutation]
    emit_strided(low, op, source, out, shape, src, dense_strides(shape, TYPE_BYTES[v.type]))


def strided_slice(low, op):
    source = low.input(op.inputs[0])
    spec = (low.const_int(t, op, "the slice") for t in op.inputs[1:4])
    first, shape, stride, _ = slices.box(op.options, *spec, low.net.values[source].shape)
    take(low, op, source, op.outputs[0], first, shape, stride)


def take(low, op, source, t_out, first, shape, stride):
    """A box of a value with steps: a view where only channels are cut, otherwise a copy."""
    net = low.net
    v = net.values[source]
    strides = value_strides(v)
    at = sum(f * s for f, s in zip(first, strides))
    out_shape = low.tensor(t_out).shape
    whole = all(f == 0 and n == m and s == 1 for f, n, m, s in
                list(zip(first, shape, v.shape, stride))[:-1])
    if low.fold and len(v.shape) == 4 and tuple(out_shape) == tuple(shape) and whole and stride[-1] == 1 and \
            TYPE_BYTES[v.type] == 1 and t_out not in low.place:
        low.val[t_out] = net.derive(source, v.offset + first[-1], shape, v.pixel, source=t_out)
        return
    out = low.output(t_out)
    vo = net.values[out]
    dst = value_strides(vo) if tuple(vo.shape) == tuple(shape) else dense_strides(shape, TYPE_BYTES[v.type])
    emit_strided(low, op, source, out, shape, [s * k for s, k in zip(strides, stride)], dst, src_first=at)


def slice_(low, op):
    """SLICE: a box by its first elements and sizes, of which -1 reaches to the end."""
    source = low.input(op.inputs[0])
    first, sizes = low.const_int(op.inputs[1], op, "the beginning"), low.const_int(op.inputs[2], op, "the size")
    shape = [m - f if n < 0 else n for f, n, m in zip(first, sizes, low.net.values[source].shape)]
    take(low, op, source, op.outputs[0], first, shape, [1] * len(shape))


GATHER_MAX = 64  # copies that one operator may become


def gather(low, op):
    """Constant indices along one axis: a copy for each run of neighbours."""
    indices = low.const_int(op.inputs[1], op, "the list of indices")
    source = low.input(op.inputs[0])
    v = low.net.values[source]
    axis = (op.options.Axis() if op.options else 0) % len(v.shape)
    runs = [i for i in range(len(indices)) if i == 0 or indices[i] != indices[i - 1] + 1]
    if len(runs) > GATHER_MAX or (op.options and op.options.BatchDims()) or not 0 <= min(indices) <= max(indices) < v.shape[axis]:
        raise ImportProblem(low.describe_missing(op, why=f"{len(runs)} runs of indices, at most {GATHER_MAX} work"))
    out = low.output(op.outputs[0])
    src = value_strides(v)
    dst = dense_strides((*v.shape[:axis], len(indices), *v.shape[axis + 1:]), TYPE_BYTES[v.type])
    for at, end in zip(runs, runs[1:] + [len(indices)]):
        part = (*v.shape[:axis], end - at, *v.shape[axis + 1:])
        emit_strided(low, op, source, out, part, src, dst, src_first=indices[at] * src[axis], dst_first=at * dst[axis])


def gather_nd(low, op):
    """Constant places in the first axes: what lies behind each place is a run of bytes, and neighbours are copied as one."""
    places = low.tensor(op.inputs[1])
    low.const_int(op.inputs[1], op, "the list of places")
    source = low.dense_input(op.inputs[0])
    v = low.net.values[source]
    depth = int(places.shape[-1]) if places.shape else 0
    if not 1 <= depth <= len(v.shape):
        raise ImportProblem(low.describe_missing(op))
    rows = np.asarray(places.data, np.int64).reshape(-1, depth)
    if (rows < 0).any() or (rows >= v.shape[:depth]).any():
        raise ImportProblem(low.describe_missing(op, why="a place outside its input"))
    flat = np.ravel_multi_index(rows.T, v.shape[:depth]).tolist() if len(rows) else []
    size, width = int(np.prod(v.shape[depth:], dtype=np.int64)), TYPE_BYTES[v.type]
    runs = [i for i in range(len(flat)) if i == 0 or flat[i] != flat[i - 1] + 1]
    if not flat or len(runs) > GATHER_MAX:
        raise ImportProblem(low.describe_missing(op, why=f"{len(runs)} runs of places, at most {GATHER_MAX} work"))
    out = low.output(op.outputs[0])
    for at, end in zip(runs, runs[1:] + [len(flat)]):
        emit_strided(low, op, source, out, ((end - at) * size,), (width,), (width,), src_first=flat[at] * size * width,
                     dst_first=at * size * width)


def split(low, op):
    t_axis, t_in = (op.inputs[0], op.inputs[1]) if op.name == "SPLIT" else (op.inputs[2], op.inputs[0])
    axis = low.const_int(t_axis, op, "the axis")[0]
    source = low.input(t_in)
    shape = low.net.values[source].shape
    axis %= len(shape)
    at = 0
    for t in op.outputs:
        part = list(shape)
        part[axis] = low.tensor(t).shape[axis]
        first = [0] * len(shape)
        first[axis] = at
        at += part[axis]
        take(low, op, source, t, first, part, [1] * len(shape))


def unpack(low, op):
    source = low.input(op.inputs[0])
    v = low.net.values[source]
    axis = op.options.Axis() % len(v.shape)
    for i, t in enumerate(op.outputs):
        part = list(v.shape)
        part[axis] = 1
        first = [0] * len(v.shape)
        first[axis] = i
        take(low, op, source, t, first, part, [1] * len(v.shape))


def pack(low, op):
    out_shape = low.tensor(op.outputs[0]).shape
    axis = op.options.Axis() % len(out_shape)
    out = low.output(op.outputs[0])
    strides = dense_strides(out_shape, TYPE_BYTES[low.net.values[out].type])
    for i, t in enumerate(op.inputs):
        source = low.input(t)
        v = low.net.values[source]
        dst = strides[:axis] + strides[axis + 1:]
        emit_strided(low, op, source, out, v.shape, value_strides(v), dst, dst_first=i * strides[axis])


def concat_table(ti, to):
    """uint8 inputs of other scale go through float arithmetic (ConcatenationWithScaling)."""
    f32 = np.float32
    if ti.scale0 == to.scale0 and ti.zero_u8 == to.zero_u8:
        return None
    scale = f32(ti.scale0 * f32(f32(1) / to.scale0))
    bias = f32(f32(-ti.zero_u8) * scale)
    return quant.table(lambda v: int(quant.round_away_f32(f32(f32(f32(v) * scale) + bias))) + to.zero_u8)


def concatenation(low, op):
    t_out = op.outputs[0]
    to = low.tensor(t_out)
    axis = op.options.Axis() % len(to.shape)
    if t_out in low.concat_storage:
        low.val[t_out] = low.net.value(low.concat_storage[t_out], to)
        out = low.val[t_out]
    else:
        out = low.output(t_out)
    strides = value_strides(low.net.values[out])
    at = 0
    for t in op.inputs:
        ti = low.tensor(t)
        if not (t in low.place and low.place[t][0] == t_out and t in low.val):
            table = concat_table(ti, to) if ti.is8 and ti.type == "UINT8" else None
            source = low.input(t)
            v = low.net.values[source]
            emit_strided(low, op, source, out, v.shape, value_strides(v), strides,
                         dst_first=at * strides[axis], table=table)
        at += ti.shape[axis]


def pad(low, op):
    found = low.folder.padding(op) if low.fold else None
    if found is not None:
        low.val[op.outputs[0]] = low.input(op.inputs[0])
        low.pads[op.outputs[0]] = found
        return
    pads = np.array(low.const_int(op.inputs[1], op, "the padding")).reshape(-1, 2)
    source = low.input(op.inputs[0])
    v = low.net.values[source]
    out = low.output(op.outputs[0])
    vo = low.net.values[out]
    fill = pad_value(low, op, vo)
    emit_fill(low, op, out, fill)
    strides = value_strides(vo)
    at = sum(int(a) * s for a, s in zip(pads[:, 0], strides))
    emit_strided(low, op, source, out, v.shape, value_strides(v), strides, dst_first=at)


def pad_value(low, op, vo):
    """The byte around: the zero point, or what PADV2 says."""
    if op.name == "PAD":
        return vo.zero if low.tensor(op.outputs[0]).is8 else 0
    value, ti = low.tensor(op.inputs[2]), low.tensor(op.inputs[0])
    if not value.is8 or value.data is None or value.type != ti.type:
        raise ImportProblem(low.describe_missing(op))
    return int(value.unsigned().ravel()[0])


def space_to_batch(low, op):
    """Only as the first part of a dilated convolution: see dilate.py."""
    if "margins" not in op.custom:
        raise ImportProblem(low.describe_missing(op, why="not around a convolution"))
    low.val[op.outputs[0]] = low.input(op.inputs[0])
    low.pads[op.outputs[0]] = op.custom["margins"]


def emit_fill(low, op, out, value):
    size = low.net.values[out].extent
    low.net.step("FILL", op, [], [out], dict(bytes=size, value=value), (size + CHUNK - 1) // CHUNK, cost=size)


def tile(low, op):
    """A copy walks six axes, of which every repeated one takes two: where that is not enough there are several copies, the last axes'
    first."""
    times = low.const_int(op.inputs[1], op, "the repetitions")
    repeated, most = [i for i, k in enumerate(times) if k > 1], 2 if len(times) > 3 else 3
    source, inner = low.input(op.inputs[0]), [repeated[i:i + most] for i in range(0, len(repeated), most)][:0:-1]
    for axes in inner:
        v = low.net.values[source]
        wide = low.net.derive(source, 0, [n * k if i in axes else n for i, (n, k) in enumerate(zip(v.shape, times))])
        low.net.values[wide].storage = low.net.storage(low.net.values[wide].count * TYPE_BYTES[v.type])
        low.net.values[wide].source = -1
        repeat(low, op, source, wide)
        source = wide
    repeat(low, op, source, low.output(op.outputs[0]))


def repeat(low, op, source, out):
    v, vo = low.net.values[source], low.net.values[out]
    dims, src, dst = [], [], []
    for n, m, s, d in zip(v.shape, vo.shape, value_strides(v), value_strides(vo)):
        dims += [m // n, n]
        src += [0, s]
        dst += [d * n, d]
    emit_strided(low, op, source, out, dims, src, dst)


def space_to_depth(low, op):
    b = op.options.BlockSize()
    source = low.input(op.inputs[0])
    v = low.net.values[source]
    n, h, w, c = v.shape
    out = low.output(op.outputs[0])
    sn, sh, sw, sc = value_strides(v)
    dn, dh, dw, dc = value_strides(low.net.values[out])
    if op.name == "SPACE_TO_DEPTH":
        emit_strided(low, op, source, out, (n, h // b, b, w // b, b, c), (sn, sh * b, sh, sw * b, sw, sc),
                     (dn, dh, dc * b * c, dw, dc * c, dc))
    else:
        k = c // (b * b)
        emit_strided(low, op, source, out, (n, h, b, w, b, k), (sn, sh, sc * b * k, sw, sc * k, sc),
                     (dn, dh * b, dh, dw * b, dw, dc))


def cast(low, op):
    ti, to = low.tensor(op.inputs[0]), low.tensor(op.outputs[0])
    if ti.is8 and to.is8:
        low.apply_table(op, op.inputs[0], op.outputs[0], low.folder.unary_table(op)[1])
        return
    source = low.dense_input(op.inputs[0])
    out = low.output(op.outputs[0])
    low.net.step("CAST", op, [source], [out], dict(count=ti.size), (ti.size + 4095) // 4096, cost=ti.size * 8)


def quantize(low, op):
    ti, to = low.tensor(op.inputs[0]), low.tensor(op.outputs[0])
    if ti.is8 and to.is8:
        low.apply_table(op, op.inputs[0], op.outputs[0], low.folder.unary_table(op)[1])
        return
    if ti.type != "FLOAT32" or not to.is8:
        raise ImportProblem(low.describe_missing(op))
    source = low.dense_input(op.inputs[0])
    out = low.output(op.outputs[0])
    bits = int(np.float32(to.scale0).view(np.int32))
    low.net.step("QUANTIZE", op, [source], [out], dict(count=ti.size, scale=bits, zero=to.zero_u8),
                 (ti.size + 4095) // 4096, cost=ti.size * 32)


def dequantize(low, op):
    ti = low.tensor(op.inputs[0])
    if not ti.is8 or low.tensor(op.outputs[0]).type != "FLOAT32":
        raise ImportProblem(low.describe_missing(op))
    source = low.dense_input(op.inputs[0])
    out = low.output(op.outputs[0])
    low.net.step("DEQUANTIZE", op, [source], [out], dict(count=ti.size, table=low.net.blob(dequantize_table(ti))),
                 (ti.size + 4095) // 4096, cost=ti.size * 5)


OPERATORS = {"RESHAPE": reshape, "SQUEEZE": reshape, "EXPAND_DIMS": reshape, "TRANSPOSE": transpose,
             "STRIDED_SLICE": strided_slice, "SPLIT": split, "SPLIT_V": split, "UNPACK": unpack, "PACK": pack,
             "CONCATENATION": concatenation, "PAD": pad, "PADV2": pad, "SLICE": slice_, "GATHER": gather, "GATHER_ND": gather_nd,
             "TILE": tile, "SPACE_TO_DEPTH": space_to_depth, "SPACE_TO_BATCH_ND": space_to_batch,
             "DEPTH_TO_SPACE": space_to_depth, "CAST": cast, "QUANTIZE": quantize, "DEQUANTIZE": dequantize}
