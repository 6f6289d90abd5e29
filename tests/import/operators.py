"""Every operator of the list, alone in a small model, against the reference interpreter bit for bit.

    python3 tests/import/operators.py [--set c|avx2|...] [--rounds N] [NAME...]

Needs tflite, numpy, flatbuffers, ai-edge-litert and pillow; build/libfovea.a is the engine (or $FOVEA_LIBRARY)."""
import argparse
import os
import sys
import tempfile

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..", "..", "tools", "import")]

import check  # noqa: E402
import costs  # noqa: E402
import graph as graph_module  # noqa: E402
import plan as plan_module  # noqa: E402
from builder import Builder  # noqa: E402
from case import Case  # noqa: E402
from engine import Engine  # noqa: E402
from lower import Lowering  # noqa: E402
from operator_cases import CASES  # noqa: E402
from write import Writer  # noqa: E402


class Twin:
    """The reference for a uint8 model, seen as the int8 one whose bytes and zero points are 128 less: of SUM the reference takes
    int8 for uint8 (LiteRT 2.3)."""

    def __init__(self, builder, inputs, outputs):
        twin = Builder()
        twin.ops, twin.signatures = builder.ops, builder.signatures
        twin.tensors = [("uint8", shape, scales, [z + 128 for z in zeros], None if data is None else data.view("uint8") ^ 128, axis)
                        if dtype == "int8" else (dtype, shape, scales, zeros, data, axis)
                        for dtype, shape, scales, zeros, data, axis in builder.tensors]
        with tempfile.NamedTemporaryFile(suffix=".tflite") as file:
            file.write(twin.bytes(inputs, outputs))
            file.flush()
            self.reference = check.reference(file.name)
        self.get_output_details, self.invoke = self.reference.get_output_details, self.reference.invoke

    def get_input_details(self):
        return [{**d, "dtype": np.int8} for d in self.reference.get_input_details()]

    def set_tensor(self, index, value):
        self.reference.set_tensor(index, value.view(np.uint8) ^ 128)

    def get_tensor(self, index):
        return (self.reference.get_tensor(index) ^ 128).view(np.int8)


def reference_of(name, case, inputs, outputs, path):
    if name == "SUM" and case.dtype == "int8":
        return Twin(case.b, inputs, outputs)
    return check.reference(path, name != "ELU")  # which has one kernel, outside of the reference's list


def leave_open(builder):
    """Sizes of everything computed are left to the run: the file says 1."""
    for _, _, outputs, *_ in builder.ops:
        builder.signatures.update({t: (-1,) * len(builder.tensors[t][1]) for t in outputs})


def run(name, kind, seed, kernel_set, is_open=False):
    """'' when equal, 'refused: ...' when the reference does not take the model, else what differs."""
    case = Case(kind, seed)
    inputs, outputs = CASES[name](case)
    if is_open:
        leave_open(case.b)
    data = case.b.bytes(inputs, outputs)
    with tempfile.NamedTemporaryFile(suffix=".tflite") as file:
        file.write(data)
        file.flush()
        try:
            interpreter = reference_of(name, case, inputs, outputs, file.name)
        except (RuntimeError, ValueError) as problem:
            return f"refused: {str(problem)[:110]}"
        try:
            net = Lowering(graph_module.read(file.name)).run()
        except graph_module.ImportProblem as problem:
            return str(problem)
    arena, _ = plan_module.plan(net)
    engine = Engine(Writer(net, arena).bytes(name, [], [0], [0]), kernel_set)
    details = interpreter.get_input_details()
    order = {t: i for i, t in enumerate(inputs)}
    for round_ in range(2):
        values = [check.noise_input(d, seed * 31 + round_ * 7 + order.get(d["index"], 0)) for d in details]
        try:
            problems = check.compare(interpreter, engine, values, False)
        except RuntimeError as problem:
            return f"refused: {str(problem)[:110]}"
        if problems:
            return "; ".join(problems)
    return ""


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*")
    parser.add_argument("--set")
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--open", action="store_true", help="models that leave all sizes but the inputs' to the run")
    parser.add_argument("--parts", action="store_true", help="cut every operator into as many parts as there can be")
    arguments = parser.parse_args()
    if arguments.parts:
        costs.UNIT_COST = 1
    wrong = 0
    for name in arguments.names or CASES:
        for kind in ("int8", "int8t", "uint8"):
            seeds = [arguments.seed] if arguments.seed is not None else range(arguments.rounds)
            results = {seed: run(name, kind, seed, arguments.set, arguments.open) for seed in seeds}
            refused = {s: r for s, r in results.items() if r.startswith("refused")}
            bad = {s: r for s, r in results.items() if r and s not in refused}
            wrong += bool(bad)
            note = f", {len(refused)} refused by the reference ({list(refused.values())[0][9:80]})" if refused else ""
            print(f"{'DIFFERS' if bad else 'equal  '} {name} {kind}: {len(results) - len(bad) - len(refused)} of "
                  f"{len(results)}{note}", flush=True)
            for seed, text in list(bad.items())[:3]:
                print(f"    seed {seed}: {text[:200]}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
