"""What a network that labels pixels makes of labelled pictures: intersection over union by class, with the pixels and pictures that it stands on, and
which class is taken for which."""
import numpy as np

from split import spread

CELL = 4          # pixels of the network's input to one of its output, along each side
NONE = 255        # as a label: counts as nothing
PICTURES_MIN = 3  # that show a class: fewer are no evaluation


def counts(run, samples, classes):
    """[pictures, truth, taken for], pixels of the network's input whose label is known. `run(picture)`: scores [h, w, classes]."""
    result = np.zeros((len(samples), classes, classes), np.int64)
    for k, (image, labels) in enumerate(samples):
        found = run(image).argmax(-1).repeat(CELL, 0).repeat(CELL, 1)
        known = labels != NONE
        result[k] = np.bincount(labels[known].astype(int) * classes + found[known], minlength=classes * classes).reshape(classes, classes)
    return result


def of_counts(matrix):
    """IoU of each class; nan where there is none of it."""
    both = np.diag(matrix).astype(np.float64)
    either = matrix.sum(0) + matrix.sum(1) - both
    return np.where(matrix.sum(1) > 0, both / np.maximum(either, 1), np.nan)


def table(names, of_float, of_int8):
    """Lines; where a figure would stand on too few pictures it is not said."""
    lines, judged = [f"{'class':20} {'pixels':>10} {'pictures':>8} {'IoU float':>9} {'IoU int8':>9} {'cost':>7}  90 of 100 such sets of pictures"], []
    a, b = of_counts(of_float.sum(0)), of_counts(of_int8.sum(0))
    for c, name in enumerate(names):
        shown = of_int8[:, c].sum(1)
        pictures = int((shown > 0).sum())
        head = f"{name[:20]:20} {int(shown.sum()):10} {pictures:8}"
        if pictures < PICTURES_MIN:
            lines.append(f"{head} {'-':>9} {'-':>9} {'-':>7}  no evaluation: {pictures} pictures held out show it, expected {PICTURES_MIN} or more")
            continue
        judged.append((a[c], b[c]))
        low, high = spread(lambda drawn, c=c: of_counts(of_int8[drawn].sum(0))[c], len(of_int8))
        lines.append(f"{head} {a[c]:9.4f} {b[c]:9.4f} {a[c] - b[c]:7.4f}  {low:.2f} to {high:.2f}")
    if len(judged) > 1:
        a, b = np.mean(judged, 0)
        lines.append(f"{'mean of ' + str(len(judged)):20} {int(of_int8.sum()):10} {len(of_int8):8} {a:9.4f} {b:9.4f} {a - b:7.4f}")
    return lines


def draw(path, by_picture, names):
    """A PNG: rows are what is there, columns what it was taken for, in thousandths of the row."""
    import judge
    matrix = by_picture.sum(0)
    parts = np.zeros((len(names) + 1, len(names) + 1), int)
    parts[:-1, :-1] = np.round(1000 * matrix / np.maximum(matrix.sum(1, keepdims=True), 1))
    judge.draw_confusion(path, parts, names)
