#!/bin/sh
# tools/train in a Python environment of its own, made at the first call (TensorFlow: about 1.5 GB under build/).
# Usage: tools/train.sh own DIR -o MODEL.fvm | own-segmentation PICTURES MASKS -o MODEL.fvm | shipped | shipped-segmentation    (--help: the options)
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
venv=$here/build/train-venv
case " $* " in
"  " | *" --help "* | *" -h "*)
    sed -n '2,3s/^# //p' "$0"
    sed -n '/^"""/,/"""$/{s/"""//g;p}' "$here/tools/train/__main__.py"
    exit 0
    ;;
esac
if [ ! -e "$venv/ready2" ]; then
    "$here/tools/install.sh" test
    python3 -m venv "$venv"
    "$venv/bin/pip" install -q --no-compile tensorflow-cpu==2.21.0 opencv-python-headless numpy tflite pillow
    touch "$venv/ready2"
fi
exec "$venv/bin/python" "$here/tools/train" "$@"
