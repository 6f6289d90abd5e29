"""Networks that keep a state from run to run (--state IN=OUT): small recurrent ones, drawn at random, give the outputs of the reference
interpreter, which gets each run's result as the next run's input by hand, bit for bit; and what cannot be a state is refused.

    python3 tests/import/states.py [--set c|avx2|...] [--rounds N]"""
import argparse
import os
import subprocess
import sys
import tempfile

import numpy as np

import operators  # noqa: F401  the paths of tools/import
import uses
from case import Case
from operators import check

BUILD = os.environ.get("BUILD", os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "build"))
RUNS = 6


def connected(c, source, width, scale_in, scale, zero=None):
    count = c.b.tensors[source][1][-1]
    weights, scales = c.weights((width, count), width, 0)
    y = c.q((1, width), scale, zero)
    c.b.op("FULLY_CONNECTED", [source, weights, c.bias(width, scale_in, scales)], [y], "FullyConnected", KeepNumDims=False, FusedActivationFunction=0)
    return y


def hidden(c):
    """Scale and zero point of what TANH gives."""
    return 1 / 128, 128 if c.dtype == "uint8" else 0


def elman(c, width=12, scale=None, zero=None, outputs=True):
    """y = W tanh(A x + B h), the next h is the tanh; the input h has another quantisation than the tanh unless it is given."""
    x = c.q((1, 8), 0.02)
    scale_h = scale or float(c.choose(1 / 128, 1 / 256, 0.011))
    h = c.q((1, width), scale_h, zero)
    both = c.q((1, width), 0.05)
    c.b.op("ADD", [connected(c, x, width, 0.02, 0.03), connected(c, h, width, scale_h, 0.03)], [both], "Add", FusedActivationFunction=0)
    new = c.q((1, width), *hidden(c))
    c.b.op("TANH", [both], [new])
    ends = [connected(c, new, 5, 1 / 128, 0.02)] if outputs else []
    return [x, h], ends + [new], [(h, new)]


def only(c):
    """The state is the only output, which stays one."""
    return elman(c, outputs=False)


def same(c):
    """The state has one quantisation: nothing but the zero point is between the runs."""
    scale, zero = hidden(c)
    return elman(c, c.int(1, 40), scale, zero)


def pictures(c):
    """A picture and two states, of which one comes first in the file; one is a part of a concatenation."""
    s = c.q((1, 6, 5, 8), 0.03)
    x = c.q((1, 6, 5, 3), 0.02)
    r = c.q((1, 6, 5, 8), 0.04)
    weights, scales = c.weights((8, 3, 3, 3), 8, 0)
    y = c.q((1, 6, 5, 8), 0.05)
    c.b.op("CONV_2D", [x, weights, c.bias(8, 0.02, scales)], [y], "Conv2D", StrideH=1, StrideW=1, DilationHFactor=1, DilationWFactor=1, Padding=0,
           FusedActivationFunction=0)
    zero = c.zero()
    mixed, more, joined = c.q((1, 6, 5, 8), 0.05, zero), c.q((1, 6, 5, 8), 0.05, zero), c.q((1, 6, 5, 16), 0.05, zero)
    c.b.op("ADD", [y, s], [mixed], "Add", FusedActivationFunction=0)
    c.b.op("SUB", [mixed, r], [more], "Sub", FusedActivationFunction=0)
    c.b.op("CONCATENATION", [mixed, more], [joined], "Concatenation", Axis=3, FusedActivationFunction=0)
    return [s, x, r], [joined, more, mixed], [(s, more), (r, mixed)]


def real(c):
    """A state of real numbers between 8-bit layers: its zero is 0."""
    x, f = c.q((1, 20), 0.02), c.b.tensor("float32", (1, 20))
    q, y, g = c.q((1, 20), 0.02), c.q((1, 20), 0.03), c.b.tensor("float32", (1, 20))
    c.b.op("QUANTIZE", [f], [q], "Quantize")
    c.b.op("ADD", [x, q], [y], "Add", FusedActivationFunction=0)
    c.b.op("DEQUANTIZE", [y], [g], "Dequantize")
    return [x, f], [y, g], [(f, g)]


def inner(c):
    """What the next run gets is no output of the file."""
    inputs, outputs, states = elman(c)
    return inputs, outputs[:1], states


def swapped(c):
    """Each of two states is the other's next value."""
    x, a, b = (c.q((1, 9), scale) for scale in (0.02, 0.03, 0.04))
    sum_, y = c.q((1, 9), 0.03), c.q((1, 9), 0.05)
    c.b.op("ADD", [x, a], [sum_], "Add", FusedActivationFunction=0)
    c.b.op("SUB", [sum_, b], [y], "Sub", FusedActivationFunction=0)
    return [x, a, b], [y, sum_], [(a, y), (b, sum_)]


NETWORKS = {"elman": elman, "only": only, "same": same, "pictures": pictures, "real": real, "inner": inner, "swapped": swapped}


def options(states, *more):
    return [word for a, b in states for word in ("--state", f"t{a}=t{b}")] + ["--decoder", "none", *more]


class Sequence:
    """The reference over several runs: what it gets and what it gives, the states fed back by hand."""

    def __init__(self, path, states, tensors, seed):
        reference = check.reference(path)
        details = {d["index"]: d for d in reference.get_tensor_details()}
        zero = held = {a: np.full(details[a]["shape"], details[a]["quantization"][1], details[a]["dtype"]) for a, _ in states}
        self.inputs = [d for d in reference.get_input_details() if d["index"] not in held]
        shown = [d for d in reference.get_output_details() if d["index"] not in [b for _, b in states]] or reference.get_output_details()
        self.values, self.results, self.matters = [], [], False
        for run in range(RUNS):
            values = [check.noise_input(d, seed * 31 + run * 7 + i) for i, d in enumerate(self.inputs)]
            for d, value in zip(self.inputs, values):
                reference.set_tensor(d["index"], value)
            given = []
            for from_states in (zero, held):
                for a, value in from_states.items():
                    reference.set_tensor(a, value)
                reference.invoke()
                given.append([reference.get_tensor(d["index"]) for d in shown])
            self.matters |= any(np.any(a != b) for a, b in zip(*given))
            self.values.append(values)
            self.results.append(given[1])
            new = {a: reference.get_tensor(b) for a, b in states}
            held = {a: requantised(new[a], details[b], details[a]) for a, b in states}


def requantised(value, source, into):
    """Through the reference's own QUANTIZE where the two differ."""
    if value.dtype == np.float32 or source["quantization"] == into["quantization"] and value.dtype == into["dtype"]:
        return value
    from builder import Builder
    b = Builder()
    x = b.tensor(np.dtype(source["dtype"]).name, value.shape, *source["quantization"])
    y = b.tensor(np.dtype(into["dtype"]).name, value.shape, *into["quantization"])
    b.op("QUANTIZE", [x], [y], "Quantize")
    with tempfile.NamedTemporaryFile(suffix=".tflite") as file:
        file.write(b.bytes([x], [y]))
        file.flush()
        quantise = check.reference(file.name)
    quantise.set_tensor(quantise.get_input_details()[0]["index"], value)
    quantise.invoke()
    return quantise.get_tensor(quantise.get_output_details()[0]["index"])


def prove(bench, name, kind, seed, kernel_set):
    """Whether the states changed any output, and '' or what differs."""
    c = Case(kind, seed)
    inputs, outputs, states = NETWORKS[name](c)
    found = bench.run(c.b.bytes(inputs, outputs), *options(states))
    if not isinstance(found, uses.Written):
        return False, f"not imported: {found}"
    sequence = Sequence(os.path.join(bench.folder, "m.tflite"), states, c.b.tensors, seed)
    engine = check.Engine(found.raw, kernel_set)
    for run, (values, expected) in enumerate(zip(sequence.values, sequence.results)):
        for i, value in enumerate(values):
            engine.set_input(i, value)
        engine.run()
        if len(engine.outputs) != len(expected):
            return False, f"{len(engine.outputs)} outputs, expected {len(expected)}"
        for i, want in enumerate(expected):
            text = check.difference(engine.tensor(engine.outputs[i]), want)
            if text:
                return False, f"run {run}, output {i}: {text}"
    return sequence.matters, ""


def compared(bench):
    """--check feeds the reference the states as well."""
    c = Case("int8", 3)
    inputs, outputs, states = NETWORKS["elman"](c)
    path = bench.file("c.tflite", c.b.bytes(inputs, outputs))
    tool = os.path.join(os.path.dirname(check.__file__), "__main__.py")
    done = subprocess.run([sys.executable, tool, path, *options(states), "--check", "--layers"], capture_output=True, text=True, check=False)
    bench.holds("--check says that states are kept", "1 state, zero before the first input, kept from each to the next" in done.stdout, True)
    bench.holds("--check with states", (done.returncode, done.stdout.count("equal ")), (0, 3))


def by_the_program(bench):
    """fovea model run keeps the states over its inputs, and says so."""
    c = Case("int8", 1)
    inputs, outputs, states = NETWORKS["elman"](c)
    bench.run(c.b.bytes(inputs, outputs), *options(states))
    sequence = Sequence(os.path.join(bench.folder, "m.tflite"), states, c.b.tensors, 1)
    files = []
    for run, values in enumerate(sequence.values):
        files.append(os.path.join(bench.folder, f"{run}.npy"))
        np.save(files[-1], values[0])
    out = os.path.join(bench.folder, "out.npz")
    done = subprocess.run([os.path.join(BUILD, "fovea"), "model", "run", os.path.join(bench.folder, "m.fvm"), *files, "--out", out],
                          capture_output=True, text=True, check=False)
    bench.holds("fovea model run takes it", f"{done.returncode} {done.stderr}", "0 ")
    bench.holds("and says that states are kept", f"kept from run to run, zero before the first of {RUNS}" in done.stdout, True)
    if done.returncode == 0:
        bench.holds("outputs of the program", np.load(out)["output0"].reshape(RUNS, -1), np.array([r[0] for r in sequence.results]).reshape(RUNS, -1))
    done = subprocess.run([os.path.join(BUILD, "fovea"), "model", "info", os.path.join(bench.folder, "m.fvm")], capture_output=True, text=True, check=False)
    bench.holds("fovea model info lists the state", "state     int8 1 x 12" in done.stdout, True)


def decoded(bench):
    """A network of a picture and a state gets a decoder, as one of a picture alone; with --outputs OUT it is an output as well."""
    c = Case("int8", 0)
    image = (1, 24, 32, 3)
    x, s = c.q(image, 1 / 255, -128), c.q(image, 1 / 255, -128)
    mixed, flat, short, y = c.q(image, 1 / 128, -128), c.q((1, 2304), 1 / 128, -128), c.q((1, 7), 1 / 128, -128), c.q((1, 7), 1 / 256, -128)
    c.b.op("ADD", [x, s], [mixed], "Add")
    c.b.op("RESHAPE", [mixed, c.b.const("int32", [1, 2304])], [flat], "Reshape", NewShape=[1, 2304])
    c.b.op("STRIDED_SLICE", [flat] + [c.b.const("int32", v) for v in ([0, 0], [1, 7], [1, 1])], [short], "StridedSlice", BeginMask=0,
           EndMask=0, EllipsisMask=0, NewAxisMask=0, ShrinkAxisMask=0)
    c.b.op("SOFTMAX", [short], [y], "Softmax", Beta=1.0)
    model = c.b.bytes([x, s], [y, mixed])
    state = ["--state", f"t{s}=t{mixed}"]
    found = bench.run(model, *state, "--labels", bench.file("seven.txt", "a\nb\nc\nd\ne\nf\ng\n"))
    bench.holds("a decoder beside a state", getattr(found, "decoder", found), "classifier")
    bench.holds("the state is no output", getattr(found, "names", []) == [f"t{y}".encode()], True)
    found = bench.run(model, *state, "--decoder", "none", "--outputs", f"t{y}", "--outputs", f"t{mixed}")
    bench.holds("but with --outputs", getattr(found, "names", []) == [f"t{y}".encode(), f"t{mixed}".encode()], True)
    found = bench.run(model, *state, "--decoder", "none", "--outputs", f"t{short}")
    bench.holds("a cut network keeps what its state needs", getattr(found, "names", []) == [f"t{short}".encode()], True)
    bench.refused("without the option", model, "nothing would set")


def refusals(bench):
    c = Case("int8", 2)
    inputs, outputs, [(h, new)] = NETWORKS["elman"](c)
    model = c.b.bytes(inputs, outputs)
    for what, text, *states in (
            ("no such input", "found no input 'h', expected IN=OUT with one of t0, t1", "h=t1"),
            ("a constant as input", "found no input", f"t2=t{new}"),
            ("no pair", "found no computed tensor ''", f"t{h}"),
            ("no such output", "found no computed tensor 'z'", f"t{h}=z"),
            ("an input as the next value", "found no computed tensor", f"t{h}=t0"),
            ("another shape", "expected one shape", f"t{h}=t{outputs[0]}"),
            ("twice", "found no input", f"t{h}=t{new}", f"t{h}=t{new}")):
        bench.refused(f"{what} as a state", model, text, *[w for s in states for w in ("--state", s)])
    c = Case("int8", 2)
    x, y = c.q((1, 4), 0.1, 0), c.q((1, 4), 0.2, 0)
    c.b.op("RELU", [x], [y])
    bench.refused("the only input as a state", c.b.bytes([x], [y]), "found the only input", "--state", f"t{x}=t{y}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--set")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("names", nargs="*")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        bench = uses.Bench(folder)
        for name in arguments.names or NETWORKS:
            for kind in ("int8", "uint8"):
                results = [prove(bench, name, kind, seed, arguments.set) for seed in range(arguments.rounds)]
                wrong = {seed: text for seed, (_, text) in enumerate(results) if text}
                matters = sum(matter for matter, _ in results)
                bench.wrong += bool(wrong) or matters == 0
                print(f"{'DIFFERS' if wrong else 'equal  '} {name} {kind}: {arguments.rounds - len(wrong)} of {arguments.rounds}, the states matter "
                      f"to {matters}", flush=True)
                for seed, text in list(wrong.items())[:3]:
                    print(f"    seed {seed}: {str(text)[:300]}")
        if arguments.set is None and not arguments.names:
            for test in (compared, by_the_program, decoded, refusals):
                test(bench)
    return 1 if bench.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
