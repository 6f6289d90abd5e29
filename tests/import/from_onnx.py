"""`tools/import --quantise MODEL.onnx`: the numbers of onnxruntime, in bytes with a stated loss; what cannot be converted is refused in a line. Needs
the Pythons of tools/quantiser_python.sh and tools/onnx_python.sh.

    build/quantiser-venv/bin/python tests/import/from_onnx.py build/onnx-venv/bin/python"""
import os
import subprocess
import sys
import tempfile

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..", "..", "tools", "import")]

from quantise import Pictures  # noqa: E402
from quantiser import Bench, pictures, said  # noqa: E402

SIDE = 64
LOSS_MAX = 3.0  # per cent of the output's numbers
# name: first number of a byte, last, how pictures are fitted, decoder or None: raw outputs
GOOD = {"classifier": (-1, 1, "stretch", "classifier"), "detector": (0, 1, "letterbox", "yolov8"), "pose": (0, 1, "letterbox", "yolov8_pose"),
        "yolox": (0, 255, "letterbox", "yolox"), "two_outputs": (-1, 1, "stretch", None)}
BROKEN = {"open": "found an input of shape [batch, 3, height, width], expected [1, 3, height, width] in numbers",
          "many": "found an input of 4 pictures, expected 1", "two": "found 2 inputs", "odd": "operator com.example.Wavelet",
          "quantised": "found the operator QuantizeLinear, expected a network of real numbers", "half": "found an input of float16, expected float32"}


def prepared(paths, low, high, fit, order):
    """As the network sees the pictures, in planes."""
    reader = Pictures((1, SIDE, SIDE, 3), -low * 255 / (high - low), (high - low) / 255, fit == "letterbox", order)
    return [reader.read(p).transpose(0, 3, 1, 2) for p in paths]


def in_bytes(path, values):
    """Outputs of the quantised network as real numbers, by LiteRT."""
    from ai_edge_litert.interpreter import Interpreter
    net = Interpreter(model_path=path, num_threads=1)
    net.allocate_tensors()
    into, runs = net.get_input_details()[0], []
    scale, zero = into["quantization"]
    for value in values:
        net.set_tensor(into["index"], np.clip(np.round(value.transpose(0, 2, 3, 1) / scale) + zero, -128, 127).astype(np.int8))
        net.invoke()
        runs.append([(net.get_tensor(d["index"]).astype(float) - d["quantization"][1]) * d["quantization"][0] for d in net.get_output_details()])
    return [np.stack(o) for o in zip(*runs)]


def as_ours(name, theirs):
    """onnxruntime's outputs in the form that is expected of ours: boxes as fractions, planes last."""
    theirs = [t.astype(float) for t in theirs]
    if name in ("detector", "pose"):
        theirs[0][:, :, :4] /= SIDE
    if name == "pose":
        for k in (0, 1):
            theirs[0][:, :, 7 + k::3] /= SIDE
    return [t.transpose(0, 1, 3, 4, 2) if t.ndim == 5 else t for t in theirs]


def good(bench, onnx_python, name):
    low, high, fit, decoder = GOOD[name]
    paths = [os.path.join(bench.folder, "pictures", f"{i:02}.png") for i in range(3, 40, 4)]
    values = prepared(paths, low, high, fit, "bgr" if decoder == "yolox" else "rgb")
    np.save(bench.path("pictures.npy"), np.stack(values))
    subprocess.run([onnx_python, os.path.join(HERE, "onnx_models.py"), bench.folder], check=True, stderr=subprocess.DEVNULL)
    out = bench.path(f"{name}.fvm")
    options = [*([] if decoder else ["--decoder", "none"]), *(["--any-loss"] if name == "detector" else [])]  # its weights are drawn: it sees nothing for sure
    done = bench.tool("--quantise", bench.path(f"{name}.onnx"), os.path.join(bench.folder, "pictures"), "-o", out, *options)
    bench.holds(f"{name} becomes a model file", done.returncode == 0 and os.path.exists(out), done)
    bench.holds(f"{name}: equals onnxruntime before it is quantised", "equals onnxruntime's to" in done.stdout, done.stdout)
    bench.holds(f"{name}: boxes in pixels are divided, others are not", ("boxes in pixels are divided" in done.stdout) == (name in ("detector", "pose")), done.stdout)
    bench.holds(f"{name}: its decoder is {decoder or 'none'}", f"decoder {decoder}\n" in done.stdout or decoder is None, done.stdout)
    if done.returncode:
        return
    with np.load(bench.path(f"{name}.npz")) as archive:
        theirs = as_ours(name, [archive[k] for k in archive.files])
    ours = in_bytes(bench.path(f"{name}.int8.tflite"), values)
    bench.holds(f"{name}: outputs in their order", [o.shape for o in ours] == [t.shape for t in theirs], [o.shape for o in ours])
    for k, (a, b) in enumerate(zip(ours, theirs)):
        loss = 100 * float(np.sqrt(np.mean((a - b) ** 2) / np.mean(b * b)))
        bench.holds(f"{name}: output {k} in bytes is off by {loss:.2f} %", loss < LOSS_MAX, loss)
        if k == 0:
            bench.holds(f"{name}: as is said, {said(done.stdout)[1]:g} %", abs(said(done.stdout)[1] - loss) < 0.02 * loss + 0.01, loss)
    if name == "detector":
        off = float(np.abs(ours[0][:, :, 4:] - theirs[0][:, :, 4:]).max())
        bench.holds(f"{name}: scores keep their steps, {off:.3f} at most", off < 0.1, off)


def refuses(bench):
    folder = os.path.join(bench.folder, "pictures")
    for name, text in BROKEN.items():
        bench.refused(name, text, "--quantise", bench.path(f"{name}.onnx"), folder)
    bench.refused("text", "not an ONNX file", "--quantise", bench.path("text.onnx", b"text, text"), folder)
    with open(bench.path("classifier.onnx"), "rb") as file:
        bench.refused("half a file", "not a", "--quantise", bench.path("cut.onnx", file.read()[:5000]), folder)
    bench.refused("no file", "No such file", "--quantise", bench.path("nowhere.onnx"), folder)
    bench.refused("no --quantise", "--quantise MODEL.onnx PICTURES", bench.path("classifier.onnx"))
    bench.refused("no converter", "`make onnx`", "--quantise", bench.path("classifier.onnx"), folder, FOVEA_ONNX="/nowhere")
    left = [n for n in os.listdir(bench.folder) if n.endswith((".fvm", ".int8.tflite")) and n.split(".")[0] not in GOOD]
    bench.holds("a refused network leaves no file", not left, left)


def main():
    with tempfile.TemporaryDirectory() as folder:
        os.mkdir(os.path.join(folder, "pictures"))
        pictures(os.path.join(folder, "pictures"), 40)
        bench = Bench(folder)
        for name in GOOD:
            good(bench, sys.argv[1], name)
        refuses(bench)
    return 1 if bench.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
