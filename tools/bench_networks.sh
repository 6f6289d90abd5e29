#!/bin/sh
# Time the networks of $FOVEA_DATA/models beside LiteRT: table on the terminal, BUILD/bench_networks.json.
# Usage: tools/bench_networks.sh BUILD
set -u
build=$1
: "${FOVEA_DATA:=../shared/data}"
models=$(ls "$FOVEA_DATA"/models/*.tflite 2>/dev/null)
if [ -z "$models" ]; then
    echo "SKIPPED networks: no .tflite files in $FOVEA_DATA/models"
    exit 0
fi
python=$(tools/networks_python.sh "$build") || {
    echo "SKIPPED networks: the packages tflite, numpy and ai-edge-litert cannot be installed"
    exit 0
}
make --no-print-directory BUILD="$build" "$build/libfovea.a" "$build/fovea" >/dev/null
# shellcheck disable=SC2086
BUILD=$build "$python" tools/import/benchmark.py --program "$build/fovea" --json "$build/bench_networks.json" $models
