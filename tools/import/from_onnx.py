"""From an ONNX file of real numbers to a .tflite file of the same numbers, by the package onnx2tf, for `tools/import --quantise`. Its packages stand
in an environment of their own (tools/onnx_python.sh), so this file is also a program, which `run` starts there:

    build/onnx-venv/bin/python tools/import/from_onnx.py MODEL.onnx OUT.tflite OPTIONS.json

The converter guesses which axes are channels. What it makes is therefore run beside onnxruntime on the user's own pictures, and
refused where the numbers differ. It needs no network: the sample pictures that it would fetch are made from the user's."""
import importlib.util
import json
import os
import re
import subprocess
import sys
import tempfile

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)

SAMPLE, SAMPLE_SHAPE = "calibration_image_sample_data_20x128x128x3_float32.npy", (20, 128, 128, 3)  # as onnx2tf names and reads it
TRIED = 4          # pictures on which the two must agree
APART_MAX = 1e-3   # of an output's largest number: sums of float32 in another order stay far below
QUANTISED = {"QuantizeLinear", "DequantizeLinear", "DynamicQuantizeLinear", "QLinearConv", "QLinearMatMul", "ConvInteger", "MatMulInteger"}
EXPORT = "export with fixed sizes (Ultralytics: dynamic=False imgsz=N)"


def is_onnx(path):
    return path.lower().endswith(".onnx")


def run(path, target, arguments):
    """Writes the .tflite file to `target`; returns the lines to print."""
    from graph import ImportProblem
    build = os.environ.get("BUILD", os.path.join(os.path.dirname(os.path.dirname(HERE)), "build"))
    python = os.environ.get("FOVEA_ONNX", os.path.join(build, "onnx-venv", "bin", "python"))
    if not os.path.exists(python):
        raise ImportProblem("--quantise: found an ONNX file and no Python package onnx2tf, expected it: `make onnx` installs it once")
    with tempfile.TemporaryDirectory() as folder:
        options, answer = os.path.join(folder, "options.json"), os.path.join(folder, "answer.json")
        with open(options, "w", encoding="utf-8") as file:
            json.dump({**{key: getattr(arguments, key) for key in ("pictures", "fit", "mean", "scale", "order")}, "answer": answer}, file)
        done = subprocess.run([python, os.path.join(HERE, "from_onnx.py"), os.path.abspath(path), os.path.abspath(target), options], stdin=subprocess.DEVNULL,
                              capture_output=True, text=True, errors="replace", check=False)
        if not os.path.exists(answer):
            raise ImportProblem(f"--quantise: onnx2tf ended with status {done.returncode}: {' '.join(done.stderr.split())[-120:]}")
        with open(answer, encoding="utf-8") as file:
            said = json.load(file)
    if "problem" in said:
        raise ImportProblem(said["problem"] + (complaint(done.stdout + done.stderr) if "why" in said else ""))
    return said["lines"]


def complaint(log):
    """The line in which the converter says what stopped it."""
    lines = [re.sub(r"\x1b\[[0-9;]*m", "", line).strip() for line in log.splitlines() if "ERROR" in line]
    return f" ({lines[0][:120]})" if lines else ""


# What follows runs in the other environment.


def listed_dims(value):
    return [d.dim_value if d.HasField("dim_value") else d.dim_param or "?" for d in value.type.tensor_type.shape.dim]


def loaded(path):
    """The model and its one input, of which the number of pictures is settled to 1."""
    import onnx
    from google.protobuf.message import DecodeError
    from graph import ImportProblem
    try:
        model = onnx.load(path)
        onnx.checker.check_model(model)
    except (DecodeError, ValueError) as problem:
        raise ImportProblem(f"not an ONNX file that can be read ({' '.join(str(problem).split())[:100]})") from problem
    except onnx.checker.ValidationError as problem:
        raise ImportProblem(f"not a valid ONNX file ({' '.join(str(problem).split())[:120]})") from problem
    graph = model.graph
    constants = {i.name for i in graph.initializer}
    inputs = [v for v in graph.input if v.name not in constants]
    if len(inputs) != 1:
        raise ImportProblem(f"--quantise: found {len(inputs)} inputs, expected one, which is a picture")
    sizes = listed_dims(inputs[0])
    if inputs[0].type.tensor_type.elem_type != onnx.TensorProto.FLOAT:
        kind = onnx.TensorProto.DataType.Name(inputs[0].type.tensor_type.elem_type).lower()
        raise ImportProblem(f"--quantise: found an input of {kind}, expected float32: export without half precision")
    if len(sizes) != 4 or any(not isinstance(n, int) or n < 1 for n in sizes[1:]):
        raise ImportProblem(f"found an input of shape [{', '.join(str(n)[:12] for n in sizes)}], expected [1, 3, height, width] in numbers: {EXPORT}")
    if sizes[0] != 1 and isinstance(sizes[0], int) and sizes[0] > 0:
        raise ImportProblem(f"found an input of {sizes[0]} pictures, expected 1: export with batch=1")
    for node in graph.node:
        check_operator(node)
    inputs[0].type.tensor_type.shape.dim[0].dim_value = 1
    return model, inputs[0].name, [1, *sizes[1:]]


def check_operator(node):
    from graph import ImportProblem
    if node.op_type in QUANTISED:
        raise ImportProblem(f"--quantise: found the operator {node.op_type}, expected a network of real numbers: export before quantisation")
    if node.domain not in ("", "ai.onnx") or importlib.util.find_spec(f"onnx2tf.ops.{node.op_type}") is None:
        name = f"{node.domain}.{node.op_type}" if node.domain else node.op_type
        raise ImportProblem(f"operator {name[:60]} ({node.name[:40]}) is not supported by onnx2tf: export without it, or cut the network before it")


def metadata_of(model):
    """As exporters write it into ONNX files, all of it text; numbers, lists and dictionaries in Python's form become such."""
    import ast
    found = {}
    for entry in model.metadata_props:
        try:
            found[entry.key] = ast.literal_eval(entry.value)
        except (SyntaxError, ValueError):
            found[entry.key] = entry.value
    return found


def sample_of(real):
    """The pictures that the converter tries its guesses on, from 0 to 1: the user's, over and over."""
    channels = []
    for picture in real:
        low, high = float(picture.min()), float(picture.max())
        rows, columns = (np.arange(128) * n // 128 for n in picture.shape[:2])
        full = np.broadcast_to(picture[rows][:, columns], (128, 128, 3))
        channels.append((full - low) / max(high - low, 1e-6))
    return np.stack([channels[i % len(channels)] for i in range(SAMPLE_SHAPE[0])]).astype(np.float32)


def converted(model, folder, real):
    """Bytes of the .tflite file; the converter works in `folder`."""
    import onnx
    import onnx2tf
    from graph import ImportProblem
    os.chdir(folder)
    np.save(SAMPLE, sample_of(real))
    onnx.save(model, "model.onnx")
    try:
        onnx2tf.convert(input_onnx_file_path="model.onnx", output_folder_path="out", non_verbose=True, verbosity="error",
                        copy_onnx_input_output_names_to_tflite=True)
        with open(os.path.join("out", "model_float32.tflite"), "rb") as file:
            return file.read()
    except Exception as problem:  # whatever the converter's libraries raise
        raise ImportProblem(f"--quantise: onnx2tf cannot convert it ({' '.join(str(problem).split())[:120]})") from problem


def outputs_onnx(model, name, values):
    import onnxruntime
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
    return [session.run(None, {name: value}) for value in values]


def outputs_tflite(data, values):
    from ai_edge_litert.interpreter import Interpreter
    net = Interpreter(model_content=data, num_threads=1)
    net.allocate_tensors()
    into, results = net.get_input_details()[0], []
    for value in values:
        net.set_tensor(into["index"], value)
        net.invoke()
        results.append([net.get_tensor(d["index"]).copy() for d in net.get_output_details()])
    return results


def apart(ours, theirs):
    """The largest difference over the largest number, as they lie or with the channels last; none: the shapes differ."""
    orders = [tuple(range(theirs[0].ndim))]
    if theirs[0].ndim in (3, 4):
        orders.append((0, *range(2, theirs[0].ndim), 1))
    found = []
    for order in orders:
        turned = [np.transpose(t, order) for t in theirs]
        if turned[0].shape == ours[0].shape:
            size = max(float(np.abs(t).max()) if t.size else 0.0 for t in turned)
            found.append(max(float(np.abs(a.astype(np.float64) - t).max()) for a, t in zip(ours, turned)) / max(size, 1e-6))
    return min((f if np.isfinite(f) else np.inf for f in found), default=np.inf)


def compared(data, model, name, values, planar):
    """(the place of each of the ONNX file's outputs, lines); refuses a conversion of which an output is another."""
    from graph import ImportProblem
    from planes import to_image
    ours = outputs_tflite(data, [to_image(v) if planar else v for v in values])
    theirs = outputs_onnx(model, name, values)
    names, left, places, lines = [o.name for o in model.graph.output], list(range(len(ours[0]))), [], []
    for k, output in enumerate(names):
        ratios = {i: apart([o[i] for o in ours], [t[k] for t in theirs]) for i in left}
        best = min(ratios, key=ratios.get, default=None)
        if best is None or ratios[best] > APART_MAX:
            by = f"{ratios[best]:.3g} of its largest number" if best is not None and np.isfinite(ratios[best]) else "its shape"
            raise ImportProblem(f"--quantise: onnx2tf made another network of it: output {output[:40]} differs from onnxruntime's by {by}, expected {APART_MAX:g}")
        left.remove(best)
        places.append(best)
        shape = list(ours[0][best].shape)
        lines.append(f"output {k} is {output[:40]} {shape}: equals onnxruntime's to {ratios[best]:.1g} of its largest number, {len(values)} pictures")
    return places, lines


def ordered(data, places):
    """The .tflite file with its outputs in the order of the ONNX file."""
    from ai_edge_litert.tools import flatbuffer_utils
    model = flatbuffer_utils.read_model_from_bytearray(bytearray(data))
    graph = model.subgraphs[0]
    graph.outputs = np.array([graph.outputs[p] for p in places], np.int32)
    model.signatureDefs = None
    return bytes(flatbuffer_utils.convert_object_to_bytearray(model))


def with_metadata(path, metadata):
    import zipfile
    if metadata:
        with zipfile.ZipFile(path, "a") as archive:
            archive.writestr("metadata.json", json.dumps(metadata, default=str))


def translate(path, target, options):
    import onnx_fractions
    import planes
    import quantise
    model, name, shape = loaded(path)
    metadata = metadata_of(model)
    fit, mean, scale = quantise.habits(options, metadata)
    planar = planes.is_planes(shape)
    pictures = quantise.Pictures(shape, mean, scale, fit == "letterbox", options["order"])
    values = [pictures.read(p) for p in quantise.listed(options["pictures"])[:SAMPLE_SHAPE[0]]]
    divided = onnx_fractions.apply(model, name, shape, planar, values[0])
    with tempfile.TemporaryDirectory() as folder:
        here = os.getcwd()
        try:
            data = converted(model, folder, [planes.to_image(v)[0] if planar else v[0] for v in values])
        finally:
            os.chdir(here)
    places, lines = compared(data, model, name, values[:TRIED], planar)
    with open(target, "wb") as file:
        file.write(ordered(data, places))
    with_metadata(target, metadata)
    return [*["boxes in pixels are divided by the input's size, so that scores keep their steps in bytes"][:divided], *lines]


def main():
    path, target, options = sys.argv[1:]
    with open(options, encoding="utf-8") as file:
        options = json.load(file)
    from graph import ImportProblem
    try:
        answer = {"lines": translate(path, target, options)}
    except ImportProblem as problem:
        answer = {"problem": str(problem)}
    except SystemExit:
        answer = {"problem": "--quantise: onnx2tf cannot convert it", "why": True}
    except OSError as problem:
        where = problem.filename if problem.filename not in (None, path) else ""
        answer = {"problem": f"{where}{': ' if where else ''}{problem.strerror or problem}"}
    with open(options["answer"], "w", encoding="utf-8") as file:
        json.dump(answer, file)


if __name__ == "__main__":
    main()
