#!/bin/sh
# tools/train in a Python environment of its own, made at the first call (TensorFlow: about 1.5 GB under build/).
# Usage: tools/train.sh own DIR -o MODEL.fvm | own-segmentation PICTURES MASKS -o MODEL.fvm | shipped | shipped-segmentation    (--help; of each, too: its options)
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
venv=$here/build/train-venv
[ $# -gt 0 ] || set -- --help
command -v python3 >/dev/null || "$here/tools/install.sh" test
for word; do # printed without making the environment
    case $word in
    -h | --help) exec python3 "$here/tools/train/options.py" "$@" ;;
    esac
done
python3 "$here/tools/train/options.py" "$@"
if [ ! -e "$venv/ready2" ]; then
    "$here/tools/install.sh" test
    python3 -m venv "$venv"
    "$venv/bin/pip" install -q --no-compile tensorflow-cpu==2.21.0 opencv-python-headless numpy tflite pillow
    touch "$venv/ready2"
fi
exec "$venv/bin/python" "$here/tools/train" "$@"
