#!/bin/sh
# Print the Python that tests Foxglove's protocol: a client by websockets, the server of foxglove-sdk to compare with, and what
# tools/foxglove/views.py needs; and put the client of npm's @foxglove/ws-protocol beside it, where there is npm.
# Usage: tools/foxglove_python.sh BUILD; fails where the packages of Python cannot be had.
set -eu
folder=$1/foxglove-venv
python=$folder/bin/python
if [ ! -f "$folder/ready" ]; then
    python3 -m venv "$folder"
    "$python" -m pip install -q --disable-pip-version-check websockets==17.4 foxglove-sdk==0.30.3 foxglove-schemas-protobuf==0.4.0 \
        mcap==1.6.0 mcap-protobuf-support==0.6.0 >&2
    touch "$folder/ready"
fi
if [ ! -f "$folder/npm-ready" ] && command -v npm >/dev/null && command -v node >/dev/null; then
    npm install --silent --no-audit --no-fund --prefix "$folder" @foxglove/ws-protocol@0.8.0 ws@8.18.0 >&2 && touch "$folder/npm-ready" ||
        echo "found no npm packages @foxglove/ws-protocol and ws" >&2
fi
echo "$python"
