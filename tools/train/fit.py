"""The training loop."""
import multiprocessing
import os
import sys
import time

import cv2
import keras
import numpy as np
import tensorflow as tf

import augment
import network

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))

import progress  # noqa: E402

_worker = {}


def _start(scenes, backgrounds, classes, seed, counter):
    cv2.setNumThreads(1)
    with counter.get_lock():
        number = counter.value
        counter.value += 1
    _worker.update(scenes=scenes, probabilities=augment.scene_probabilities(scenes), backgrounds=backgrounds, classes=classes,
                   rng=np.random.default_rng([seed, number]))


def _batch(size):
    made = [augment.sample(*(_worker[k] for k in ("rng", "scenes", "probabilities", "backgrounds", "classes"))) for _ in range(size)]
    return np.stack([m[0] for m in made])[..., None], np.stack([m[1] for m in made])


def fit(model, scenes, backgrounds, classes, steps, batch=16, rate=2e-3, seed=1, report=print, keep=None, minutes=None, begun=None,
        rise=200):
    """Trains in place for a number of steps, or fewer where `minutes` since `begun` (now, unless given; of time.monotonic) are up before.
    The rate rises over `rise` steps and falls as half a cosine over the rest, by steps or by time, whichever is farther. `keep(step)`
    is called now and then. Returns the steps made. With one worker, and steps alone, the result depends on the seed alone, up to the
    order in which the library's threads add."""
    counter = multiprocessing.Value("i", 0)
    rise = max(1, min(rise, steps // 10))
    optimizer = keras.optimizers.AdamW(rate, weight_decay=1e-3, clipnorm=5.0)

    @tf.function(jit_compile=False)
    def train(images, grid):
        with tf.GradientTape() as tape:
            output = model((tf.cast(images, tf.float32) - 128.0) / 128.0, training=True)
            value = network.loss(grid, tf.cast(output, tf.float32))
        optimizer.apply_gradients(zip(tape.gradient(value, model.trainable_variables), model.trainable_variables))
        return value

    with multiprocessing.Pool(1, _start, (scenes, backgrounds, classes, seed, counter)) as pool:
        pending = [pool.apply_async(_batch, (batch,)) for _ in range(4)]
        recent, entered = [], time.monotonic()
        begun, printed = entered if begun is None else begun, entered
        limit = max(begun + 60 * minutes - entered, 1.0) if minutes else np.inf
        for step in range(steps):
            done = max(step / steps, (time.monotonic() - entered) / limit)
            if done >= 1:
                progress.clear()
                return step
            optimizer.learning_rate.assign(rate * min((step + 1) / rise, 0.01 + 0.99 * (0.5 + 0.5 * np.cos(np.pi * done))))
            images, grid = pending.pop(0).get()
            pending.append(pool.apply_async(_batch, (batch,)))
            recent.append(float(train(images, grid)))
            now = time.monotonic()
            progress.show("train", step + 1, steps, f"loss {np.mean(recent):.3f}  {now - begun:.0f} s")
            if (step + 1) % 100 == 0 or now - printed > 60:
                progress.clear()
                report(f"step {step + 1} of {steps}, loss {np.mean(recent):.3f}, {now - begun:.0f} s")
                recent, printed = [], now
            if keep is not None and (step + 1) % 500 == 0:
                keep(step + 1)
    progress.clear()
    return steps
