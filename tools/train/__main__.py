"""tools/train: train an int8 network and write it as a Fovea model file.

    python3 tools/train own DIR -o MODEL.fvm            a detector, from pictures with YOLO labels and classes.txt
    python3 tools/train own DIR --coco FILE -o MODEL.fvm
    python3 tools/train own-segmentation PICTURES MASKS -o MODEL.fvm
                                                        one that labels pixels, from label PNGs and MASKS/classes.txt
    python3 tools/train shipped                         the detector that comes with Fovea, from rendered scenes
    python3 tools/train shipped-segmentation            the network that comes with Fovea and labels pixels

`tools/train.sh` runs this in a Python environment of its own. See README.md beside this file."""
import argparse
import os
import sys
import time

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "2")
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import detection  # noqa: E402
import labels  # noqa: E402
import segmentation  # noqa: E402
import weights  # noqa: E402

BEGUN = time.monotonic()


def add_own(commands, name, what):
    command = commands.add_parser(name, help=f"train {what} on your own pictures")
    command.add_argument("-o", "--output", required=True, help="the .fvm file to write; a .tflite is left beside it")
    command.add_argument("--minutes", type=float, default=10, help="training ends so long after the start, default 10; quantising and judging come after it")
    command.add_argument("--steps", type=int, default=1500, help="the most steps, of 8 pictures each, default 1500")
    command.add_argument("--continue", action="store_true", help="go on from the weights that a training with this output has left; what was held out stays so")
    return command


def add_shipped(commands, name, what, output, weights_file, worlds, data_seed):
    command = commands.add_parser(name, help=f"train {what} that comes with Fovea")
    command.add_argument("--fovea", default="build/fovea")
    command.add_argument("--work", default="build/train", help="where scenes and photographs are kept")
    command.add_argument("-o", "--output", default=output)
    command.add_argument("--weights", default=weights_file, help="where the float weights are kept")
    command.add_argument("--worlds", type=int, default=worlds)
    command.add_argument("--data-seed", type=int, default=data_seed, help=f"of the rendered worlds, default {data_seed}")
    command.add_argument("--steps", type=int, default=4000)
    command.add_argument("--batch", type=int, default=16, help="pictures of a step, default 16")
    command.add_argument("--minutes", type=float, help="at most about so long; the schedule then ends with the time")
    command.add_argument("--rate", type=float, default=2e-3)
    command.add_argument("--resume", action="store_true", help="go on from --weights")
    return command


def parse():
    parser = argparse.ArgumentParser(prog="tools/train", description=__doc__.split("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    own = add_own(commands, "own", "a detector")
    own.add_argument("folder", help="pictures, with YOLO labels beside them unless --coco")
    own.add_argument("--coco", help="COCO annotations (JSON)")
    own.add_argument("--judge", metavar="DIR", help="labelled pictures of other scenes to judge by; all of the first folder are then learnt from")
    pixels = add_own(commands, "own-segmentation", "a network that labels pixels")
    pixels.add_argument("pictures", help="pictures")
    pixels.add_argument("masks", help="MASKS/NAME.png for each PICTURES/NAME.*: PNGs of grey levels or a palette, whose pixels are labels; 255: not known")
    pixels.add_argument("--classes", metavar="FILE", help="a line for each class, NAME or LABEL NAME, and perhaps #rrggbb; default MASKS/classes.txt")
    pixels.add_argument("--judge", nargs=2, metavar=("PICTURES", "MASKS"), help="labelled pictures of other scenes to judge by; all of the first are then learnt from")
    shipped = add_shipped(commands, "shipped", "the detector", "build/train/detector.fvm", weights.SHIPPED, 150, 1)
    for command in (own, shipped):
        command.add_argument("--score", type=float, default=0.3, help="score threshold written into the model, default 0.3")
    segmenter = add_shipped(commands, "shipped-segmentation", "the network that labels pixels", "build/train/segmenter.fvm", segmentation.WEIGHTS, 560, 3)
    for command in (own, shipped, pixels, segmenter):
        command.add_argument("--seed", type=int, default=1)
    return parser.parse_args()


def main():
    arguments = parse()
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
