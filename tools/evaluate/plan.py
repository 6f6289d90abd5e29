"""Which runs a sweep makes: the product of recordings, starts, steps, directions, crops, parameters and versions."""
import hashlib
import itertools
import json
import os
import re
import subprocess
import sys
import tempfile

import one

FRAMES_LEFT = 15  # fewer frames than this are no run worth judging


class Wrong(Exception):
    """Something given is not as it must be: the line to print."""


def numbers(text, what):
    """Of "0-30", "0-60/5" (each 5th), "3,7,11", and mixtures joined by commas."""
    found = []
    for part in text.split(","):
        match = re.fullmatch(r"(\d+)(?:-(\d+)(?:/([1-9]\d*))?)?", part)
        if not match:
            raise Wrong(f"{what}: found {part!r}, expected numbers such as 3,7 or 0-30 or 0-60/5")
        first, last, stride = int(match[1]), int(match[2] or match[1]), int(match[3] or 1)
        if last < first:
            raise Wrong(f"{what}: found {part!r}, expected the lower number first")
        found += range(first, last + 1, stride)
    return found


def braces(text):
    """Of "sim:road?seed={1..100}" the hundred sources; of text without such a range itself."""
    match = re.search(r"\{(\d+)\.\.(\d+)\}", text)
    if not match:
        return [text]
    values = range(int(match[1]), int(match[2]) + 1)
    return [each for value in values for each in braces(text[:match.start()] + str(value) + text[match.end():])]


def parameters(texts):
    """[{key: value}]: the product of "key=value|value" over all keys."""
    rows = []
    for text in texts:
        key, equals, values = text.partition("=")
        if not key or not equals:
            raise Wrong(f"--set: found {text!r}, expected KEY=VALUE or KEY=VALUE|VALUE")
        rows.append([(key, value) for value in values.split("|")])
    return [dict(row) for row in itertools.product(*rows)]


def crop(text):
    """(left, top, right, bottom) pixels of a picture's sides in which no feature is taken; one number: of all sides."""
    values = text.split(",")
    if not all(re.fullmatch(r"\d+", value) for value in values) or len(values) not in (1, 4):
        raise Wrong(f"--crop: found {text!r}, expected pixels, one number or LEFT,TOP,RIGHT,BOTTOM")
    return tuple(int(value) for value in values) * (4 // len(values))


def data_hash(source):
    """Of what a source reads, as far as it is named by a path: names and sizes of all files, and the bytes of small ones."""
    total = hashlib.sha256()
    for path in re.findall(r"(?:euroc|tum|kitti|images|lcmlog|video):([^?\[ ]+)", source):
        if os.path.isfile(path):
            total.update(f"{os.path.getsize(path)}".encode())
        for folder, folders, files in os.walk(path):
            folders.sort()
            for name in sorted(files):
                whole = os.path.join(folder, name)
                size = os.path.getsize(whole)
                total.update(f"{os.path.relpath(whole, path)} {size}\n".encode())
                if name.lower().endswith((".txt", ".csv", ".yaml")) and size < 1 << 22:
                    with open(whole, "rb") as file:
                        total.update(file.read())
    return total.hexdigest()[:16]


def tools_hash():
    """Of the code that measures: results of other measures are other results."""
    total = hashlib.sha256()
    for name in ("metric.py", "metrics.py", "one.py"):
        with open(os.path.join(one.HERE, name), "rb") as file:
            total.update(file.read())
    return total.hexdigest()[:16]


def absolute(source):
    """With absolute paths, so that it means the same wherever a worker stands."""
    def whole(match):
        return match[1] + (os.path.abspath(match[2]) if os.path.exists(match[2]) else match[2])
    return re.sub(r"((?:euroc|tum|kitti|images|lcmlog|video):)([^?\[ ]+)", whole, source)


def probe(binary, source):
    """Frames of a source and the size of its images, by a run without odometry."""
    with tempfile.TemporaryDirectory() as folder:
        stats = os.path.join(folder, "stats.json")
        words = [binary["path"], "run", "--source", source, "--rate", "max", "--picture", "none", "--quiet", "--stats", stats, "--set",
                 "lcm_url=", "--set", "odometry.enabled=false", "--set", "features.count_max=100"]
        done = subprocess.run(words, capture_output=True, text=True, errors="replace",
                              env={**os.environ, "FOVEA_PLUGINS": binary["plugins"]})
        if done.returncode:
            raise Wrong(f"{source}: {one.first_line(done.stderr)}")
        with open(stats, encoding="utf-8") as file:
            read = json.load(file)
        return read["frames"]["in"], (read["width"], read["height"])


def key_of(spec):
    """What makes a run that run: not where its binary stands, nor what it is called."""
    parts = {name: spec[name] for name in ("binary_hash", "source", "data_hash", "start", "step", "frames", "reverse", "crop", "set")}
    return hashlib.sha256(json.dumps([parts, tools_hash()], sort_keys=True).encode()).hexdigest()[:24]


def starts_of(text, frames, step):
    """The start frames; `all`: each that leaves FRAMES_LEFT frames at this step."""
    return range(0, frames - (FRAMES_LEFT - 1) * step) if text == "all" else numbers(text, "--starts")


def specs(binaries, sources, starts="0", steps="1", directions=(False,), frames="0", crops=((0, 0, 0, 0),), sets=({},)):
    """All runs, those of all versions of a run beside each other; what is asked for twice, once."""
    found = {}
    for source in (absolute(each) for text in sources for each in braces(text)):
        data = data_hash(source)
        count, size = probe(binaries[0], source) if starts == "all" or any(map(any, crops)) else (None, None)
        for step, reverse, limit, sides, values in itertools.product(numbers(steps, "--steps"), directions, numbers(frames, "--frames"),
                                                                     crops, sets):
            if any(sides) and (sides[0] + sides[2] >= size[0] or sides[1] + sides[3] >= size[1]):
                raise Wrong(f"--crop: found {','.join(map(str, sides))} of {size[0]} x {size[1]} pixels, expected some to be left")
            for start, binary in itertools.product(starts_of(starts, count, step), binaries):
                spec = {"binary": binary["path"], "binary_hash": binary["hash"], "version": binary["label"], "plugins": binary["plugins"],
                        "source": source, "data_hash": data, "start": start, "step": step, "frames": limit, "reverse": reverse,
                        "crop": list(sides), "size": list(size) if size else None, "set": values}
                spec["run"] = key_of(spec)
                found.setdefault(spec["run"], spec)
    if not found:
        print("sweep: no start leaves enough frames", file=sys.stderr)
    return list(found.values())
