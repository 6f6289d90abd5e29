"""Average precision of a detector on a folder of images with YOLO label files, ours beside the reference pipeline.

    python3 tools/import/average_precision.py MODEL.tflite FOLDER [--program build/fovea]

Ours is `fovea detect`; the reference is LiteRT (BUILTIN_REF) fed with images that numpy resizes by the same definition.
Both are scored by pycocotools. Needs tflite, numpy, ai-edge-litert, pillow and pycocotools."""
import argparse
import contextlib
import glob
import io
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import check  # noqa: E402
from engine import ROOT  # noqa: E402

# COCO's 80 classes among its 90 category numbers (0-based), as detectors with 90 classes number them.
GAPS = (11, 25, 28, 29, 44, 65, 67, 68, 70, 82, 90)
NINETY = [i for i in range(90) if i not in GAPS]


def truth(folder):
    """The label files as a COCO data set."""
    from PIL import Image
    images, boxes = [], []
    for number, path in enumerate(sorted(glob.glob(os.path.join(folder, "*.jpg")))):
        width, height = Image.open(path).size
        images.append(dict(id=number, file_name=path, width=width, height=height))
        for line in open(os.path.splitext(path)[0] + ".txt", encoding="utf-8"):
            c, x, y, w, h = (float(v) for v in line.split())
            box = [(x - w / 2) * width, (y - h / 2) * height, w * width, h * height]
            boxes.append(dict(id=len(boxes) + 1, image_id=number, category_id=int(c), bbox=box, area=box[2] * box[3],
                              iscrowd=0))
    return dict(images=images, annotations=boxes, categories=[dict(id=i, name=str(i)) for i in range(80)])


def score(data, detections):
    """Average precision over IoU 0.5 to 0.95, and at 0.5, in points."""
    from pycocotools.coco import COCO
    from pycocotools.cocoeval import COCOeval
    with contextlib.redirect_stdout(io.StringIO()):
        coco = COCO()
        coco.dataset = data
        coco.createIndex()
        evaluation = COCOeval(coco, coco.loadRes(detections), "bbox")
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
    return 100 * evaluation.stats[0], 100 * evaluation.stats[1]


def eighty(class_id):
    return NINETY.index(class_id) if class_id in NINETY else None


def ours(model, data, program):
    found = []
    with tempfile.NamedTemporaryFile(suffix=".fvm") as file:
        subprocess.run([sys.executable, os.path.dirname(os.path.abspath(__file__)), model, "-o", file.name, "--score",
                        "0"], check=True, capture_output=True)
        lines = subprocess.run([program, "detect", "--model", file.name] + [i["file_name"] for i in data["images"]],
                               check=True, capture_output=True, text=True).stdout.splitlines()
    for image, line in zip(data["images"], lines):
        for d in json.loads(line)["detections"]:
            category = eighty(d["class"])
            x0, y0, x1, y1 = d["box_px"]
            if category is not None:
                found.append(dict(image_id=image["id"], category_id=category, score=d["score"],
                                  bbox=[x0 + 0.5, y0 + 0.5, x1 - x0, y1 - y0]))
    return found


def resized(pixels, height, width):
    """Bilinear, pixel centres aligned, edges repeated, rounded."""
    def axis(n_in, n_out):
        x = np.clip((np.arange(n_out) + 0.5) * n_in / n_out - 0.5, 0, n_in - 1)
        low = np.minimum(x.astype(int), n_in - 1)
        return low, np.minimum(low + 1, n_in - 1), x - low
    y0, y1, wy = axis(pixels.shape[0], height)
    x0, x1, wx = axis(pixels.shape[1], width)
    p = pixels.astype(np.float64)
    wx, wy = wx[None, :, None], wy[:, None, None]
    top = p[y0][:, x0] * (1 - wx) + p[y0][:, x1] * wx
    bottom = p[y1][:, x0] * (1 - wx) + p[y1][:, x1] * wx
    return np.floor(top * (1 - wy) + bottom * wy + 0.5).astype(np.uint8)


def theirs(model, data):
    from PIL import Image
    interpreter = check.reference(model)
    detail = interpreter.get_input_details()[0]
    found = []
    for image in data["images"]:
        pixels = np.asarray(Image.open(image["file_name"]).convert("RGB"))
        value = resized(pixels, *(int(v) for v in detail["shape"][1:3]))[None]
        interpreter.set_tensor(detail["index"], check.as_type(value, detail))
        interpreter.invoke()
        boxes, classes, scores, count = (interpreter.get_tensor(d["index"]) for d in interpreter.get_output_details())
        for i in range(int(count.ravel()[0])):
            category = eighty(int(classes[0, i]))
            y0, x0, y1, x1 = np.clip(boxes[0, i], 0, 1)
            if category is not None:
                w, h = image["width"], image["height"]
                found.append(dict(image_id=image["id"], category_id=category, score=float(scores[0, i]),
                                  bbox=[float(x0 * w), float(y0 * h), float((x1 - x0) * w), float((y1 - y0) * h)]))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("model")
    parser.add_argument("folder")
    parser.add_argument("--program", default=os.path.join(ROOT, "build", "fovea"))
    arguments = parser.parse_args()
    data = truth(arguments.folder)
    a = score(data, ours(arguments.model, data, arguments.program))
    b = score(data, theirs(arguments.model, data))
    print(f"average precision: ours {a[0]:.2f} (at 0.5: {a[1]:.2f}), reference {b[0]:.2f} ({b[1]:.2f}), "
          f"difference {a[0] - b[0]:+.2f} points")
    return 0 if abs(a[0] - b[0]) <= 0.1 else 1


if __name__ == "__main__":
    sys.exit(main())
