#!/bin/sh
# The int8 engine against LiteRT's reference kernels, bit for bit: every operator, forms of them that real models have, networks
# drawn at random, and every model of $FOVEA_DATA on photographs and noise, on every kernel set of this processor; and operators whose
# sizes the file leaves open.
# Usage: tools/check_networks.sh BUILD [ROUNDS [SETS]]     SETS, as in 'c avx2'; best: the one that runs here
set -u
build=$1
rounds=${2:-20}
: "${FOVEA_DATA:=../shared/data}"
python=$(tools/networks_python.sh "$build") || {
    echo "SKIPPED networks: the packages tflite, numpy and ai-edge-litert cannot be installed"
    exit 0
}
make --no-print-directory BUILD="$build" "$build/libfovea.a" "$build/fovea" >/dev/null
export BUILD="$build"
failed=0
echo "== golden files as committed"
golden=$(mktemp -d)
if "$python" tests/import/make_golden.py "$golden"; then
    for file in nn_operators.bin detector.fvm; do
        cmp "$golden/$file" "tests/golden/$file" || { echo "WRONG  tests/golden/$file: written anew it differs; tests/import/make_golden.py renews it"; failed=1; }
    done
else
    failed=1
fi
rm -r "$golden"
echo "== uses"
"$python" tests/import/uses.py || failed=1
for test in segments named inputs command_line; do
    "$python" "tests/import/$test.py" || failed=1
done
echo "== states"
"$python" tests/import/states.py --rounds "$rounds" || failed=1
echo "== decoders"
"$python" tests/import/decoders.py || failed=1
echo "== segmentation of streets, by LiteRT's reference kernels and numpy alone"
streets=$FOVEA_DATA/street_camvid
labeller=$FOVEA_DATA/models/deeplabv3_mnv2_dm05_pascal_quant.tflite
if [ -d "$streets" ] && [ -f "$labeller" ]; then
    place=$(mktemp -d)
    printf '8 car\n9 person\n10 bicycle\n' >"$place/map"
    "$python" tools/import "$labeller" -o "$place/model.fvm" --labels "$FOVEA_DATA/images/pascal_voc_segmentation_labels.txt" >/dev/null &&
        "$build/fovea" segment --model "$place/model.fvm" "$streets"/img/*.png --evaluate "$streets/annot" --classes-map "$place/map" --json >"$place/found" &&
        "$python" tests/segment/confusion.py "$labeller" "$streets/img" "$streets/annot" "$place/map" "$place/found" car=7 person=15 bicycle=2 || failed=1
    rm -r "$place"
else
    echo "SKIPPED segmentation of streets: no street_camvid and DeepLab in $FOVEA_DATA"
fi
echo "== quantiser"
if quantiser=$(tools/quantiser_python.sh "$build"); then
    "$quantiser" tests/import/quantiser.py || failed=1
    echo "== ONNX files"
    if [ -f "$build/onnx-venv/ready" ] || [ "$rounds" -ge 20 ]; then
        if onnx=$(tools/onnx_python.sh "$build"); then
            "$quantiser" tests/import/from_onnx.py "$onnx" || failed=1
        else
            echo "SKIPPED ONNX files: the package onnx2tf cannot be installed"
        fi
    else
        echo "SKIPPED ONNX files: \`make onnx\` installs their 1.7 GB; \`make campaign\` does"
    fi
else
    echo "SKIPPED quantiser: the package ai-edge-quantizer cannot be installed"
fi
echo "== training: splits and figures"
trainer=build/train-venv/bin/python
[ -x "$trainer" ] || trainer=$python
"$trainer" tests/train/own.py || failed=1
for test in operators variants odd; do
    echo "== $test, sizes left open"
    "$python" "tests/import/$test.py" --open --rounds "$rounds" || failed=1
done
for test in operators odd; do
    echo "== $test, in as many parts as there can be"
    "$python" "tests/import/$test.py" --parts --rounds "$rounds" || failed=1
done
sets="c neon dotprod"
[ "$(uname -m)" = x86_64 ] && sets="c sse4 avx2 avxvnni avx512"
for set in ${3:-$sets}; do
    choice="--set $set"
    [ "$set" = best ] && choice=
    # shellcheck disable=SC2086
    for test in operators variants odd graphs states; do
        echo "== $test, kernel set $set"
        "$python" "tests/import/$test.py" $choice --rounds "$rounds" || failed=1
    done
    for model in "$FOVEA_DATA"/models/*.tflite; do
        [ -f "$model" ] || { echo "SKIPPED models: no .tflite files in $FOVEA_DATA/models"; break; }
        echo "== $(basename "$model"), kernel set $set"
        "$python" tools/import "$model" $choice --check "$FOVEA_DATA"/images/*.jpg "$FOVEA_DATA"/images/*.bmp || failed=1
    done
done
exit $failed
