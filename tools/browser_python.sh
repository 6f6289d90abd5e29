#!/bin/sh
# Print the Python that drives Chromium in tests of the page, making its environment when it is not there. Chromium and its driver are
# Debian's (tools/install.sh test).
# Usage: tools/browser_python.sh BUILD; fails where the packages cannot be had.
set -eu
python=$1/browser-venv/bin/python
if [ ! -f "$1/browser-venv/ready" ]; then
    python3 -m venv "$1/browser-venv"
    "$python" -m pip install -q --disable-pip-version-check selenium==4.51.0 axe-core-python==0.1.0 >&2
    touch "$1/browser-venv/ready"
fi
echo "$python"
