"""What a detector finds on labelled pictures: average precision with the number of objects that it stands on, and which class is taken for which."""
import numpy as np

from split import OBJECTS_MIN, spread

OVERLAP = 0.5


def iou(a, b):
    w, h = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    if w <= 0 or h <= 0:
        return 0.0
    return w * h / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - w * h)


def matched(detections, boxes, c, threshold=OVERLAP):
    """(rows of score and 0 or 1, objects) of one picture and class. `boxes` rows: class, corners, counts (1) or is passed over (0)."""
    mine, rows = boxes[boxes[:, 0] == c], []
    taken = np.zeros(len(mine), bool)
    for d in detections[detections[:, 0] == c]:
        overlaps = [0.0 if taken[k] else iou(d[1:5], b[1:5]) for k, b in enumerate(mine)]
        k = int(np.argmax(overlaps)) if overlaps else -1
        if k >= 0 and overlaps[k] >= threshold:
            taken[k] = True
            if mine[k, 5] > 0:
                rows.append((d[5], 1))
        else:
            rows.append((d[5], 0))
    return np.array(rows, np.float64).reshape(-1, 2), int((mine[:, 5] > 0).sum())


def precision_of(parts):
    """Area under the interpolated curve (Everingham et al. 2010) over pictures; nan without objects."""
    total = sum(count for _, count in parts)
    if total == 0:
        return float("nan")
    rows = np.concatenate([rows for rows, _ in parts])
    hits = rows[np.argsort(-rows[:, 0], kind="stable"), 1]
    right = np.cumsum(hits)
    precision = np.maximum.accumulate((right / np.arange(1, len(hits) + 1))[::-1])[::-1]
    return float((precision * hits).sum() / total)


def figures(found, truth, classes):
    """(objects, AP, its 5th and 95th percentile over pictures drawn again) per class; nan where there is none."""
    result = []
    for c in range(classes):
        parts = [matched(d, b, c) for d, b in zip(found, truth)]
        low, high = spread(lambda drawn, parts=parts: precision_of([parts[i] for i in drawn]), len(parts))
        result.append((sum(count for _, count in parts), precision_of(parts), low, high))
    return result


def table(labels, of_float, of_int8):
    """Lines; where a figure would stand on too few objects it is not said."""
    lines, judged = [f"{'class':20} {'objects':>8} {'AP float':>9} {'AP int8':>9} {'cost':>7}  90 of 100 such sets of pictures"], []
    for name, (count, a, *_), (_, b, low, high) in zip(labels, of_float, of_int8):
        if count < OBJECTS_MIN:
            lines.append(f"{name[:20]:20} {count:8} {'-':>9} {'-':>9} {'-':>7}  no evaluation: {count} objects held out, expected {OBJECTS_MIN} or more")
            continue
        judged.append((a, b))
        lines.append(f"{name[:20]:20} {count:8} {a:9.4f} {b:9.4f} {a - b:7.4f}  {low:.2f} to {high:.2f}")
    if len(judged) > 1:
        a, b = np.mean(judged, 0)
        lines.append(f"{'mean of ' + str(len(judged)):20} {sum(f[0] for f in of_int8 if f[0] >= OBJECTS_MIN):8} {a:9.4f} {b:9.4f} {a - b:7.4f}")
    return lines


def confusion(found, truth, classes, score):
    """[truth of each class and nothing][found as each class and nothing], at the score threshold; pairs by overlap alone, the best first."""
    counts = np.zeros((classes + 1, classes + 1), int)
    for detections, boxes in zip(found, truth):
        taken = np.zeros(len(boxes), bool)
        for d in sorted((d for d in detections if d[5] >= score), key=lambda d: -d[5]):
            overlaps = [0.0 if taken[k] else iou(d[1:5], b[1:5]) for k, b in enumerate(boxes)]
            k = int(np.argmax(overlaps)) if overlaps else -1
            if k >= 0 and overlaps[k] >= OVERLAP:
                taken[k] = True
                if boxes[k, 5] > 0:
                    counts[int(boxes[k, 0]), int(d[0])] += 1
            else:
                counts[classes, int(d[0])] += 1
        for b in boxes[~taken]:
            if b[5] > 0:
                counts[int(b[0]), classes] += 1
    return counts


def draw_confusion(path, counts, labels):
    """A PNG: rows are what is there, columns what was found; the darker the more of the row."""
    import cv2
    cell, left, top = 84, 190, 120
    n = len(counts)
    picture = np.full((top + n * cell + 20, left + n * cell + 20, 3), 255, np.uint8)

    def write(text, x, y, colour=(0, 0, 0), scale=0.5):
        cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)

    write("found as", left, 30)
    write("there is", 12, top - 12)
    for k in range(n):
        name = labels[k][:20] if k < len(labels) else None
        write((name or "not found")[:10], left + k * cell + 4, top - 12, scale=0.42)
        write(name or "nothing", 12, top + k * cell + cell // 2 + 5)
    for i in range(n):
        for j in range(n):
            part = counts[i, j] / max(int(counts[i].sum()), 1)
            x, y = left + j * cell, top + i * cell
            good = i == j and i < len(labels)
            colour = np.array([255, 255, 255]) - part * (np.array([150, 100, 150]) if good else np.array([160, 150, 30]))
            cv2.rectangle(picture, (x, y), (x + cell - 2, y + cell - 2), tuple(float(v) for v in colour), -1)
            cv2.rectangle(picture, (x, y), (x + cell - 2, y + cell - 2), (190, 190, 190), 1)
            if not (i == n - 1 and j == n - 1):
                write(str(counts[i, j]), x + 10, y + cell // 2 + 5)
    if not cv2.imwrite(path, picture):
        raise OSError(0, "cannot be written", path)
