"""Float weights in files, and how they are taken over."""
import os

import keras
import numpy as np

import classes
from labels import LabelProblem
from options import DETECTOR_WEIGHTS

SHIPPED = DETECTOR_WEIGHTS
CELL_PLACES = 4  # of a cell of the last layer, each with all classes (segmenter.py)
CALIBRATION_IMAGES = 200  # at most; two of each picture are enough


def save(model, path, **more):
    """Half precision: the file is read again only to train on from it."""
    named = {v.path.replace("/", "."): np.asarray(v).astype(np.float16) for v in model.weights}
    part = path + ".part.npz"
    np.savez_compressed(part, **named, **more)
    os.replace(part, path)


def load(model, path, names=None, known=()):
    """Every weight whose name and shape fit. Where the classes are new, `names`: of a detector's head what tells the box and that there is an
    object, no class is preferred; of a layer that labels pixels the classes that `path` has under the same names, of all `known`."""
    stored = np.load(path)
    head, pixels = (next((name.rsplit(".", 1)[0] for name in stored if name.startswith(last)), None) for last in ("head", "pixels"))
    for variable in model.weights:
        name = variable.path.replace("/", ".")
        last = name.startswith(("head", "pixels"))
        if name in stored and stored[name].shape == tuple(variable.shape) and not (names and last):
            variable.assign(stored[name].astype(np.float32))
        elif name.startswith("head"):
            value = np.zeros(variable.shape, np.float32)
            value[..., :5] = stored[head + name[name.rindex("."):]][..., :5]
            variable.assign(value)
        elif names and last and known:
            variable.assign(classes.carried_over(variable.numpy(), stored[pixels + name[name.rindex("."):]], names, known, CELL_PLACES))


def keep(model, path):
    """Saves them, and goes on with what was saved: a model file that is made of them can be made again from `path`."""
    save(model, path)
    load(model, path)


def earlier(path, names):
    """What a training before has left: (weights' file, names of its judged pictures, steps)."""
    if not os.path.exists(path):
        raise LabelProblem(f"--continue: {path}: not there; expected what a training with this output has left")
    with np.load(path) as stored:
        known = [str(n) for n in stored["fovea_names"]]
        if known != names:
            raise LabelProblem(f"--continue: {path}: found classes {' '.join(known)[:80]}, expected {' '.join(names)[:80]}")
        return {str(n) for n in stored["fovea_judged"]}, int(stored["fovea_steps"])


def quick_arithmetic():
    """Where the processor multiplies bfloat16 in tiles, train with it: half the time of a step."""
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        if "amx_bf16" in file.read():
            keras.config.set_dtype_policy("mixed_bfloat16")
