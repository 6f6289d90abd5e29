"""The training loop."""
import multiprocessing
import time

import keras
import numpy as np
import tensorflow as tf

import augment
import network

_worker = {}


def _start(scenes, photos, classes, seed, counter):
    with counter.get_lock():
        number = counter.value
        counter.value += 1
    _worker.update(scenes=scenes, photos=photos, classes=classes, rng=np.random.default_rng([seed, number]))


def _batch(size):
    made = [augment.sample(_worker["rng"], _worker["scenes"], _worker["photos"], _worker["classes"]) for _ in range(size)]
    return np.stack([m[0] for m in made])[..., None], np.stack([m[1] for m in made])


def fit(model, scenes, photos, classes, steps, batch=16, rate=2e-3, seed=1, report=print, keep=None):
    """Trains in place and returns the median seconds of a step. `keep(step)` is called now and then. With one worker the result depends on the seed alone, up to the
    order in which the library's threads add."""
    counter = multiprocessing.Value("i", 0)
    schedule = keras.optimizers.schedules.CosineDecay(rate * 0.05, steps, alpha=0.01, warmup_target=rate, warmup_steps=min(200, steps // 10))
    optimizer = keras.optimizers.AdamW(schedule, weight_decay=1e-3, clipnorm=5.0)

    @tf.function(jit_compile=False)
    def train(images, grid):
        with tf.GradientTape() as tape:
            output = model((tf.cast(images, tf.float32) - 128.0) / 128.0, training=True)
            value = network.loss(grid, output)
        optimizer.apply_gradients(zip(tape.gradient(value, model.trainable_variables), model.trainable_variables))
        return value

    with multiprocessing.Pool(1, _start, (scenes, photos, classes, seed, counter)) as pool:
        pending = [pool.apply_async(_batch, (batch,)) for _ in range(4)]
        recent, seconds, begun = [], [], time.time()
        for step in range(steps):
            step_begun = time.time()
            images, grid = pending.pop(0).get()
            pending.append(pool.apply_async(_batch, (batch,)))
            recent.append(float(train(images, grid)))
            seconds.append(time.time() - step_begun)
            if (step + 1) % 100 == 0:
                report(f"step {step + 1} of {steps}, loss {np.mean(recent):.3f}, {time.time() - begun:.0f} s")
                recent = []
            if keep is not None and (step + 1) % 500 == 0:
                keep(step + 1)
    return float(np.median(seconds))
