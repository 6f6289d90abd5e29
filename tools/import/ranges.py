"""What the bytes of a picture become in a network's input: (pixel - mean) scale, by the input's quantisation. Calibration on dull pictures leaves a
range that is a part of the usual one: the bytes' own numbers would then stretch the contrast of every picture."""
from typing import NamedTuple

from graph import ImportProblem

USUAL = ((0, 1), (-1, 1), (-0.5, 0.5), (0, 255), (-128, 127))  # of networks that take pictures
PARTS = ((0, 1), (-1, 1))  # those whose parts are known as such; others lie inside of 0 to 255, too
NEAR = 0.05  # of a range: what a calibration misses of it
LEAST = 0.25  # of a range, that pictures of any kind have
SIDE_MIN = 16  # pixels: what is smaller is no picture


class Natural(NamedTuple):
    mean: float
    scale: float
    note: str = ""  # what was taken, where the file does not say it
    doubt: str = ""  # why nothing is certain


def of(graph, t):
    """Of an input: where its range is a usual one, or none that is known, the pixel is the quantised value itself; an input of real numbers that are
    quantised first gets the usual range in full."""
    tensor, real = graph.tensors[t], graph.tensors[t].type == "FLOAT32"
    if real:
        readers = [op for op in graph.ops if t in op.inputs]
        if len(readers) != 1 or readers[0].name != "QUANTIZE":
            return Natural(127.5, 1 / 127.5)
        tensor = graph.tensors[readers[0].outputs[0]]
    if not tensor.is8 or not float(tensor.scale0) > 0:
        return Natural(127.5, 1 / 127.5)
    low, high = (float(tensor.scale0) * (v - tensor.zero_u8) for v in (0, 255))
    for a, b in USUAL:
        if abs(low - a) + abs(high - b) < NEAR * (b - a):
            return full(a, b) if real and (a, b) != (-128, 127) else Natural(float(tensor.zero_u8), float(tensor.scale0))
    inside = next(((a, b) for a, b in PARTS if a - NEAR * (b - a) <= low and high <= b + NEAR * (b - a)), None)
    if inside is None or not is_picture(graph.tensors[t].shape):
        return Natural(float(tensor.zero_u8), float(tensor.scale0))
    a, b = inside
    text = f"input {graph.tensors[t].name[:40]!r} holds {low:.3g} to {high:.3g}, a part of {a} to {b}"
    ends = min(abs(low - a), abs(high - b)) < NEAR / 2 * (b - a) and high - low >= LEAST * (b - a)
    return full(a, b)._replace(**{"note" if ends else "doubt": text})


def full(a, b):
    return Natural(255 * a / (a - b), (b - a) / 255)


def is_picture(shape):
    return len(shape) == 4 and shape[3] in (1, 3) and min(shape[1:3]) >= SIDE_MIN


def settled(graph, arguments, kind):
    """(mean, scale): as the options say, else as the range of the first input does. Raises ImportProblem where a decoder would read what nobody
    knows; raw outputs are of use for arrays, too."""
    found = of(graph, graph.inputs[0])
    said = arguments.mean is not None and arguments.scale is not None
    if found.doubt and not said and kind != "none":
        raise ImportProblem(f"{found.doubt} or of another range: expected --mean and --scale (here {found.mean:g} and {found.scale:.6g}), or --decoder none")
    if (found.note or found.doubt) and not said:
        graph.notes.append(f"{found.note or found.doubt}, which is taken: --mean and --scale say otherwise")
    return found.mean if arguments.mean is None else arguments.mean, found.scale if arguments.scale is None else arguments.scale
