"""Training on a user's own labelled pictures, whatever the labels are."""
import os
import time
from typing import Callable, NamedTuple

import keras
import numpy as np

import fit
import network
import split
import weights
from labels import LabelProblem

FEW_PICTURES = 500  # with fewer the first layers stay as they come
FEW_STEPS = 100     # fewer hardly change the weights that come with Fovea


class Kind(NamedTuple):
    unit: str          # of what is counted
    measure: Callable  # (scenes): how much of each class each shows, [pictures, classes]
    build: Callable    # (classes): the network
    weights: str       # the file to begin from
    known: list        # its classes, where those of the same names keep what it knows of them; [] where all are learnt anew
    task: Callable     # (scenes to learn from): fit.Task
    whole: Callable    # (scenes): as the network sees them in use, with their truth
    finish: Callable   # (model, scenes learnt from, scenes held out)


def train(kind, names, scenes, paths, others, arguments, begun):
    """`scenes`: grey pictures with their labels behind them; `others`: None, or names and scenes to judge by in place of some of these."""
    keras.utils.set_random_seed(arguments.seed)
    weights.quick_arithmetic()
    kept, before, judged = os.path.splitext(arguments.output)[0] + ".training.npz", 0, None
    if getattr(arguments, "continue"):
        judged, before = weights.earlier(kept, names)
    elif others:
        judged = set()
    objects = kind.measure(scenes)
    parts = split.split([s[0] for s in scenes], paths, objects, arguments.seed, judged)
    learn, watch, held_out = ([scenes[i] for i in part] for part in (parts.learn, parts.watch, parts.judge))
    if not learn:
        raise LabelProblem(f"{os.path.dirname(paths[0])}: found {len(scenes)} pictures and none left to learn from, expected more")
    split.hold(parts, objects, kind.unit, os.path.dirname(paths[0]))
    split.say(parts, objects, names, kind.unit)
    if others:
        if others[0] != names:
            raise LabelProblem(f"--judge: found classes {' '.join(others[0])[:80]}, expected {' '.join(names)[:80]}")
        held_out = others[1]
        print(f"judged by {len(held_out)} other pictures")
    model = kind.build(len(names))
    if before:
        weights.load(model, kept)
    else:
        weights.load(model, kind.weights, names, kind.known)
    if len(learn) < FEW_PICTURES:
        for layer in model.layers:
            layer.trainable = layer.name.removesuffix("_norm") not in network.EARLY
    aside = [os.path.basename(paths[i]) for i in parts.judge]

    def keep(step):
        weights.save(model, kept, fovea_names=np.array(names), fovea_judged=np.array(aside), fovea_steps=np.array(before + step))

    made = fit.fit(model, learn, None, len(names), arguments.steps, batch=8, rate=5e-4 if before else 1e-3, seed=arguments.seed + before, minutes=arguments.minutes,
                   report=lambda line: print(line, flush=True), keep=keep, begun=begun, rise=20, task=kind.task(learn), watched=kind.whole(watch))
    keep(made)
    print(f"{made} steps{f' after {before} before' if before else ''} in {(time.monotonic() - begun) / 60:.1f} minutes, {sum(os.times()[:4]) / 60:.1f} of a processor", flush=True)
    if made < min(FEW_STEPS, arguments.steps):
        print(f"fewer than {FEW_STEPS}: the machine was busy, more --minutes or --continue will help", flush=True)
    kind.finish(model, learn, held_out)
