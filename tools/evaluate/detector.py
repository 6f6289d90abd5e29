"""Precision, recall and average precision of a detector on rendered frames of seeds that it never saw, and what it finds by
mistake on photographs.

Usage: detector.py --model FILE.fvm [--fovea build/fovea] [--frames 1000] [--photos DIR...] [--work DIR] [--draw DIR]
Frames count that show at least five objects of at least 12 px (longer side) and half visible; objects hidden more or smaller
are passed over, found or not. Frames are chosen so that half of the objects are below 48 px."""
import argparse
import glob
import json
import os
import random
import subprocess
import sys

import numpy as np

SIZE_MIN_PX, SIZE_SMALL_PX, VISIBLE_MIN, OBJECTS_MIN, OVERLAP = 12, 48, 0.5, 5, 0.5
FIRST_SEED = 5_000_000  # training draws seeds below 1,000,000


def address(rng, index):
    lens = rng.choice(["radtan", "radtan", "equidistant", "pinhole"])
    fov = rng.uniform(80, 120) if lens == "equidistant" else rng.uniform(65, 100)
    trajectory = rng.choice(["wander", "wander", "wander", "orbit"])
    return (f"sim:{trajectory}?seed={FIRST_SEED + index}&objects={rng.choice([24, 32, 48])}&lens={lens}&fov={fov:.1f}"
            f"&noise={rng.uniform(0, 4):.1f}&light={rng.uniform(0.6, 1.4):.2f}&time={rng.uniform(0, 300):.1f}")


def read_truth(folder):
    with open(os.path.join(folder, "truth.json"), encoding="utf-8") as file:
        truth = json.load(file)
    frames = {i["id"]: (os.path.join(folder, i["file_name"]), []) for i in truth["images"]}
    for a in truth["annotations"]:
        x, y, w, h = a["bbox"]
        counts = max(w, h) >= SIZE_MIN_PX and a["visible"] >= VISIBLE_MIN
        frames[a["image_id"]][1].append((a["category_id"] - 1, x, y, x + w, y + h, counts))
    return list(frames.values())


def choose(frames, wanted):
    """Frames with enough objects, the large ones thinned until half of all objects are small."""
    chosen, small, large = [], 0, 0
    for path, boxes in frames:
        sizes = [max(b[3] - b[1], b[4] - b[2]) for b in boxes if b[5]]
        little = sum(s < SIZE_SMALL_PX for s in sizes)
        if len(sizes) < OBJECTS_MIN or (large > small and len(sizes) - little > little):
            continue
        chosen.append((path, boxes))
        small, large = small + little, large + len(sizes) - little
        if len(chosen) == wanted:
            break
    return chosen, small, large


def render(arguments):
    rng, frames, index = random.Random(20), [], 0
    while True:
        folder = os.path.join(arguments.work, f"unseen-{index:04d}")
        uri = address(rng, index)
        if not os.path.exists(os.path.join(folder, "truth.json")):
            os.makedirs(arguments.work, exist_ok=True)
            subprocess.run([arguments.fovea, "export", "--source", uri, "--frames", "24", "--step", "37", folder], check=True,
                           stdout=subprocess.DEVNULL)
        frames += read_truth(folder)
        index += 1
        chosen, small, large = choose(frames, arguments.frames)
        if len(chosen) == arguments.frames or index == 400:
            return chosen, small, large


def detect(arguments, paths, draw=None):
    """Detections (class, corners in COCO's convention, score) by path."""
    found = {}
    for begin in range(0, len(paths), 200):
        command = [arguments.fovea, "detect", "--model", arguments.model, *paths[begin:begin + 200]]
        lines = subprocess.run(command + (["--draw", draw] if draw else []), check=True, capture_output=True, text=True).stdout
        for line in lines.splitlines():
            row = json.loads(line)
            found[row["image"]] = [(d["class"], *(v + 0.5 for v in d["box_px"]), d["score"]) for d in row["detections"]]
    return found


def iou(a, b):
    w, h = min(a[3], b[3]) - max(a[1], b[1]), min(a[4], b[4]) - max(a[2], b[2])
    return 0.0 if w <= 0 or h <= 0 else w * h / ((a[3] - a[1]) * (a[4] - a[2]) + (b[3] - b[1]) * (b[4] - b[2]) - w * h)


def judge(detections, boxes):
    """Rows (score, class, right) of the detections that count; those on objects passed over do not."""
    taken, rows = set(), []
    for d in sorted(detections, key=lambda d: -d[5]):
        candidates = [(iou(d, b), k) for k, b in enumerate(boxes) if b[0] == d[0] and k not in taken]
        best, k = max(candidates, default=(0.0, -1))
        if best >= OVERLAP:
            taken.add(k)
            if boxes[k][5]:
                rows.append((d[5], d[0], True))
        elif not any(not b[5] and iou(d, b) >= 0.3 for b in boxes):
            rows.append((d[5], d[0], False))
    return rows


def figures(rows, totals, names):
    """(name, objects, precision, recall, AP50) per class and of all."""
    result = []
    for c in [*range(len(names)), None]:
        mine = sorted((r for r in rows if c is None or r[1] == c), reverse=True)
        total = sum(totals) if c is None else totals[c]
        right = np.cumsum([r[2] for r in mine]) if mine else np.zeros(1)
        envelope = np.maximum.accumulate((right / np.arange(1, len(right) + 1))[::-1])[::-1]
        ap = sum(p for p, r in zip(envelope, mine) if r[2]) / max(total, 1)
        result.append(("all" if c is None else names[c], total, right[-1] / max(len(mine), 1), right[-1] / max(total, 1), ap))
    return result


def table(rows, totals, names):
    print(f"{'class':10} {'objects':>8} {'precision':>10} {'recall':>8} {'AP50':>7}")
    for name, total, precision, recall, ap in figures(rows, totals, names):
        print(f"{name:10} {total:8} {precision:10.4f} {recall:8.4f} {ap:7.4f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--model", required=True)
    parser.add_argument("--fovea", default="build/fovea")
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--photos", nargs="*", default=[], help="folders of photographs without the trained objects")
    parser.add_argument("--work", default="build/evaluate-detector")
    parser.add_argument("--draw", help="draw what was found on the photographs into this folder")
    arguments = parser.parse_args()
    chosen, small, large = render(arguments)
    print(f"{len(chosen)} frames, {small + large} objects, {small} of them below {SIZE_SMALL_PX} px")
    found, rows, names = detect(arguments, [path for path, _ in chosen]), [], ["ball", "cone", "box", "person"]
    for path, boxes in chosen:
        rows += judge(found[path], boxes)
    table(rows, [sum(b[5] for _, boxes in chosen for b in boxes if b[0] == c) for c in range(len(names))], names)
    for folder in arguments.photos:
        paths = sorted(p for p in glob.glob(os.path.join(folder, "**", "*"), recursive=True) if p.lower().endswith((".png", ".jpg")))
        boxes = detect(arguments, paths, arguments.draw)
        by_class = [sum(d[0] == c for list_ in boxes.values() for d in list_) for c in range(len(names))]
        print(f"{folder}: {len(paths)} photographs, boxes per photograph {sum(by_class) / max(len(paths), 1):.3f} "
              f"({', '.join(f'{n} {k}' for n, k in zip(names, by_class))})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
