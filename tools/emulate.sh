#!/bin/sh
# Run an aarch64 program under qemu, with the libraries that tools/make_sysroot.sh unpacked for it.
# Usage: tools/emulate.sh PROGRAM [ARGUMENT...]     QEMU_PLUGIN=FILE loads a plug-in of qemu
set -eu
libraries=$(cd "$(dirname "$0")/.." && pwd)/build-aarch64/sysroot
exec qemu-aarch64 -L /usr/aarch64-linux-gnu \
    -E "LD_LIBRARY_PATH=$libraries/usr/lib/aarch64-linux-gnu:$libraries/lib/aarch64-linux-gnu" "$@"
