"""One run of `fovea run` and its measures: a function of its specification alone, whoever calls it and wherever. Needs numpy.

The specification is a dictionary of plain values (plan.py makes it). The result has three tables: the run, its maps, its frames.
"""
import contextlib
import fcntl
import glob
import hashlib
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import zlib

import numpy as np

import metrics

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.append(os.path.join(HERE, "..", "subscribers"))

import read_recording  # noqa: E402

# Nothing but poses is wanted of the messages; none of these touches what is computed.
QUIET = ("lcm_url=", "features_every=0", "map_every=0", "statistics_every=0", "camera_status_every=0")
TIMEOUT_S = 3600


class Broken(Exception):
    """The run could not be made here; elsewhere or later it may."""


def hash_file(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def png(width, height, rows):
    """A grey PNG of 8 bits, of rows of bytes."""
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"".join(b"\0" + row for row in rows)))
            + chunk(b"IEND", b""))


def crop_mask(spec, folder):
    """The mask that leaves of each side `crop` pixels without features: the camera and its calibration stay as they are."""
    left, top, right, bottom = spec["crop"]
    width, height = spec["size"]
    inside = bytes(left) + b"\xff" * (width - left - right) + bytes(right)
    path = os.path.join(folder, "mask.png")
    with open(path, "wb") as file:
        file.write(png(width, height, [inside if top <= y < height - bottom else bytes(width) for y in range(height)]))
    return path


def command(spec, folder, more=()):
    """The command line of a run; its files are in `folder`."""
    words = [spec["binary"], "run", "--source", spec["source"], "--rate", "max", "--start", str(spec["start"]), "--step",
             str(spec["step"])]
    if spec["frames"]:
        words += ["--frames", str(spec["frames"])]
    if spec["reverse"]:
        words.append("--reverse")
    for key, value in sorted(spec["set"].items()):
        words += ["--set", f"{key}={value}"]
    if any(spec["crop"]):
        words += ["--set", f"mask={crop_mask(spec, folder)}"]
    for key in QUIET:
        words += ["--set", key]
    return words + list(more)


def read_tum(path):
    """{stamp in nanoseconds: (position, quaternion w x y z)}"""
    poses = {}
    with open(path, encoding="ascii") as file:
        for line in file:
            if line.startswith("#") or not line.strip():
                continue
            word = line.split()
            seconds, _, fraction = word[0].partition(".")
            stamp = int(seconds + fraction.ljust(9, "0"))
            values = [float(text) for text in word[1:]]
            poses[stamp] = (np.array(values[:3]), np.array([values[6], *values[3:6]]))
    return poses


def covariance(upper):
    matrix = np.zeros((6, 6))
    matrix[np.triu_indices(6)] = upper
    return matrix + np.triu(matrix, 1).T


def digest(m):
    """Of all that a pose says, as a signed integer: two runs are the same up to the first frame where it differs."""
    numbers = [m["state"], m["reset_counter"], m["map_id"], *m["position"], *m["orientation"], *m["covariance"], m["quality"],
               m["inliers"], m["reference_keyframe"], *m["keyframe_position"], *m["keyframe_orientation"], m["scale"]]
    return struct.unpack("<q", hashlib.blake2b(struct.pack(f"<{len(numbers)}d", *numbers), digest_size=8).digest())[0]


def read_run(folder):
    """Columns of all frames of a run, from its recording and its trajectories."""
    truth, final = (read_tum(os.path.join(folder, name)) for name in ("truth.tum", "final.tum"))
    poses = [message for _, _, message in read_recording.messages(os.path.join(folder, "run.log"), ["CAMERA_POSE"])]
    stamps = [m["stamp"]["time_ns"] for m in poses]
    nowhere = (np.full(3, np.nan), np.array([1.0, 0, 0, 0]))
    known = [truth.get(stamp, nowhere) for stamp in stamps]
    n = len(poses)
    column = lambda name, kind: np.array([m[name] for m in poses], kind)
    turned = lambda name: np.array([metrics.rotation(m[name]) if np.all(np.isfinite(m[name])) and any(m[name]) else np.eye(3)
                                    for m in poses]).reshape(n, 3, 3)
    return {
        "frame": np.array([m["stamp"]["sequence"] for m in poses], np.int64), "stamp_ns": np.array(stamps, np.int64),
        "metric": column("scale_state", np.int8) == 2, "state": column("state", np.int8), "map": column("map_id", np.int32), "reset": column("reset_counter", np.int32),
        "quality": column("quality", np.float32), "inliers": column("inliers", np.int32),
        "position": column("position", float).reshape(n, 3), "R": turned("orientation"),
        "covariance": np.array([covariance(m["covariance"]) for m in poses]).reshape(n, 6, 6),
        "velocity": column("velocity", float).reshape(n, 3),
        "velocity_covariance": np.array([covariance(m["velocity_covariance"]) for m in poses]).reshape(n, 6, 6),
        "gravity": column("gravity", float).reshape(n, 3), "gravity_sigma": column("gravity_sigma", float),
        "scale_sigma": column("scale_sigma", float),
        "keyframe": column("reference_keyframe", np.int64), "keyframe_stamp_ns": column("keyframe_stamp_ns", np.int64),
        "keyframe_position": column("keyframe_position", float).reshape(n, 3), "keyframe_R": turned("keyframe_orientation"),
        "change_count": column("change_count", np.int32),
        "change": [(m["change_scale"], metrics.rotation(m["change_orientation"]), np.array(m["change_position"]))
                   if np.isfinite(m["change_scale"]) else (1.0, np.eye(3), np.zeros(3)) for m in poses],
        "has_truth": np.array([stamp in truth for stamp in stamps], bool),
        "truth_position": np.array([p for p, _ in known]).reshape(n, 3),
        "truth_R": np.array([metrics.rotation(q) for _, q in known]).reshape(n, 3, 3),
        "final": np.array([final.get(stamp, nowhere)[0] for stamp in stamps]).reshape(n, 3),
        "digest": np.array([digest(m) for m in poses], np.int64),
    }


def frames_table(key, run):
    """What is kept of each frame, in metres of the truth's world."""
    table = {"run": [key] * len(run["frame"]), "i": np.arange(len(run["frame"]), dtype=np.int32)}
    for name in ("frame", "stamp_ns", "state", "map", "reset", "quality", "inliers", "keyframe", "digest", "error_m", "sigma_m",
                 "local_scale", "velocity_nees", "gravity_deg"):
        table[name] = run[name]
    for axis, letter in enumerate("xyz"):
        table[letter] = run["aligned"][:, axis]
        table["truth_" + letter] = run["truth_position"][:, axis]
    for name in ("keyframe", "apart"):
        for k, what in enumerate(("error_m", "error_deg", "nees")):
            table[f"{name}_{what}"] = run[f"{name}_error"][:, k]
    table["apart_sigma_m"] = run["apart_error"][:, 3]
    return {name: values.tolist() if isinstance(values, np.ndarray) else values for name, values in table.items()}


def first_line(text):
    return text.strip().splitlines()[0][:500] if text.strip() else ""


def remove_left(place):
    """Remove the scratch folders of workers that were killed: those whose lock nobody holds."""
    for folder in glob.glob(os.path.join(place, "fovea-sweep-*")):
        try:
            if time.time() - os.stat(folder).st_mtime < 60:  # perhaps made just now, and not locked yet
                continue
            with open(os.path.join(folder, "lock"), "wb") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)
        except OSError:  # in use, another user's, or gone
            continue


@contextlib.contextmanager
def scratch_folder():
    """In memory where there is room: a recording holds all frames, and is read once."""
    memory = "/dev/shm"
    roomy = os.access(memory, os.W_OK) and shutil.disk_usage(memory).free > 2 << 30
    place = memory if roomy else tempfile.gettempdir()
    remove_left(place)
    folder = tempfile.mkdtemp(prefix="fovea-sweep-", dir=place)
    try:
        with open(os.path.join(folder, "lock"), "wb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def run(spec):
    """The three tables of a run, as lists of rows (run, maps) and as columns (frames)."""
    try:
        found = hash_file(spec["binary"])
    except OSError as why:
        raise Broken(f"{spec['binary']}: {why.strerror}") from why
    if found != spec["binary_hash"]:
        raise Broken(f"{spec['binary']}: found a binary of hash {found[:12]}, expected {spec['binary_hash'][:12]}")
    with scratch_folder() as folder:
        return measure(spec, folder)


def measure(spec, folder):
    at = lambda name: os.path.join(folder, name)
    words = command(spec, folder, ["--picture", "none", "--quiet", "--record", at("run.log"), "--truth", at("truth.tum"), "--stats",
                                   at("stats.json"), "--trajectory-final", at("final.tum")])
    begin = time.monotonic()
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=TIMEOUT_S, errors="replace",
                              env={**os.environ, "FOVEA_PLUGINS": spec["plugins"]})
    except subprocess.TimeoutExpired as why:
        raise Broken(f"{spec['source']}: no end after {TIMEOUT_S} s") from why
    if done.returncode in (-9, -15):
        raise Broken(f"{spec['source']}: killed by signal {-done.returncode}")
    row = {name: spec[name] for name in ("run", "binary_hash", "version", "source", "start", "step", "reverse", "data_hash")}
    row.update(frames_max=spec["frames"], crop=",".join(map(str, spec["crop"])), set=json.dumps(spec["set"], sort_keys=True),
               status=done.returncode, complaint=first_line(done.stderr) if done.returncode else "",
               wall_s=time.monotonic() - begin)
    if done.returncode:
        return {"run": row, "maps": [], "frames": None}
    with open(at("stats.json"), encoding="utf-8") as file:
        stats = json.load(file)
    columns = read_run(folder)
    maps = metrics.judge(columns, spec["source"])
    counted = np.bincount(columns["state"], minlength=len(metrics.STATES))
    row.update({f"frames_{name}": int(n) for name, n in zip(metrics.STATES, counted)})
    row.update(frames=len(columns["frame"]), width=stats["width"], height=stats["height"], kernel_set=stats["kernel_set"],
               maps=len(np.unique(columns["map"][columns["map"] >= 0])), mean_ms=stats["frame"]["mean_ns"] * 1e-6,
               p99_ms=stats["frame"]["p99_ns"] * 1e-6, resident_mib=stats["resident_bytes"] / 2**20,
               digest=hashlib.sha256(columns["digest"].tobytes()).hexdigest()[:16])
    for each in maps:
        each["run"] = spec["run"]
    return {"run": row, "maps": maps, "frames": frames_table(spec["run"], columns)}
