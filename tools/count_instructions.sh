#!/bin/sh
# Count the instructions that aarch64 executes for each kernel on one 752x480 image (plain C and NEON), and for a frame of the
# whole program, with a counting plug-in of qemu. Needs the cross build (make cross, or its targets below).
# Usage: tools/count_instructions.sh [NAME]     kernels whose name contains NAME; without NAME all, and the frame.
set -eu
cd "$(dirname "$0")/.."
name=${1:-}
build=build-aarch64
sysroot=$PWD/$build/sysroot
mkdir -p "$build"
cc -shared -fPIC -O2 tools/count/count.c -o $build/count.so

count() { # command: instructions executed
    qemu-aarch64 -plugin $build/count.so -L /usr/aarch64-linux-gnu \
        -E "LD_LIBRARY_PATH=$sysroot/usr/lib/aarch64-linux-gnu:$sysroot/lib/aarch64-linux-gnu" "$@" 2>&1 >/dev/null |
        sed -n 's/^instructions //p'
}
per_image() { # variant: instructions of one more pass over the image
    echo $((($(count $tests --times 3 "$1") - $(count $tests --times 1 "$1")) / 2))
}

tests=$build/tests/kernels/test_kernels
variants=$(qemu-aarch64 -L /usr/aarch64-linux-gnu \
    -E "LD_LIBRARY_PATH=$sysroot/usr/lib/aarch64-linux-gnu:$sysroot/lib/aarch64-linux-gnu" $tests --list)
echo "| kernel, one image | plain C | best variant | C / best |"
echo "| --- | ---: | ---: | ---: |"
for c in $(echo "$variants" | grep '__c$'); do
    kernel=${c%__c}
    case $kernel in *"$name"*) ;; *) continue ;; esac
    best=$(echo "$variants" | grep "^${kernel}__" | tail -n 1)
    plain=$(per_image "$c")
    fast=$(per_image "$best")
    echo "| $kernel | $plain | $fast (${best##*__}) | $(awk "BEGIN { printf \"%.1f\", $plain / ($fast > 0 ? $fast : 1) }") |"
done
[ -z "$name" ] || exit 0

few=$(count $build/fovea run --source sim: --frames 20 --quiet --timings none)
many=$(count $build/fovea run --source sim: --frames 40 --quiet --timings none)
echo "| whole program per frame, simulated camera included | | $(((many - few) / 20)) | |"
