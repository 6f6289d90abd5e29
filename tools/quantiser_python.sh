#!/bin/sh
# Print the Python of `tools/import --quantise`, making its environment when it is not there.
# Usage: tools/quantiser_python.sh BUILD; fails where the packages cannot be had.
set -eu
python=${FOVEA_QUANTISER:-$1/quantiser-venv/bin/python}
if [ ! -f "$1/quantiser-venv/ready" ] && [ -z "${FOVEA_QUANTISER:-}" ]; then
    python3 -m venv "$1/quantiser-venv"
    "$python" -m pip install -q --disable-pip-version-check ai-edge-quantizer==0.10.0 tflite numpy flatbuffers pillow >&2
    touch "$1/quantiser-venv/ready"
fi
echo "$python"
