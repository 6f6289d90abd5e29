"""Intersection over union of a network that labels pixels as the shipped one does, on rendered frames of seeds that training never draws.

Usage: segmentation.py [--model FILE.fvm] [--fovea build/fovea] [--frames 500] [--work DIR] [--draw DIR] [--mean IOU] [--least IOU]
Exit 1: over all frames the classes' mean overlap is below --mean, or one class's below --least. Four frames of each of many worlds: `fovea export --masks` renders, `fovea segment --evaluate` judges at the size of the frames; counts are added up."""
import argparse
import glob
import json
import os
import random
import re
import subprocess
import sys

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "train"))

import scenes  # noqa: E402

PER_WORLD = 4


def render(arguments):
    """(trajectory, folder) of each world."""
    rng, worlds = random.Random(41), []
    os.makedirs(arguments.work, exist_ok=True)
    for world in range(-(-arguments.frames // PER_WORLD)):
        uri, step = scenes.options(rng, scenes.UNSEEN), rng.randrange(20, 90)
        folder = os.path.join(arguments.work, f"unseen-{world:04d}")
        trajectory = re.match(r"sim:(\w+)", uri).group(1)
        if not os.path.exists(os.path.join(folder, "classes-map.txt")):
            scenes.render(arguments.fovea, uri, PER_WORLD, step // 6 if trajectory == "road" else step, folder)
        worlds.append((trajectory, folder))
    return worlds


def judge(arguments, folder):
    """(names, confusion matrix) as `fovea segment --json` gives it."""
    pictures = sorted(p for p in glob.glob(os.path.join(folder, "*.png")) if not p.endswith(".mask.png"))
    command = [arguments.fovea, "segment", "--model", arguments.model, "--evaluate", folder, "--classes-map", os.path.join(folder, "classes-map.txt"), "--json"]
    found = json.loads(subprocess.run(command + pictures, check=True, capture_output=True, text=True).stdout)
    if arguments.draw:
        os.makedirs(arguments.draw, exist_ok=True)
        drawn = os.path.join(arguments.draw, os.path.basename(folder) + ".png")
        subprocess.run([arguments.fovea, "segment", "--model", arguments.model, "--draw", drawn, pictures[0]], check=True, stdout=subprocess.DEVNULL)
    return found["classes"], np.array(found["confusion"], np.int64), found["pictures"]


def overlaps(matrix):
    """Of each class; nan where no label and no pixel of it is there."""
    both = np.diag(matrix)[:-1].astype(float)
    either = (matrix.sum(0) + matrix.sum(1) - np.diag(matrix))[:-1]
    return np.where(either > 0, both / np.maximum(either, 1), np.nan)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--model", default="src/detect/segmenter.fvm")
    parser.add_argument("--fovea", default="build/fovea")
    parser.add_argument("--frames", type=int, default=500)
    parser.add_argument("--work", default="build/evaluate-segmentation")
    parser.add_argument("--draw", help="draw the classes over a frame of each world into this folder")
    parser.add_argument("--mean", type=float, default=0, help="the mean over the classes that is expected at least")
    parser.add_argument("--least", type=float, default=0, help="the overlap of each class that is expected at least")
    arguments = parser.parse_args()
    sums, pictures, names = {}, {}, []
    for trajectory, folder in render(arguments):
        names, matrix, count = judge(arguments, folder)
        place = {"road": "roads", "drive": "the robot's halls"}.get(trajectory, "rooms, corridors, halls")
        for key in (place, "all"):
            sums[key], pictures[key] = sums.get(key, 0) + matrix, pictures.get(key, 0) + count
    print(f"{'':26} {'frames':>6} " + " ".join(f"{n:>9}" for n in names[:-1]) + f" {'mean':>9}")
    for key in sorted(sums, key=lambda k: -pictures[k]):
        values = overlaps(sums[key])
        print(f"{key:26} {pictures[key]:6} " + " ".join(f"{v:9.4f}" for v in values) + f" {np.nanmean(values):9.4f}")
    parts = 1000 * sums["all"] / np.maximum(sums["all"].sum(1, keepdims=True), 1)
    print("\nof 1000 pixels of a class (rows) are taken for\n" + f"{'':12}" + " ".join(f"{n:>9}" for n in names[:-1]))
    for name, row in zip(names[:-1], parts):
        print(f"{name:12}" + " ".join(f"{v:9.1f}" for v in row[:-1]))
    values = overlaps(sums["all"])
    if not (np.nanmean(values) >= arguments.mean and np.nanmin(values) >= arguments.least):
        print(f"found a mean of {np.nanmean(values):.4f} and a least of {np.nanmin(values):.4f}, expected {arguments.mean} and {arguments.least} or more")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
