"""Networks that label pixels: training of the one that comes with Fovea, and of a user's own."""
import os
import time

import keras
import numpy as np

import augment
import backgrounds
import convert
import fit
import label_pictures
import options
import overlap
import own
import pixels
import scenes as scenes_module
import segmenter
import weights as weights_module

CLASSES = ["floor", "wall", "obstacle", "movable", "other"]
COLOURS = ["#50b450", "#50a0c8", "#dc3c3c", "#ffc800", "#8c8c8c"]
OF_EXPORT = np.array([4, 3, 3, 3, 3, 0, 1, 2, 5], np.uint8)  # background; ball, cone, box, person; floor, wall, obstacle, pit
MOVABLE, PIT = CLASSES.index("movable"), len(CLASSES)
OF_LABELS = np.array([0, 1, 2, 3, 4, 2])  # the class of each label: a pit is an obstacle
PIT_PIXELS = 300  # so many are worth learning from
PIT_WEIGHT = 3.0  # of a pit's pixels in the loss, for one of other obstacles: who calls a pit floor drives into it
SHOWN_EVERY = 1000  # steps
PLACES = [("places", scenes_module.PLACES, 50), ("drives", scenes_module.DRIVES, 36), ("roads", scenes_module.ROADS, 14)]  # of 100 worlds
PIT_TIMES = 2  # as often as other frames are these drawn to learn from; those held out count once
PITS = [("pits", scenes_module.PITS, 50, 36), ("edges", scenes_module.EDGES, 30, 16)]  # more halls for 100 worlds, and frames of each: those that show a pit are taken, as few others do


def labelled(scenes):
    """(grey, labels) of rendered scenes."""
    return [(image, OF_EXPORT[mask]) for image, mask, _ in scenes]


def of_classes(labels):
    """Labels of classes alone: a pit is an obstacle."""
    table = np.full(256, overlap.NONE, np.uint8)
    table[:len(OF_LABELS)] = OF_LABELS
    return table[labels]


def whole(scenes, count, seed):
    """(picture, labels) at the network's input, as in use."""
    rng = np.random.default_rng(seed)
    return [pixels.place(rng, *scenes[i], fixed=True) for i in rng.permutation(len(scenes))[:count]]


def task_of(scenes, classes, movable=None, of=None, times=None, even=None):
    """Where labels are finer than classes `of` is the class of each, `times` how often a pixel of it counts as much as its class does; `even`: of segmenter.loss_of."""
    def targets(labels, count):
        return pixels.cells(labels, count)
    of = np.arange(classes) if of is None else of
    weights = pixels.class_weights(scenes, of) * (1.0 if times is None else times)
    return fit.Task(pixels.sampler(movable), pixels.equally, targets, segmenter.loss_of(weights, of, even))


def finish(trained, scenes, samples, names, colours, output, task, photographs=None):
    """Quantise, compare on `samples` and write OUTPUT (.fvm), the .tflite beside it and what is taken for what."""
    keras.config.set_dtype_policy("float32")
    model = segmenter.build(len(names), probabilities=True)
    model.set_weights(trained.get_weights())
    rng, probabilities = np.random.default_rng(7), pixels.equally(scenes)
    images = [task.sample(rng, scenes, probabilities, photographs, len(names))[0]
              for _ in range(min(weights_module.CALIBRATION_IMAGES, 2 * len(scenes)))]
    data = convert.to_tflite(model, images)
    tflite = os.path.splitext(output)[0] + ".tflite"
    with open(tflite, "wb") as file:
        file.write(data)
    if samples:
        quantised = convert.Int8(data)
        of_float, of_int8 = (overlap.counts(run, samples, len(names)) for run in (lambda image: convert.run_float(model, image), quantised))
        for line in overlap.table(names, of_float, of_int8):
            print(line, flush=True)
        picture = os.path.splitext(output)[0] + ".confusion.png"
        overlap.draw(picture, of_int8, names)
        print(f"{picture}: which class is taken for which, in thousandths of a class's pixels")
    convert.write_fvm(tflite, output, names, ["--decoder", "segment", "--fit", "letterbox"], colours)


def train_shipped(arguments):
    keras.utils.set_random_seed(arguments.seed)
    weights_module.quick_arithmetic()
    photos_folder = os.path.join(arguments.work, "backgrounds")
    backgrounds.fetch(photos_folder)
    photos = backgrounds.read(photos_folder)
    photographs = augment.Backgrounds(photos, [], np.full(len(photos), 1 / len(photos)))

    def rendered(worlds, seed, pit_times=1):
        found = []
        for folder, kind, share in PLACES:
            found += scenes_module.render_many(arguments.fovea, os.path.join(arguments.work, folder), -(-worlds * share // 100), 12, seed, kind)
        halls = []
        for folder, kind, share, frames in PITS:
            halls += scenes_module.render_many(arguments.fovea, os.path.join(arguments.work, folder), -(-worlds * share // 100), frames, seed, kind)
        return labelled(found) + pit_times * [(image, labels) for image, labels in labelled(halls) if (labels == PIT).sum() >= PIT_PIXELS]

    scenes, held_out = rendered(arguments.worlds, arguments.data_seed, PIT_TIMES), rendered(max(4, arguments.worlds // 12), arguments.data_seed + 1)
    samples = [(image, of_classes(labels)) for image, labels in whole(held_out, 200, 11)]
    shares = ", ".join(f"{name} {share:.3f}" for name, share in zip(CLASSES, pixels.shares(scenes, OF_LABELS)))
    print(f"{len(photos)} photographs, {len(scenes)} scenes, {len(held_out)} held out; of all pixels {shares}", flush=True)
    model = segmenter.build(len(CLASSES))
    weights_module.load(model, arguments.weights if arguments.resume and os.path.exists(arguments.weights) else weights_module.SHIPPED)
    task = task_of(scenes, len(CLASSES), MOVABLE, OF_LABELS, np.where(np.arange(len(OF_LABELS)) == PIT, PIT_WEIGHT, 1.0), PIT)

    def keep(step):
        weights_module.save(model, arguments.weights)
        if step % SHOWN_EVERY == 0:
            seen = overlap.counts(lambda image: convert.run_float(model, image), samples[:60], len(CLASSES))
            print(f"step {step}: IoU on held out scenes " + ", ".join(f"{n} {v:.3f}" for n, v in zip(CLASSES, overlap.of_counts(seen.sum(0)))), flush=True)

    begun, begun_with = time.monotonic(), [np.array(w) for w in model.get_weights()]
    made = fit.fit(model, scenes, photographs, len(OF_LABELS), arguments.steps, batch=arguments.batch, rate=arguments.rate, seed=arguments.seed, minutes=arguments.minutes,
                   report=lambda line: print(line, flush=True), keep=keep, task=task)
    weights_module.keep(model, arguments.weights)
    if arguments.part < 1:
        fit.go_back(model, begun_with, arguments.part, scenes, photographs, len(OF_LABELS), task)
        weights_module.keep(model, arguments.weights)
    print(f"{made} steps in {(time.monotonic() - begun) / 60:.1f} minutes, {sum(os.times()[:4]) / 60:.1f} of a processor", flush=True)
    finish(model, scenes, samples, CLASSES, COLOURS, arguments.output, task, photographs)


def pictures_shown(scenes, classes):
    """How much of each class each picture shows, in thousands of pixels."""
    return np.array([np.bincount(labels[::2, ::2].ravel(), minlength=256)[:classes] for _, labels in scenes]) * 4 / 1000


def train_own(arguments, begun):
    names, colours, scenes, paths = label_pictures.read(arguments.pictures, arguments.masks, arguments.classes)
    others = None
    if arguments.judge:
        found, _, judged, _ = label_pictures.read(*arguments.judge, arguments.classes)
        others = found, judged

    def end(model, learn, held_out):
        finish(model, learn, whole(held_out, len(held_out), 11), names, colours, arguments.output, task_of(learn, len(names)))

    own.train(own.Kind("thousand pixels", lambda scenes: pictures_shown(scenes, len(names)), segmenter.build, options.SEGMENTER_WEIGHTS, CLASSES,
                       lambda learn: task_of(learn, len(names)), lambda watch: whole(watch, len(watch), 11), end),
              names, scenes, paths, others, arguments, begun)
