"""The training loop."""
import multiprocessing
import os
import sys
import time
from typing import Callable, NamedTuple

import cv2
import keras
import numpy as np
import tensorflow as tf

import augment
import network

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))

import progress  # noqa: E402

WATCH_STEPS, PATIENCE = 25, 10  # the loss is looked at so often; so many looks without a better one are the end
BETTER = 0.003                  # by so much of it
KEEP_STEPS = 250
_worker = {}
cv2.setNumThreads(1)  # of this process, from its beginning: threads of OpenCV's do not live on in a worker, which would wait for them for ever


class Task(NamedTuple):
    """What is learnt."""
    sample: Callable         # (rng, scenes, probabilities, backgrounds, classes): picture and target
    probabilities: Callable  # (scenes): how often each is drawn
    targets: Callable        # (truth of a watched picture, classes): target
    loss: Callable           # (targets, outputs)


DETECTION = Task(augment.sample, augment.scene_probabilities, augment.targets, network.loss)


def _start(task, scenes, backgrounds, classes, seed, counter):
    with counter.get_lock():
        number = counter.value
        counter.value += 1
    _worker.update(sampler=task.sample, scenes=scenes, probabilities=task.probabilities(scenes), backgrounds=backgrounds, classes=classes,
                   rng=np.random.default_rng([seed, number]))


def _batch(size):
    made = [_worker["sampler"](*(_worker[k] for k in ("rng", "scenes", "probabilities", "backgrounds", "classes"))) for _ in range(size)]
    return np.stack([m[0] for m in made])[..., None], np.stack([m[1] for m in made])


class Watch:
    """The loss on pictures that are not learnt from; keeps the weights of the least one."""

    def __init__(self, model, task, samples, classes):
        self.model, self.best, self.weights, self.stale, self.step = model, np.inf, None, 0, 0
        self.images = np.stack([image for image, _ in samples])[..., None]
        self.grids = np.stack([task.targets(truth, classes) for _, truth in samples])
        self.run = tf.function(lambda images, grid: task.loss(grid, tf.cast(model((tf.cast(images, tf.float32) - 128.0) / 128.0, training=False), tf.float32)))

    def look(self, step):
        """Whether it has not become better for long."""
        value = float(np.mean([float(self.run(self.images[i:i + 4], self.grids[i:i + 4])) for i in range(0, len(self.images), 4)]))
        if value < self.best * (1 - BETTER):
            self.best, self.weights, self.stale, self.step = value, self.model.get_weights(), 0, step
        else:
            self.stale += 1
        return value, self.stale >= PATIENCE


class Rate:
    """Rises over `rise` steps and falls as half a cosine over the rest, by steps or by time, whichever is farther; once `end` is called it falls
    to nothing over a fifth of the steps made."""

    def __init__(self, rate, rise, steps, limit):
        self.rate, self.rise, self.steps, self.limit, self.entered, self.ending = rate, rise, steps, limit, time.monotonic(), None

    def done(self, step):
        part = max(step / self.steps, (time.monotonic() - self.entered) / self.limit)
        if self.ending:
            begin, count, before = self.ending
            part = max(part, before + (1 - before) * (step - begin) / count)
        return part

    def at(self, step):
        return self.rate * min((step + 1) / self.rise, 0.01 + 0.99 * (0.5 + 0.5 * np.cos(np.pi * min(self.done(step), 1.0))))

    def end(self, step):
        if self.ending is None:
            self.ending = (step, max(60, step // 5), max(self.done(step), 0.6))

    def minutes_left(self, step):
        spent, part = time.monotonic() - self.entered, self.done(step)
        return spent * (1 - part) / part / 60 if part > 0.003 else None


def fit(model, scenes, backgrounds, classes, steps, batch=16, rate=2e-3, seed=1, report=print, keep=None, minutes=None, begun=None,
        rise=200, task=DETECTION, watched=None):
    """Trains in place for a number of steps, or fewer where `minutes` since `begun` (now, unless given; of time.monotonic) are up before, or
    where the loss on `watched` pictures (image, truth) has not fallen for long; the weights are then those of its least. `keep(step)`
    is called now and then. Returns the steps made. With one worker, and steps alone, the result depends on the seed alone, up to the
    order in which the library's threads add."""
    counter = multiprocessing.Value("i", 0)
    optimizer = keras.optimizers.AdamW(rate, weight_decay=1e-3, clipnorm=5.0)
    watch = Watch(model, task, watched, classes) if watched else None

    @tf.function(jit_compile=False)
    def train(images, grid):
        with tf.GradientTape() as tape:
            output = model((tf.cast(images, tf.float32) - 128.0) / 128.0, training=True)
            value = task.loss(grid, tf.cast(output, tf.float32))
        optimizer.apply_gradients(zip(tape.gradient(value, model.trainable_variables), model.trainable_variables))
        return value

    with multiprocessing.Pool(1, _start, (task, scenes, backgrounds, classes, seed, counter)) as pool:
        pending = [pool.apply_async(_batch, (batch,)) for _ in range(4)]
        recent, entered, seen = [], time.monotonic(), ""
        begun, printed, step = entered if begun is None else begun, entered, 0
        course = Rate(rate, max(1, min(rise, steps // 10)), steps, max(begun + 60 * minutes - entered, 1.0) if minutes else np.inf)
        while step < steps and course.done(step) < 1:
            optimizer.learning_rate.assign(course.at(step))
            images, grid = pending.pop(0).get()
            pending.append(pool.apply_async(_batch, (batch,)))
            recent.append(float(train(images, grid)))
            step += 1
            if watch and step % WATCH_STEPS == 0:
                value, stale = watch.look(step)
                seen = f", watched {value:.3f} (least {watch.best:.3f})"
                if stale and course.ending is None:
                    course.end(step)
                    progress.clear()
                    report(f"step {step}: the loss on the watched pictures has not fallen since step {watch.step}, so the training ends soon")
            now, left = time.monotonic(), course.minutes_left(step)
            line = f"loss {np.mean(recent):.3f}{seen}, {(now - begun) / 60:.1f} minutes" + (f", {left:.1f} left" if left is not None else "")
            progress.show("train", step, steps, line)
            if step % 100 == 0 or now - printed > 60:
                progress.clear()
                report(f"step {step} of at most {steps}, {line}")
                recent, printed = [], now
            if keep is not None and step % KEEP_STEPS == 0:
                keep(step)
    progress.clear()
    if watch and watch.look(step)[0] > watch.best and watch.weights is not None:
        report(f"the weights are those of step {watch.step}")
        model.set_weights(watch.weights)
    return step


def go_back(model, begun_with, part, scenes, backgrounds, classes, task, batch=8, batches=40, seed=1):
    """Sets weights `part` of the way from `begun_with` to the model's (Wortsman et al. 2022): what was known before and what was learnt both stay. The statistics of the
    normalisation, which lie on no such line, are taken anew from samples."""
    model.set_weights([a + part * (b - a) for a, b in zip(begun_with, model.get_weights())])
    rng, probabilities = np.random.default_rng(seed), task.probabilities(scenes)
    for _ in range(batches):
        images = np.stack([task.sample(rng, scenes, probabilities, backgrounds, classes)[0] for _ in range(batch)])[..., None]
        model((tf.cast(images, tf.float32) - 128.0) / 128.0, training=True)
