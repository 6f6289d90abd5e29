"""Damaged .tflite files: each is read all the same, or refused in one line of at most 200 characters; what is read is opened and run by the engine.
Under asan+ubsan it finds what the engine does wrong with what the import lets through:

    tests/import/mutants.sh [COUNT [FIRST]]      COUNT mutants from seed FIRST on (2000, 0) with the engine of build-asan
    python3 tests/import/mutants.py COUNT FIRST  the same with the engine of $FOVEA_LIBRARY

Mutants are of the models in $FOVEA_DATA of at most 1 MB and of small networks of every operator; a seed makes the same mutant again."""
import argparse
import ctypes
import glob
import os
import random
import sys
import time

import operators
import uses
from case import Case
from engine import Engine
from graph import FAULTS  # noqa: F401  what convert() turns into lines

MODEL_MAX, ARENA_MAX, UNITS_MAX, SECONDS_MAX = 1 << 20, 1 << 26, 3000, 60
BATCH = 50  # mutants of a process: what kills it costs no more


def originals():
    """(name, what gives its bytes)."""
    found = []
    for path in sorted(glob.glob(os.path.join(os.environ.get("FOVEA_DATA", "../shared/data"), "models", "*.tflite"))):
        if os.path.getsize(path) <= MODEL_MAX:
            found.append((os.path.basename(path), lambda path=path: open(path, "rb").read()))
    for name, case_of in operators.CASES.items():
        def small(case_of=case_of, draw=random):
            case = Case(draw.choice(("int8", "int8t", "uint8")), draw.randrange(1000))
            inputs, outputs = case_of(case)
            return case.b.bytes(inputs, outputs)
        found.append((name, small))
    return found


def structure(model):
    """Where the words lie that refer to others: all but long runs of weights."""
    bounds, step = [], 64
    for at in range(0, len(model), step):
        part = model[at:at + step]
        if part.count(0) * 4 >= len(part):  # tables, offsets and small numbers
            bounds.append(at)
    return bounds or [0]


def mutate(draw, model):
    model = bytearray(model)
    places = structure(model)
    for _ in range(draw.choice((1, 1, 2, 3, 8))):
        at = draw.choice(places) + draw.randrange(64) if draw.random() < 0.8 else draw.randrange(len(model))
        if at >= len(model):
            continue
        how = draw.randrange(5)
        if how == 0:
            model[at] ^= 1 << draw.randrange(8)
        elif how == 1:
            model[at] = draw.choice((0, 1, 127, 128, 255))
        elif how == 2:
            at -= at % 4
            model[at:at + 4] = draw.choice((0, 1, -1, 2, 1 << 16, 1 << 30, -(1 << 31))).to_bytes(4, "little", signed=True)
        elif how == 3:
            at -= at % 4
            word = int.from_bytes(model[at:at + 4], "little")
            model[at:at + 4] = (word + draw.randint(-8, 8) & 0xFFFFFFFF).to_bytes(4, "little")
        elif draw.random() < 0.2:
            del model[draw.randrange(len(model)):]
            model += b"\0" * 4
    return bytes(model)


def run(data):
    """The engine on a file that the import wrote: some units, bytes of any value."""
    engine = Engine(data, random.choice(("c", "sse4", None)))
    if len(engine.arena) > ARENA_MAX:
        return
    engine.arena[:] = 0x37
    done, progress = ctypes.c_uint32(), operators.check.Progress(0, 0)
    engine.lib.fv_nn_run(engine.model, engine.kernels, ctypes.c_void_p(engine.arena.ctypes.data), ctypes.byref(progress), ctypes.c_uint32(UNITS_MAX), ctypes.byref(done))


def one(bench, seed, files):
    """'read' or 'refused'; anything else is a finding."""
    draw = random.Random(seed)
    random.seed(seed)
    name, read = draw.choice(files)
    mutant = mutate(draw, read())
    begin = time.monotonic()
    found = bench.run(mutant, "--decoder", "none")
    if isinstance(found, uses.Written):
        try:
            run(found.raw)
        except RuntimeError as problem:
            return f"{name}: the engine refuses what was written: {problem}"
        kind = "read"
    else:
        status, line = found
        if status != 2 or line.count("\n") != 1 or len(line.split(": ", 1)[1]) > 201:
            return f"{name}: status {status}, {line[-300:]!r}"
        kind = "refused"
    took = time.monotonic() - begin
    return kind if took < SECONDS_MAX else f"{name}: {took:.0f} s"


def batch(folder, seeds, out):
    """In a process of its own; a line for each mutant, begun and ended."""
    bench, files = uses.Bench(folder), originals()
    with open(out, "a", encoding="utf-8") as file:
        for seed in seeds:
            print("begun", seed, file=file, flush=True)
            print("ended", seed, one(bench, seed, files), file=file, flush=True)


def results(first, end, folder):
    """{seed: what became of it}, seed by seed as they end."""
    out = os.path.join(folder, "out")
    while first < end:
        open(out, "w", encoding="utf-8").close()
        last = min(first + BATCH, end)
        child = os.fork()
        if child == 0:
            batch(folder, range(first, last), out)
            os._exit(0)
        _, status = os.waitpid(child, 0)
        with open(out, encoding="utf-8") as file:
            lines = [line.rstrip("\n").split(" ", 2) for line in file]
        ended = {int(line[1]): line[2] for line in lines if line[0] == "ended"}
        yield from ended.items()
        first = last
        if status:
            died = int(lines[-1][1]) if lines else last - 1
            yield died, f"the process ended with status {status:#x}"
            first = died + 1


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("count", type=int)
    parser.add_argument("first", type=int, nargs="?", default=0)
    arguments = parser.parse_args()
    import tempfile
    counts, findings = {"read": 0, "refused": 0}, 0
    with tempfile.TemporaryDirectory() as folder:
        for seed, found in results(arguments.first, arguments.first + arguments.count, folder):
            if found in counts:
                counts[found] += 1
            else:
                findings += 1
                print(f"WRONG  mutant {seed}: {found}", flush=True)
            done = sum(counts.values()) + findings
            if done % 100 == 0:
                print(f"{done} mutants: {counts['read']} read and run, {counts['refused']} refused, {findings} findings", flush=True)
    done = sum(counts.values()) + findings
    print(f"{'WRONG ' if findings or done != arguments.count else 'holds '} {done} damaged .tflite files: {counts['read']} read and run, {counts['refused']} refused in a line each, {findings} findings")
    return 1 if findings or done != arguments.count else 0


if __name__ == "__main__":
    sys.exit(main())
