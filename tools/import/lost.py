"""What quantising has destroyed: an output whose error is as large as its numbers, and a score that bytes hold below one half, since no picture
showed what the network seeks."""
import choose
import details
import graph as graph_module
from graph import ImportProblem, origin

ONWARDS = "or --any-loss to go on"


def parsed(data, names):
    """The network, ended at these tensors if there are any."""
    graph = graph_module.parse(data)
    if names:
        graph_module.cut(graph, names)
    return graph


def read_by(kind, known, count):
    """Which outputs the decoder reads, and which of them hold its scores."""
    if kind == "ssd":
        return [2], []  # boxes change their places with their scores
    if known is not None and any(known.roles):
        read = [role - 1 for role in known.roles if role]
        return read, [known.roles[1] - 1] if known.roles[1] else read[:1]
    return (list(range(count)),) * 2 if kind in choose.SEVERAL else ([0], [0])


def score_inputs(graph, t):
    """The tensors that LOGISTIC makes scores of t from, through operators that move or join numbers."""
    made = {out: op for op in graph.ops for out in op.outputs}
    found, ways, seen = set(), [t], set()
    while ways:
        t = ways.pop()
        op = made.get(t)
        if op is None or t in seen:
            continue
        seen.add(t)
        if op.name == "LOGISTIC":
            found.add(op.inputs[0])
        elif op.name in ("CONCATENATION", "PACK"):
            ways += op.inputs
        elif op.name in (*choose.MOVED, "TRANSPOSE", "STRIDED_SLICE", "SLICE"):
            ways.append(op.inputs[0])
    return found


def is_silent(e, t, logits):
    """Whether no score of t can be above one half: what LOGISTIC takes has no bytes above zero, in any part."""
    inputs = [origin(e.graph, i)[0] for i in score_inputs(e.graph, t) or ([t] if logits else [])]
    return bool(inputs) and all(e.graph.tensors[i].is8 and e.range_of(e.graph.tensors[i])[1] <= 0 for i in inputs)


def fault(data, kind, labels, metadata, arguments, lost):
    """The line that refuses the quantised network, None: it holds. `lost`: for each output its error's share of its numbers."""
    if kind in (None, "none"):
        return None
    whole, graph = parsed(data, []), parsed(data, arguments.outputs)
    e = choose.Evidence(graph, labels, metadata, arguments)
    try:
        known = details.of(kind, e, arguments)
    except ImportProblem:
        return None  # what reads the file next says it
    read, scores = read_by(kind, known, len(e.outs))
    logits = known is not None and known.logits & details.LOGITS_SCORES
    if any(is_silent(e, graph.outputs[i], logits) for i in scores):
        return f"--quantise: no picture showed what is sought: its score can be 0.5 at most: expected pictures that show it, {ONWARDS}"
    places = {whole.tensors[t].name: i for i, t in enumerate(whole.outputs)}
    for i in read:
        place = places.get(e.outs[i].name)
        if place is not None and lost[place] >= 1:
            return (f"--quantise: output {place} {e.outs[i].name[:30]} is lost, its error is {100 * lost[place]:.0f} % of its numbers: "
                    f"expected other pictures, {ONWARDS}")
    return None


def share(error, size, step):
    """Of an output's numbers: rms of the error, of the numbers, and the distance of its bytes, below which no error means anything."""
    return error / max(size, step, 1e-30)
