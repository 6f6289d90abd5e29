"""Samples with a class for each pixel: the picture and its labels scaled, turned, mirrored and shifted together, surfaces covered by photographs, then light, blur and
noise as in `augment`. A scene is (grey, labels): bytes, overlap.NONE where nothing is known."""
import cv2
import numpy as np

import augment
import vary
from augment import HEIGHT, WIDTH
from overlap import CELL, NONE

TURNED, COVERED, OVER_PHOTO = 0.3, 0.25, 0.06  # of the samples


def place(rng, image, labels, fixed=False):
    """Scale, mirror and shift both into the network's input, as `augment.place` does with boxes."""
    canvas, marks = np.full((HEIGHT, WIDTH), 114, np.uint8), np.full((HEIGHT, WIDTH), NONE, np.uint8)
    where = augment.placing(rng, image.shape, canvas.shape, augment.scale_of(rng, image, fixed), fixed)
    augment.put(canvas, image, where)
    augment.put(marks, labels, where, cv2.INTER_NEAREST)
    mirrored = slice(None, None, -1 if not fixed and rng.random() < 0.5 else 1)
    return canvas[:, mirrored], marks[:, mirrored]


def cells(labels, classes):
    """The most frequent class of each cell; NONE where less than half of it is known."""
    shape = (HEIGHT // CELL, CELL, WIDTH // CELL, CELL)
    counts = np.stack([(labels == c).reshape(shape).sum((1, 3), dtype=np.uint8) for c in range(classes)])
    return np.where(counts.sum(0) >= CELL * CELL // 2, counts.argmax(0), NONE).astype(np.uint8)


def turn(rng, image, labels):
    matrix, size = vary.turning(rng, *image.shape[::-1]), image.shape[::-1]
    turned = cv2.warpAffine(image, matrix, size, borderMode=cv2.BORDER_CONSTANT, borderValue=114)
    return turned, cv2.warpAffine(labels, matrix, size, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=NONE)


def cover(rng, image, labels, photographs):
    """What one of the classes shows gets another texture, of a photograph; its own light and shade stay."""
    here = labels == rng.choice(np.unique(labels))
    h, w = image.shape
    texture = augment.photo_crop(rng, photographs, w, h).astype(np.float32)
    part, own = rng.uniform(0.2, 0.8), image.astype(np.float32)
    shade = cv2.blur(own, (31, 31))
    mixed = own * (1 - part) + shade * texture / max(float(texture.mean()), 1.0) * part
    return np.where(here, np.clip(mixed, 0, 255), own).astype(np.uint8)


def sampler(movable=None):
    """A function for `fit.Task`. `movable`: a class whose pixels may stand before a photograph, of which nothing is known."""
    def sample(rng, scenes, probabilities, photographs, classes):
        image, labels = scenes[rng.choice(len(scenes), p=probabilities)]
        kind = rng.random()
        if photographs and movable is not None and kind < OVER_PHOTO and (labels == movable).any():
            alone = labels == movable
            image, _ = augment.over_photo(rng, (image, alone, None), photographs)
            labels = np.where(alone, labels, NONE).astype(np.uint8)
        elif photographs and kind > 1 - COVERED:
            image = cover(rng, image, labels, photographs)
        if rng.random() < TURNED:
            image, labels = turn(rng, image, labels)
        image, labels = place(rng, image, labels, fixed=rng.random() < 0.4)
        return augment.degrade(rng, np.ascontiguousarray(image)), cells(labels, classes)
    return sample


def equally(scenes):
    return np.full(len(scenes), 1 / len(scenes))


def shares(scenes, of):
    """The share of each class in the known pixels of all scenes; `of`: the class of each label."""
    counts = sum(np.bincount(labels[::2, ::2].ravel(), minlength=256)[:len(of)] for _, labels in scenes)
    counts = np.bincount(of, counts)
    return counts / max(counts.sum(), 1.0)


def class_weights(scenes, of):
    """Of each label: its class counts by one over the root of its share, so that rare ones are not lost; 1 on average over the pixels."""
    share = shares(scenes, of)
    weights = np.where(share > 0, 1 / np.sqrt(np.maximum(share, 1e-3)), 0.0)
    return (weights / (weights * share).sum())[of]
