#!/bin/sh
# Print a Python that has what tools/import needs to compare with LiteRT, making its environment when it is not there.
# Usage: tools/networks_python.sh BUILD; fails where the packages cannot be had.
set -eu
python=${FOVEA_PYTHON:-$1/networks-venv/bin/python}
if [ ! -x "$python" ]; then
    python3 -m venv "$1/networks-venv"
    "$python" -m pip install -q --disable-pip-version-check tflite numpy flatbuffers ai-edge-litert pillow pycocotools >&2
fi
echo "$python"
