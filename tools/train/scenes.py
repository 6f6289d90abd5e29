"""Rendered training scenes: frames of the simulated camera with random worlds, lenses, light, blur and noise."""
import json
import os
import random
import subprocess

import cv2
import numpy as np

CLASSES = ["ball", "cone", "box", "person"]  # 1 to 4 in masks, which have classes of what stands still behind them


def options(rng):
    """A random address of the simulated camera."""
    trajectory = rng.choices(["wander", "orbit", "tour", "corridor", "fast", "still"], [9, 4, 2, 1, 1, 1])[0]
    lens = rng.choice(["radtan", "radtan", "equidistant", "pinhole"])
    fov = rng.uniform(75, 125) if lens == "equidistant" else rng.uniform(62, 105)
    values = dict(seed=rng.randrange(1, 10**6), objects=rng.choice([24, 32, 48, 48]), lens=lens, fov=f"{fov:.1f}",
                  noise=f"{rng.uniform(0, 5):.1f}", light=f"{rng.uniform(0.5, 1.6):.2f}", time=f"{rng.uniform(0, 300):.1f}",
                  textures=rng.choices(["natural", "repeated"], [5, 1])[0])
    if rng.random() < 0.12:
        values.update(blur=1, exposure=f"{rng.uniform(3, 15):.1f}")
    return f"sim:{trajectory}?" + "&".join(f"{k}={v}" for k, v in values.items())


def render(fovea, uri, frames, step, folder):
    """Exports frames with masks and truth; returns the folder."""
    subprocess.run([fovea, "export", "--masks", "--source", uri, "--frames", str(frames), "--step", str(step), folder],
                   check=True, stdout=subprocess.DEVNULL)
    return folder


def read(folder):
    """List of (image, mask, boxes); a box is (class from 0, left, top, right, bottom, visible fraction), in pixels."""
    with open(os.path.join(folder, "truth.json"), encoding="utf-8") as file:
        truth = json.load(file)
    boxes = {image["id"]: [] for image in truth["images"]}
    for a in truth["annotations"]:
        x, y, w, h = a["bbox"]
        boxes[a["image_id"]].append((a["category_id"] - 1, x, y, x + w, y + h, a["visible"]))
    scenes = []
    for image in truth["images"]:
        path = os.path.join(folder, image["file_name"])
        mask = cv2.imread(path.replace(".png", ".mask.png"), cv2.IMREAD_GRAYSCALE)
        mask[mask > len(CLASSES)] = 0
        scenes.append((cv2.imread(path, cv2.IMREAD_GRAYSCALE), mask, np.array(boxes[image["id"]], np.float32).reshape(-1, 6)))
    return scenes


def render_many(fovea, folder, worlds, frames, seed):
    """Worlds that are not there yet are rendered; returns all scenes."""
    rng = random.Random(seed)
    scenes = []
    for world in range(worlds):
        uri, step = options(rng), rng.randrange(20, 45)
        target = os.path.join(folder, f"{seed}-{world:04d}")
        if not os.path.exists(os.path.join(target, "truth.json")):
            subprocess.run(["rm", "-rf", target], check=True)
            os.makedirs(folder, exist_ok=True)
            render(fovea, uri, frames, step, target)
        scenes += read(target)
    return scenes
