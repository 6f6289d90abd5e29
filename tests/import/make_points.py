"""Write tests/golden/points.txt: drawn outputs of heads with keypoints, of turned boxes and of YOLOX, and what they stand for by heads.py, for a picture of 96 x 64.

One case: a line "head NAME side letterbox classes points values point_score logits normalised score", a line "out rank d0.. scale zero"
and one of the bytes in hex per output, a line "set class score x0 y0 x1 y1 angle" per object (all 0: no box), a line "point x y score" per
keypoint, a line "end". Needs numpy."""
import os

import numpy as np

import heads

HERE = os.path.dirname(os.path.abspath(__file__))
WIDTH, HEIGHT = 96, 64


def pose(r):
    n = 84
    data = r.integers(0, 256, (1, 21, n))
    data[0, 2:4] //= 4
    data[0, 4:6] = np.minimum(data[0, 4:6], r.integers(0, 256, (2, n))) // 2
    return [(data, 1 / 256, 0)], "64 1 2 5 3 2 0 1 0.25"


def blaze(r):
    boxes, scores = r.integers(100, 156, (1, 896, 16)), r.integers(0, 140, (1, 896, 1))
    boxes[..., 2:4] += 40
    return [(boxes, 1.0, 128), (scores, 0.1, 128)], "128 1 1 6 2 0 1 0 0.25"


def movenet(r):
    return [(r.integers(0, 256, (1, 1, 17, 3)), 1 / 256, 0)], "64 1 1 17 3 2 0 1 0.05"


def landmarks(r):
    return [(r.integers(0, 256, (1, 1, 1, 1404)), 1.0, 20), (r.integers(130, 256, (1, 1, 1, 1)), 0.1, 128)], "192 0 1 468 3 0 1 0 0.1"


def end2end(r):
    data = r.integers(0, 256, (1, 30, 6))
    data[..., 2:4] = np.minimum(data[..., :2] + data[..., 2:4] // 3, 255)
    data[..., 5] = 0
    return [(data, 1 / 256, 0)], "64 1 1 0 0 0 0 1 0.25"


def obb(r):
    data = r.integers(0, 256, (1, 7, 84))
    data[0, 2:4] //= 3
    return [(data, 1 / 256, 0)], "64 1 2 0 0 0 0 1 0.25"


def yolox(r):
    data = r.integers(90, 180, (1, 84, 7))
    data[..., 4:] = r.integers(128, 192, (1, 84, 3))
    return [(data, 1 / 64, 128)], "64 1 2 0 0 0 0 0 0.25"


CASES = {"yolov8_pose": pose, "blaze": blaze, "movenet": movenet, "landmarks": landmarks, "end2end": end2end, "yolov8_obb": obb, "yolox": yolox}


def main():
    r = np.random.default_rng(11)
    with open(os.path.join(HERE, "..", "golden", "points.txt"), "w", encoding="ascii") as file:
        for name, make in CASES.items():
            outs, words = make(r)
            values = [np.float32(scale) * (data.astype(np.float32) - zero) for data, scale, zero in outs]
            file.write(f"head {name} {words}\n")
            for data, scale, zero in outs:
                file.write(f"out {data.ndim} {' '.join(map(str, data.shape))} {scale:.9g} {zero}\n{data.astype(np.uint8).tobytes().hex()}\n")
            for found in heads.DECODERS[name](values, WIDTH, HEIGHT)[:300]:
                file.write("set " + " ".join(f"{v:.9g}" for v in (found["class"], found["score"], *found.get("box_px", [0] * 4), found.get("angle", 0))) + "\n")
                for point in found.get("keypoints_px", []):
                    file.write("point " + " ".join(f"{v:.9g}" for v in point) + "\n")
            file.write("end\n")


if __name__ == "__main__":
    main()
