"""Where every tensor lies in the arena: lifetimes, in-place joins, then greedy placement.

Placing the largest first at the lowest free offset is Pisarchyk and Lee's greedy-by-size ("Efficient Memory
Management for Deep Neural Net Inference", 2020). A few other orders are tried as well and the smallest arena kept."""
from layout import ALIGN


def align(n):
    return (n + ALIGN - 1) // ALIGN * ALIGN


def join_in_place(net):
    """Operators that read each element before writing it may write over an input that nobody reads later."""
    inputs = {net.values[i].storage for i in net.inputs}

    def root(i):
        while net.storages[i].joined >= 0:
            i = net.storages[i].joined
        return i
    for number, step in enumerate(net.steps):
        if not step.in_place:
            continue
        vi, vo = net.values[step.inputs[0]], net.values[step.outputs[0]]
        a, b = root(vi.storage), vo.storage
        sa, sb = net.storages[a], net.storages[b]
        if sa.data is not None or sb.data is not None or a == b or sb.joined >= 0:
            continue
        others = {root(net.values[i].storage) for i in step.inputs[1:]}
        if sa.last != number or sb.first != number or vi.offset or vo.offset or a in others or \
                sb.bytes > sa.bytes or a in inputs:
            continue
        sb.joined = a
        sa.last = max(sa.last, sb.last)
    return root


def place(items):
    """items: (bytes, first, last, id) in order of placement; returns offsets by id and the total."""
    placed, offsets, total = [], {}, 0
    for size, first, last, name in items:
        gaps = sorted((o, s) for o, s, f, l in placed if f <= last and first <= l)
        at = 0
        for o, s in gaps:
            if at + size <= o:
                break
            at = max(at, o + s)
        placed.append((at, size, first, last))
        offsets[name] = at
        total = max(total, at + size)
    return offsets, total


def plan(net):
    """Fill in offsets; returns the arena's bytes, and the bound no plan can go below."""
    root = join_in_place(net)
    items = [(align(s.bytes), s.first, s.last, i) for i, s in enumerate(net.storages)
             if s.data is None and s.joined < 0 and s.last >= s.first - 1 and s.first < 1 << 30]
    steps = range(-1, len(net.steps) + 1)
    breadth = {t: sum(b for b, f, l, _ in items if f <= t <= l) for t in steps}
    widest = sorted(steps, key=lambda t: -breadth[t])
    rank = {}
    for t in widest:
        for item in items:
            if item[1] <= t <= item[2]:
                rank.setdefault(item[3], len(rank))
    orders = [sorted(items, key=lambda x: (-x[0], x[1])), sorted(items, key=lambda x: (x[1], -x[0])),
              sorted(items, key=lambda x: (-(x[2] - x[1]) * x[0], -x[0])),
              sorted(items, key=lambda x: rank[x[3]]),
              sorted(items, key=lambda x: (-x[0] * (x[2] - x[1] + 1) ** 0.5, x[1]))]
    offsets, total = min((place(order) for order in orders), key=lambda r: r[1])
    for i, s in enumerate(net.storages):
        if s.data is None and s.joined < 0:
            s.offset = offsets.get(i, 0)
    for i, s in enumerate(net.storages):
        if s.joined >= 0:
            s.offset = net.storages[root(i)].offset
    return total, max(breadth.values())
