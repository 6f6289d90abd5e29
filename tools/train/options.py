"""The command line of tools/train. It needs nothing but Python: tools/train.sh looks at the arguments by it before it installs what training needs."""
import argparse
import math
import os

HERE = os.path.dirname(os.path.abspath(__file__))
DETECTOR_WEIGHTS, SEGMENTER_WEIGHTS = os.path.join(HERE, "weights.npz"), os.path.join(HERE, "segmenter.npz")
DESCRIPTION = "Train an int8 network and write it as a Fovea model file. See README.md beside this file."


def number(kind, least, most, expected):
    """An argument of a kind (int, float) from `least` to `most`; refused in one line that says what was expected."""
    def read(text):
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"found {text}, expected {expected}")
        return value
    return read


COUNT = number(int, 1, 10**9, "a whole number from 1 on")
SEED = number(int, 0, 2**32 - 1, "a whole number from 0 to 4294967295")
MINUTES = number(float, 0.01, 1e6, "a number of minutes from 0.01 on")
FRACTION = number(float, 0, 1, "a number from 0 to 1")
RATE = number(float, 1e-9, 1, "a number from 1e-9 to 1")


def add_own(commands, name, what):
    command = commands.add_parser(name, help=f"train {what} on your own pictures")
    command.add_argument("-o", "--output", required=True, help="the .fvm file to write; a .tflite is left beside it")
    command.add_argument("--minutes", type=MINUTES, default=10, help="training ends so long after the start, default 10; quantising and judging come after it")
    command.add_argument("--steps", type=COUNT, default=1500, help="the most steps, of 8 pictures each, default 1500")
    command.add_argument("--continue", action="store_true", help="go on from the weights that a training with this output has left; what was held out stays so")
    return command


def add_shipped(commands, name, what, output, weights_file, worlds, data_seed):
    command = commands.add_parser(name, help=f"train {what} that comes with Fovea")
    command.add_argument("--fovea", default="build/fovea")
    command.add_argument("--work", default="build/train", help="where scenes and photographs are kept")
    command.add_argument("-o", "--output", default=output)
    command.add_argument("--weights", default=weights_file, help="where the float weights are kept")
    command.add_argument("--worlds", type=COUNT, default=worlds)
    command.add_argument("--data-seed", type=SEED, default=data_seed, help=f"of the rendered worlds, default {data_seed}")
    command.add_argument("--steps", type=COUNT, default=4000)
    command.add_argument("--batch", type=COUNT, default=16, help="pictures of a step, default 16")
    command.add_argument("--minutes", type=MINUTES, help="at most about so long; the schedule then ends with the time")
    command.add_argument("--rate", type=RATE, default=2e-3)
    command.add_argument("--resume", action="store_true", help="go on from --weights")
    return command


def parse(words=None):
    parser = argparse.ArgumentParser(prog="tools/train.sh", description=DESCRIPTION)
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
    shipped = add_shipped(commands, "shipped", "the detector", "build/train/detector.fvm", DETECTOR_WEIGHTS, 150, 1)
    for command in (own, shipped):
        command.add_argument("--score", type=FRACTION, default=0.3, help="score threshold written into the model, default 0.3")
    segmenter = add_shipped(commands, "shipped-segmentation", "the network that labels pixels", "build/train/segmenter.fvm", SEGMENTER_WEIGHTS, 560, 3)
    segmenter.add_argument("--part", type=FRACTION, default=1.0, help="end so far of the way from the weights that the training began with to those that it made, default 1: all of it")
    for command in (own, shipped, pixels, segmenter):
        command.add_argument("--seed", type=SEED, default=1)
    return parser.parse_args(words)


if __name__ == "__main__":
    parse()
