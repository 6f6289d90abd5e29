#!/bin/sh
# Print the Python of tools/examples/obstacle_distance.py, making its environment when it is not there.
# Usage: tools/mavlink_python.sh BUILD; fails where the packages cannot be had.
set -eu
python=$1/mavlink-venv/bin/python
if [ ! -f "$1/mavlink-venv/ready" ]; then
    python3 -m venv "$1/mavlink-venv"
    timeout 180 "$python" -m pip install -q --disable-pip-version-check lcm==1.5.3 pymavlink==2.4.50 >&2
    touch "$1/mavlink-venv/ready"
fi
echo "$python"
