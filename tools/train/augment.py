"""Training samples: rendered scenes and objects pasted over photographs, at random size, light, blur and noise."""
from typing import NamedTuple

import cv2
import numpy as np

WIDTH, HEIGHT, STRIDE = 640, 480, 8
VISIBLE_MIN, VISIBLE_IGNORE = 0.5, 0.2  # objects between these are neither right nor wrong
SIZE_MIN, SIZE_IGNORE = 11, 5           # longer side in pixels of the network's input
SMALL_PX, SMALL_MOST = 48, 8            # a scene is drawn the more often the more small objects it has, up to this number
PHOTO_FRACTION = 0.32                   # of the samples: photographs alone


class Backgrounds(NamedTuple):
    photos: list             # grey
    stamps: list             # cut out things that are none of the classes: (grey, alpha from 0 to 1)
    probability: np.ndarray  # how often each photo is drawn


def scene_probabilities(scenes):
    """How often each scene is drawn."""
    count = []
    for _, _, boxes in scenes:
        size = np.maximum(boxes[:, 3] - boxes[:, 1], boxes[:, 4] - boxes[:, 2])
        count.append(((boxes[:, 5] >= VISIBLE_MIN) & (size >= SIZE_MIN) & (size < SMALL_PX)).sum())
    probability = 1.0 + np.minimum(count, SMALL_MOST)
    return probability / probability.sum()


def photo_crop(rng, backgrounds, width, height):
    photo = backgrounds.photos[rng.choice(len(backgrounds.photos), p=backgrounds.probability)]
    h, w = photo.shape
    scale = rng.uniform(max(0.25, 240 / min(h, w)), 1.0)
    ch, cw = max(32, int(min(h, w * 0.75) * scale)), max(32, int(min(w, h / 0.75) * scale))
    y, x = rng.integers(h - ch + 1), rng.integers(w - cw + 1)
    interpolation = cv2.INTER_AREA if cw > width else cv2.INTER_LINEAR
    crop = cv2.resize(photo[y:y + ch, x:x + cw], (width, height), interpolation=interpolation)
    return crop[:, ::-1] if rng.random() < 0.5 else crop


def stamp(rng, image, stamps):
    """A few cut out things on a photograph: what is none of the classes, in every size."""
    image, (h, w) = image.astype(np.float32), image.shape
    for _ in range(rng.integers(1, 7)):
        grey, alpha = stamps[rng.integers(len(stamps))]
        factor = np.exp(rng.uniform(np.log(14), np.log(260))) / max(grey.shape)
        if factor > 1.5:
            continue
        size = max(3, round(grey.shape[1] * factor)), max(3, round(grey.shape[0] * factor))
        grey, alpha = (cv2.resize(v, size, interpolation=cv2.INTER_AREA)[:, ::rng.choice([-1, 1])] for v in (grey, alpha))
        y, x = rng.integers(-size[1] // 3, h - size[1] * 2 // 3), rng.integers(-size[0] // 3, w - size[0] * 2 // 3)
        y0, x0, y1, x1 = max(y, 0), max(x, 0), min(y + size[1], h), min(x + size[0], w)
        part, a = image[y0:y1, x0:x1], alpha[y0 - y:y1 - y, x0 - x:x1 - x]
        image[y0:y1, x0:x1] = part * (1 - a) + grey[y0 - y:y1 - y, x0 - x:x1 - x] * a * rng.uniform(0.6, 1.3)
    return np.clip(image, 0, 255).astype(np.uint8)


def over_photo(rng, scene, backgrounds):
    """The objects of a scene in front of a photograph."""
    image, mask, boxes = scene
    h, w = image.shape
    alpha = cv2.GaussianBlur((mask > 0).astype(np.float32), (3, 3), 0.8)
    gain = rng.uniform(0.6, 1.5)
    mixed = image * alpha * gain + photo_crop(rng, backgrounds, w, h) * (1 - alpha)
    return np.clip(mixed, 0, 255).astype(np.uint8), boxes


def scale_of(rng, image, fixed):
    """To the width of the network's input, or about."""
    return WIDTH / image.shape[1] * (1.0 if fixed else float(np.exp(rng.uniform(np.log(0.7), np.log(1.7)))))


def place(rng, image, boxes, fixed=False):
    """Scale, mirror and shift into the network's input; grey where the image does not reach."""
    scale = scale_of(rng, image, fixed)
    canvas = np.full((HEIGHT, WIDTH), 114, np.uint8)
    boxes = paste(rng, canvas, image, boxes, scale, fixed)
    if not fixed and rng.random() < 0.5:
        canvas = canvas[:, ::-1]
        boxes[:, [1, 3]] = WIDTH - boxes[:, [3, 1]]
    return canvas, boxes


class Place(NamedTuple):
    """Where a scaled picture lies on a canvas, part of it perhaps beside it."""
    left: int
    top: int
    width: int
    height: int


def placing(rng, shape, canvas, scale, centred):
    (h, w), (height, width) = shape, canvas
    nw, nh = max(8, round(w * scale)), max(8, round(h * scale))
    left = (width - nw) // 2 if centred else int(rng.integers(min(0, width - nw), max(0, width - nw) + 1))
    top = (height - nh) // 2 if centred else int(rng.integers(min(0, height - nh), max(0, height - nh) + 1))
    return Place(left, top, nw, nh)


def put(canvas, image, where, interpolation=None):
    """Draws the scaled picture there; `interpolation` None: the best for pictures."""
    if interpolation is None:
        interpolation = cv2.INTER_AREA if where.width < image.shape[1] else cv2.INTER_LINEAR
    small = cv2.resize(image, (where.width, where.height), interpolation=interpolation)
    left, top = where.left, where.top
    x0, y0, x1, y1 = max(left, 0), max(top, 0), min(left + where.width, canvas.shape[1]), min(top + where.height, canvas.shape[0])
    canvas[y0:y1, x0:x1] = small[y0 - top:y1 - top, x0 - left:x1 - left]


def paste(rng, canvas, image, boxes, scale, centred):
    """Draws the scaled image on the canvas, somewhere or centred, and returns where the boxes are now, cut at its border."""
    (h, w), (height, width) = image.shape, canvas.shape
    where = placing(rng, image.shape, canvas.shape, scale, centred)
    put(canvas, image, where, cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    moved = boxes.copy()
    moved[:, [1, 3]] = boxes[:, [1, 3]] * (where.width / w) + where.left
    moved[:, [2, 4]] = boxes[:, [2, 4]] * (where.height / h) + where.top
    return cut(moved, width, height)


def mosaic(rng, draw):
    """Four scaled scenes side by side: small objects are many then, and every part of the input teaches something."""
    canvas = np.full((HEIGHT, WIDTH), 114, np.uint8)
    x, y = int(rng.uniform(0.35, 0.65) * WIDTH), int(rng.uniform(0.35, 0.65) * HEIGHT)
    parts = []
    for x0, y0, x1, y1 in ((0, 0, x, y), (x, 0, WIDTH, y), (0, y, x, HEIGHT), (x, y, WIDTH, HEIGHT)):
        image, boxes = draw()
        least = max((x1 - x0) / image.shape[1], (y1 - y0) / image.shape[0])
        flip = rng.random() < 0.5
        boxes = paste(rng, canvas[y0:y1, x0:x1], image, boxes, least * float(rng.uniform(1.0, 1.7)), False)
        if flip:
            canvas[y0:y1, x0:x1] = canvas[y0:y1, x0:x1][:, ::-1].copy()
            boxes[:, [1, 3]] = x1 - x0 - boxes[:, [3, 1]]
        parts.append(boxes + np.array([0, x0, y0, x0, y0, 0], np.float32))
    return canvas, np.concatenate(parts)


def cut(boxes, width, height):
    """Cut boxes at the border; the visible fraction falls with what is lost."""
    area = np.maximum((boxes[:, 3] - boxes[:, 1]) * (boxes[:, 4] - boxes[:, 2]), 1e-6)
    result = boxes.copy()
    result[:, [1, 3]] = np.clip(boxes[:, [1, 3]], 0, width)
    result[:, [2, 4]] = np.clip(boxes[:, [2, 4]], 0, height)
    left = (result[:, 3] - result[:, 1]) * (result[:, 4] - result[:, 2])
    result[:, 5] *= left / area
    return result[left > 0]


def degrade(rng, image):
    """Light, contrast, blur and noise of a camera."""
    x = image.astype(np.float32)
    if rng.random() < 0.7:
        x = 255 * (x / 255) ** float(np.exp(rng.uniform(-0.5, 0.5)))
        x = (x - 128) * rng.uniform(0.6, 1.35) + 128 + rng.uniform(-35, 35)
    if rng.random() < 0.2:
        x = cv2.GaussianBlur(x, (7, 7), rng.uniform(0.5, 2.0))
    if rng.random() < 0.4:
        x = x + rng.standard_normal(x.shape, np.float32) * np.float32(rng.uniform(1, 9))
    if rng.random() < 0.1:
        x = 255 - x if rng.random() < 0.1 else x * np.linspace(rng.uniform(0.5, 1), rng.uniform(0.5, 1), x.shape[1])[None, :]
    return np.clip(x, 0, 255).astype(np.uint8)


def targets(boxes, classes):
    """Grid of [height/stride, width/stride, 4 box + 1 weight of the box + 1 heat + 1 weight of the heat + classes].

    Heat is 1 in the cell of an object's centre and falls off as a Gaussian that keeps overlaps above 0.7 (CenterNet, Zhou
    et al. 2019); objects hidden or small neither count as there nor as not there."""
    gh, gw = HEIGHT // STRIDE, WIDTH // STRIDE
    grid = np.zeros((gh, gw, 7 + classes), np.float32)
    grid[..., 6] = 1
    ys, xs = np.mgrid[0:gh, 0:gw].astype(np.float32)
    size = np.maximum(boxes[:, 3] - boxes[:, 1], boxes[:, 4] - boxes[:, 2])
    for i in np.argsort(boxes[:, 5] * np.minimum(size, 40)):  # clear ones last: they win a contested cell
        c, x0, y0, x1, y1, visible = boxes[i]
        w, h = x1 - x0, y1 - y0
        cx, cy = (x0 + x1) / 2 / STRIDE, (y0 + y1) / 2 / STRIDE
        gx, gy = min(int(cx), gw - 1), min(int(cy), gh - 1)
        if visible < VISIBLE_MIN or size[i] < SIZE_MIN:
            if visible >= VISIBLE_IGNORE and size[i] >= SIZE_IGNORE:
                reach_x, reach_y = max(1, int(w / STRIDE / 4)), max(1, int(h / STRIDE / 4))
                part = grid[max(0, gy - reach_y):gy + reach_y + 1, max(0, gx - reach_x):gx + reach_x + 1]
                part[..., 6] = np.where(part[..., 5] > 0.99, part[..., 6], 0)
            continue
        sx, sy = max(0.6, w / STRIDE * 0.09), max(0.6, h / STRIDE * 0.09)
        heat = np.exp(-((xs - gx) / sx) ** 2 / 2 - ((ys - gy) / sy) ** 2 / 2)
        np.maximum(grid[..., 5], np.where(heat > 0.02, heat, 0), out=grid[..., 5])
        for ny in range(max(0, gy - 1), min(gh, gy + 2)):      # neighbours learn the box too, as they may fire
            for nx in range(max(0, gx - 1), min(gw, gx + 2)):
                centre = nx == gx and ny == gy
                if not centre and (heat[ny, nx] < 0.2 or grid[ny, nx, 4] == 1):
                    continue
                grid[ny, nx, :4] = x0, y0, x1, y1
                grid[ny, nx, 4] = 1 if centre else 0.3
                grid[ny, nx, 7:] = 0
                grid[ny, nx, 7 + int(c)] = 1
        grid[gy, gx, 6] = 1
        grid[gy, gx, 5] = 1
    return grid


def sample(rng, scenes, probabilities, backgrounds, classes):
    def draw():
        scene = scenes[rng.choice(len(scenes), p=probabilities)]
        if backgrounds and scene[1] is not None and rng.random() < 0.3:
            return over_photo(rng, scene, backgrounds)
        return scene[0], scene[2]

    kind = rng.random()
    if backgrounds and kind < PHOTO_FRACTION:
        image, boxes = photo_crop(rng, backgrounds, WIDTH, HEIGHT), np.zeros((0, 6), np.float32)
        if rng.random() < 0.4:
            image = stamp(rng, image, backgrounds.stamps)
    elif kind < 0.5:
        image, boxes = mosaic(rng, draw)
    else:
        image, boxes = place(rng, *draw(), fixed=rng.random() < 0.5)
    return degrade(rng, image), targets(boxes, classes)
