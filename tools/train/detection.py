"""Networks that find objects: training of the one that comes with Fovea, and of a user's own."""
import os

import keras
import numpy as np

import augment
import backgrounds
import convert
import fit
import judge
import labels as labels_module
import network
import own
import scenes as scenes_module
import split
import vary
import weights


def rate_photos(model, photographs):
    """Draws the photographs more often in which the network sees objects that are not there (hard negatives)."""
    rng, found = np.random.default_rng(5), []
    for k in range(len(photographs.photos)):
        only = augment.Backgrounds(photographs.photos[k:k + 1], [], np.ones(1))
        found.append(len(convert.decode(convert.run_float(model, augment.photo_crop(rng, only, augment.WIDTH, augment.HEIGHT)), 0.2)))
    probability = 1.0 + np.minimum(found, 8) / 2
    print(f"{sum(found)} boxes seen on {len(found)} photographs", flush=True)
    return photographs._replace(probability=probability / probability.sum())


def whole(scenes, count, seed):
    """Scenes as the network sees them in use, and what counts in them: (image, rows of class, corners, 0 or 1)."""
    rng = np.random.default_rng(seed)
    chosen = [scenes[i] for i in rng.permutation(len(scenes))[:count]]
    samples = []
    for image, _, boxes in chosen:
        small, moved = augment.place(rng, image, boxes, fixed=True)
        size = np.maximum(moved[:, 3] - moved[:, 1], moved[:, 4] - moved[:, 2])
        moved[:, 5] = (moved[:, 5] >= augment.VISIBLE_MIN) & (size >= augment.SIZE_MIN)
        samples.append((small, moved))
    return samples


def finish(trained, scenes, samples, names, output, score, sampler=augment.sample, photographs=None):
    """Quantise, compare on `samples` and write OUTPUT (.fvm), the .tflite beside it and what is taken for what."""
    keras.config.set_dtype_policy("float32")
    model = network.build(len(names))
    model.set_weights(trained.get_weights())
    rng, probabilities = np.random.default_rng(7), augment.scene_probabilities(scenes)
    images = [sampler(rng, scenes, probabilities, photographs, len(names))[0] for _ in range(min(weights.CALIBRATION_IMAGES, 2 * len(scenes)))]
    data = convert.to_tflite(model, images)
    tflite = os.path.splitext(output)[0] + ".tflite"
    with open(tflite, "wb") as file:
        file.write(data)
    if samples:
        found = convert.compare(model, data, samples, names)
        picture = os.path.splitext(output)[0] + ".confusion.png"
        judge.draw_confusion(picture, judge.confusion(found, [boxes for _, boxes in samples], len(names), score), names)
        print(f"{picture}: which class is found as which, at a score of {score:g}")
    convert.to_fvm(tflite, output, names, score)


def train_shipped(arguments):
    keras.utils.set_random_seed(arguments.seed)
    weights.quick_arithmetic()
    photos_folder, scenes_folder = os.path.join(arguments.work, "backgrounds"), os.path.join(arguments.work, "scenes")
    backgrounds.fetch(photos_folder)
    photos, stamps = backgrounds.read(photos_folder), backgrounds.read_stamps(photos_folder)
    photographs = augment.Backgrounds(photos, stamps, np.full(len(photos), 1 / len(photos)))
    scenes = scenes_module.render_many(arguments.fovea, scenes_folder, arguments.worlds, 16, arguments.data_seed)
    held_out = scenes_module.render_many(arguments.fovea, scenes_folder, max(4, arguments.worlds // 12), 16, arguments.data_seed + 1)
    print(f"{len(photos)} photographs, {len(stamps)} stamps, {len(scenes)} scenes, {len(held_out)} held out", flush=True)
    model = network.build(len(scenes_module.CLASSES))
    if arguments.resume and os.path.exists(arguments.weights):
        weights.load(model, arguments.weights)
        photographs = rate_photos(model, photographs)
    fit.fit(model, scenes, photographs, len(scenes_module.CLASSES), arguments.steps, batch=arguments.batch, rate=arguments.rate, seed=arguments.seed,
            minutes=arguments.minutes, report=lambda line: print(line, flush=True), keep=lambda step: weights.save(model, arguments.weights))
    weights.save(model, arguments.weights)
    finish(model, scenes, whole(held_out, 200, 11), scenes_module.CLASSES, arguments.output, arguments.score, photographs=photographs)


def read_own(folder, coco=None):
    return labels_module.read_coco(coco, folder) if coco else labels_module.read_yolo(folder)


def train_own(arguments, begun):
    names, scenes, paths = read_own(arguments.folder, arguments.coco)
    others = read_own(arguments.judge)[:2] if arguments.judge else None

    def end(model, learn, held_out):
        finish(model, learn, whole(held_out, len(held_out), 11), names, arguments.output, arguments.score, vary.sample)

    own.train(own.Kind("objects", lambda scenes: split.objects_of([s[2] for s in scenes], len(names)), network.build, weights.SHIPPED, [],
                       lambda _: fit.DETECTION._replace(sample=vary.sample), lambda watch: whole(watch, len(watch), 11), end),
              names, scenes, paths, others, arguments, begun)
