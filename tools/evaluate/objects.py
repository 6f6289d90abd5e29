"""Objects with ids on simulated scenes with crossings and occlusions, beside plain SORT and ByteTrack on the same detections; and the
quality of these detections.

Usage: objects.py [--fovea build/fovea] [--model FILE.fvm] [--scenes 20] [--frames 300] [--first-seed N] [--work DIR] [--output FILE]
`fovea run` writes detections and objects; SORT and ByteTrack (package `trackers`) get its detections, at the rate of the inferences,
and Fovea's thresholds of score, for theirs are made for other detectors. They run twice: on the detections that are published, and on
those with the boxes below the model's threshold that Fovea's second stage of matching takes. MOTA, IDF1 and HOTA of all scenes
together come from `trackeval`, at IoU 0.5 and without regard to class, as SORT knows none. Objects count that are at least 12 px long
and half visible; boxes on others are ignored."""
import argparse
import contextlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

import numpy as np
import supervision
import trackers
from trackeval.metrics import CLEAR, HOTA, Identity

import detector

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))

import progress  # noqa: E402

FIRST_SEED = 7_000_000  # neither trained on nor in detector.py; the settings of objects were chosen on 20 seeds from 7,500,000 on
WAYS = ["orbit", "wander", "still", "wander"]
# Thresholds as src/runtime/config.c has them; 60 frames of 30 Hz are the two seconds for which objects coast.
SCORE_HIGH, SCORE_NEW = 0.4, 0.4
SORT = {"track_activation_threshold": SCORE_NEW, "lost_track_buffer": 60}
BYTETRACK = {"track_activation_threshold": SCORE_NEW, "high_conf_det_threshold": SCORE_HIGH, "lost_track_buffer": 60}
NAMES = ["ball", "cone", "box", "person"]


def address(index, first_seed):
    return f"sim:{WAYS[index % len(WAYS)]}?seed={first_seed + index}&objects={(12, 16, 20, 24)[index // 4 % 4]}&time={7 * index}"


def xyxy(rows):
    return np.array([r[1:5] for r in rows], float).reshape(-1, 4)


def read_detections(path):
    """Rows (class, corners, score) by frame."""
    found = {}
    with open(path, encoding="utf-8") as file:
        for d in json.load(file):
            x, y, w, h = d["bbox"]
            found.setdefault(d["image_id"], []).append((d["category_id"] - 1, x, y, x + w, y + h, d["score"]))
    return found


def read_objects(path):
    """Rows (id, corners) by frame."""
    found = {}
    with open(path, encoding="utf-8") as file:
        for line in file:
            frame, number, x, y, w, h = [float(v) for v in line.split(",")[:6]]
            x, y = x - 0.5, y - 0.5
            found.setdefault(int(frame) - 1, []).append((int(number), x, y, x + w, y + h))
    return found


def read_truth(folder, step):
    """Rows (id, corners, counts, class) by frame. As in MOTChallenge, an object that leaves the image comes back under a new id."""
    with open(os.path.join(folder, "truth.json"), encoding="utf-8") as file:
        truth = json.load(file)
    found = {image["id"] * step: [] for image in truth["images"]}
    width, height = truth["images"][0]["width"], truth["images"][0]["height"]
    last, visit = {}, {}  # by object: image and whether its box touched the border then; how often it came
    for a in sorted(truth["annotations"], key=lambda a: a["image_id"]):
        (x, y, w, h), image, number = a["bbox"], a["image_id"], a["track_id"]
        if number in last and last[number][1] and image - last[number][0] > 1:
            visit[number] = visit.get(number, 0) + 1
        last[number] = image, x < 1 or y < 1 or x + w > width - 1 or y + h > height - 1
        counts = max(w, h) >= detector.SIZE_MIN_PX and a["visible"] >= detector.VISIBLE_MIN
        found[image * step].append(((number, visit.get(number, 0)), x, y, x + w, y + h, counts, a["category_id"] - 1))
    return found


def inferences_of(frames, detections):
    """The step to export so that every frame of an inference is among the exported ones, and these frames: those with detections, and
    in longer gaps those without."""
    seen = [0, *sorted(detections), frames]
    step = int(np.median(np.diff(seen))) or 1
    inferences = sorted({f for a, b in zip(seen, seen[1:]) for f in range(a, b, step) if f == a or b - f >= step} - {frames})
    return int(np.gcd.reduce(inferences)) or 1, inferences


def peer(tracker, inferences, detections):
    result = {}
    for frame in inferences:
        rows = detections.get(frame, [])
        given = supervision.Detections(xyxy=xyxy(rows), confidence=np.array([r[5] for r in rows], float),
                                       class_id=np.array([r[0] for r in rows], int))
        out = tracker.update(given)
        result[frame] = [(int(i), *box) for i, box in zip(out.tracker_id, out.xyxy) if i >= 0] if len(out) else []
    return result


def overlaps(a, b):
    """IoU of every row of `a` with every row of `b`."""
    corner = np.maximum(a[:, None, :2], b[None, :, :2]), np.minimum(a[:, None, 2:], b[None, :, 2:])
    both = np.prod(np.maximum(corner[1] - corner[0], 0), axis=2)
    area = [np.prod(v[:, 2:] - v[:, :2], axis=1) for v in (a, b)]
    return both / np.maximum(area[0][:, None] + area[1][None] - both, 1e-9)


def sequence(inferences, truth, tracks):
    """What trackeval's metrics take. Tracks that lie on an object that does not count, and on none that does, are ignored."""
    ids = {"gt": {}, "tracker": {}}
    data = {f"{kind}_ids": [] for kind in ids} | {"similarity_scores": [], "num_timesteps": len(inferences)}
    for frame in inferences:
        objects, own = [t for t in truth[frame] if t[5]], tracks.get(frame, [])
        hidden = xyxy([t for t in truth[frame] if not t[5]])
        similar = overlaps(xyxy(objects), xyxy(own))
        keep = np.ones(len(own), bool)
        if len(own) and len(hidden):
            keep = ~((overlaps(hidden, xyxy(own)).max(0) >= 0.3) & ((similar.max(0) if len(objects) else 0) < detector.OVERLAP))
        data["similarity_scores"].append(similar[:, keep])
        for kind, rows in (("gt", objects), ("tracker", [t for t, k in zip(own, keep) if k])):
            data[f"{kind}_ids"].append(np.array([ids[kind].setdefault(r[0], len(ids[kind])) for r in rows], int))
    for kind in ids:
        data[f"num_{kind}_ids"] = len(ids[kind])
        data[f"num_{kind}_dets"] = sum(len(v) for v in data[f"{kind}_ids"])
    return data


def judge(sequences):
    """MOTA, IDF1, HOTA and switches over all sequences."""
    with contextlib.redirect_stdout(io.StringIO()):  # they print their settings
        metrics = HOTA(), CLEAR({"THRESHOLD": detector.OVERLAP}), Identity({"THRESHOLD": detector.OVERLAP})
    hota, clear, identity = (m.combine_sequences({k: m.eval_sequence(s) for k, s in enumerate(sequences)}) for m in metrics)
    found, missed, false = (clear[f"CLR_{k}"] for k in ("TP", "FN", "FP"))
    return {"MOTA": clear["MOTA"], "IDF1": identity["IDF1"], "HOTA": float(np.mean(hota["HOTA"])), "switches": int(clear["IDSW"]),
            "missed": missed / max(missed + found, 1), "false": false / max(found + false, 1)}


def threshold_of(arguments):
    """The model's threshold of score."""
    printed = subprocess.run([arguments.fovea, "model", "info", arguments.model], check=True, capture_output=True, text=True).stdout
    return float(re.search(r"^boxes +score at least ([0-9.]+),", printed, re.MULTILINE).group(1))


def peers(inferences, frames, published, all_boxes):
    """Tracks by name of the peer, of the published detections and of all boxes."""
    rate, tracks = 30 * len(inferences) / frames, {}
    for what, detections in (("", published), (", all boxes", all_boxes)):
        tracks["SORT" + what] = peer(trackers.SORTTracker(frame_rate=rate, **SORT), inferences, detections)
        tracks["ByteTrack" + what] = peer(trackers.ByteTrackTracker(frame_rate=rate, **BYTETRACK), inferences, detections)
    return tracks


def run(arguments, index, folder):
    """Detections, objects, truth and the frames of inferences."""
    uri, paths = address(index, arguments.first_seed), [os.path.join(folder, name) for name in ("found.json", "objects.txt")]
    subprocess.run([arguments.fovea, "run", "--quiet", "--source", uri, "--frames", str(arguments.frames), "--model", arguments.model,
                    "--detections", paths[0], "--all-boxes", "--objects", paths[1], "--picture", "none", "--set", "lcm_url=", *arguments.extra], check=True)
    detections = read_detections(paths[0])
    step, inferences = inferences_of(arguments.frames, detections)
    truth = os.path.join(arguments.work or folder, f"truth-{arguments.first_seed + index}-{step}-{arguments.frames}")
    if not os.path.exists(os.path.join(truth, "truth.json")):
        subprocess.run([arguments.fovea, "export", "--source", uri, "--step", str(step), "--frames", str(inferences[-1] // step + 1), truth],
                       check=True, stdout=subprocess.DEVNULL)
        for name in os.listdir(truth):
            if name.endswith(".png"):
                os.remove(os.path.join(truth, name))
    return detections, read_objects(paths[1]), read_truth(truth, step), inferences


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fovea", default="build/fovea")
    parser.add_argument("--model", default="src/detect/shipped.fvm")
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--work", help="keep the truth of the scenes here")
    parser.add_argument("--output")
    parser.add_argument("extra", nargs="*", help="more arguments for fovea run, after --")
    arguments = parser.parse_args()
    sequences, rows, totals, threshold = {}, [], [0] * len(NAMES), threshold_of(arguments)
    for index in range(arguments.scenes):
        progress.show("evaluate objects", index, arguments.scenes, address(index, arguments.first_seed))
        folder = tempfile.mkdtemp()
        all_boxes, objects, truth, inferences = run(arguments, index, folder)
        shutil.rmtree(folder)
        detections = {frame: [d for d in list_ if d[5] >= threshold] for frame, list_ in all_boxes.items()}
        for name, found in {"fovea": objects, **peers(inferences, arguments.frames, detections, all_boxes)}.items():
            sequences.setdefault(name, []).append(sequence(inferences, truth, found))
        for frame in inferences:
            boxes = [(t[6], *t[1:6]) for t in truth[frame]]
            rows += detector.judge(detections.get(frame, []), boxes)
            for box in boxes:
                totals[box[0]] += bool(box[5])
        progress.clear()
        print(f"{address(index, arguments.first_seed)}: " + ", ".join(f"{n} IDF1 {judge(s[-1:])['IDF1']:.3f}" for n, s in sequences.items()), flush=True)
    report(arguments, sequences, rows, totals)


def report(arguments, sequences, rows, totals):
    lines = [f"`tools/evaluate/objects.py --scenes {arguments.scenes}`, detections by `{arguments.model}`. An object that leaves the image counts as "
             "a new one when it returns. \"All boxes\": with those below the model's threshold, which Fovea's second stage of matching takes too.", "",
             f"{arguments.scenes} scenes of {arguments.frames} frames, {sum(s['num_gt_ids'] for s in sequences['fovea'])} objects, "
             f"{sum(totals)} boxes in the frames of inferences.", "",
             "| program | MOTA | IDF1 | HOTA | switches | missed | false |", "| --- | --- | --- | --- | --- | --- | --- |"]
    for name, list_ in sequences.items():
        cells = [f"{value:.3f}" if isinstance(value, float) else str(value) for value in judge(list_).values()]
        lines.append(" | ".join([f"| {name}", *cells]) + " |")
    lines += ["", "| class | boxes | precision | recall | AP50 |", "| --- | --- | --- | --- | --- |"]
    for name, total, precision, recall, ap in detector.figures(rows, totals, NAMES):
        lines.append(f"| {name} | {total} | {precision:.3f} | {recall:.3f} | {ap:.3f} |")
    print("\n".join(lines))
    if arguments.output:
        with open(arguments.output, "w", encoding="utf-8") as file:
            file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
