"""Training samples: rendered scenes and objects pasted over photographs, at random size, light, blur and noise."""
import cv2
import numpy as np

WIDTH, HEIGHT, STRIDE = 640, 480, 8
VISIBLE_MIN, VISIBLE_IGNORE = 0.5, 0.2  # objects between these are neither right nor wrong
SIZE_MIN, SIZE_IGNORE = 11, 5           # longer side in pixels of the network's input


def photo_crop(rng, photos, width, height):
    photo = photos[rng.integers(len(photos))]
    h, w = photo.shape
    scale = rng.uniform(max(0.25, 240 / min(h, w)), 1.0)
    ch, cw = max(32, int(min(h, w * 0.75) * scale)), max(32, int(min(w, h / 0.75) * scale))
    y, x = rng.integers(h - ch + 1), rng.integers(w - cw + 1)
    interpolation = cv2.INTER_AREA if cw > width else cv2.INTER_LINEAR
    crop = cv2.resize(photo[y:y + ch, x:x + cw], (width, height), interpolation=interpolation)
    return crop[:, ::-1] if rng.random() < 0.5 else crop


def over_photo(rng, scene, photos):
    """The objects of a scene in front of a photograph."""
    image, mask, boxes = scene
    h, w = image.shape
    alpha = cv2.GaussianBlur((mask > 0).astype(np.float32), (3, 3), 0.8)
    gain = rng.uniform(0.6, 1.5)
    mixed = image * alpha * gain + photo_crop(rng, photos, w, h) * (1 - alpha)
    return np.clip(mixed, 0, 255).astype(np.uint8), boxes


def place(rng, image, boxes, fixed=False):
    """Scale, mirror and shift into the network's input; grey where the image does not reach."""
    h, w = image.shape
    scale = WIDTH / w if fixed else WIDTH / w * float(np.exp(rng.uniform(np.log(0.4), np.log(1.6))))
    nw, nh = max(8, round(w * scale)), max(8, round(h * scale))
    small = cv2.resize(image, (nw, nh), interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    left = (WIDTH - nw) // 2 if fixed else int(rng.integers(min(0, WIDTH - nw), max(0, WIDTH - nw) + 1))
    top = (HEIGHT - nh) // 2 if fixed else int(rng.integers(min(0, HEIGHT - nh), max(0, HEIGHT - nh) + 1))
    canvas = np.full((HEIGHT, WIDTH), 114, np.uint8)
    x0, y0, x1, y1 = max(left, 0), max(top, 0), min(left + nw, WIDTH), min(top + nh, HEIGHT)
    canvas[y0:y1, x0:x1] = small[y0 - top:y1 - top, x0 - left:x1 - left]
    moved = boxes.copy()
    moved[:, [1, 3]] = boxes[:, [1, 3]] * (nw / w) + left
    moved[:, [2, 4]] = boxes[:, [2, 4]] * (nh / h) + top
    if not fixed and rng.random() < 0.5:
        canvas = canvas[:, ::-1]
        moved[:, [1, 3]] = WIDTH - moved[:, [3, 1]]
    return canvas, cut(moved)


def cut(boxes):
    """Cut boxes at the border; the visible share falls with what is lost."""
    area = np.maximum((boxes[:, 3] - boxes[:, 1]) * (boxes[:, 4] - boxes[:, 2]), 1e-6)
    result = boxes.copy()
    result[:, [1, 3]] = np.clip(boxes[:, [1, 3]], 0, WIDTH)
    result[:, [2, 4]] = np.clip(boxes[:, [2, 4]], 0, HEIGHT)
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


def sample(rng, scenes, photos, classes):
    kind = rng.random()
    if kind < 0.2 and photos:
        image, boxes = photo_crop(rng, photos, WIDTH, HEIGHT), np.zeros((0, 6), np.float32)
    else:
        scene = scenes[rng.integers(len(scenes))]
        image, boxes = over_photo(rng, scene, photos) if kind < 0.5 and photos and scene[1] is not None else (scene[0], scene[2])
        image, boxes = place(rng, image, boxes, fixed=rng.random() < 0.3)
    return degrade(rng, image), targets(boxes, classes)
