"""A user's own images with YOLO or COCO labels."""
import glob
import json
import os

import numpy as np

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".webp")


class LabelProblem(Exception):
    """One line: the file, where in it, what was found and what was expected."""


def read_image(path):
    import cv2
    image = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise LabelProblem(f"{path}: not a picture that can be read")
    return image


def read_yolo(folder):
    """DIR/classes.txt, and beside each picture (or in DIR/labels for DIR/images) a .txt with `class x y w h` per line, fractions of the
    picture. Returns (names, scenes, paths); a picture without a text file has no objects."""
    names_path = os.path.join(folder, "classes.txt")
    if not os.path.exists(names_path):
        raise LabelProblem(f"{names_path}: not there; expected one class name per line (or --coco FILE)")
    with open(names_path, encoding="utf-8") as file:
        names = [line.strip() for line in file if line.strip()]
    scenes, paths = [], []
    for path in sorted(glob.glob(os.path.join(folder, "**", "*"), recursive=True)):
        if not path.lower().endswith(SUFFIXES):
            continue
        text = os.path.splitext(path)[0] + ".txt"
        if not os.path.exists(text):
            text = text.replace(os.sep + "images" + os.sep, os.sep + "labels" + os.sep)
        image = read_image(path)
        rows = read_yolo_text(text, len(names), image.shape) if os.path.exists(text) else []
        scenes.append((image, None, np.array(rows, np.float32).reshape(-1, 6)))
        paths.append(path)
    if not scenes:
        raise LabelProblem(f"{folder}: found no pictures, expected {' '.join(SUFFIXES)}")
    return names, scenes, paths


def read_yolo_text(path, classes, shape):
    height, width = shape
    rows = []
    with open(path, encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            if not line.strip():
                continue
            try:
                c, x, y, w, h = [float(v) for v in line.split()]
            except ValueError:
                raise LabelProblem(f"{path}:{number}: found '{line.strip()[:60]}', expected `class x y width height`") from None
            if c != int(c) or not 0 <= c < classes:
                raise LabelProblem(f"{path}:{number}: found class {c:g}, expected 0 to {classes - 1} (classes.txt)")
            if not (0 <= x <= 1 and 0 <= y <= 1 and 0 < w <= 1 and 0 < h <= 1):
                raise LabelProblem(f"{path}:{number}: found {x:g} {y:g} {w:g} {h:g}, expected fractions of the picture from 0 to 1")
            rows.append((c, (x - w / 2) * width, (y - h / 2) * height, (x + w / 2) * width, (y + h / 2) * height, 1.0))
    return rows


def read_coco(path, folder):
    """COCO annotations; pictures are looked for in `folder`."""
    try:
        with open(path, encoding="utf-8") as file:
            data = json.load(file)
        categories = sorted(data["categories"], key=lambda c: c["id"])
        index = {c["id"]: i for i, c in enumerate(categories)}
        rows = {image["id"]: [] for image in data["images"]}
        for a in data["annotations"]:
            x, y, w, h = (float(v) for v in a["bbox"])
            shown = float(a.get("visible", 0.0 if a.get("iscrowd") else 1.0))
            rows[a["image_id"]].append((index[a["category_id"]], x, y, x + w, y + h, shown))
    except (json.JSONDecodeError, KeyError, TypeError, ValueError) as problem:
        raise LabelProblem(f"{path}: not COCO annotations: {type(problem).__name__} {problem}") from None
    scenes = [(read_image(os.path.join(folder, image["file_name"])), None, np.array(rows[image["id"]], np.float32).reshape(-1, 6))
              for image in data["images"]]
    if not scenes:
        raise LabelProblem(f"{path}: found no images")
    return [c["name"] for c in categories], scenes, [os.path.join(folder, image["file_name"]) for image in data["images"]]
