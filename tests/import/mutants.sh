#!/bin/sh
# Damaged .tflite files, imported and run with the engine under asan+ubsan; see mutants.py.
# Usage: tests/import/mutants.sh [COUNT [FIRST]]
set -u
cd "$(dirname "$0")/../.."
python=$(tools/networks_python.sh build) || {
    echo "SKIPPED mutants: the packages tflite and numpy cannot be installed"
    exit 0
}
make --no-print-directory BUILD=build-asan SAN=asan build-asan/libfovea.a || exit 1
library=$PWD/build-asan/libfovea-internal.so
clang++ -shared -shared-libsan -fsanitize=address,undefined -o "$library" -Wl,--whole-archive build-asan/libfovea.a -Wl,--no-whole-archive \
    -llcm -ljpeg -pthread || exit 1
# Python's own memory is of no concern, nor what it leaks.
LD_PRELOAD=$(clang -print-file-name="libclang_rt.asan-$(uname -m).so") ASAN_OPTIONS=detect_leaks=0:allocator_may_return_null=1 \
    UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1 FOVEA_LIBRARY=$library exec "$python" tests/import/mutants.py "${1:-2000}" "${2:-0}"
