"""Average precision on labelled pictures of the network of real numbers and of what the quantiser made of it: both outputs go through the same
decoding here, so that the difference is the quantiser's alone. `fovea detect` on the model file gives the same boxes as the latter."""
import os
import sys

import numpy as np

from graph import ImportProblem

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "train"))

import judge  # noqa: E402
import labels as labels_module  # noqa: E402

SCORE_MIN, OVERLAP_MAX, MOST = 0.01, 0.5, 300
BY_COLUMN = ("yolov8", "yolov8_pose", "yolov8_seg")  # [1, 4 + classes + more, n]
FRACTIONS_MAX = 8.0                                  # larger numbers are pixels
ENOUGH = 8                                           # with fewer labelled pictures kept aside, or no class with enough objects, all count


def names_of(folder):
    """The classes that label files of a folder number; None: no classes.txt."""
    path = os.path.join(folder, "classes.txt")
    if not os.path.exists(path):
        return None
    with open(path, encoding="utf-8", errors="replace") as file:
        return [line.strip() for line in file if line.strip()]


def suppressed(rows):
    """Rows of class, corners, score; greedy by class."""
    rows, kept = rows[np.argsort(-rows[:, 5], kind="stable")][:4000], []
    area = (rows[:, 3] - rows[:, 1]) * (rows[:, 4] - rows[:, 2])
    alive = np.ones(len(rows), bool)
    for i, row in enumerate(rows):
        if not alive[i]:
            continue
        kept.append(row)
        if len(kept) == MOST:
            break
        w = np.clip(np.minimum(rows[:, 3], row[3]) - np.maximum(rows[:, 1], row[1]), 0, None)
        h = np.clip(np.minimum(rows[:, 4], row[4]) - np.maximum(rows[:, 2], row[2]), 0, None)
        both = w * h
        alive &= (rows[:, 0] != row[0]) | (both <= OVERLAP_MAX * np.maximum(area + area[i] - both, 1e-12))
    return np.array(kept, np.float64).reshape(-1, 6)


def boxes(kind, outputs, width, height, classes):
    """Class, corners in pixels of the input, score."""
    if kind in BY_COLUMN or kind == "yolov5":
        columns = outputs[0][0].T if kind in BY_COLUMN else outputs[0][0]
        scores = columns[:, 4:4 + classes] if kind in BY_COLUMN else columns[:, 4:5] * columns[:, 5:5 + classes]
        x, y, w, h = (columns[:, k] for k in range(4))
        rows = [x - w / 2, y - h / 2, x + w / 2, y + h / 2]
        score, kinds = scores.max(1), scores.argmax(1)
    else:
        rows, score, kinds = list(outputs[0][0].T[:4]), outputs[0][0][:, 4], np.round(outputs[0][0][:, 5])
    found = np.stack([kinds, *rows, score], 1)[score >= SCORE_MIN]
    if len(found) and np.abs(found[:, 1:5]).max() < FRACTIONS_MAX:
        found[:, 1:5] *= [width, height, width, height]
    return suppressed(found)


def truths(folder, files, pictures, names, labels):
    """(index of the picture, boxes as the network sees it) of the pictures that have a label file."""
    known, result = names_of(folder), []
    count = len(known) if known else len(labels) or 4096
    place = {i: labels.index(n) if n in labels else -1 for i, n in enumerate(known)} if known and labels and known != labels else None
    for index, path in enumerate(files):
        stem = os.path.splitext(os.path.basename(path))[0]
        text = os.path.join(folder, stem + ".txt")
        if not os.path.exists(text):
            continue
        try:
            rows = np.array(labels_module.read_yolo_text(text, count, (1, 1)), np.float64).reshape(-1, 6)
        except labels_module.LabelProblem as problem:
            raise ImportProblem(str(problem)) from problem
        if place is not None:
            rows[:, 0] = [place[int(c)] for c in rows[:, 0]]
            rows = rows[rows[:, 0] >= 0]
        left, top, across, down = pictures.placed(path)
        rows[:, [1, 3]] = rows[:, [1, 3]] * across + left
        rows[:, [2, 4]] = rows[:, [2, 4]] * down + top
        result.append((index, rows))
    if not result:
        raise ImportProblem(f"--labels {folder}: found no label file for any of the pictures, expected {os.path.splitext(os.path.basename(files[0]))[0]}.txt")
    return result


def lines(kind, kept, folder, labels, classes):
    """What is printed."""
    if kind not in (*BY_COLUMN, "yolov5", "end2end"):
        return [f"no average precision of the decoder {kind or 'none'}, only of {', '.join((*BY_COLUMN, 'yolov5', 'end2end'))}"]
    found = truths(folder, kept.files, kept.pictures, names_of(folder), labels)
    aside = [f for f in found if f[0] in kept.aside]
    enough = len(aside) >= ENOUGH and any(sum(int((rows[:, 0] == c).sum()) for _, rows in aside) >= judge.OBJECTS_MIN for c in range(classes))
    chosen, where = (aside, "that the quantiser did not see") if enough else (found, "of which the quantiser saw some")
    size = (kept.pictures.width, kept.pictures.height)
    real, whole = ([boxes(kind, net(kept.values[i]), *size, classes) for i, _ in chosen] for net in (kept.before, kept.after))
    truth = [rows for _, rows in chosen]
    used = sorted({int(c) for rows in truth for c in rows[:, 0]})
    a, b = (judge.figures(f, truth, used[-1] + 1 if used else 0) for f in (real, whole))
    text = [labels[c] if c < len(labels) else str(c) for c in range(len(a))]
    table = judge.table([text[c] for c in used], [a[c] for c in used], [b[c] for c in used])
    few = sum("no evaluation" in line for line in table)
    table = [line for line in table if "no evaluation" not in line] if few < len(used) else []
    more = [f"no evaluation of {few} classes with fewer than {judge.OBJECTS_MIN} objects"] if few else []
    return [f"average precision at IoU {judge.OVERLAP} on {len(chosen)} pictures {where}: real numbers (float) beside bytes (int8)", *table, *more,
            *whatever(real, whole, truth)]


def whatever(real, whole, truth):
    """A line on boxes of any class, where there are objects enough."""
    def one(rows):
        return np.concatenate([np.zeros((len(rows), 1)), rows[:, 1:]], 1)

    truth = [one(rows) for rows in truth]
    (count, a, *_), (_, b, *_) = (judge.figures([one(rows) for rows in found], truth, 1)[0] for found in (real, whole))
    return [f"boxes whatever their class: {count} objects, AP {a:.4f} of real numbers, {b:.4f} of bytes"] if count >= judge.OBJECTS_MIN else []
