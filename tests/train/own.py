"""The parts of `tools/train own` and `own-segmentation` that need no training: pictures are split by scenes, few objects or pictures are no evaluation, samples from a
user's pictures keep their boxes and labels on their objects, and wrong label pictures are refused in one line. The last two need OpenCV (and Pillow), and are skipped without it.

    build/train-venv/bin/python tests/train/own.py"""
import contextlib
import io
import os
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "tools", "train"))

import classes  # noqa: E402
import judge  # noqa: E402
import options  # noqa: E402
import overlap  # noqa: E402
import split  # noqa: E402

wrong = 0


def holds(what, good, found=""):
    global wrong
    wrong += not good
    print(f"{'holds ' if good else 'WRONG '} {what}" + ("" if good else f": {found}"))


def picture(r, like=None):
    """Coarse blocks; `like` another one but for noise."""
    blocks = np.kron(r.integers(0, 256, (12, 16)), np.ones((20, 20))) if like is None else like
    return np.clip(blocks + r.normal(0, 8, blocks.shape), 0, 255).astype(np.uint8)


def box(c, x=10.0, visible=1.0, size=40.0):
    return [c, x, 20.0, x + size, 20.0 + size, visible]


def drawn(r, scenes, each):
    images, names, boxes = [], [], []
    for s in range(scenes):
        first = picture(r)
        for k in range(each):
            images.append(picture(r, first))
            names.append(f"pictures/{s:02}_{k}.png")
            boxes.append(np.array([box(0)] + [box(1)] * (s % 4 == 0), np.float32))
    return images, names, boxes


def refuses(words, option, text):
    """In one line, which names the option, what was found and what was expected."""
    said, status = io.StringIO(), None
    try:
        with contextlib.redirect_stderr(said):
            options.parse([*words, f"{option}={text}"])
    except SystemExit as end:
        status = end.code
    last = said.getvalue().strip().split("\n")[-1]
    holds(f"{option} {text} is refused", status == 2 and f"argument {option}: found {text}, expected a " in last, last)


def wrong_numbers():
    pixels = ["own-segmentation", "pictures", "masks", "-o", "m.fvm"]
    for option, text in (("--minutes", "-5"), ("--minutes", "0"), ("--minutes", "nan"), ("--minutes", "soon"), ("--steps", "0"), ("--steps", "2.5"), ("--seed", "-1")):
        refuses(pixels, option, text)
    refuses(["own", "pictures", "-o", "m.fvm"], "--score", "1.5")
    for option, text in (("--rate", "0"), ("--part", "-0.1"), ("--batch", "0"), ("--worlds", "none"), ("--data-seed", "4294967296")):
        refuses(["shipped-segmentation"], option, text)
    given = options.parse([*pixels, "--minutes=0.5", "--steps=7", "--seed=0"])
    holds("numbers in range are taken", (given.minutes, given.steps, given.seed) == (0.5, 7, 0), given)


def splits():
    r = np.random.default_rng(1)
    images, names, boxes = drawn(r, 20, 3)
    numbers = split.scene_numbers(images, names)
    holds("pictures that are alike are one scene", len(set(numbers)) == 20 and all(numbers[3 * s] == numbers[3 * s + 2] for s in range(20)), numbers)
    parts = split.split(images, names, split.objects_of(boxes, 2), 1)
    whole = sorted(parts.learn + parts.watch + parts.judge)
    holds("every picture is in one part", whole == list(range(60)), whole)
    scenes = [set(numbers[p]) for p in (parts.learn, parts.watch, parts.judge)]
    holds("no scene is in two", not (scenes[0] & scenes[1] or scenes[0] & scenes[2] or scenes[1] & scenes[2]), scenes)
    rare = split.objects_of([boxes[i] for i in parts.judge], 2).sum(0)
    holds("a fifth of the objects of each class is held out", rare[0] == 12 and rare[1] == 3, rare)
    again = split.split(images, names, split.objects_of(boxes, 2), 1)
    holds("the same seed gives the same parts", again == parts)
    kept = split.split(images + [picture(r), picture(r, images[parts.judge[0]])], names + ["pictures/new.png", "pictures/like.png"], split.objects_of([*boxes, boxes[0], boxes[0]], 2), 5,
                       {os.path.basename(names[i]) for i in parts.judge})
    holds("--continue: what was held out stays so, and what is of its scenes", kept.judge == parts.judge + [61], kept.judge)
    by_folder = split.scene_numbers([picture(r) for _ in range(4)], ["a/0.png", "a/1.png", "b/0.png", "b/1.png"])
    holds("a folder is a scene where there are several", list(by_folder) == [0, 0, 1, 1], by_folder)
    first = picture(r)
    one = split.split([picture(r, first) for _ in range(25)], [f"{i}.png" for i in range(25)], np.ones((25, 1), int), 1)
    holds("one scene is said", one.mixed and one.judge == list(range(20, 25)), one)


def judged(objects):
    """AP and lines where every object is found, and beside half of them something that is not there with a higher score."""
    truth = [np.array([box(0)], np.float32)] * objects
    found = [np.array([[0, 10, 20, 50, 60, 0.6]] + [[0, 200, 20, 240, 60, 0.7]] * (i % 2), np.float32) for i in range(objects)]
    figures = judge.figures(found, truth, 1)
    return figures[0], judge.table(["ball"], figures, figures)[1]


def figures():
    (count, value, low, high), line = judged(40)
    holds("a figure stands beside the number of its objects", count == 40 and " 40 " in line and f"{value:.4f}" in line, line)
    holds("its value is the area under the curve", abs(value - 40 / 60) < 1e-6, value)
    holds("and what other pictures would have given", low < value < high and high - low < 0.3, (low, high))
    _, line = judged(3)
    holds(f"3 objects are no evaluation: {line}", "no evaluation: 3 objects" in line and "0." not in line, line)
    truth = [np.array([box(0), box(1, 100), box(1, 200, 0.0)], np.float32)]
    found = [np.array([[1, 10, 20, 50, 60, 0.9], [1, 200, 20, 240, 60, 0.8], [0, 300, 20, 340, 60, 0.7], [0, 300, 120, 340, 160, 0.1]], np.float32)]
    counts = judge.confusion(found, truth, 2, 0.3)
    holds("what is taken for what", counts.tolist() == [[0, 1, 0], [0, 0, 1], [1, 0, 0]], counts.tolist())


def samples():
    try:
        import vary
    except ImportError:
        print("SKIPPED samples of own pictures: no OpenCV in this Python")
        return
    r = np.random.default_rng(2)
    scenes = []
    for _ in range(6):  # white discs on dark ground
        image, rows = r.integers(0, 60, (240, 320)).astype(np.uint8), []
        for x in (60, 160, 250):
            size, y = int(r.integers(24, 50)), int(r.integers(70, 170))
            ys, xs = np.mgrid[0:240, 0:320]
            image[(xs - x) ** 2 + (ys - y) ** 2 < (size / 2) ** 2] = 230
            rows.append([0, x - size / 2, y - size / 2, x + size / 2, y + size / 2, 1.0])
        scenes.append((image, None, np.array(rows, np.float32)))
    kinds = {"turned": lambda s: vary.turn(r, s[0], s[2]), "pasted": lambda s: vary.paste_objects(r, s[0], s[2], vary.crops(scenes)),
             "half hidden": lambda s: vary.hide(r, s[0], s[2])}
    for name, make in kinds.items():
        inside, count = [], 0
        for k in range(60):
            image, boxes = make(scenes[k % 6])
            for b in boxes[boxes[:, 5] > 0.95]:
                x, y, w, h = (b[1] + b[3]) / 2, (b[2] + b[4]) / 2, b[3] - b[1], b[4] - b[2]
                if min(x, y) > 2 and x < image.shape[1] - 2 and y < image.shape[0] - 2:
                    count += 1
                    inside.append(image[int(y), int(x)] > 100 and 0.6 < w / h < 1.7)
        holds(f"{name} objects are where their boxes are ({count})", count > 100 and np.mean(inside) > 0.97, np.mean(inside))
    more = np.mean([len(vary.paste_objects(r, s[0], s[2], vary.crops(scenes))[1]) for s in scenes * 5])
    holds("objects are set on other pictures", more > 4, more)


def overlaps():
    """Two pictures of the network's input: in each a block of class 1 of 8 x 8 pixels is found where the labels have it, or a cell beside."""
    labels = np.zeros((16, 32), np.uint8)
    labels[4:12, 8:16], labels[:, 24:] = 1, overlap.NONE

    def run(shift):
        scores = np.zeros((4, 8, 2))
        scores[..., 0] = 0.5
        scores[1:3, 2 + shift:4 + shift, 1] = 1
        return scores

    counts = overlap.counts(run, [(0, labels), (1, labels)], 2)
    holds("pixels are counted by label and class, unknown ones not", counts.tolist() == [[[320, 0], [0, 64]], [[288, 32], [32, 32]]], counts.tolist())
    values = overlap.of_counts(counts.sum(0))
    holds("their overlap is what both share of either", np.allclose(values, [608 / 672, 96 / 160]), values)
    lines = overlap.table(["ground", "block"], counts, counts)
    holds("a class that few pictures show is no evaluation", "no evaluation: 2 pictures" in lines[2] and "0." not in lines[2], lines[2])
    lines = overlap.table(["ground", "block"], counts[[0, 1, 0, 1]], counts[[0, 1, 0, 1]])
    holds("its value stands beside the number of its pixels and pictures", " 256 " in lines[2] and " 4 " in lines[2] and "0.6000" in lines[2], lines[2])


def known_classes():
    """Two groups of three classes; the layer's last axis is group by group."""
    stored = np.arange(12, dtype=np.float16).reshape(2, 6)
    fresh = np.full((2, 4), 99.0)
    made = classes.carried_over(fresh, stored, ["wall", "grass"], ["floor", "wall", "other"], 2)
    holds("a class keeps what is known of its name, a new one begins", made.tolist() == [[1, 99, 4, 99], [7, 99, 10, 99]], made.tolist())
    same = classes.carried_over(np.zeros((2, 6)), stored, ["floor", "wall", "other"], ["floor", "wall", "other"], 2)
    holds("the same classes keep all", (same == stored).all(), same)


def labelled_pictures():
    try:
        import pixels
    except ImportError:
        print("SKIPPED samples with labels of pixels: no OpenCV in this Python")
        return
    r, wrong_pixels, known = np.random.default_rng(4), [], []
    labels = np.where(np.kron(r.random((6, 8)) < 0.4, np.ones((40, 40))) > 0, 1, 0).astype(np.uint8)
    image = np.where(labels == 1, 220, 30).astype(np.uint8)
    for k in range(60):
        a, b = pixels.turn(r, image, labels) if k % 2 else (image, labels)
        a, b = pixels.place(r, a, b, fixed=k % 3 == 0)
        there = b != overlap.NONE
        wrong_pixels.append(np.mean((a > 125)[there] != (b == 1)[there]))
        known.append(there.mean())
    holds("labels stay on what they label, however it is turned, scaled and mirrored", max(wrong_pixels) < 0.02 and min(known) > 0.3, (max(wrong_pixels), min(known)))
    whole = np.full((480, 640), overlap.NONE, np.uint8)
    whole[:240] = 1
    whole[:2, :4], whole[236:240, 4:6] = 0, overlap.NONE
    cells = pixels.cells(whole, 2)
    finer = [(np.zeros((8, 8), np.uint8), np.repeat(np.array([0, 1, 2, overlap.NONE], np.uint8), 16).reshape(8, 8))]
    weights = pixels.class_weights(finer, np.array([0, 1, 1]))
    holds("labels of one class weigh as the class does", np.allclose(weights, [weights[0], weights[0] / 2**0.5, weights[0] / 2**0.5]), weights)
    holds("a cell has its most frequent class", cells[0, 0] == 0 and cells[0, 1] == 1 and cells[59, 1] == 1 and cells[60, 0] == overlap.NONE, cells[:2, :2])


def refused(read, *arguments):
    from labels import LabelProblem
    try:
        read(*arguments)
    except LabelProblem as problem:
        return str(problem)
    return ""


def label_files():
    try:
        import cv2
        import PIL.Image

        import label_pictures
    except ImportError:
        print("SKIPPED label pictures: no OpenCV or Pillow in this Python")
        return
    with tempfile.TemporaryDirectory() as folder:
        at = {name: os.path.join(folder, name) for name in ("a.png", "classes.txt", "masks", "masks/a.png")}
        os.mkdir(at["masks"])
        classes = os.path.join(at["masks"], "classes.txt")
        os.mkdir(os.path.join(folder, "pictures"))
        picture = os.path.join(folder, "pictures", "a.png")
        cv2.imwrite(picture, np.zeros((6, 8), np.uint8))

        def write(text, values, mode="P"):
            with open(classes, "w", encoding="utf-8") as file:
                file.write(text)
            made = PIL.Image.fromarray(values) if mode != "P" else PIL.Image.fromarray(values, "P")
            if mode == "P":
                made.putpalette([k * 7 % 256 for k in range(768)])
            made.save(at["masks/a.png"])

        def read():
            return label_pictures.read(os.path.join(folder, "pictures"), at["masks"])

        values = np.arange(48, dtype=np.uint8).reshape(6, 8) % 4
        write("0 floor #00ff00\n1 wall #ff0000\n2 floor #00ff00\n3 ignore #000000\n", values)
        names, colours, scenes, _ = read()
        expected = np.array([0, 1, 0, 255], np.uint8)[values]
        holds("numbers of a palette are labels, and several may be one class", names == ["floor", "wall"] and colours == ["#00ff00", "#ff0000"] and
              (scenes[0][1] == expected).all(), (names, colours))
        write("floor\nwall\n", values % 2, "L")
        holds("names alone are the labels from 0 on", read()[0] == ["floor", "wall"] and (read()[2][0][1] == values % 2).all())
        write("floor\nwall\n", values)
        said = refused(read)
        holds(f"a label without a class: {said}", "a.png: found label 2 in 12 pixels, expected" in said and "classes.txt" in said)
        write("floor\nwall\n", values[:5] % 2, "L")
        holds("another size", "found 8 x 5 pixels, expected 8 x 6 as" in refused(read), refused(read))
        write("floor\nwall\n", np.zeros((6, 8, 3), np.uint8), "RGB")
        holds("colours in place of numbers", "found RGB pixels, expected class numbers" in refused(read), refused(read))
        for text, what in (("floor\n", "found 1 classes, expected 2 to 254"), ("0 a\n0 b\n", ":2: found label 0 again"), ("a #00ff00\nb\n", ":2: found no colour"),
                           ("0 a\n300 b\n", ":2: found label 300")):
            write(text, values, "L")
            holds(f"classes {text!r}", what in refused(read), refused(read))
        write("\ufefffloor\nwall\n", values % 2, "L")
        holds("a byte order mark before the classes", read()[0] == ["floor", "wall"], read()[0])
        rig = os.path.join(folder, "rig")
        os.mkdir(rig)
        cv2.imwrite(os.path.join(rig, "0.png"), np.full((6, 8), 99, np.uint8))
        cv2.imwrite(os.path.join(rig, "0.cam1.png"), np.full((6, 8), 99, np.uint8))
        said = refused(lambda: label_pictures.read(rig, rig, classes))
        holds("a picture that would be its own labels", said.startswith(os.path.join(rig, "0.png") + ": found no label picture but"), said)
        cv2.imwrite(os.path.join(rig, "0.mask.png"), (values % 2).astype(np.uint8))
        _, _, scenes, paths = label_pictures.read(rig, rig, classes)
        holds("of an export of a rig the first camera's pictures", paths == [os.path.join(rig, "0.png")] and (scenes[0][1] == values % 2).all(), paths)
        write("floor\nwall\n", values % 2, "L")
        os.remove(at["masks/a.png"])
        holds("a picture without labels", "masks/a.png: not there; expected the labels of " in refused(read), refused(read))


def nothing_to_learn():
    """Pictures to learn from that show no object at all are refused; one object is enough."""
    r = np.random.default_rng(6)
    images, names, boxes = drawn(r, 20, 1)
    none = np.zeros((20, 2), int)
    said = refused(split.hold, split.split(images, names, none, 1), none, "objects", "folder")
    holds(f"no object: {said}", said.startswith("folder: found no objects of any class in ") and said.endswith(" of 20 pictures, those to learn from: expected some"), said)
    objects = split.objects_of(boxes, 2)
    parts = split.split(images, names, objects, 1)
    held_out = objects.copy()
    held_out[parts.learn] = 0
    holds("objects of pictures that are held out are not learnt from", "found no objects of" in refused(split.hold, parts, held_out, "objects", "folder"))
    held_out[parts.learn[0], 1] = 1
    holds("one object", refused(split.hold, parts, held_out, "objects", "folder") == "")


def quietened():
    """What a library writes to the error stream is not shown, unless what it does fails."""
    start = f"import sys; sys.path.insert(0, {os.path.dirname(split.__file__)!r})\nimport os\nfrom quiet import quiet\nwith quiet():\n    os.write(2, b'noise'); print('more', file=sys.stderr)\n"
    for end, expected in (("print('own', file=sys.stderr)", "own\n"), ("", "")):
        done = subprocess.run([sys.executable, "-c", start + end], capture_output=True, text=True, check=False)
        holds("a library's words are kept back", (done.returncode, done.stderr) == (0, expected), done)
    done = subprocess.run([sys.executable, "-c", start + "    raise ValueError('odd')"], capture_output=True, text=True, check=False)
    holds("and shown where it fails", done.returncode == 1 and done.stderr.startswith("noisemore\n") and done.stderr.endswith("ValueError: odd\n"), done)


def evened():
    """What is far away counts by the few cells that it shows."""
    try:
        import segmenter
    except ImportError:
        print("left out: TensorFlow is not there")
        return
    shown = [600, 150, 2400, 10, 9000, 0]
    here = np.stack([(np.arange(120 * 160) < n).reshape(120, 160, 1) for n in shown]).astype(np.float32)
    found = np.asarray(segmenter.even_out(here)).ravel()
    holds("the fewer cells of a pit a picture shows, the more each counts", np.allclose(found, [1, 2, 0.5, 3, 0.5, 3]), found)
    output = np.tile(np.array([4, -4], np.float32), (1, 120, 160, 1))  # class 0 everywhere
    for label in (1, 2):  # both of class 1; the second is evened out
        labels = np.zeros((1, 120, 160), np.uint8)
        labels[0, :10, :15] = label
        plain, even = (float(segmenter.loss_of([1, 1, 1], np.array([0, 1, 1]), e)(labels, output)) for e in (None, 2))
        holds(f"label {label} is {'' if label == 2 else 'not '}evened out", (even > 1.1 * plain) == (label == 2) and (label == 2 or even == plain), (plain, even))


def main():
    wrong_numbers()
    splits()
    figures()
    samples()
    overlaps()
    evened()
    known_classes()
    labelled_pictures()
    label_files()
    nothing_to_learn()
    quietened()
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
