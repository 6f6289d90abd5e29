#!/bin/sh
# Run a program of a cross build with the libraries of its root (FOVEA_ROOT).
# Usage: tools/package/emulate.sh PROGRAM [ARGUMENT...]
set -eu
libraries=$FOVEA_ROOT/usr/lib/aarch64-linux-gnu
exec qemu-aarch64 -L "$FOVEA_ROOT" -E "LD_LIBRARY_PATH=$libraries:$libraries/blas:$libraries/lapack:$FOVEA_ROOT/lib/aarch64-linux-gnu" "$@"
