"""ONNX files with random weights, built by the package onnx as exporters build theirs: pictures in planes, a fixed size.

    build/onnx-venv/bin/python tests/import/onnx_models.py FOLDER      writes all of them, and what onnxruntime computes on FOLDER/pictures.npy"""
import os
import sys

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

SIDE, CLASSES = 64, 3


class Net:
    def __init__(self, seed):
        self.r, self.nodes, self.constants, self.count = np.random.default_rng(seed), [], [], 0

    def const(self, value, dtype=np.float32):
        self.constants.append(numpy_helper.from_array(np.asarray(value, dtype), f"c{len(self.constants)}"))
        return self.constants[-1].name

    def op(self, kind, *inputs, outputs=1, domain="", **fields):
        names = [f"{kind}_{self.count}_{k}" for k in range(outputs)]
        self.nodes.append(helper.make_node(kind, list(inputs), names, name=f"/{kind}_{self.count}", domain=domain, **fields))
        self.count += 1
        return names[0] if outputs == 1 else names

    def conv(self, x, inputs, outputs, stride=1, kernel=3, groups=1, bias=0.0):
        weights = self.r.normal(0, 1.4 / np.sqrt(kernel * kernel * inputs // groups), (outputs, inputs // groups, kernel, kernel))
        return self.op("Conv", x, self.const(weights), self.const(self.r.normal(bias, 0.2, outputs)), kernel_shape=[kernel, kernel],
                       strides=[stride, stride], pads=[kernel // 2] * 4, group=groups)

    def silu(self, x):
        return self.op("Mul", x, self.op("Sigmoid", x))

    def norm(self, x, channels):
        draws = [self.r.uniform(0.5, 1.5, channels), self.r.normal(0, 0.2, channels), self.r.normal(0, 0.2, channels), self.r.uniform(0.5, 1.5, channels)]
        return self.op("BatchNormalization", x, *[self.const(d) for d in draws])

    def model(self, outputs, shape=(1, 3, SIDE, SIDE), kind=TensorProto.FLOAT, metadata=None, domains=()):
        graph = helper.make_graph(self.nodes, "net", [helper.make_tensor_value_info("images", kind, shape)],
                                  [helper.make_tensor_value_info(o, TensorProto.FLOAT, [1, 4] if domains else None) for o in outputs], self.constants)
        opsets = [helper.make_opsetid("", 17), *[helper.make_opsetid(d, 1) for d in domains]]
        made = helper.make_model(graph, opset_imports=opsets, ir_version=8)
        helper.set_model_props(made, {k: str(v) for k, v in (metadata or {}).items()})
        return onnx.shape_inference.infer_shapes(made) if not domains else made


def classifier(shape=(1, 3, SIDE, SIDE), kind=TensorProto.FLOAT):
    """Blocks of MobileNetV2 and a residual, as torch exports them."""
    n = Net(1)
    x = n.op("Relu", n.norm(n.conv("images", 3, 8, 2), 8))
    x = n.op("Clip", n.conv(x, 8, 16, 2), n.const(0), n.const(6))
    y = n.op("Clip", n.conv(x, 16, 16, 1, groups=16), n.const(0), n.const(6))
    x = n.op("Add", x, n.conv(y, 16, 16, kernel=1))
    x = n.op("LeakyRelu", n.conv(x, 16, 24, 2), alpha=0.1)
    x = n.op("Flatten", n.op("GlobalAveragePool", x))
    x = n.op("Gemm", x, n.const(n.r.normal(0, 0.7, (5, 24))), n.const(np.zeros(5)), transB=1)
    return n.model([n.op("Softmax", x, axis=1)], shape, kind)


def backbone(n, picture="images"):
    """Three levels of 8, 16 and 32 pixels, the coarser ones enlarged into the finer."""
    x = n.silu(n.conv(n.silu(n.conv(picture, 3, 8, 2)), 8, 16, 2))
    a = n.op("Add", x, n.silu(n.conv(n.silu(n.conv(x, 16, 8)), 8, 16)))
    p3 = n.silu(n.conv(a, 16, 16, 2))
    p4 = n.silu(n.conv(p3, 16, 24, 2))
    p5 = n.silu(n.conv(p4, 24, 32, 2))
    p5 = n.op("Concat", p5, n.op("MaxPool", p5, kernel_shape=[5, 5], strides=[1, 1], pads=[2] * 4), axis=1)
    enlarged = n.op("Resize", p4, "", n.const([1, 1, 2, 2]), mode="nearest", coordinate_transformation_mode="asymmetric", nearest_mode="floor")
    return [(n.op("Concat", p3, enlarged, axis=1), 40, 8), (p4, 24, 16), (p5, 64, 32)]


def cells():
    """Centres of the cells [2, n] in cells, and each one's stride [1, n]."""
    centres, strides = [], []
    for stride in (8, 16, 32):
        ys, xs = np.mgrid[0:SIDE // stride, 0:SIDE // stride] + 0.5
        centres.append(np.stack([xs.ravel(), ys.ravel()]))
        strides.append(np.full((1, xs.size), stride))
    return np.concatenate(centres, 1)[None], np.concatenate(strides, 1)[None]


def yolov8(points=0):
    """The head of YOLOv8: distances as expectations over bins, boxes in pixels beside scores; with keypoints that of YOLOv8-pose."""
    n, bins = Net(2), 8
    boxes, scores, keys = [], [], []
    for x, channels, _ in backbone(n):
        for kind, width, bias in ((boxes, 4 * bins, 0.0), (scores, CLASSES, -3.0), (keys, 3 * points, 0.0)):
            if width:
                last = n.conv(n.silu(n.conv(x, channels, 24)), 24, width, kernel=1, bias=bias)
                kind.append(n.op("Reshape", last, n.const([1, width, -1], np.int64)))
    centres, strides = cells()
    bin_scores = n.op("Transpose", n.op("Reshape", n.op("Concat", *boxes, axis=2), n.const([1, 4, bins, -1], np.int64)), perm=[0, 2, 1, 3])
    mean = n.op("Conv", n.op("Softmax", bin_scores, axis=1), n.const(np.arange(bins).reshape(1, bins, 1, 1) / bins), kernel_shape=[1, 1])
    near, far = n.op("Split", n.op("Reshape", mean, n.const([1, 4, -1], np.int64)), n.const([2, 2], np.int64), outputs=2, axis=1)
    low, high = n.op("Sub", n.const(centres), near), n.op("Add", n.const(centres), far)
    middle = n.op("Div", n.op("Add", low, high), n.const(2))
    pixels = n.op("Mul", n.op("Concat", middle, n.op("Sub", high, low), axis=1), n.const(strides))
    out = n.op("Concat", pixels, n.op("Sigmoid", n.op("Concat", *scores, axis=2)), axis=1)
    metadata = {"task": "detect", "names": {0: "cat", 1: "dog", 2: "kite"}, "stride": 32, "imgsz": [SIDE, SIDE]}
    if points:
        raw = n.op("Reshape", n.op("Concat", *keys, axis=2), n.const([1, points, 3, -1], np.int64))
        place, seen = n.op("Split", raw, n.const([2, 1], np.int64), outputs=2, axis=2)
        place = n.op("Mul", n.op("Add", n.op("Mul", place, n.const(2)), n.const(centres[:, None] - 0.5)), n.const(strides[:, None]))
        joined = n.op("Concat", place, n.op("Sigmoid", seen), axis=2)
        out = n.op("Concat", out, n.op("Reshape", joined, n.const([1, 3 * points, -1], np.int64)), axis=1)
        metadata.update(task="pose", kpt_shape=[points, 3])
    return n.model([out], metadata=metadata)


def yolox():
    """The head of YOLOX before its cells are added: offsets in cells and logarithms of sizes, beyond 2 on the finest level, beside scores."""
    n, levels = Net(7), []
    for x, channels, stride in backbone(n, n.op("Mul", "images", n.const(1 / 255))):
        box, *scores = [n.conv(n.silu(n.conv(x, channels, 24)), 24, width, kernel=1, bias=bias) for width, bias in ((4, 0.0), (1, -2.0), (CLASSES, -1.0))]
        size = np.log(80 / stride)
        box = n.op("Add", n.op("Mul", box, n.const(0.3)), n.const(np.array([0, 0, size, size]).reshape(1, 4, 1, 1)))
        levels.append(n.op("Reshape", n.op("Concat", box, *[n.op("Sigmoid", s) for s in scores], axis=1), n.const([1, 5 + CLASSES, -1], np.int64)))
    return n.model([n.op("Transpose", n.op("Concat", *levels, axis=2), perm=[0, 2, 1])])


def two_outputs():
    """Of which the first is in planes, and the second is computed before it."""
    n = Net(4)
    x = n.op("Relu", n.conv("images", 3, 12, 4))
    score = n.op("Sigmoid", n.op("Flatten", n.op("GlobalAveragePool", n.conv(x, 12, 6))))
    return n.model([n.op("Tanh", n.conv(x, 12, 7)), score])


def broken():
    """What is refused: name, model."""
    odd = Net(5)
    quantised = Net(6)
    q = quantised.op("QuantizeLinear", "images", quantised.const(0.1), quantised.const(0, np.uint8))
    two = classifier()
    two.graph.input.append(helper.make_tensor_value_info("other", TensorProto.FLOAT, (1, 4)))
    return {"open": classifier(("batch", 3, "height", "width")), "many": classifier((4, 3, SIDE, SIDE)), "two": two,
            "odd": odd.model([odd.op("Wavelet", odd.conv("images", 3, 4), domain="com.example")], domains=("com.example",)),
            "quantised": quantised.model([quantised.op("DequantizeLinear", q, quantised.const(0.1), quantised.const(0, np.uint8))]),
            "half": half()}


def half():
    graph = helper.make_graph([helper.make_node("Relu", ["images"], ["out"])], "net",
                              *[[helper.make_tensor_value_info(name, TensorProto.FLOAT16, (1, 3, SIDE, SIDE))] for name in ("images", "out")])
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


def good():
    return {"classifier": classifier(("batch", 3, SIDE, SIDE)), "detector": yolov8(), "pose": yolov8(4), "yolox": yolox(), "two_outputs": two_outputs()}


def main():
    folder = sys.argv[1]
    import onnxruntime
    pictures = np.load(os.path.join(folder, "pictures.npy"))
    for name, model in {**good(), **broken()}.items():
        onnx.save(model, os.path.join(folder, f"{name}.onnx"))
    for name, model in good().items():
        session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
        runs = [session.run(None, {"images": p}) for p in pictures]
        np.savez(os.path.join(folder, f"{name}.npz"), *[np.stack(o) for o in zip(*runs)])


if __name__ == "__main__":
    main()
