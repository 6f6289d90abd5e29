#!/bin/sh
# Print the Python of tools/mcap.py, making its environment when it is not there.
# Usage: tools/mcap_python.sh BUILD; fails where the packages cannot be had.
set -eu
python=$1/mcap-venv/bin/python
if [ ! -f "$1/mcap-venv/ready" ]; then
    python3 -m venv "$1/mcap-venv"
    "$python" -m pip install -q --disable-pip-version-check mcap==1.6.0 mcap-protobuf-support==0.6.0 foxglove-schemas-protobuf==0.4.0 >&2
    touch "$1/mcap-venv/ready"
fi
echo "$python"
