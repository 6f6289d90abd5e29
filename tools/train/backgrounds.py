"""Background photographs without objects: images that come with Debian packages, unpacked and not installed."""
import glob
import os
import subprocess
import zipfile

import cv2
import numpy as np

PACKAGES = ["plasma-workspace-wallpapers", "lomiri-wallpapers-16.04", "lomiri-wallpapers-20.04", "ukui-wallpapers", "gnome-backgrounds",
            "mate-backgrounds", "hugin-data", "python3-skimage", "opencv-doc", "ufoai-textures", "tuxpaint-stamps-default"]
# Pictures of the package that show what the detector looks for, or are drawings of no use.
SKIP = ("fruits", "messi", "lena", "basketball", "vtest", "trimap", "matte", "mask", "doxygen", "inline_umlgraph", "/html/classcv",
        "/html/struct", "/stamps/", "_nm.", "_sm.", "_gm.", "_rm.", "tex_misc", "tex_trak", "tex_alien", "tex_lights", "tex_base", "tex_ctp1",
        "tex_material", "tex_furniture", "tex_tech", "tex_ufo", "crate", "tex_pics")
# Cut out things that are none of the classes.
STAMPS = ["animals", "vehicles", "plants", "town", "household", "military", "clothes", "hobbies/music"]
LONGEST, SHORTEST_PX, SMALLEST_BYTES = 1400, 240, 20000


def fetch(folder):
    """Downloads and unpacks the packages once."""
    os.makedirs(folder, exist_ok=True)
    for package in PACKAGES:
        target = os.path.join(folder, package)
        if os.path.isdir(target):
            continue
        subprocess.run(["apt-get", "download", "-qq", package], cwd=folder, check=True, stderr=subprocess.DEVNULL)
        archive = glob.glob(os.path.join(folder, package + "_*.deb"))[0]
        subprocess.run(["dpkg-deb", "-x", archive, target + ".part"], check=True)
        for packed in glob.glob(os.path.join(target + ".part", "**", "*.pk3"), recursive=True):
            with zipfile.ZipFile(packed) as file:
                file.extractall(packed + ".files")
            os.remove(packed)
        os.rename(target + ".part", target)
        os.remove(archive)


def read(folder):
    """All photographs as grey images, sorted by path; small ones and drawings are left out."""
    photos, seen = [], set()
    for path in sorted(glob.glob(os.path.join(folder, "**", "*"), recursive=True)):
        if not path.lower().endswith((".jpg", ".jpeg", ".png", ".webp")) or os.path.islink(path):
            continue
        size = os.path.getsize(path)
        if size < SMALLEST_BYTES or any(word in path.lower() for word in SKIP) or (size, os.path.basename(path)) in seen:
            continue
        seen.add((size, os.path.basename(path)))
        image = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
        if image is None or min(image.shape) < SHORTEST_PX or len(set(image[::16, ::16].ravel())) < 64:
            continue
        factor = LONGEST / max(image.shape)
        photos.append(cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA) if factor < 1 else image)
    return photos


def read_stamps(folder):
    """The cut out things, as (grey, alpha from 0 to 1), at most 300 px."""
    stamps = []
    for kind in STAMPS:
        for path in sorted(glob.glob(os.path.join(folder, "**", "stamps", kind, "**", "*.png"), recursive=True)):
            image = cv2.imread(path, cv2.IMREAD_UNCHANGED)
            if image is None or image.ndim != 3 or image.shape[2] != 4 or max(image.shape) < 60:
                continue
            factor = min(1.0, 300 / max(image.shape))
            image = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
            stamps.append((cv2.cvtColor(image[..., :3], cv2.COLOR_BGR2GRAY), image[..., 3].astype(np.float32) / 255))
    return stamps
