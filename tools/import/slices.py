"""What STRIDED_SLICE takes of a tensor, from its begin, end, stride and masks."""


def _rows(options, begin, end, stride, rank):
    """Begin, end, stride and the masks of begin, end and dropped axes by axis of the input (None for a new axis, which moves no byte):
    an ellipsis becomes whole axes."""
    whole = (0, 0, 1, 1, 1, 0)
    new = [i for i in range(len(begin)) if options.NewAxisMask() >> i & 1 and not options.EllipsisMask() >> i & 1]
    kept = rank - (len(begin) - len(new) - bin(options.EllipsisMask()).count("1"))
    rows = []
    for i in range(len(begin)):
        if options.EllipsisMask() >> i & 1:
            rows += [whole] * kept
        elif i in new:
            rows.append(None)
        else:
            rows.append((begin[i], end[i], stride[i], options.BeginMask() >> i & 1, options.EndMask() >> i & 1,
                         options.ShrinkAxisMask() >> i & 1))
    return rows + [whole] * (rank - sum(row is not None for row in rows))


def _axis(n, row, by_length):
    """First element, their number, step."""
    begin, end, s, from_start, to_end, dropped = row
    b = begin + n if begin < 0 else begin
    if dropped:
        return b, 1, 1
    lo, hi = (0, n) if s > 0 else (-1, n - 1)
    b = min(max(b, lo), hi)
    if from_start:
        b = 0 if s > 0 else n - 1
    e = b + end if by_length else end + n if end < 0 else end
    e = min(max(e, lo), hi)
    if to_end:
        e = n if s > 0 else -1
    return b, max(0, -((b - e) // s) if s > 0 else (b - e - s - 1) // -s), s


def box(options, begin, end, stride, shape):
    """First elements, numbers and steps by axis of the input, and the shape that comes out."""
    by_length = hasattr(options, "Offset") and options.Offset()
    axes, out, left = [], [], list(shape)
    for row in _rows(options, begin, end, stride, len(shape)):
        if row is None:
            out.append(1)
            continue
        axes.append(_axis(left.pop(0), row, by_length))
        if not row[5]:
            out.append(axes[-1][1])
    first, counts, steps = ([axis[i] for axis in axes] for i in range(3))
    return first, counts, steps, out
