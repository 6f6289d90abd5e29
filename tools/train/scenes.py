"""Rendered training scenes: frames of the simulated camera with random worlds, lenses, light, blur and noise."""
import json
import os
import random
import subprocess
from typing import NamedTuple

import numpy as np

CLASSES = ["ball", "cone", "box", "person"]  # 1 to 4 in masks, which have classes of what stands still behind them


class Kind(NamedTuple):
    """What is drawn: trajectories and how often, numbers of moving objects, seeds from and below."""
    trajectories: dict
    objects: tuple
    seeds: tuple = (1, 10**6)
    more: dict = {}  # options of every address


CROWDED = Kind({"wander": 9, "orbit": 4, "tour": 2, "corridor": 1, "fast": 1, "still": 1}, (24, 32, 48, 48))
PLACES = Kind({"wander": 6, "orbit": 4, "tour": 5, "corridor": 3, "fast": 1, "still": 1, "road": 2}, (0, 6, 12, 24, 40))
DRIVES = Kind({"drive": 1}, (0, 3, 6, 8))
ROADS = Kind({"road": 1}, (0, 3, 6, 8))
PITS = Kind({"drive": 1}, (0, 0, 3), (10**6, 2 * 10**6))
EDGES = Kind({"drive": 1}, (0, 0, 3), (2 * 10**6, 3 * 10**6), {"stands": 1})
UNSEEN = Kind(PLACES.trajectories | {"drive": 6}, PLACES.objects, (7 * 10**6, 8 * 10**6))


def options(rng, kind=CROWDED):
    """A random address of the simulated camera."""
    trajectory = rng.choices(list(kind.trajectories), list(kind.trajectories.values()))[0]
    lens = rng.choice(["radtan", "radtan", "equidistant", "pinhole"])
    fov = rng.uniform(75, 125) if lens == "equidistant" else rng.uniform(62, 105)
    values = dict(seed=rng.randrange(*kind.seeds), objects=rng.choice(kind.objects), lens=lens, fov=f"{fov:.1f}",
                  noise=f"{rng.uniform(0, 5):.1f}", light=f"{rng.uniform(0.5, 1.6):.2f}", time=f"{rng.uniform(0, 300):.1f}",
                  textures=rng.choices(["natural", "repeated"], [5, 1])[0])
    if rng.random() < 0.12:
        values.update(blur=1, exposure=f"{rng.uniform(3, 15):.1f}")
    if trajectory in ("road", "drive"):
        values.update(objects=min(values["objects"], 8), time=f"{rng.uniform(0, 9):.1f}")
    values.update(kind.more)
    return f"sim:{trajectory}?" + "&".join(f"{k}={v}" for k, v in values.items())


def render(fovea, uri, frames, step, folder):
    """Exports frames with masks and truth; returns the folder."""
    subprocess.run([fovea, "export", "--masks", "--source", uri, "--frames", str(frames), "--step", str(step), folder],
                   check=True, stdout=subprocess.DEVNULL)
    return folder


def read(folder, objects_alone=True):
    """List of (image, mask, boxes); a box is (class from 0, left, top, right, bottom, visible fraction), in pixels. The masks hold objects alone, or
    every class of `fovea export --masks`."""
    import cv2
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
        if objects_alone:
            mask[mask > len(CLASSES)] = 0
        scenes.append((cv2.imread(path, cv2.IMREAD_GRAYSCALE), mask, np.array(boxes[image["id"]], np.float32).reshape(-1, 6)))
    return scenes


def render_many(fovea, folder, worlds, frames, seed, kind=CROWDED):
    """Worlds that are not there yet are rendered; returns all scenes."""
    rng = random.Random(seed)
    scenes = []
    for world in range(worlds):
        uri, step = options(rng, kind), rng.randrange(20, 45)
        if "sim:road" in uri:
            step //= 6  # of the few frames of a drive
        elif kind is PITS:
            step //= 3
        elif kind is EDGES:
            step = 30  # a second: each frame from elsewhere
        target = os.path.join(folder, f"{seed}-{world:04d}")
        if not os.path.exists(os.path.join(target, "truth.json")):
            subprocess.run(["rm", "-rf", target], check=True)
            os.makedirs(folder, exist_ok=True)
            render(fovea, uri, frames, step, target)
        scenes += read(target, kind is CROWDED)
    return scenes
