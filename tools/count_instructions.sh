#!/bin/sh
# Count the instructions that aarch64 executes, with a counting plug-in of qemu: for each kernel on one 752x480 image (plain C
# and the best NEON), and for a frame of the whole program. Needs make all, and the cross build of make cross.
# Usage: tools/count_instructions.sh [NAME]     kernels whose name contains NAME; without NAME all, and the frame.
set -eu
cd "$(dirname "$0")/.."
name=${1:-}
build=build-aarch64
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cc -shared -fPIC -O2 tools/count/count.c -o "$work/count.so"

count() { # command: instructions executed
    QEMU_PLUGIN=$work/count.so tools/emulate.sh "$@" 2>&1 >/dev/null | sed -n 's/^instructions //p'
}
per_image() { # variant: instructions of one more pass over the image
    echo $((($(count $tests --times 3 "$1") - $(count $tests --times 1 "$1")) / 2))
}
line() { # name, plain C, best, its set
    echo "| $1 | $2 | $3 ($4) | $(awk "BEGIN { printf \"%.1f\", $2 / ($3 > 0 ? $3 : 1) }") |"
}

tests=$build/tests/kernels/test_kernels
variants=$(tools/emulate.sh $tests --list)
echo "| what | plain C | best variant | C / best |"
echo "| --- | ---: | ---: | ---: |"
for c in $(echo "$variants" | grep '__c$'); do
    kernel=${c%__c}
    case $kernel in *"$name"*) ;; *) continue ;; esac
    best=$(echo "$variants" | grep "^${kernel}__" | tail -n 1)
    line "$kernel" "$(per_image "$c")" "$(per_image "$best")" "${best##*__}"
done
[ -z "$name" ] || exit 0

# The frame: all that the program does with a frame of a recording, from taking it to sending its messages.
build/fovea run --source sim:orbit --frames 40 --quiet --picture none --record "$work/run.lcm" >/dev/null
per_frame() { # kernel set
    replayed="run --source lcmlog:$work/run.lcm --quiet --picture none --frames"
    # shellcheck disable=SC2086
    echo $((($(FOVEA_CPU=$1 count $build/fovea $replayed 40) - $(FOVEA_CPU=$1 count $build/fovea $replayed 20)) / 20))
}
line "frame of the whole program, sim:orbit 640x480" "$(per_frame c)" "$(per_frame i8mm)" best
