"""From a network of real numbers to full integers, inputs and outputs included, by the package ai-edge-quantizer on the user's pictures; and what
that costs on them, output by output. It has an environment of its own (tools/quantiser_python.sh) and needs no network when it runs."""
import contextlib
import glob
import logging
import os
import sys
import warnings
import zipfile
from typing import NamedTuple

import numpy as np
import tflite

import choose
import custom
import dense
import details
import graph as graph_module
import lost
import planes
import use
from graph import ImportProblem

PICTURES = (".bmp", ".jpeg", ".jpg", ".png", ".ppm", ".pgm")
HOLD_OUT = 4  # of so many pictures the last is kept for the loss, where there are at least twice as many


@contextlib.contextmanager
def quiet():
    """Libraries talk to the error stream itself."""
    sys.stderr.flush()
    kept, nothing = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings(), contextlib.redirect_stderr(open(os.devnull, "w", encoding="utf-8")):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(logging.NOTSET)
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nothing)


def listed(paths):
    """Pictures, and those in folders."""
    found = []
    for path in paths:
        found += [p for p in sorted(glob.glob(os.path.join(glob.escape(path), "*"))) if p.lower().endswith(PICTURES)] if os.path.isdir(path) else [path]
    if not found:
        raise ImportProblem("--quantise: found no pictures, expected some like those that the camera will give")
    return found


class Pictures:
    """As the network is to see them."""

    def __init__(self, shape, mean, scale, letterbox, order):
        self.planar = planes.is_planes(shape)
        sizes = [int(n) for n in shape]
        if len(sizes) != 4 or sizes[0] != 1 or sizes[1 if self.planar else 3] not in (1, 3):
            raise ImportProblem(f"--quantise: found an input of shape {sizes}, expected a picture: [1, h, w, 1 or 3] or [1, 1 or 3, h, w]")
        self.channels, self.height, self.width = sizes[1:] if self.planar else (sizes[3], sizes[1], sizes[2])
        self.mean, self.scale, self.letterbox, self.order = mean, scale, letterbox, order

    def area(self, picture):
        """Where the picture lies in the input: left, top, width, height."""
        width, height = self.width, self.height
        if self.letterbox:
            ratio = min(self.width / picture.width, self.height / picture.height)
            width, height = max(1, round(picture.width * ratio)), max(1, round(picture.height * ratio))
        return (self.width - width) // 2, (self.height - height) // 2, width, height

    def placed(self, path):
        from PIL import Image
        with Image.open(path) as picture:
            return self.area(picture)

    def read(self, path):
        from PIL import Image
        try:
            picture = Image.open(path).convert("L" if self.channels == 1 else "RGB")
        except OSError as problem:
            raise ImportProblem(f"{path}: not a picture that can be read ({str(problem)[:80]})") from problem
        left, top, width, height = self.area(picture)
        full = np.full((self.height, self.width, self.channels), 114, np.float32)
        full[top:top + height, left:left + width] = np.asarray(picture.resize((width, height), Image.Resampling.BILINEAR), np.float32).reshape(
            height, width, self.channels)
        full = full[:, :, ::-1] if self.order == "bgr" else full
        real = ((full - np.float32(self.mean)) * np.float32(self.scale))[None]
        return np.ascontiguousarray(np.transpose(real, planes.TO_PLANES) if self.planar else real)


def prepared(raw):
    """The model as the quantiser wants it: a signature, names that differ, no tensor that nothing needs; its picture's shape, and those of
    its outputs."""
    from ai_edge_litert.tools import flatbuffer_utils
    schema = flatbuffer_utils.schema_fb
    model = flatbuffer_utils.read_model_from_bytearray(bytearray(raw))
    graph_module.single(tflite.Model.GetRootAs(raw, 0))
    graph = model.subgraphs[0]
    if len(graph.inputs) != 1:
        raise ImportProblem(f"--quantise: found {len(graph.inputs)} inputs, expected one, which is a picture")
    for code in model.operatorCodes:  # files of converters before 2020 have their number in the older field alone, which the quantiser does not read
        code.builtinCode = max(code.builtinCode, code.deprecatedBuiltinCode)
    dense.constants(model, schema)
    custom.standard(model, schema)
    used = sorted({int(t) for op in graph.operators for t in [*op.inputs, *op.outputs] if t >= 0} | {int(t) for t in [*graph.inputs, *graph.outputs]})
    place = {t: i for i, t in enumerate(used)}
    graph.tensors = [graph.tensors[t] for t in used]
    for op in graph.operators:
        op.inputs = np.array([place.get(int(t), -1) for t in op.inputs], np.int32)
        op.outputs = np.array([place[int(t)] for t in op.outputs], np.int32)
    graph.inputs, graph.outputs = (np.array([place[int(t)] for t in ts], np.int32) for ts in (graph.inputs, graph.outputs))
    image = graph.tensors[graph.inputs[0]]
    if image.type != schema.TensorType.FLOAT32:
        raise ImportProblem("--quantise: found a quantised input, expected a network of real numbers (float32)")
    seen = set()
    for i, tensor in enumerate(graph.tensors):
        if not tensor.name or tensor.name in seen:
            tensor.name = (tensor.name or b"t") + b"_%d" % i
        seen.add(tensor.name)
    signature = schema.SignatureDefT()
    signature.signatureKey, signature.subgraphIndex = b"serving_default", 0
    signature.inputs, signature.outputs = ([entry(schema, b"%s%d" % (kind, n), t) for n, t in enumerate(ts)]
                                           for kind, ts in ((b"input", graph.inputs), (b"output", graph.outputs)))
    model.signatureDefs = [signature]
    drop_buffers(model)
    outputs = [[int(n) for n in graph.tensors[t].shape] for t in graph.outputs]
    return bytes(flatbuffer_utils.convert_object_to_bytearray(model)), [int(n) for n in image.shape], outputs


def drop_buffers(model):
    """Bytes that no tensor has any more, as those of half precision or of another form of the weights, would go along into the quantised file."""
    holders = [t for graph in model.subgraphs for t in graph.tensors] + list(model.metadata or [])
    used = sorted({0} | {int(holder.buffer) for holder in holders})
    place = {old: new for new, old in enumerate(used)}
    for holder in holders:
        holder.buffer = place[int(holder.buffer)]
    model.buffers = [model.buffers[old] for old in used]


def entry(schema, name, t):
    made = schema.TensorMapT()
    made.name, made.tensorIndex = name, int(t)
    return made


def widen(ranges, found):
    """From the least to the largest number of all pictures; the package itself takes a moving average, which cuts what few pictures show."""
    for name, limits in found.items():
        known = ranges.setdefault(name, dict(limits))
        for key, pick in (("min", np.minimum), ("max", np.maximum)):
            if key in limits and key in known:
                known[key] = pick(known[key], limits[key])


def quantised(data, values):
    from ai_edge_quantizer import quantizer, recipe
    worker, ranges = quantizer.Quantizer(bytearray(data), recipe.static_wi8_ai8()), {}
    for value in values:
        widen(ranges, worker.calibrate({"serving_default": [{"input0": value}]}, num_threads=1))
    return bytes(worker.quantize(ranges, enable_progress_bar=False, enable_progress_report=False).quantized_model)


class Net:
    """A network in LiteRT: real pictures in, real numbers out, whatever it computes with."""

    def __init__(self, data):
        from ai_edge_litert.interpreter import Interpreter
        self.run = Interpreter(model_content=data, num_threads=1)
        self.run.allocate_tensors()
        self.outputs = self.run.get_output_details()

    def __call__(self, value):
        detail = self.run.get_input_details()[0]
        if detail["dtype"] != np.float32:
            scale, zero = detail["quantization"]
            info = np.iinfo(detail["dtype"])
            value = np.clip(np.round(value / np.float32(scale)) + zero, info.min, info.max).astype(detail["dtype"])
        self.run.set_tensor(detail["index"], value)
        self.run.invoke()
        return [self.real(d) for d in self.outputs]

    def real(self, detail):
        value, (scale, zero) = self.run.get_tensor(detail["index"]), detail["quantization"]
        return (value.astype(np.float64) - zero) * scale if scale else value.astype(np.float64)


class Tried(NamedTuple):
    before: Net
    after: Net
    pictures: Pictures
    files: list
    values: list
    aside: range  # of the files: not seen by the quantiser


def losses(before, after, values):
    """For each output a line, and the share that is lost: the root of the mean square of the differences beside that of the numbers."""
    pairs = [(before(v), after(v)) for v in values]
    lines, shares = [], []
    for i, detail in enumerate(before.outputs):
        a, b = (np.stack([pair[k][i] for pair in pairs]) for k in (0, 1))
        size, off = float(np.sqrt(np.mean(a * a))), np.abs(a - b)
        rms = float(np.sqrt(np.mean(off * off)))
        same = sum(int(np.argmax(x) == np.argmax(y)) for x, y in zip(a, b))
        lines.append(f"loss of output {i} {detail['name'][:40]} {[int(n) for n in detail['shape']]}: rms {rms:.4g}, {100 * rms / max(size, 1e-30):.2f} % of the "
                     f"numbers' {size:.3g}; at most {float(off.max()):.3g}; the largest number at the same place in {same} of {len(values)}")
        shares.append(lost.share(rms, size, float(after.outputs[i]["quantization"][0])))
    return lines, shares


def with_archive(source, target):
    """Labels and metadata in a zip archive at the end of the model go along."""
    if not zipfile.is_zipfile(source):
        return
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "a") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))


def write(path, target, made):
    """There whole or not at all."""
    part = f"{target}.part"
    try:
        with open(part, "wb") as file:
            file.write(made)
        with_archive(path, part)
        os.replace(part, target)
    except OSError:
        if os.path.exists(part):
            os.remove(part)
        raise


def has_yolo_head(image, outputs):
    """Whether an output has a row for each cell of YOLO's grids, or three."""
    cells = choose.cells_of(*(image[2:4] if planes.is_planes(image) else image[1:3])) if len(image) == 4 else set()
    return any(len(shape) == 3 and min(shape[1:]) > 4 and any(n in shape[1:] or 3 * n in shape[1:] for n in cells) for shape in outputs)


def decoder_of(data, arguments, metadata, labels):
    """That which the quantised network is likely to get, None: nothing is certain, as its line will say then. Ranges are not known yet."""
    if arguments.decoder:
        return arguments.decoder
    try:
        graph = graph_module.parse(data)
        if arguments.outputs:
            graph_module.cut(graph, arguments.outputs)
        labels = labels if arguments.labels is None else use.labels_of(arguments, labels)
        return choose.choose(choose.Evidence(graph, labels, metadata, arguments))
    except (ImportProblem, *graph_module.FAULTS):
        return None


def habits(options, metadata, image=(), outputs=(), kind=None):
    """(fit, mean, scale): as the options (a dictionary) say; else the fit with which the decoder runs, and the range that YOLOX, other YOLO networks,
    known ones of this side and outputs of so many numbers, or most others take."""
    known = any((image[2], int(np.prod(shape))) in details.FRACTIONS for shape in outputs) if len(image) == 4 else False
    yolo = metadata.get("task") or has_yolo_head(image, outputs)
    fit = use.fit_of(kind) if kind not in (None, "none") else "letterbox" if yolo else "stretch"
    if kind == "yolox":
        ours = (fit, 0.0, 1.0)
    else:
        ours = (fit, 0.0, 1 / 255) if yolo or known else (fit, 127.5, 1 / 127.5)
    return tuple(usual if options[key] is None else options[key] for key, usual in zip(("fit", "mean", "scale"), ours))


def run(path, target, arguments, metadata, labels=()):
    """Write the int8 model to `target`; returns the lines to print, and what average precision needs."""
    with open(path, "rb") as file:
        raw = file.read()
    if raw[4:8] != b"TFL3":
        raise ImportProblem(f"byte 4: found {raw[4:8]!r}, expected b'TFL3': not a .tflite file")
    try:
        with quiet():
            data, shape, outputs = prepared(raw)
            kind = decoder_of(data, arguments, metadata, list(labels))
            fit, mean, scale = habits(vars(arguments), metadata, shape, outputs, kind)
            pictures = Pictures(shape, mean, scale, fit == "letterbox", arguments.order or use.order_of(kind))
            files = listed(arguments.pictures)
            values = [pictures.read(p) for p in files]
            kept = values[HOLD_OUT - 1::HOLD_OUT] if len(values) >= 2 * HOLD_OUT else []
            made = quantised(data, [v for i, v in enumerate(values) if not kept or i % HOLD_OUT != HOLD_OUT - 1])
            tried = Tried(Net(data), Net(made), pictures, files, values, range(HOLD_OUT - 1, len(values), HOLD_OUT) if kept else range(0))
            lines, shares = losses(tried.before, tried.after, kept or values)
            why = None if arguments.any_loss else lost.fault(made, kind, list(labels), metadata, arguments, shares)
            if why:
                raise ImportProblem(why)
    except (ImportProblem, OSError, KeyboardInterrupt, MemoryError):
        raise
    except Exception as problem:  # whatever the quantiser's libraries raise on a model that they do not take
        raise ImportProblem(f"--quantise: the quantiser gave up: {' '.join(str(problem).split())[:120]}") from problem
    write(path, target, made)
    arguments.fit, arguments.mean, arguments.scale = fit, mean, scale  # as it was calibrated, so it runs
    low, high = (0 - mean) * scale, (255 - mean) * scale
    where = f"{len(kept)} that it did not see" if kept else "the same ones"
    text = [f"quantised on {len(values) - len(kept)} pictures as {low:.3g} to {high:.3g} ({fit}); losses on {where}", *lines, f"{target}: {len(made)} bytes"]
    return text, tried
