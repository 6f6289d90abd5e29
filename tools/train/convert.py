"""From a trained network to an int8 .tflite and a .fvm, and what the int8 step cost."""
import os
import subprocess
import sys

import numpy as np
import tensorflow as tf
from tensorflow.python.framework.convert_to_constants import convert_variables_to_constants_v2

import judge
import network
from augment import HEIGHT, STRIDE, WIDTH
from quiet import quiet

SCORE_MIN = 0.05
IMPORT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "import")


def to_tflite(model, images):
    """Int8 per channel, int8 in and out, calibrated on `images` (uint8, [n, 480, 640])."""
    def calibration():
        for image in images:
            yield [((image.astype(np.float32) - 128.0) / 128.0)[None, ..., None]]

    with quiet():
        fixed = tf.function(lambda image: model(image, training=False),
                            input_signature=[tf.TensorSpec((1, HEIGHT, WIDTH, 1), tf.float32)])
        frozen = convert_variables_to_constants_v2(fixed.get_concrete_function())
        converter = tf.lite.TFLiteConverter.from_concrete_functions([frozen])
        converter.optimizations = [tf.lite.Optimize.DEFAULT]
        converter.representative_dataset = calibration
        converter.target_spec.supported_ops = [tf.lite.OpsSet.TFLITE_BUILTINS_INT8]
        converter.inference_input_type = converter.inference_output_type = tf.int8
        return converter.convert()


def write_fvm(tflite, output, labels, options, colours=None):
    """Writes `output` with tools/import and these options of it."""
    texts = {output + ".labels": labels} | ({output + ".colours": colours} if colours else {})
    try:
        for path, lines in texts.items():
            with open(path, "w", encoding="utf-8") as file:
                file.write("\n".join(lines) + "\n")
        command = [sys.executable, IMPORT, tflite, "-o", output, "--labels", output + ".labels", *options]
        subprocess.run(command + (["--colours", output + ".colours"] if colours else []), check=True)
    finally:
        for path in texts:
            if os.path.exists(path):
                os.remove(path)


def to_fvm(tflite, output, labels, score, iou=0.5):
    """A detector's."""
    anchor = network.ANCHOR_PX / STRIDE
    write_fvm(tflite, output, labels, ["--decoder", "yolov2", "--fit", "letterbox", "--anchors", f"{anchor},{anchor}", "--score", str(score),
                                       "--iou", str(iou), "--agnostic"])


def decode(output, score_min=SCORE_MIN, iou_max=0.5):
    """Raw grid [60, 80, 5 + classes] to rows (class, left, top, right, bottom, score), best first, suppressed over all classes."""
    t = tf.constant(output)
    x0, y0, x1, y1 = (v.numpy().ravel() for v in network.boxes_of(t))
    probability = tf.nn.softmax(t[..., 5:]).numpy().reshape(-1, output.shape[-1] - 5)
    score = (1 / (1 + np.exp(-output[..., 4]))).ravel()[:, None] * probability
    best = score.argmax(1)
    top = score.max(1)
    order = [i for i in np.argsort(-top, kind="stable") if top[i] >= score_min][:300]
    kept = []
    for i in order:
        box = np.array([best[i], x0[i], y0[i], x1[i], y1[i], top[i]], np.float32)
        if all(judge.iou(box[1:5], k[1:5]) <= iou_max for k in kept):
            kept.append(box)
    return np.array(kept, np.float32).reshape(-1, 6)


def run_float(model, image):
    return model(((image.astype(np.float32) - 128.0) / 128.0)[None, ..., None], training=False).numpy()[0].astype(np.float32)


class Int8:
    """The .tflite in the reference interpreter."""

    def __init__(self, data):
        with quiet():
            try:
                from ai_edge_litert.interpreter import Interpreter  # TensorFlow is to lose its own
            except ImportError:
                Interpreter = tf.lite.Interpreter
            self.interpreter = Interpreter(model_content=data)
            self.interpreter.allocate_tensors()
        self.input, self.output = self.interpreter.get_input_details()[0], self.interpreter.get_output_details()[0]

    def __call__(self, image):
        scale, zero = self.input["quantization"]
        x = np.round((image.astype(np.float32) - 128.0) / 128.0 / scale + zero)
        self.interpreter.set_tensor(self.input["index"], np.clip(x, -128, 127).astype(np.int8)[None, ..., None])
        self.interpreter.invoke()
        scale, zero = self.output["quantization"]
        return (self.interpreter.get_tensor(self.output["index"])[0].astype(np.float32) - zero) * scale


def compare(model, data, samples, labels):
    """Prints AP at IoU 0.5 of the float network beside the int8 one, per class, on (image, boxes) pairs; returns what the int8 one found."""
    quantised = Int8(data)
    truth = [boxes for _, boxes in samples]
    of_float, of_int8 = [decode(run_float(model, image)) for image, _ in samples], [decode(quantised(image)) for image, _ in samples]
    for line in judge.table(labels, judge.figures(of_float, truth, len(labels)), judge.figures(of_int8, truth, len(labels))):
        print(line)
    return of_int8
