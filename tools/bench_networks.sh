#!/bin/sh
# Time the networks of $FOVEA_DATA/models beside LiteRT: table on the terminal, BUILD/bench_networks.json. Then both held to AVX2,
# and what llvm-mca makes of the ARM loops.
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
export BUILD="$build"
# shellcheck disable=SC2086
"$python" tools/import/benchmark.py --program "$build/fovea" --json "$build/bench_networks.json" $models
[ "$(uname -m)" = x86_64 ] || exit 0
# Both held to AVX2: ours by its own choice of kernels, the other by hiding what the processor has beyond.
${CC:-gcc} -O2 -shared -fPIC -o "$build/hold_avx2.so" tools/import/hold_avx2.c
if LD_PRELOAD="$build/hold_avx2.so" env true 2>&1 | grep -q hold_avx2; then
    echo "SKIPPED networks on AVX2 alone: LiteRT cannot be held to it here"
else
    echo "both held to AVX2:"
    # shellcheck disable=SC2086
    LD_PRELOAD="$build/hold_avx2.so" FOVEA_CPU=avx2 "$python" tools/import/benchmark.py --set avx2 --program "$build/fovea" \
        --json "$build/bench_networks_avx2.json" $models
fi
# ARM's matrix products: estimates, and their share of what the core's model does with nothing but products.
tools/mca.py nn_gemm || echo "SKIPPED ARM loops: tools/install.sh cross installs what they need"
