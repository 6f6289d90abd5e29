"""`tools/import --quantise`: a network of real numbers becomes an int8 one that the engine runs as the reference does, with the loss that is said, and
what cannot be quantised is refused in a line. Needs the quantiser's Python (tools/quantiser_python.sh).

    build/quantiser-venv/bin/python tests/import/quantiser.py"""
import os
import re
import struct
import subprocess
import sys
import tempfile
import zipfile

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
TOOL = os.path.join(HERE, "..", "..", "tools", "import")
sys.path[:0] = [HERE, TOOL, os.path.join(HERE, "..", "..", "tools", "train")]

from builder import Builder  # noqa: E402

SIDE = 32


class Real(Builder):
    """Layers of real numbers with random weights."""

    def __init__(self, seed, planes=False):
        super().__init__()
        self.r = np.random.default_rng(seed)
        self.input = self.tensor("float32", (1, 3, SIDE, SIDE) if planes else (1, SIDE, SIDE, 3))
        self.last = self.input
        if planes:
            self.then("TRANSPOSE", (1, SIDE, SIDE, 3), None, self.const("int32", [0, 2, 3, 1]), options="Transpose")

    def then(self, name, shape, _, *more, options=None, **fields):
        out = self.tensor("float32", shape)
        self.op(name, [self.last, *more], [out], options, **fields)
        self.last = out

    def weights(self, shape, fan):
        return self.const("float32", self.r.normal(0, 1.5 / np.sqrt(fan), shape))

    def conv(self, channels, stride, activation=0):
        _, h, w, c = self.tensors[self.last][1]
        self.then("CONV_2D", (1, h // stride, w // stride, channels), None, self.weights((channels, 3, 3, c), 9 * c),
                  self.const("float32", self.r.normal(0, 0.2, channels)), options="Conv2D", StrideH=stride, StrideW=stride, DilationHFactor=1,
                  DilationWFactor=1, Padding=0, FusedActivationFunction=activation)

    def file(self):
        return self.bytes([self.input], [self.last])


def network(planes=False):
    """With functions that the quantiser leaves as real numbers."""
    b = Real(3, planes)
    b.conv(8, 2, 3)
    b.conv(16, 2)
    b.then("LEAKY_RELU", (1, 8, 8, 16), None, options="LeakyRelu", Alpha=0.1)
    b.conv(12, 1)
    b.then("PRELU", (1, 8, 8, 12), None, b.const("float32", b.r.uniform(0, 0.4, (1, 1, 12))))
    b.then("MEAN", (1, 12), None, b.const("int32", [1, 2]), options="Reducer", KeepDims=False)
    b.then("FULLY_CONNECTED", (1, 5), None, b.weights((5, 12), 12), b.const("float32", np.zeros(5)), options="FullyConnected")
    return b.file()


def pictures(folder, count, low=0, high=256):
    """Smooth ones with edges, all different."""
    from PIL import Image
    r = np.random.default_rng(1)
    for i in range(count):
        small = r.integers(low, high, (4, 5, 3)).astype(np.uint8)
        Image.fromarray(small).resize((48, 40), Image.Resampling.NEAREST if i % 2 else Image.Resampling.BICUBIC).save(os.path.join(folder, f"{i:02}.png"))


class Bench:
    def __init__(self, folder):
        self.folder, self.wrong = folder, 0

    def path(self, name, data=None):
        path = os.path.join(self.folder, name)
        if data is not None:
            with open(path, "wb") as file:
                file.write(data)
        return path

    def tool(self, *arguments, python=sys.executable, **environment):
        return subprocess.run([python, TOOL, *arguments], capture_output=True, text=True, env={**os.environ, **environment})

    def holds(self, what, good, found=""):
        self.wrong += not good
        print(f"{'holds ' if good else 'WRONG '} {what}" + ("" if good else f": {found}"))

    def refused(self, what, text, *arguments, **keys):
        done = self.tool(*arguments, **keys)
        good = done.returncode == 2 and text in done.stderr and done.stderr.count("\n") == 1 and len(done.stderr) <= 300
        self.holds(f"{what}: {done.stderr.strip()[-160:]}", good, done)


def said(text):
    """The rms of the loss that is printed."""
    found = re.search(r"^loss of output 0 .*: rms ([0-9.e+-]+), ([0-9.]+) %", text, re.M)
    return (float(found[1]), float(found[2])) if found else (np.nan, np.nan)


def measured(real, whole, paths):
    """The same by the definition: pictures as -1 to 1, outputs as real numbers."""
    from ai_edge_litert.interpreter import Interpreter
    from PIL import Image
    off = []
    nets = [Interpreter(model_path=p, num_threads=1) for p in (real, whole)]
    for net in nets:
        net.allocate_tensors()
    for path in paths:
        x = np.asarray(Image.open(path).convert("RGB").resize((SIDE, SIDE), Image.Resampling.BILINEAR), np.float32)
        x = (x - np.float32(127.5)) * np.float32(1 / 127.5)
        scale, zero = nets[1].get_input_details()[0]["quantization"]
        outs = []
        for net, value in zip(nets, (x, np.clip(np.round(x / scale) + zero, -128, 127).astype(np.int8))):
            detail, out = net.get_input_details()[0], net.get_output_details()[0]
            net.set_tensor(detail["index"], value[None] if detail["shape"][3] == 3 else value.transpose(2, 0, 1)[None])
            net.invoke()
            value = net.get_tensor(out["index"]).astype(np.float64)
            outs.append((value - out["quantization"][1]) * out["quantization"][0] if out["quantization"][0] else value)
        off.append(outs[0] - outs[1])
    return float(np.sqrt(np.mean(np.square(off))))


def quantises(bench, planes):
    folder = os.path.join(bench.folder, "pictures")
    model, out = bench.path("real.tflite", network(planes)), bench.path("out.fvm")
    with zipfile.ZipFile(model, "a") as archive:
        archive.writestr("labels.txt", "a\nb\nc\nd\ne\n")
    done = bench.tool("--quantise", model, folder, "-o", out, "--decoder", "none")
    form = "planes" if planes else "pixels"
    bench.holds(f"a network of real numbers, {form}", done.returncode == 0 and "quantised on 30 pictures" in done.stdout and os.path.exists(out), done)
    rms, share = said(done.stdout)
    whole = bench.path("out.int8.tflite")
    expected = measured(model, whole, [os.path.join(folder, f"{i:02}.png") for i in range(3, 40, 4)])
    bench.holds(f"its loss is that of the pictures kept aside, {rms:g}", abs(rms - expected) < 0.002 * expected, expected)
    bench.holds(f"and small, {share:g} %", share < 6, share)
    check = bench.tool(whole, "--decoder", "none", "--check", os.path.join(folder, "00.png"), "--layers")
    bench.holds("the engine equals the reference", check.returncode == 0 and "equal" in check.stdout and "DIFFERS" not in check.stdout, check)
    with zipfile.ZipFile(whole) as archive:
        bench.holds("labels go along", archive.namelist() == ["labels.txt"], archive.namelist())


def sloped(form):
    """Two PRELU whose slopes have this of their maps' three axes, the first of more elements than a step has."""
    b = Real(5)
    for channels, stride in ((40, 1), (12, 2)):
        b.conv(channels, stride)
        shape = b.tensors[b.last][1]
        slopes = b.r.uniform(-0.3, 1.3, [n if axis in form else 1 for n, axis in zip(shape[1:], "hwc")])
        b.then("PRELU", shape, None, b.const("float32", slopes))
    return b.file()


def slopes(bench):
    """PRELU of Keras without shared_axes, and its other forms, by the quantiser's own path."""
    folder = os.path.join(bench.folder, "pictures")
    for form in ("hwc", "hw", "c"):
        model, out = bench.path(f"{form}.tflite", sloped(form)), bench.path(f"{form}.fvm")
        done = bench.tool("--quantise", model, folder, "-o", out, "--decoder", "none")
        bench.holds(f"slopes by {form}", done.returncode == 0 and "2 TABLE_PAIR" in done.stdout and os.path.exists(out), done)
        check = bench.tool(bench.path(f"{form}.int8.tflite"), "--decoder", "none", "--check", os.path.join(folder, "01.png"), "--layers")
        bench.holds(f"slopes by {form} equal the reference", check.returncode == 0 and "equal" in check.stdout and "DIFFERS" not in check.stdout, check)
        rms, share = said(done.stdout)
        bench.holds(f"and lose little, {share:g} %", share < 6, rms)


def known(bench):
    """A network of which the int8 form is given: its real numbers, quantised again on photographs, lose little."""
    from real import real
    data = os.environ.get("FOVEA_DATA", os.path.join(HERE, "..", "..", "..", "shared", "data"))
    model, photographs = os.path.join(data, "models", "vww_96_int8.tflite"), os.path.join(data, "coco_32")
    if not os.path.exists(model):
        print("SKIPPED a known network: no vww_96_int8.tflite in $FOVEA_DATA/models")
        return
    with open(model, "rb") as file:
        path = bench.path("vww.tflite", real(file.read()))
    done = bench.tool("--quantise", path, photographs, "-o", bench.path("vww.fvm"))
    bench.holds(f"a known network loses {said(done.stdout)[1]:g} %", said(done.stdout)[1] < 3 and "decoder classifier" in done.stdout, done)


def older(data):
    """The file as converters of phones write it: operators' numbers in the older field alone, weights of half precision behind DEQUANTIZE, those of
    convolutions sparse before that, behind DENSIFY: of each four neighbouring channels all are stored or none."""
    from ai_edge_litert.tools import flatbuffer_utils
    schema = flatbuffer_utils.schema_fb
    model, draw = flatbuffer_utils.read_model_from_bytearray(bytearray(data)), np.random.default_rng(8)
    graph, kinds = model.subgraphs[0], schema.BuiltinOperator
    steps = []

    def then(kind, source, shape, dtype):
        tensor, op = schema.TensorT(), schema.OperatorT()
        tensor.shape, tensor.type, tensor.buffer, tensor.name = list(shape), dtype, 0, b"step%d" % len(steps)
        graph.tensors.append(tensor)
        if kind not in [c.builtinCode for c in model.operatorCodes]:
            model.operatorCodes.append(schema.OperatorCodeT())
            model.operatorCodes[-1].builtinCode = model.operatorCodes[-1].deprecatedBuiltinCode = kind
        op.opcodeIndex = [c.builtinCode for c in model.operatorCodes].index(kind)
        op.inputs, op.outputs = np.array([source], np.int32), np.array([len(graph.tensors) - 1], np.int32)
        steps.append(op)
        return len(graph.tensors) - 1
    for op in list(graph.operators):
        for place, t in enumerate(op.inputs):
            tensor = graph.tensors[t]
            stored = model.buffers[tensor.buffer].data
            if tensor.type != schema.TensorType.FLOAT32 or stored is None or len(stored) == 0:
                continue
            values, shape = np.frombuffer(bytes(stored), np.float32).reshape(tensor.shape), list(tensor.shape)
            tensor.type = schema.TensorType.FLOAT16
            if len(shape) == 4 and shape[3] % 4 == 0:
                kept = np.flatnonzero(draw.random(values.size // 4) < 0.6)
                tensor.sparsity = blocks(schema, shape, kept)
                values = values.reshape(-1, 4)[kept]
            model.buffers[tensor.buffer].data = np.frombuffer(values.astype(np.float16).tobytes(), np.uint8)
            t = t if tensor.sparsity is None else then(kinds.DENSIFY, t, shape, schema.TensorType.FLOAT16)
            op.inputs[place] = then(kinds.DEQUANTIZE, t, shape, schema.TensorType.FLOAT32)
    graph.operators = steps + list(graph.operators)
    for code in model.operatorCodes:
        code.deprecatedBuiltinCode, code.builtinCode = max(code.builtinCode, code.deprecatedBuiltinCode), 0
    return bytes(flatbuffer_utils.convert_object_to_bytearray(model))


def blocks(schema, shape, kept):
    """Blocks of four along the last axis, by their numbers in order."""
    def kind(size=0, **lists):
        made = schema.DimensionMetadataT()
        made.format, made.denseSize = int(bool(lists)), size
        for name, values in lists.items():
            vector = schema.Int32VectorT()
            vector.values = [int(v) for v in values]
            setattr(made, name, vector)
            setattr(made, name + "Type", schema.SparseIndexVector.Int32Vector)
        return made
    rows, width = int(np.prod(shape[:3])), shape[3] // 4
    found = schema.SparsityParametersT()
    found.traversalOrder, found.blockMap = [0, 1, 2, 3, 4], [3]
    found.dimMetadata = [kind(n) for n in shape[:3]] + [kind(arraySegments=np.searchsorted(kept // width, np.arange(rows + 1)), arrayIndices=kept % width),
                                                        kind(4)]
    return found


def halves(bench):
    """What LiteRT computes from the older file, the same file with its constants made plain computes too."""
    from ai_edge_litert.interpreter import Interpreter
    import quantise
    made = older(network())
    outs = []
    for data in (made, quantise.prepared(made)[0]):
        net = Interpreter(model_content=data, num_threads=1)
        net.allocate_tensors()
        detail, out = net.get_input_details()[0], net.get_output_details()[0]
        net.set_tensor(detail["index"], np.random.default_rng(2).uniform(-1, 1, detail["shape"]).astype(np.float32))
        net.invoke()
        outs.append(net.get_tensor(out["index"]))
    bench.holds("constants of half precision, and sparse ones", np.abs(outs[0] - outs[1]).max() < 1e-5 < np.abs(outs[0]).max(), outs)
    path = bench.path("older.tflite", made)
    done = bench.tool("--quantise", path, os.path.join(bench.folder, "pictures"), "-o", bench.path("older.fvm"), "--decoder", "none")
    bench.holds(f"and their network loses {said(done.stdout)[1]:g} %", said(done.stdout)[1] < 6, done)
    bench.refused("weights of half precision without --quantise", "found float16", path)
    bench.tool("--quantise", bench.path("newer.tflite", network()), os.path.join(bench.folder, "pictures"), "-o", bench.path("newer.fvm"), "--decoder", "none")
    sizes = [os.path.getsize(bench.path(f"{name}.int8.tflite")) for name in ("older", "newer")]
    bench.holds("bytes that no tensor has any more do not go along", abs(sizes[0] - sizes[1]) < 0.1 * sizes[1], sizes)


def enlarged(padding, own):
    """A convolution that enlarges: the standard operator with a bias, or MediaPipe's own, which has the picture first and its options as bytes."""
    from ai_edge_litert.tools import flatbuffer_utils
    b, kernel = Real(5), 3 if padding else 2
    b.conv(8, 2, 3)
    half = SIDE // 2
    height, width = (2 * half, half) if padding == 0 else (2 * (half - 1) + kernel, half - 1 + kernel)  # strides 2 down, 1 to the right
    shape, weights, bias = b.const("int32", [1, height, width, 4]), b.weights((4, kernel, kernel, 8), 8), b.const("float32", b.r.normal(0, 0.2, 4))
    inputs, out = [shape, weights, b.last, bias], b.tensor("float32", (1, height, width, 4))
    b.op("TRANSPOSE_CONV", inputs, [out], "TransposeConv", StrideH=2, StrideW=1, Padding=padding)
    b.last = out
    model = flatbuffer_utils.read_model_from_bytearray(bytearray(b.file()))
    op = model.subgraphs[0].operators[-1]
    code = model.operatorCodes[op.opcodeIndex]
    code.version = 3
    if own is not None:
        op.builtinOptions, op.builtinOptionsType, op.customOptions = None, 0, own
        code.builtinCode = code.deprecatedBuiltinCode = flatbuffer_utils.schema_fb.BuiltinOperator.CUSTOM
        code.deprecatedBuiltinCode, code.customCode, code.version = 32, b"Convolution2DTransposeBias", 1
        op.inputs = np.array([inputs[2], weights, bias], np.int32)
    return bytes(flatbuffer_utils.convert_object_to_bytearray(model))


def own_operators(bench):
    """MediaPipe's convolution that enlarges is the standard one with other names."""
    from ai_edge_litert.interpreter import Interpreter
    import quantise
    for padding in (0, 1):
        outs = []
        for data in (enlarged(padding, None), quantise.prepared(enlarged(padding, struct.pack("<iii", padding + 1, 2, 1)))[0]):
            net = Interpreter(model_content=data, num_threads=1)
            net.allocate_tensors()
            net.set_tensor(net.get_input_details()[0]["index"], np.random.default_rng(2).uniform(-1, 1, (1, SIDE, SIDE, 3)).astype(np.float32))
            net.invoke()
            outs.append(net.get_tensor(net.get_output_details()[0]["index"]))
        bench.holds(f"MediaPipe's transposed convolution, {outs[0].shape}", np.array_equal(*outs) and outs[0].std() > 0.1, outs)
    path, folder = bench.path("own.tflite", enlarged(1, struct.pack("<iii", 2, 2, 1))), os.path.join(bench.folder, "pictures")
    done = bench.tool("--quantise", path, folder, "-o", bench.path("own.fvm"), "--decoder", "none")
    bench.holds(f"and its network loses {said(done.stdout)[1]:g} %", said(done.stdout)[1] < 6, done)
    for what, text, options in (("padding 0", "found padding 0", (0, 2, 1)), ("stride 0", "strides 0 and 2", (2, 0, 2)),
                                ("other strides", "found an output of", (2, 1, 2)), ("few options", "found 8 bytes", (2, 2))):
        bench.refused(f"{what} of it", text, "--quantise", bench.path("own.tflite", enlarged(1, struct.pack(f"<{len(options)}i", *options))), folder)


def ranges(bench):
    """Pictures of YOLO networks and of known ones that take them as 0 to 1; others take -1 to 1."""
    import quantise
    import use
    none = dict(fit=None, mean=None, scale=None)
    found = [quantise.habits(none, {}, [1, side, side, 3], [[1, n], [1, 1]]) for side, n in ((224, 63), (192, 1404), (192, 2016 * 18), (128, 896 * 16))]
    bench.holds("networks that are known to take 0 to 1", [f[1] for f in found] == [0, 0, 0, 127.5], found)
    shapes = ([1, 84, 8400], [1, 25200, 85], [1, 56, 8400], [1, 21, 21])
    found = [quantise.habits(none, {}, image, [shape])[:2] for image in ([1, 640, 640, 3], [1, 3, 640, 640]) for shape in shapes]
    bench.holds("and networks whose output has a row for each cell of YOLO's grids",
                found == 2 * [*3 * [("letterbox", 0)], ("stretch", 127.5)], found)
    found = quantise.habits(none, {}, [1, 416, 416, 3], [[1, 3549, 6]], "yolox")
    bench.holds("YOLOX takes the bytes of pictures, blue first", (found, use.order_of("yolox")) == (("letterbox", 0, 1), "bgr"), found)
    dull = os.path.join(bench.folder, "dull")
    os.mkdir(dull)
    pictures(dull, 4, 60, 160)
    done, out = bench.tool("--quantise", bench.path("dull.tflite", network()), dull, "-o", bench.path("dull.fvm"), "--decoder", "none"), ()
    if done.returncode == 0:
        with open(bench.path("dull.fvm"), "rb") as file:
            raw = file.read()
        out = [struct.unpack_from("<f", raw, 160 + at)[0] for at in (20, 32)]
    bench.holds("the model file has the mean and scale of the calibration, whatever range its pictures have", np.allclose(out, (127.5, 1 / 127.5)), (out, done))


def faces():
    """Outputs of the shapes of those of MediaPipe's detector of faces."""
    b, side = Builder(), 128
    x, flat = b.tensor("float32", (1, side, side, 3)), b.tensor("float32", (1, side * side * 3))
    b.op("RESHAPE", [x, b.const("int32", [1, side * side * 3])], [flat], "Reshape", NewShape=[1, side * side * 3])
    outs = []
    for count in (16, 1):
        cut, out = b.tensor("float32", (1, 896 * count)), b.tensor("float32", (1, 896, count))
        b.op("STRIDED_SLICE", [flat] + [b.const("int32", v) for v in ([0, 0], [1, 896 * count], [1, 1])], [cut], "StridedSlice", BeginMask=0,
             EndMask=0, EllipsisMask=0, NewAxisMask=0, ShrinkAxisMask=0)
        b.op("RESHAPE", [cut, b.const("int32", [1, 896, count])], [out], "Reshape", NewShape=[1, 896, count])
        outs.append(out)
    return b.bytes([x], outs)


def fits(bench):
    """A network is calibrated on pictures that are fitted as they will be when it runs, and its model file says so."""
    import quantise
    import argparse
    import use
    parser = argparse.ArgumentParser()
    use.add_arguments(parser)
    for what, data, options, kind, fit in (("faces", faces(), (), "blaze", "letterbox"), ("a network of no certain decoder", network(), (), None, "stretch"),
                                           ("poses that the user names", network(), ("--decoder", "movenet"), "movenet", "letterbox")):
        arguments = parser.parse_args(options)
        found = quantise.decoder_of(quantise.prepared(data)[0], arguments, {}, [])
        bench.holds(f"{what}: the decoder before quantisation", found == kind, found)
        found = quantise.habits(vars(arguments), {}, [1, 128, 128, 3], [], kind)[0]
        bench.holds(f"{what} are calibrated on pictures as by {fit}", found == fit, found)
    b = Real(2)
    b.conv(51, 2)
    b.then("MEAN", (1, 51), None, b.const("int32", [1, 2]), options="Reducer", KeepDims=False)
    b.then("LOGISTIC", (1, 51), None)
    b.then("RESHAPE", (1, 1, 17, 3), None, b.const("int32", [1, 1, 17, 3]), options="Reshape", NewShape=[1, 1, 17, 3])
    path, folder = bench.path("people.tflite", b.file()), os.path.join(bench.folder, "pictures")
    for options, fit in ((("--decoder", "movenet"), "letterbox"), (("--decoder", "none"), "stretch"), (("--decoder", "none", "--fit", "letterbox"), "letterbox")):
        done, said_so = bench.tool("--quantise", path, folder, "-o", bench.path("people.int8.fvm"), *options), -1
        if done.returncode == 0:
            with open(bench.path("people.int8.fvm"), "rb") as file:
                said_so = struct.unpack_from("<i", file.read(164), 160)[0]
        bench.holds(f"{' '.join(options)}: {fit} in calibration and in the model file", (f"({fit})" in done.stdout, said_so) == (True, fit == "letterbox"), done)
    bench.holds("the quantised network's name ends in .int8 once", os.path.exists(bench.path("people.int8.tflite")) and
                not os.path.exists(bench.path("people.int8.int8.tflite")))


def precision(bench):
    """AP beside that of what `fovea detect` finds with the model file, on photographs with labels."""
    from real import real
    data = os.environ.get("FOVEA_DATA", os.path.join(HERE, "..", "..", "..", "shared", "data"))
    program = os.path.join(os.environ.get("BUILD", os.path.join(HERE, "..", "..", "build")), "fovea")
    model, photographs = os.path.join(data, "models", "yolov8n_full_integer_quant_224.tflite"), os.path.join(data, "coco_32")
    if not os.path.exists(model) or not os.path.exists(program):
        print("SKIPPED average precision: no yolov8n_full_integer_quant_224.tflite in $FOVEA_DATA/models, or no program")
        return
    with open(model, "rb") as file:
        path = bench.path("boxes.tflite", real(file.read()))
    arguments = ["--mean", "0", "--scale", str(1 / 255), "--fit", "letterbox", "--score", "0.01"]
    done = bench.tool("--quantise", path, photographs, "--labels", photographs, "-o", bench.path("boxes.fvm"), *arguments)
    found = re.search(r"whatever their class: (\d+) objects, AP ([0-9.]+) of real numbers, ([0-9.]+) of bytes", done.stdout)
    bench.holds("average precision is said", found is not None, done)
    if found is None:
        return
    import judge
    import json
    from PIL import Image
    files = sorted(os.path.join(photographs, n) for n in os.listdir(photographs) if n.endswith(".jpg"))
    seen = subprocess.run([program, "detect", "--model", bench.path("boxes.fvm"), *files], capture_output=True, text=True, check=True).stdout.splitlines()
    rows, truth = [], []
    for name, line in zip(files, seen):
        width, height = Image.open(name).size
        rows.append(np.array([[0, *d["box_px"], d["score"]] for d in json.loads(line)["detections"]], float).reshape(-1, 6))
        with open(name[:-4] + ".txt", encoding="utf-8") as file:
            v = np.array([line.split() for line in file], float).reshape(-1, 5)
        x, y, w, h = v[:, 1] * width, v[:, 2] * height, v[:, 3] * width, v[:, 4] * height
        truth.append(np.stack([0 * x, x - w / 2, y - h / 2, x + w / 2, y + h / 2, 1 + 0 * x], 1))
    count, value = judge.figures(rows, truth, 1)[0][:2]
    bench.holds(f"on all objects, {count}", int(found[1]) == count, found[1])
    bench.holds(f"it is that of `fovea detect`, {value:.3f} beside {found[3]}", abs(float(found[3]) - value) < 0.02, value)
    bench.holds(f"bytes lose little of {found[2]}", abs(float(found[2]) - float(found[3])) < 0.05 and float(found[2]) > 0.3, found[0])
    bench.refused("labels of other pictures", "found no label file for any of the pictures", "--quantise", path, photographs, "--labels", bench.folder, *arguments)
    bench.refused("a folder of labels without --quantise", "goes with --quantise", bench.path("boxes.int8.tflite"), "--labels", photographs)


def points(bias):
    """Five keypoints, and a score whose numbers before LOGISTIC lie about the bias."""
    b = Real(4)
    b.conv(8, 2, 3)
    b.then("MEAN", (1, 8), None, b.const("int32", [1, 2]), options="Reducer", KeepDims=False)
    inner, outs = b.last, []
    for count, start in ((10, 16.0), (1, bias)):
        b.last = inner
        b.then("FULLY_CONNECTED", (1, count), None, b.const("float32", b.r.normal(0, 0.2 if count == 1 else 8, (count, 8))),
               b.const("float32", np.full(count, start)), options="FullyConnected")
        outs.append(b.last)
    b.then("LOGISTIC", (1, 1), None)
    return b.bytes([b.input], [outs[0], b.last])


def cancelling():
    """Differences of large numbers, of which bytes leave nothing."""
    b = Real(5)
    b.then("MEAN", (1, 3), None, b.const("int32", [1, 2]), options="Reducer", KeepDims=False)
    for number in (1003.0, -1003.0):
        b.then("ADD", (1, 3), None, b.const("float32", np.full((1, 3), number)), options="Add")
    return b.file()


def losses_that_refuse(bench):
    """A network is not written whose output is lost, or whose score no picture has brought above one half."""
    folder = os.path.join(bench.folder, "pictures")
    out = bench.path("lost.fvm")
    for what, data, text, options in (("an output that is lost", cancelling(), "--quantise: output 0 ", ("--decoder", "embedding")),
                                      ("a score that no picture shows", points(-6.0), "no picture showed what is sought", ("--decoder", "landmarks", "--points", "5,2"))):
        path = bench.path("lossy.tflite", data)
        bench.refused(what, text, "--quantise", path, folder, "-o", out, *options)
        bench.holds("nothing is written", not os.path.exists(out) and not os.path.exists(bench.path("lost.int8.tflite")))
        done = bench.tool("--quantise", path, folder, "-o", out, "--any-loss", *options)
        bench.holds("--any-loss goes on", done.returncode == 0 and os.path.exists(out) and os.path.exists(bench.path("lost.int8.tflite")), done)
        for written in (out, bench.path("lost.int8.tflite")):
            os.remove(written)
    done = bench.tool("--quantise", bench.path("lossy.tflite", cancelling()), folder, "-o", out, "--decoder", "none")
    bench.holds("what no decoder reads is not refused", done.returncode == 0, done)
    done = bench.tool("--quantise", bench.path("seen.tflite", points(6.0)), folder, "-o", out, "--decoder", "landmarks", "--points", "5,2")
    bench.holds("a score on both sides of one half", done.returncode == 0, done)
    bench.refused("--any-loss alone", "found without --quantise", bench.path("lossy.tflite"), "--any-loss")


def refuses(bench):
    folder = os.path.join(bench.folder, "pictures")
    model = bench.path("real.tflite")
    whole = bench.path("out.int8.tflite")
    bench.refused("a quantised network", "expected a network of real numbers", "--quantise", whole, folder, "-o", bench.path("other.fvm"))
    bench.refused("no pictures", "found no pictures", "--quantise", model)
    bench.refused("a file that is no picture", "not a picture", "--quantise", model, bench.path("text.png", b"text"))
    bench.refused("a file that is no network", "not a .tflite file", "--quantise", bench.path("text.tflite", b"text text"), folder)
    bench.refused("half a network", "gave up", "--quantise", bench.path("half.tflite", network()[:3000]), folder)
    bench.refused("pictures without --quantise", "expected one model", whole, model)
    bench.refused("no quantiser", "`make quantiser`", "--quantise", model, folder, python=sys.executable, FOVEA_QUANTISER="/nowhere",
                  PYTHONPATH=blind(bench))
    two = Real(1)
    second = two.tensor("float32", (1, SIDE, SIDE, 3))
    two.op("ADD", [two.input, second], [two.tensor("float32", (1, SIDE, SIDE, 3))], "Add")
    bench.refused("two inputs", "found 2 inputs", "--quantise", bench.path("two.tflite", two.bytes([two.input, second], [second + 1])), folder)
    bench.holds("a refused network leaves no file", not os.path.exists(bench.path("two.int8.tflite")) and not os.path.exists(bench.path("two.fvm")))


def blind(bench):
    """A folder whose sitecustomize.py hides the package."""
    os.makedirs(os.path.join(bench.folder, "blind"), exist_ok=True)
    bench.path("blind/sitecustomize.py", b"import importlib.util as u\nf = u.find_spec\nu.find_spec = lambda n, *a: None if 'quantizer' in n else f(n, *a)\n")
    return os.path.join(bench.folder, "blind")


def main():
    with tempfile.TemporaryDirectory() as folder:
        os.mkdir(os.path.join(folder, "pictures"))
        pictures(os.path.join(folder, "pictures"), 40)
        bench = Bench(folder)
        quantises(bench, False)
        quantises(bench, True)
        slopes(bench)
        known(bench)
        halves(bench)
        own_operators(bench)
        ranges(bench)
        fits(bench)
        precision(bench)
        losses_that_refuse(bench)
        refuses(bench)
    return 1 if bench.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
