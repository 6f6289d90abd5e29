"""Samples from few pictures of a user's own: what `augment` does, and besides objects cut out and set on other pictures, turned pictures and objects half
hidden (copy and paste: Ghiasi et al. 2021, with boxes faded at their borders in place of masks; erasing: Zhong et al. 2020)."""
import cv2
import numpy as np

import augment

TURN_DEGREES, SHEAR = 12.0, 0.08
PASTED_MOST = 4
SIZE_PX = (14.0, 220.0)  # longer side of what is pasted
MARGIN = 0.12            # of a box, around it, in which it fades
_crops = {}


def crops(scenes):
    """(grey, class, margin in pixels) of every object that is seen whole and large enough."""
    if id(scenes) not in _crops:
        found = []
        for image, _, boxes in scenes:
            for c, x0, y0, x1, y1, visible in boxes:
                m = MARGIN * max(x1 - x0, y1 - y0)
                left, top, right, bottom = (int(round(v)) for v in (x0 - m, y0 - m, x1 + m, y1 + m))
                if visible >= 0.9 and max(x1 - x0, y1 - y0) >= 2 * augment.SIZE_MIN and left >= 0 and top >= 0 and right <= image.shape[1] and bottom <= image.shape[0]:
                    found.append((image[top:bottom, left:right], c, m))
        _crops[id(scenes)] = found
    return _crops[id(scenes)]


def hide_under(boxes, x0, y0, x1, y1):
    """What lies under a new box is seen the less."""
    w = np.clip(np.minimum(boxes[:, 3], x1) - np.maximum(boxes[:, 1], x0), 0, None)
    h = np.clip(np.minimum(boxes[:, 4], y1) - np.maximum(boxes[:, 2], y0), 0, None)
    area = np.maximum((boxes[:, 3] - boxes[:, 1]) * (boxes[:, 4] - boxes[:, 2]), 1e-6)
    boxes[:, 5] *= 1 - w * h / area


def fade(width, height, margin):
    """1 in the middle, 0 at the border, over the margin."""
    def ramp(n):
        return np.clip((np.minimum(np.arange(n), np.arange(n)[::-1]) + 0.5) / max(margin, 1.0), 0, 1)
    return np.minimum(ramp(height)[:, None], ramp(width)[None, :]).astype(np.float32)


def paste_objects(rng, image, boxes, cut_out):
    image, boxes = image.astype(np.float32), boxes.copy()
    for _ in range(rng.integers(1, PASTED_MOST + 1)):
        grey, c, margin = cut_out[rng.integers(len(cut_out))]
        longest = max(grey.shape) - 2 * margin
        factor = min(float(np.exp(rng.uniform(np.log(SIZE_PX[0]), np.log(SIZE_PX[1])))) / longest, 1.6)
        w, h = max(6, round(grey.shape[1] * factor)), max(6, round(grey.shape[0] * factor))
        if w >= image.shape[1] or h >= image.shape[0]:
            continue
        small = cv2.resize(grey, (w, h), interpolation=cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR).astype(np.float32)
        small = small[:, ::-1] if rng.random() < 0.5 else small
        x, y, m = int(rng.integers(image.shape[1] - w)), int(rng.integers(image.shape[0] - h)), margin * factor
        hide_under(boxes, x + m, y + m, x + w - m, y + h - m)
        alpha, under = fade(w, h, m), image[y:y + h, x:x + w]
        image[y:y + h, x:x + w] = under * (1 - alpha) + small * rng.uniform(0.7, 1.35) * alpha
        boxes = np.concatenate([boxes, np.array([[c, x + m, y + m, x + w - m, y + h - m, 1.0]], np.float32)])
    return np.clip(image, 0, 255).astype(np.uint8), boxes


def turning(rng, width, height):
    """An affine map about the middle, [2, 3]: turned and sheared a little."""
    angle, shear = np.radians(rng.uniform(-TURN_DEGREES, TURN_DEGREES)), rng.uniform(-SHEAR, SHEAR)
    linear = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ np.array([[1, shear], [0, 1]])
    middle = np.array([width / 2, height / 2])
    return np.concatenate([linear, (middle - linear @ middle)[:, None]], 1)


def turn(rng, image, boxes):
    """Turned and sheared a little; boxes around the ellipses that fill them."""
    height, width = image.shape
    matrix = turning(rng, width, height)
    linear = matrix[:, :2]
    turned = cv2.warpAffine(image, matrix, (width, height), borderMode=cv2.BORDER_CONSTANT, borderValue=114)
    if len(boxes) == 0:
        return turned, boxes
    centre = np.stack([boxes[:, [1, 3]].mean(1), boxes[:, [2, 4]].mean(1)]) - 0.0
    half = np.stack([boxes[:, 3] - boxes[:, 1], boxes[:, 4] - boxes[:, 2]]) / 2
    centre = linear @ centre + matrix[:, 2:]
    half = np.sqrt((linear ** 2) @ (half ** 2))
    moved = boxes.copy()
    moved[:, 1:3], moved[:, 3:5] = (centre - half).T, (centre + half).T
    return turned, augment.cut(moved, width, height)


def hide(rng, image, boxes):
    """A patch over a part of some objects."""
    image, boxes = image.copy(), boxes.copy()
    for box in boxes[rng.random(len(boxes)) < 0.3]:
        w, h = (box[3] - box[1]) * rng.uniform(0.2, 0.6), (box[4] - box[2]) * rng.uniform(0.2, 0.6)
        x, y = rng.uniform(box[1] - w / 2, box[3] - w / 2), rng.uniform(box[2] - h / 2, box[4] - h / 2)
        left, top, right, bottom = max(int(x), 0), max(int(y), 0), min(int(x + w), image.shape[1]), min(int(y + h), image.shape[0])
        if right - left < 2 or bottom - top < 2:
            continue
        from_x, from_y = rng.integers(image.shape[1] - (right - left) + 1), rng.integers(image.shape[0] - (bottom - top) + 1)
        image[top:bottom, left:right] = image[from_y:from_y + bottom - top, from_x:from_x + right - left].copy()
        hide_under(boxes, left, top, right, bottom)
    return image, boxes


def sample(rng, scenes, probabilities, _, classes):
    cut_out = crops(scenes)

    def draw():
        image, _, boxes = scenes[rng.choice(len(scenes), p=probabilities)]
        if rng.random() < 0.5:
            image, boxes = turn(rng, image, boxes)
        if cut_out and rng.random() < 0.6:
            image, boxes = paste_objects(rng, image, boxes, cut_out)
        return hide(rng, image, boxes) if rng.random() < 0.3 else (image, boxes)

    image, boxes = augment.mosaic(rng, draw) if rng.random() < 0.4 else augment.place(rng, *draw(), fixed=rng.random() < 0.3)
    return augment.degrade(rng, image), augment.targets(boxes, classes)
