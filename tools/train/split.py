"""Which pictures are learnt from, which the training watches itself by, and which it is judged by: by scenes, since two pictures of one scene show the same
objects in the same light, and a figure on the second says nothing about new ones."""
import os
from typing import NamedTuple

import numpy as np

from labels import LabelProblem

JUDGED, WATCHED = 0.2, 0.15  # of the pictures, or of what is left of them
ALIKE = 0.9                  # correlation of small copies: the same scene
SMALL = (18, 24)             # rows and columns of a small copy
TRIES = 300
OBJECTS_MIN = 10             # fewer are no evaluation
WATCH_MIN = 20               # with fewer pictures to learn from none is left to watch


class Split(NamedTuple):
    learn: list   # indices
    watch: list
    judge: list
    scenes: int
    mixed: bool   # all pictures are of one scene: judged are the last ones of it


def small_copy(image):
    """Of zero mean and length 1; blocks are averaged."""
    rows, columns = (np.linspace(0, n, k + 1).astype(int)[:-1] for n, k in zip(image.shape, SMALL))
    means = np.add.reduceat(np.add.reduceat(image.astype(np.float64), rows, 0), columns, 1)
    means -= means.mean()
    return (means / max(float(np.sqrt((means * means).sum())), 1e-9)).ravel()


def scene_numbers(images, paths):
    """A number for each picture, the same for those of one scene: of one folder, where there are several, or alike."""
    count, parent = len(images), list(range(len(images)))

    def root(i):
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    folders, first = [os.path.dirname(p) for p in paths], {}
    if len(set(folders)) > 1:
        for i, folder in enumerate(folders):
            parent[root(i)] = root(first.setdefault(folder, i))
    copies = np.stack([small_copy(image) for image in images])
    for i in range(count):
        for j in np.flatnonzero(copies[:i] @ copies[i] > ALIKE):
            parent[root(i)] = root(int(j))
    numbers = {}
    return np.array([numbers.setdefault(root(i), len(numbers)) for i in range(count)])


def objects_of(boxes, classes):
    """How many objects of each class, [pictures, classes]."""
    return np.array([np.bincount(b[:, 0].astype(int), minlength=classes)[:classes] if len(b) else np.zeros(classes, int) for b in boxes])


def taken_aside(rng, numbers, objects, part):
    """Indices of whole scenes, about `part` of the pictures and of each class's objects; none where there is one scene."""
    kinds = np.unique(numbers)
    total, best, found = np.maximum(objects.sum(0), 1), np.inf, np.zeros(0, int)
    if len(kinds) < 2:
        return found
    for _ in range(TRIES):
        aside = np.zeros(len(numbers), bool)
        for kind in rng.permutation(kinds)[:-1]:
            aside |= numbers == kind
            if aside.mean() >= part:
                break
        off = abs(aside.mean() - part) + np.abs(objects[aside].sum(0) / total - part)[objects.sum(0) > 0].mean() if objects.any() else abs(aside.mean() - part)
        if off < best:
            best, found = off, np.flatnonzero(aside)
    return found


def split(images, paths, objects, seed, judged=None):
    """`objects`: how much of each class a picture shows, [pictures, classes]. `judged`: names of pictures that stay judged, from a training before; all others, but those of their scenes, are learnt from."""
    rng, numbers = np.random.default_rng(seed), scene_numbers(images, paths)
    everything, mixed = np.arange(len(images)), False
    if judged is not None:
        kept = np.array([os.path.basename(p) in judged for p in paths])
        judge = np.flatnonzero(np.isin(numbers, numbers[kept])) if not kept.all() and len(np.unique(numbers)) > 1 else np.flatnonzero(kept)
    else:
        judge = taken_aside(rng, numbers, objects, JUDGED)
        if len(judge) == 0 and len(images) > 1:
            mixed, judge = True, everything[-max(1, len(images) // 5):]
    rest = np.setdiff1d(everything, judge)
    watch = rest[taken_aside(rng, numbers[rest], objects[rest], WATCHED)] if len(rest) >= WATCH_MIN else np.zeros(0, int)
    return Split([int(i) for i in np.setdiff1d(rest, watch)], [int(i) for i in watch], [int(i) for i in judge], len(np.unique(numbers)), mixed)


def hold(parts, objects, unit, where):
    """Pictures that show nothing of any class teach nothing. `objects`: how much of each class each picture shows."""
    if not np.sum(objects[parts.learn]):
        raise LabelProblem(f"{where}: found no {unit.split()[-1]} of any class in {len(parts.learn)} of {len(objects)} pictures, those to learn from: expected some")


def say(parts, objects, names, unit="objects"):
    count = len(parts.learn) + len(parts.watch) + len(parts.judge)
    print(f"{len(names)} classes, {count} pictures of {parts.scenes} scenes: {len(parts.learn)} to learn from, {len(parts.watch)} to stop by, "
          f"{len(parts.judge)} held out to judge by; none shares a scene with another part" if not parts.mixed else
          f"{len(names)} classes, {count} pictures of one scene: the last {len(parts.judge)} are held out, and figures on them say little about other scenes")
    for c, name in enumerate(names):
        learn, watch, judge = (int(objects[part, c].sum()) for part in (parts.learn, parts.watch, parts.judge))
        print(f"  {name}: {learn} {unit} to learn from, {watch} to stop by, {judge} to judge by")


def spread(values, weights, rounds=400, seed=3):
    """5th and 95th percentile of a figure over pictures drawn with replacement: `values(indices)`."""
    rng = np.random.default_rng(seed)
    drawn = [values(rng.integers(0, weights, weights)) for _ in range(rounds)]
    drawn = [d for d in drawn if np.isfinite(d)]
    return tuple(np.percentile(drawn, [5, 95])) if drawn else (float("nan"), float("nan"))
