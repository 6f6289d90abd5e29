"""tools/import: turn an int8 or uint8 .tflite file into a Fovea model file (.fvm).

    python3 tools/import MODEL.tflite [-o MODEL.fvm] [--labels FILE] [--decoder NAME] ...
    python3 tools/import MODEL.tflite --check IMAGE... [--layers] [--set avx2]
    python3 tools/import --quantise FLOAT.tflite|MODEL.onnx PICTURE... [-o MODEL.fvm]
    python3 tools/import --recut 0,2 MODEL.fvm -o NEW.fvm

Needs the packages tflite and numpy; --check also ai-edge-litert and pillow. See README.md beside this file."""
import importlib.util
import os
import platform
import sys
import tempfile
import warnings

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)


def enter_quantiser():
    """Go on with the quantiser's own Python where this one lacks it."""
    build = os.environ.get("BUILD", os.path.join(os.path.dirname(os.path.dirname(HERE)), "build"))
    python = os.environ.get("FOVEA_QUANTISER", os.path.join(build, "quantiser-venv", "bin", "python"))
    if importlib.util.find_spec("ai_edge_quantizer") is not None:
        return
    if os.environ.get("FOVEA_QUANTISER_RUNS") or not os.path.exists(python):
        print("tools/import --quantise: found no Python package ai-edge-quantizer, expected it: `make quantiser` installs it once", file=sys.stderr)
        sys.exit(2)
    os.environ["FOVEA_QUANTISER_RUNS"] = "1"
    os.execv(python, [python, *sys.argv])


if __name__ == "__main__" and "--quantise" in sys.argv:
    enter_quantiser()
for package in ("numpy", "tflite", "flatbuffers"):
    try:
        __import__(package)
    except ImportError:
        sys.exit(f"tools/import: found no Python package {package}, expected it: pip install tflite numpy flatbuffers")

import command  # noqa: E402
import graph as graph_module  # noqa: E402
import plan as plan_module  # noqa: E402
import recut  # noqa: E402
import trial  # noqa: E402
import use  # noqa: E402
from lower import Lowering, REFUSAL_MAX, shortened  # noqa: E402
from write import Writer  # noqa: E402


def convert(path, arguments=None, fold=True):
    """Returns the file's bytes and a dictionary of figures."""
    try:
        return translate(path, arguments, fold)
    except graph_module.FAULTS as problem:
        why = shortened(" ".join(str(problem).split()), REFUSAL_MAX - 60)
        raise graph_module.ImportProblem(f"its tensors and operators do not fit each other ({why})") from problem


def translate(path, arguments, fold):
    graph = graph_module.read(path)
    if arguments is not None and arguments.names:
        return graph, None
    if arguments is not None and arguments.state:
        graph_module.keep_states(graph, arguments.state, arguments.outputs)
    if arguments is not None and arguments.outputs:
        graph_module.cut(graph, arguments.outputs)
    net = Lowering(graph, fold).run()
    arena, bound = plan_module.plan(net)
    writer = Writer(net, arena)
    written, trying = use.describe(path, graph, net, arguments)
    name = os.path.splitext(os.path.basename(path))[0]
    data = writer.bytes(name, *written)
    if arguments is not None:
        trial.engine(data)  # what the engine refuses to load is refused here
    tried = trying is None or arguments is None or trial.run(data, graph, *trying)
    figures = dict(operators=len(graph.ops), steps=len(net.steps), macs=sum(s.macs for s in net.steps),
                   weights=len(net.data), arena=arena, bound=bound, file=len(data), graph=graph, net=net, decoder=trying[0] if trying else None, tried=tried)
    return data, figures


def print_operators(graph):
    counts = {}
    for op in graph.ops:
        counts[op.name] = counts.get(op.name, 0) + 1
    print("operators: " + ", ".join(f"{n} {name}" for name, n in sorted(counts.items())))


def print_names(graph):
    for t in graph.inputs:
        tensor = graph.tensors[t]
        print(f"     input                    {tensor.type.lower()}[{', '.join(map(str, tensor.shape))}] {tensor.name}")
    for op in graph.ops:
        for t in op.outputs:
            tensor = graph.tensors[t]
            print(f"{op.index:4} {op.name:24} {tensor.type.lower()}[{', '.join(map(str, tensor.shape))}] {tensor.name}")
    return 0


def print_notes(figures):
    """What was taken where the file does not say it."""
    for note in figures["graph"].notes:
        print(note)


def kernel_sets():
    """Those that a processor of this kind may have."""
    return ["c", "sse4", "avx2", "avxvnni", "avx512"] if platform.machine() == "x86_64" else ["c", "neon", "dotprod", "i8mm"]


def same_file(one, other):
    return os.path.exists(one) and os.path.exists(other) and os.path.samefile(one, other)


def put(path, data):
    """A file that is there whole or not at all; a device is written as it is."""
    path = os.path.realpath(path)
    if os.path.exists(path) and not os.path.isfile(path):
        with open(path, "wb") as file:
            file.write(data)
        return
    part = f"{path}.part"
    try:
        with open(part, "wb") as file:
            file.write(data)
        os.replace(part, path)
    except OSError:
        if os.path.exists(part):
            os.remove(part)
        raise


def quantise_first(arguments, output):
    """From here on the model is the quantised one, which is left beside the output; returns what average precision needs."""
    import from_onnx
    import quantise
    target = os.path.splitext(output)[0].removesuffix(".int8") + ".int8.tflite"
    if same_file(target, arguments.model):
        raise graph_module.ImportProblem(f"found the model that is to be quantised at {target}, expected another output")
    with tempfile.TemporaryDirectory() as folder:
        model = arguments.model
        if from_onnx.is_onnx(model):
            model = os.path.join(folder, "real.tflite")
            for line in from_onnx.run(arguments.model, model, arguments):
                print(line)
        labels, metadata = use.archive(model)
        lines, tried = quantise.run(model, target, arguments, metadata, labels)
    print("\n".join(lines))
    arguments.model = target
    return tried


def print_precision(tried, arguments, figures):
    import precision
    own, _ = use.archive(arguments.model)
    labels, outputs = use.labels_of(arguments, own), tried.before.outputs
    kind = figures["decoder"] or arguments.decoder
    classes = len(labels) or (int(outputs[0]["shape"][1]) - 4 if kind == "yolov8" else int(outputs[0]["shape"][2]) - 5)
    print("\n".join(precision.lines(kind, tried, arguments.labels, labels, classes)))


def cut_anew(arguments):
    """Write the model file with other cuts of some operators."""
    path, output = arguments.model, arguments.output
    if output is None or same_file(output, path):
        return complain(f"--recut {path}: found {'no -o' if output is None else 'that file as -o'}, expected another file to write")
    try:
        with open(path, "rb") as file:
            data = file.read()
        trial.engine(data)
        put(output, recut.run(data, arguments.recut))
    except graph_module.ImportProblem as problem:
        return complain(f"{path}: {shortened(str(problem))}")
    except OSError as problem:
        return complain(f"{problem.filename or output}: {problem.strerror}")
    print(f"{output}: operators {arguments.recut} cut by the table of costs")
    return 0


def complain(text):
    print(text, file=sys.stderr)
    return 2


def options():
    parser = command.Parser(prog="tools/import", description=__doc__.split("\n")[0])
    parser.add_argument("model")
    parser.add_argument("pictures", nargs="*", metavar="PICTURE", help="pictures or folders of them, for --quantise")
    parser.add_argument("--quantise", action="store_true", help="the model is of real numbers: quantise it on the pictures first")
    parser.add_argument("--any-loss", action="store_true", help="with --quantise: go on where an output that the decoder reads is lost, or no picture showed "
                        "what is sought")
    parser.add_argument("-o", "--output", help="the .fvm file (default: beside the model)")
    parser.add_argument("--check", nargs="*", metavar="IMAGE", help="compare with the reference on images and noise")
    parser.add_argument("--layers", action="store_true", help="compare every operator, not only the outputs")
    parser.add_argument("--set", choices=kernel_sets(), help="kernel set for --check; default: the best of this processor")
    parser.add_argument("--recut", metavar="OPERATORS", help="the model is a .fvm file: cut these convolutions anew, by today's table of costs")
    parser.add_argument("--no-fold", action="store_true", help="merge nothing, for finding faults")
    use.add_arguments(parser)
    return parser.parse_intermixed_args()


def main():
    try:
        arguments = options()
    except graph_module.ImportProblem as problem:
        return complain(f"tools/import: {shortened(str(problem))}")
    warnings.simplefilter("ignore", RuntimeWarning)  # numpy's, of scales that a damaged file has; what is wrong is said in one line
    if arguments.pictures and not arguments.quantise:
        return complain(f"{arguments.pictures[0]}: found a second file, expected one model (pictures go with --quantise)")
    if arguments.any_loss and not arguments.quantise:
        return complain("--any-loss: found without --quantise, expected with it")
    if arguments.recut is not None:
        return cut_anew(arguments)
    if arguments.output is not None and arguments.output.endswith((".tflite", ".onnx")):
        return complain(f"-o {arguments.output}: found the name of a file to read, expected that of the model file to write, as MODEL.fvm")
    output, tried = arguments.output or os.path.splitext(arguments.model)[0] + ".fvm", None
    try:
        if arguments.quantise:
            tried = quantise_first(arguments, output)
        data, figures = convert(arguments.model, arguments, not arguments.no_fold)
        if same_file(output, arguments.model):
            return complain(f"-o {output}: found the model that is read, expected another file")
        if tried is not None and figures is not None and arguments.labels is not None and os.path.isdir(arguments.labels):
            print_precision(tried, arguments, figures)
    except graph_module.ImportProblem as problem:
        return complain(f"{arguments.model}: {shortened(' '.join(str(problem).split()))}")
    except OSError as problem:
        return complain(f"{problem.filename or arguments.model}: {problem.strerror}")
    if figures is None:
        return print_names(data)
    print_operators(figures["graph"])
    print_notes(figures)
    if figures["decoder"]:
        print(f"decoder {figures['decoder']}" + ("" if figures["tried"] else "; not tried on pictures: `make` builds what runs them"))
    print(f"steps {figures['steps']}, multiply-accumulates {figures['macs'] / 1e6:.1f} million, constants "
          f"{figures['weights'] / 1024:.0f} KiB, arena {figures['arena'] / 1024:.0f} KiB (no plan can go below "
          f"{figures['bound'] / 1024:.0f})")
    if arguments.check is not None:
        import check
        try:
            return 1 if check.check(arguments.model, data, arguments.check, arguments.layers, arguments.set, graph=figures["graph"]) else 0
        except check.CheckProblem as problem:
            return complain(f"--check: {problem}")
    try:
        put(output, data)
    except OSError as problem:
        return complain(f"{output}: {problem.strerror}")
    print(f"{output}: {len(data)} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(command.run(main))
