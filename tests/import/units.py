"""The longest unit of each network, in milliseconds of processor time, the least of several runs, on every kernel set: of the models in
$FOVEA_DATA and those shipped, and of operators alone in shapes that estimates of work get wrong (unit_cases.py). A unit is to take 0.25 ms at
most on the machines that tools/import/costs.txt was measured on; on another one the table shows how far it is from that.

    python3 tests/import/units.py [--sets sse4,avx2] [--runs 7] [NAME...]      as a table; exit 1 where a unit takes longer
    python3 tests/import/units.py --renew PROCESSOR [--sets ...]               measure tools/import/costs.txt anew, for these sets"""
import argparse
import ctypes
import glob
import os
import sys
import tempfile
import time

import numpy as np

import operators  # noqa: F401  the paths of tools/import
import costs
import graph as graph_module
import plan as plan_module
from case import Case
from engine import ROOT, SETS, Engine, library
from layout import UNIT_COST
from lower import Lowering
from unit_cases import NETWORKS
from write import Writer

MOST_MS = 0.25
COST_MS = MOST_MS / UNIT_COST  # of one that a formula says
ENOUGH = 0.5  # of a unit's cost: in what is smaller the call itself takes most of the time


def sets_here():
    """Those of costs.txt that this processor has."""
    best = ctypes.c_int()
    library().fv_cpu_parse(None, ctypes.byref(best), None)
    return [s for s in costs.SETS if SETS[s] <= best.value]


def imported(tflite):
    """The .fvm file and its steps."""
    with tempfile.NamedTemporaryFile(suffix=".tflite") as file:
        file.write(tflite)
        file.flush()
        net = Lowering(graph_module.read(file.name)).run()
    arena, _ = plan_module.plan(net)
    return Writer(net, arena).bytes("units", [], [0], [0]), net.steps


def networks(names):
    """(name, what gives its file and steps) of each; a shipped file has no steps."""
    found = []
    for name, make in NETWORKS.items():
        def build(make=make, kind="uint8" if "uint8" in name else "int8"):
            case = Case(kind, 1)
            made = make(case)
            return imported(case.b.bytes(*made))
        found.append((name, build))
    for path in sorted(glob.glob(os.path.join(os.environ.get("FOVEA_DATA", "../shared/data"), "models", "*.tflite"))):
        found.append((os.path.basename(path)[:-7], lambda path=path: imported(open(path, "rb").read())))
    for path in ("src/detect/shipped.fvm", "src/detect/segmenter.fvm"):
        found.append((path, lambda path=path: (open(os.path.join(ROOT, path), "rb").read(), None)))
    return [(name, build) for name, build in found if not names or any(n in name for n in names)]


def timed(data, kernel_set, runs):
    """[operator, rows, least milliseconds] of each unit."""
    engine, units = Engine(data, kernel_set), []
    for _ in range(runs):
        engine.arena[:] = np.arange(len(engine.arena)) * 37 % 251
        progress, done, unit, status = operators.check.Progress(0, 0), ctypes.c_uint32(), 0, 1
        arguments = (engine.model, engine.kernels, ctypes.c_void_p(engine.arena.ctypes.data), ctypes.byref(progress), ctypes.c_uint32(1),
                     ctypes.byref(done))
        while status:
            op, row = progress.op, progress.row
            before = time.thread_time_ns()
            status = engine.lib.fv_nn_run(*arguments)
            took = (time.thread_time_ns() - before) * 1e-6
            if unit == len(units):
                end = progress.row if progress.op == op else int(engine.ops[op][13])
                units.append([op, end - row, took])
            units[unit][2] = min(units[unit][2], took)
            unit += 1
    return units


def table(arguments, sets):
    """Print what each network takes; how many take too long."""
    over = 0
    print(f"| network | units | {' | '.join(sets)} |\n| --- | ---: |{' ---: |' * len(sets)}")
    for name, build in networks(arguments.names):
        data, steps = build()
        results = [timed(data, s, arguments.runs) for s in sets]
        worst = [max(units, key=lambda u: u[2]) for units in results]
        over += any(ms > MOST_MS for _, _, ms in worst)
        what = "" if steps is None or not arguments.verbose else " (" + ", ".join(f"{steps[op].work} {steps[op].name}" for op, _, _ in worst) + ")"
        print(f"| {name}{what} | {len(results[0])} | {' | '.join(f'{ms:.3f}' for _, _, ms in worst)} |", flush=True)
    return over


def ratios(steps, units):
    """(work, time over what the formula says) of the units that tell."""
    for op, rows, ms in units:
        step = steps[op]
        per_row = -(-step.cost // step.rows)
        if per_row * rows >= ENOUGH * UNIT_COST or ms > 0.8 * MOST_MS:
            yield step.work, ms / (step.formula / step.rows * rows * COST_MS)


def renew(arguments, sets):
    """Measure the columns of these sets: of each kind of work the unit that takes longest for what its formula says."""
    most = {}
    for name, build in networks(arguments.names):
        data, steps = build()
        for kernel_set in sets if steps is not None else ():
            for work, ratio in ratios(steps, timed(data, kernel_set, arguments.runs)):
                if ratio > most.get((work, kernel_set), (0,))[0]:
                    most[work, kernel_set] = ratio, name
    found = costs.read()
    for (work, kernel_set), (ratio, name) in sorted(most.items()):
        found[work][kernel_set] = -(-int(1000 * ratio) // 10)
        print(f"{work:20} {kernel_set:7} {found[work][kernel_set]:5} by {name}")
    others = [line for line in costs.comment() if line.split()[1].rstrip(":") not in sets]
    costs.write(found, others + [f"# {s}: {arguments.renew}\n" for s in sets])
    print("not measured:", ", ".join(sorted({f"{w} {s}" for w in found for s in sets} - {f"{w} {s}" for w, s in most})) or "none")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sets", help="default: those that this processor has")
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--renew", metavar="PROCESSOR", help="what to call this one in the table")
    parser.add_argument("--verbose", action="store_true", help="name the work of each longest unit")
    parser.add_argument("names", nargs="*")
    arguments = parser.parse_args()
    sets = arguments.sets.split(",") if arguments.sets else sets_here()
    if arguments.renew:
        return renew(arguments, sets)
    return 1 if table(arguments, sets) else 0


if __name__ == "__main__":
    sys.exit(main())
