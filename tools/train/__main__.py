"""tools/train: train an int8 network and write it as a Fovea model file.

    python3 tools/train own DIR -o MODEL.fvm            a detector, from pictures with YOLO labels and classes.txt
    python3 tools/train own DIR --coco FILE -o MODEL.fvm
    python3 tools/train own-segmentation PICTURES MASKS -o MODEL.fvm
                                                        one that labels pixels, from label PNGs and MASKS/classes.txt
    python3 tools/train shipped                         the detector that comes with Fovea, from rendered scenes
    python3 tools/train shipped-segmentation            the network that comes with Fovea and labels pixels

`tools/train.sh` runs this in a Python environment of its own. See README.md beside this file."""
import os
import sys
import time

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "2")
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import detection  # noqa: E402
import labels  # noqa: E402
import options  # noqa: E402
import segmentation  # noqa: E402

BEGUN = time.monotonic()


def main():
    arguments = options.parse()
    run = {"own": lambda a: detection.train_own(a, BEGUN), "own-segmentation": lambda a: segmentation.train_own(a, BEGUN),
           "shipped": detection.train_shipped, "shipped-segmentation": segmentation.train_shipped}
    try:
        run[arguments.command](arguments)
    except (labels.LabelProblem, OSError) as problem:
        print(problem, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
