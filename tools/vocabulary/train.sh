#!/bin/sh
# Train src/map/vocabulary.bin again: simulated frames of several worlds, the pictures of Debian's opencv-doc and of
# scikit-image (PyPI). The committed file came from SEED and scikit-image's version below; the same ones give the same bytes.
# Usage: tools/vocabulary/train.sh [OUTPUT]
set -eu
cd "$(dirname "$0")/../.."
seed=1
skimage=0.26.0
output=${1:-src/map/vocabulary.bin}
build=${BUILD:-build}

tools/install.sh build bench
make --no-print-directory -j"$(nproc)" BUILD="$build" "$build/train-vocabulary"
[ -d "$build/vocabulary/skimage" ] || {
    python3 -m venv "$build/vocabulary/venv"
    "$build/vocabulary/venv/bin/pip" download -q --no-deps -d "$build/vocabulary" "scikit-image==$skimage"
    python3 -m zipfile -e "$build"/vocabulary/scikit_image-*.whl "$build/vocabulary"
}

list=$build/vocabulary/list
{
    find /usr/share/doc/opencv-doc/examples/data -maxdepth 1 \( -name '*.jpg' -o -name '*.png' \)
    find "$build/vocabulary/skimage/data" \( -name '*.jpg' -o -name '*.png' \)
} | LC_ALL=C sort >"$list"
for n in 1 2 3 4 5 6; do
    echo "sim:tour?seed=10$n&frames=2040 68"
    echo "sim:corridor?seed=20$n&frames=1290 86"
    echo "sim:wander?seed=30$n&frames=3000 150"
    echo "sim:orbit?seed=40$n&width=752&height=480&frames=900 60"
done >>"$list"
"$build/train-vocabulary" "$seed" "$output" "$list"
