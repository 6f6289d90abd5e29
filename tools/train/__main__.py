"""tools/train: train an int8 detector and write it as a Fovea model file.

    python3 tools/train own DIR -o MODEL.fvm            pictures with YOLO labels and classes.txt
    python3 tools/train own DIR --coco FILE -o MODEL.fvm
    python3 tools/train shipped                         the detector that comes with Fovea, from rendered scenes

`tools/train.sh` runs this in a Python environment of its own. See README.md beside this file."""
import argparse
import os
import sys
import time

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "2")
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import keras  # noqa: E402
import numpy as np  # noqa: E402

import augment  # noqa: E402
import backgrounds  # noqa: E402
import convert  # noqa: E402
import fit  # noqa: E402
import judge  # noqa: E402
import labels as labels_module  # noqa: E402
import network  # noqa: E402
import scenes as scenes_module  # noqa: E402
import split as split_module  # noqa: E402
import vary  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
WEIGHTS = os.path.join(HERE, "weights.npz")
CALIBRATION_IMAGES = 200  # at most; two of each picture are enough
FEW_PICTURES = 500  # with fewer the first layers stay as they come
FEW_STEPS = 100     # fewer hardly change the weights that come with Fovea
BEGUN = time.monotonic()


def save_weights(model, path, **more):
    """Half precision: the file is read again only to train on from it."""
    named = {v.path.replace("/", "."): np.asarray(v).astype(np.float16) for v in model.weights}
    part = path + ".part.npz"
    np.savez_compressed(part, **named, **more)
    os.replace(part, path)


def load_weights(model, path, new_classes=False):
    """Every weight whose name and shape fit. Of a head for other classes, or where they are new, what tells the box and that there
    is an object; no class is preferred."""
    stored = np.load(path)
    head = next(name.rsplit(".", 1)[0] for name in stored if name.startswith("head"))
    for variable in model.weights:
        name = variable.path.replace("/", ".")
        if name in stored and stored[name].shape == tuple(variable.shape) and not (new_classes and name.startswith("head")):
            variable.assign(stored[name].astype(np.float32))
        elif name.startswith("head"):
            value = np.zeros(variable.shape, np.float32)
            value[..., :5] = stored[head + name[name.rindex("."):]][..., :5]
            variable.assign(value)


def quick_arithmetic():
    """Where the processor multiplies bfloat16 in tiles, train with it: half the time of a step."""
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        if "amx_bf16" in file.read():
            keras.config.set_dtype_policy("mixed_bfloat16")


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
    images = [sampler(rng, scenes, probabilities, photographs, len(names))[0] for _ in range(min(CALIBRATION_IMAGES, 2 * len(scenes)))]
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
    quick_arithmetic()
    photos_folder, scenes_folder = os.path.join(arguments.work, "backgrounds"), os.path.join(arguments.work, "scenes")
    backgrounds.fetch(photos_folder)
    photos, stamps = backgrounds.read(photos_folder), backgrounds.read_stamps(photos_folder)
    photographs = augment.Backgrounds(photos, stamps, np.full(len(photos), 1 / len(photos)))
    scenes = scenes_module.render_many(arguments.fovea, scenes_folder, arguments.worlds, 16, arguments.data_seed)
    held_out = scenes_module.render_many(arguments.fovea, scenes_folder, max(4, arguments.worlds // 12), 16, arguments.data_seed + 1)
    print(f"{len(photos)} photographs, {len(stamps)} stamps, {len(scenes)} scenes, {len(held_out)} held out", flush=True)
    model = network.build(len(scenes_module.CLASSES))
    if arguments.resume and os.path.exists(arguments.weights):
        load_weights(model, arguments.weights)
        photographs = rate_photos(model, photographs)
    fit.fit(model, scenes, photographs, len(scenes_module.CLASSES), arguments.steps, rate=arguments.rate, seed=arguments.seed,
            minutes=arguments.minutes, report=lambda line: print(line, flush=True), keep=lambda step: save_weights(model, arguments.weights))
    save_weights(model, arguments.weights)
    finish(model, scenes, whole(held_out, 200, 11), scenes_module.CLASSES, arguments.output, arguments.score, photographs=photographs)


def read_own(folder, coco=None):
    return labels_module.read_coco(coco, folder) if coco else labels_module.read_yolo(folder)


def earlier(path, names):
    """What a training before has left: (weights' file, names of its judged pictures, steps)."""
    if not os.path.exists(path):
        raise labels_module.LabelProblem(f"--continue: {path}: not there; expected what a training with this output has left")
    with np.load(path) as stored:
        known = [str(n) for n in stored["fovea_names"]]
        if known != names:
            raise labels_module.LabelProblem(f"--continue: {path}: found classes {' '.join(known)[:80]}, expected {' '.join(names)[:80]}")
        return {str(n) for n in stored["fovea_judged"]}, int(stored["fovea_steps"])


def say_split(parts, boxes, names):
    counts = {key: split_module.objects_of([boxes[i] for i in getattr(parts, key)], len(names)).sum(0) if getattr(parts, key) else np.zeros(len(names), int)
              for key in ("learn", "watch", "judge")}
    print(f"{len(names)} classes, {len(boxes)} pictures of {parts.scenes} scenes: {len(parts.learn)} to learn from, {len(parts.watch)} to stop by, "
          f"{len(parts.judge)} held out to judge by; none shares a scene with another part" if not parts.mixed else
          f"{len(names)} classes, {len(boxes)} pictures of one scene: the last {len(parts.judge)} are held out, and figures on them say little about other scenes")
    for c, name in enumerate(names):
        print(f"  {name}: {counts['learn'][c]} objects to learn from, {counts['watch'][c]} to stop by, {counts['judge'][c]} to judge by")


def train_own(arguments):
    keras.utils.set_random_seed(arguments.seed)
    quick_arithmetic()
    names, scenes, paths = read_own(arguments.folder, arguments.coco)
    kept, before, judged = os.path.splitext(arguments.output)[0] + ".training.npz", 0, None
    if getattr(arguments, "continue"):
        judged, before = earlier(kept, names)
    elif arguments.judge:
        judged = set()
    parts = split_module.split([s[0] for s in scenes], paths, [s[2] for s in scenes], len(names), arguments.seed, judged)
    say_split(parts, [s[2] for s in scenes], names)
    learn, watch, held_out = ([scenes[i] for i in part] for part in (parts.learn, parts.watch, parts.judge))
    if not learn:
        raise labels_module.LabelProblem(f"{arguments.folder}: found {len(scenes)} pictures and none left to learn from, expected more")
    if arguments.judge:
        others, held_out, _ = read_own(arguments.judge)
        if others != names:
            raise labels_module.LabelProblem(f"{arguments.judge}: found classes {' '.join(others)[:80]}, expected {' '.join(names)[:80]}")
        print(f"judged by the {len(held_out)} pictures of {arguments.judge}")
    model = network.build(len(names))
    load_weights(model, kept if before else WEIGHTS, new_classes=not before)
    if len(learn) < FEW_PICTURES:
        for layer in model.layers:
            layer.trainable = layer.name.removesuffix("_norm") not in network.EARLY
    aside = [os.path.basename(paths[i]) for i in parts.judge]

    def keep(step):
        save_weights(model, kept, fovea_names=np.array(names), fovea_judged=np.array(aside), fovea_steps=np.array(before + step))

    made = fit.fit(model, learn, None, len(names), arguments.steps, batch=8, rate=5e-4 if before else 1e-3, seed=arguments.seed + before, minutes=arguments.minutes,
                   report=lambda line: print(line, flush=True), keep=keep, begun=BEGUN, rise=20, sampler=vary.sample,
                   watched=whole(watch, len(watch), 11))
    keep(made)
    print(f"{made} steps{f' after {before} before' if before else ''} in {(time.monotonic() - BEGUN) / 60:.1f} minutes, {sum(os.times()[:4]) / 60:.1f} of a processor", flush=True)
    if made < min(FEW_STEPS, arguments.steps):
        print(f"fewer than {FEW_STEPS}: the machine was busy, more --minutes or --continue will help", flush=True)
    finish(model, learn, whole(held_out, len(held_out), 11), names, arguments.output, arguments.score, vary.sample)


def main():
    parser = argparse.ArgumentParser(prog="tools/train", description=__doc__.split("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    own = commands.add_parser("own", help="train on your own pictures")
    own.add_argument("folder", help="pictures, with YOLO labels beside them unless --coco")
    own.add_argument("--coco", help="COCO annotations (JSON)")
    own.add_argument("-o", "--output", required=True, help="the .fvm file to write; a .tflite is left beside it")
    own.add_argument("--minutes", type=float, default=10, help="training ends so long after the start, default 10; quantising and judging come after it")
    own.add_argument("--steps", type=int, default=1500, help="the most steps, of 8 pictures each, default 1500")
    own.add_argument("--judge", metavar="DIR", help="labelled pictures of other scenes to judge by; all of the first folder are then learnt from")
    own.add_argument("--continue", action="store_true", help="go on from the weights that a training with this output has left; what was held out stays so")
    shipped = commands.add_parser("shipped", help="train the detector that comes with Fovea")
    shipped.add_argument("--fovea", default="build/fovea")
    shipped.add_argument("--work", default="build/train", help="where scenes and photographs are kept")
    shipped.add_argument("-o", "--output", default="build/train/detector.fvm")
    shipped.add_argument("--weights", default=WEIGHTS, help="where the float weights are kept")
    shipped.add_argument("--worlds", type=int, default=150)
    shipped.add_argument("--data-seed", type=int, default=1, help="of the rendered worlds, default 1")
    shipped.add_argument("--steps", type=int, default=4000)
    shipped.add_argument("--minutes", type=float, help="at most about so long; the schedule then ends with the time")
    shipped.add_argument("--rate", type=float, default=2e-3)
    shipped.add_argument("--resume", action="store_true", help="go on from --weights")
    for command in (own, shipped):
        command.add_argument("--seed", type=int, default=1)
        command.add_argument("--score", type=float, default=0.3, help="score threshold written into the model, default 0.3")
    arguments = parser.parse_args()
    try:
        train_own(arguments) if arguments.command == "own" else train_shipped(arguments)
    except (labels_module.LabelProblem, OSError) as problem:
        print(problem, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
