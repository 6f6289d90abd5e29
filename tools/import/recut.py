"""A model file whose convolutions are cut anew, by the table of measured costs, where the .tflite file is not at hand: nothing changes but what
the file says that their rows cost, so outputs stay as they are, and recordings, which hold their model, replay with the old cuts.

The shipped networks were cut so: their first convolutions alone took longer than a unit (--recut 0; tests/import/uses.py holds that the
committed files are what it makes)."""
import struct
import zlib

import numpy as np

import costs
from graph import ImportProblem
from layout import KINDS, MAGIC, OP_WORDS, PARAMS
from lower_conv import gemm_cost, gemm_work

AT_OPS, AT_ROWS, AT_COST, AT_PARAMS = 28, 13, 15, 16  # a byte of the header, words of an operator


def cost_of(words, index):
    """Of a row of an operator, in sixteenths of a nanosecond."""
    if KINDS[words[0]] != "CONV":
        raise ImportProblem(f"--recut {index}: found {KINDS[words[0]].lower()}, expected a convolution or a fully connected layer")
    p = dict(zip(PARAMS["CONV"], (int(w) for w in words[AT_PARAMS:])))
    rows, single = p["batch"] * p["out_h"], p["single_rounding"]
    kh = 0 if all(p[x] == 1 for x in ("kh", "kw", "stride_x", "stride_y")) else p["kh"]
    formula = gemm_cost(rows, p["out_w"], p["out_c"], p["k"], kh, single)
    return -(-costs.scaled(gemm_work(single), formula) // int(words[AT_ROWS]))


def run(data, text):
    """The file's bytes; `text`: numbers of operators, with commas between."""
    if data[:4] != MAGIC:
        raise ImportProblem("found another file, expected a model file (.fvm) to cut anew")
    data, (count, first) = bytearray(data), struct.unpack_from("<2I", data, AT_OPS)
    numbers = text.split(",")
    if not all(n.isdigit() and int(n) < count for n in numbers):
        raise ImportProblem(f"--recut {text}: found no such operator, expected numbers from 0 to {count - 1}, with commas between")
    for index in map(int, numbers):
        at = first + 4 * OP_WORDS * index
        struct.pack_into("<i", data, at + 4 * AT_COST, cost_of(np.frombuffer(data, "<i4", OP_WORDS, at), index))
    struct.pack_into("<I", data, 12, zlib.crc32(bytes(data[16:])))
    return bytes(data)
