"""Networks beside LiteRT: the same inputs, one thread, same run, calls interleaved, medians of thread-CPU time.

    python3 tools/import/benchmark.py [--json FILE] [--program build/fovea] MODEL.tflite...

Prints a table of milliseconds (ours, LiteRT with XNNPACK), their ratio, GMAC/s and the fraction of what the matrix kernel
reaches here. Needs tflite, numpy and ai-edge-litert."""
import argparse
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import time

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import check  # noqa: E402
import graph as graph_module  # noqa: E402
import plan as plan_module  # noqa: E402
import use  # noqa: E402
from engine import Engine, ROOT  # noqa: E402
from lower import Lowering  # noqa: E402
from write import Writer  # noqa: E402


def convert(path):
    graph = graph_module.read(path)
    net = Lowering(graph).run()
    arena, _ = plan_module.plan(net)
    data = Writer(net, arena).bytes("bench", *use.describe(path, graph, net, None)[0])
    weights = [t for t in graph.tensors if t.is8 and t.data is not None]
    return data, sum(s.macs for s in net.steps), "uint8" if weights[0].type == "UINT8" else "int8"


def peak(program, data):
    """GMAC/s of the matrix kernel on a product in cache, as `fovea model info` finds it."""
    with tempfile.NamedTemporaryFile(suffix=".fvm") as file:
        file.write(data)
        file.flush()
        text = subprocess.run([program, "model", "info", file.name], capture_output=True, text=True).stdout
    found = re.search(r"matrix kernel's (\d+) GMAC/s", text)
    return float(found.group(1)) if found else float("nan")


def measure(path, kernel_set):
    from ai_edge_litert.interpreter import Interpreter
    data, macs, kind = convert(path)
    engine = Engine(data, kernel_set)
    peer = Interpreter(model_content=check.mended(path), num_threads=1)
    peer.allocate_tensors()
    values = [check.noise_input(detail, 1) for detail in peer.get_input_details()]
    for detail, value in zip(peer.get_input_details(), values):
        peer.set_tensor(detail["index"], value)
    ours, theirs = [], []
    run = engine.caller()
    for _ in range(max(15, min(300, int(4e9 / max(macs, 1e6) / 10)))):
        for number, value in enumerate(values):  # a run may write over its inputs
            engine.set_input(number, value)
        a = time.thread_time_ns()
        peer.invoke()
        b = time.thread_time_ns()
        run()
        theirs.append(b - a)
        ours.append(time.thread_time_ns() - b)
    return data, kind, macs, float(np.median(ours)) * 1e-6, float(np.median(theirs)) * 1e-6


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("models", nargs="+")
    parser.add_argument("--json")
    parser.add_argument("--set", help="kernel set, default the best")
    parser.add_argument("--program", default=os.path.join(ROOT, "build", "fovea"))
    arguments = parser.parse_args()
    rows, best = [], None
    print(f"{'network':42} {'form':6} {'ours ms':>8} {'LiteRT ms':>9} {'ratio':>6} {'GMAC/s':>7} {'of peak':>7}")
    for path in arguments.models:
        data, kind, macs, ours, theirs = measure(path, arguments.set)
        best = peak(arguments.program, data) if best is None else best
        name, rate = os.path.splitext(os.path.basename(path))[0], macs / ours * 1e-6
        print(f"{name[:42]:42} {kind:6} {ours:8.3f} {theirs:9.3f} {ours / theirs:6.2f} {rate:7.1f} {rate / best:7.0%}",
              flush=True)
        rows.append(dict(name=name, form=kind, ours_ms=ours, litert_xnnpack_ms=theirs, ratio=ours / theirs,
                         gmacs_per_s=rate, fraction_of_peak=rate / best))
    for kind in ("int8", "uint8"):
        ratios = [r["ratio"] for r in rows if r["form"] == kind]
        if ratios:
            print(f"{kind}: geometric mean of ratios {math.exp(sum(map(math.log, ratios)) / len(ratios)):.3f}, "
                  f"largest {max(ratios):.2f}")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump(dict(peak_gmacs_per_s=best, results=rows), file, indent=1)
    return 0


if __name__ == "__main__":
    sys.exit(main())
