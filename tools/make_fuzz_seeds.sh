#!/bin/sh
# Write the seed inputs of the fuzz targets of recordings and calibrations into tests/fuzz/corpus. Needs a build.
# Usage: tools/make_fuzz_seeds.sh [BUILD]
set -eu
cd "$(dirname "$0")/.."
build=${1:-build}
${CC:-cc} -std=c11 -D_GNU_SOURCE -Iinclude -Isrc -Itests -I"$build/generated" -o "$build/fuzz-seeds" tests/fuzz/seeds.c tests/common/datasets.c tests/common/small_map.c \
    -Wl,--start-group "$build/libfovea-app.a" "$build/libfovea.a" -Wl,--end-group -lyaml -lpng -ljpeg -lz -ldl -llcm -lm
"$build/fuzz-seeds" tests/fuzz/corpus
find tests/fuzz/corpus -type f | sort
