"""A user's own pictures with a label picture for each: PNGs whose pixels are class numbers."""
import glob
import os
import re

import numpy as np

from labels import SUFFIXES, LabelProblem, read_image
from overlap import NONE

CLASSES_MAX = 254


def is_colour(text):
    return len(text) == 7 and text[0] == "#" and all(c in "0123456789abcdefABCDEF" for c in text[1:])


def read_classes(path):
    """(names, colours or None, class of each label as 256 bytes, labels that may occur). A line is a class: NAME, of the labels 0, 1, 2...; or LABEL NAME, where several
    labels may have one name, and `ignore` is none. A colour, #rrggbb, may follow all names or none; `# ` begins a comment."""
    if not os.path.exists(path):
        raise LabelProblem(f"{path}: not there; expected a line for each class: NAME, or LABEL NAME, and perhaps #rrggbb")
    with open(path, encoding="utf-8-sig") as file:
        texts = [(line + " ").partition("# ")[0].split() for line in file]
    lines = [(number, words) for number, words in enumerate(texts, 1) if words]
    coloured = [is_colour(words[-1]) and len(words) > 1 for _, words in lines]
    if any(coloured) and not all(coloured):
        number = lines[coloured.index(False)][0]
        raise LabelProblem(f"{path}:{number}: found no colour, expected #rrggbb as in other lines")
    numbered = all(words[0].isdecimal() and len(words) > 1 + c for (_, words), c in zip(lines, coloured))
    names, colours, table = [], [], np.full(256, NONE, np.uint8)
    taken = set()
    for k, ((number, words), c) in enumerate(zip(lines, coloured)):
        colour, words = (words[-1], words[:-1]) if c else (None, words)
        label, name = (int(words[0]), " ".join(words[1:])) if numbered else (k, " ".join(words))
        if label > 255 or label in taken:
            raise LabelProblem(f"{path}:{number}: found label {label}{' again' if label in taken else ''}, expected each label from 0 to 255 once")
        taken.add(label)
        if name == "ignore":
            continue
        if name not in names:
            names.append(name)
            colours.append(colour)
        table[label] = names.index(name)
    if not 2 <= len(names) <= CLASSES_MAX:
        raise LabelProblem(f"{path}: found {len(names)} classes, expected 2 to {CLASSES_MAX}")
    return names, colours if any(coloured) else None, table, taken | {NONE}


def read_labels(path, size, picture):
    """The numbers in a PNG of grey levels or a palette."""
    from PIL import Image, UnidentifiedImageError
    if not os.path.exists(path):
        raise LabelProblem(f"{path}: not there; expected the labels of {picture}")
    try:
        with Image.open(path) as image:
            if image.mode not in ("L", "P"):
                raise LabelProblem(f"{path}: found {image.mode} pixels, expected class numbers in grey levels or a palette of 8 bits")
            if image.size != size:
                raise LabelProblem(f"{path}: found {image.size[0]} x {image.size[1]} pixels, expected {size[0]} x {size[1]} as {picture}")
            return np.array(image)
    except (UnidentifiedImageError, OSError, SyntaxError) as problem:
        raise LabelProblem(f"{path}: not a picture that can be read: {problem}") from None


def label_path(picture, pictures, masks):
    """For PICTURES/a/b.jpg MASKS/a/b.mask.png, or MASKS/a/b.png where MASKS/a holds no *.mask.png; None: a picture of a rig's further camera,
    PICTURES/a/b.camN.jpg, that has none, as in folders of `fovea export`."""
    stem = os.path.join(masks, os.path.splitext(os.path.relpath(picture, pictures))[0])
    path = stem + (".mask.png" if glob.glob(os.path.join(glob.escape(os.path.dirname(stem)), "*.mask.png")) else ".png")
    there, itself = os.path.exists(path), os.path.exists(path) and os.path.samefile(path, picture)
    if re.search(r"\.cam[1-9]$", stem) and (itself or not there):
        return None
    if itself:
        raise LabelProblem(f"{picture}: found no label picture but the picture itself, expected one of class numbers in {masks}")
    return path


def read(pictures, masks, classes=None):
    """(names, colours, [(grey, classes of the pixels)], paths): pictures without those that label_path has nothing for."""
    path = classes or os.path.join(masks, "classes.txt")
    names, colours, table, known = read_classes(path)
    scenes, paths, others = [], [], 0
    for picture in sorted(glob.glob(os.path.join(pictures, "**", "*"), recursive=True)):
        if not picture.lower().endswith(SUFFIXES) or picture.endswith(".mask.png"):
            continue
        at = label_path(picture, pictures, masks)
        if at is None:
            others += 1
            continue
        image = read_image(picture)
        labels = read_labels(at, image.shape[::-1], picture)
        strange = sorted(set(np.unique(labels).tolist()) - known)
        if strange:
            count = int((labels == strange[0]).sum())
            raise LabelProblem(f"{at}: found label {strange[0]} in {count} pixels, expected those of {path}, or {NONE} where nothing is known")
        scenes.append((image, table[labels]))
        paths.append(picture)
    if not scenes:
        raise LabelProblem(f"{pictures}: found no pictures, expected {' '.join(SUFFIXES)}")
    if others:
        print(f"{pictures}: {others} pictures of further cameras (*.camN.*) left out, which have no labels")
    return names, colours, scenes, paths
