#!/bin/sh
# A recording replays bit for bit wherever it was made: every kernel set, gcc and clang, libc's FMA and AVX2 variants masked,
# and aarch64 under qemu, in both directions. Builds that do not exist are named and skipped, unless --all asks for them.
# Usage: tests/replay/everywhere.sh [--all] [FRAMES]
set -u
cd "$(dirname "$0")/../.."
all=
[ "${1:-}" = --all ] && all=1 && shift
frames=${1:-200}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
failures=0 checks=0

run() { # run NAME COMMAND...: count it, show the output of what failed
    name=$1
    shift
    checks=$((checks + 1))
    if "$@" >"$folder/out" 2>&1; then
        echo "ok    $name"
    else
        echo "FAILED $name"
        tail -n 5 "$folder/out"
        failures=$((failures + 1))
    fi
}

have() {
    [ -x "$1" ] && return 0
    echo "SKIPPED $1: not built"
    [ -n "$all" ] && failures=$((failures + 1))
    return 1
}

record() { # record LOG COMMAND...
    log=$1
    shift
    # shellcheck disable=SC2086 # the model only with --all: its network takes an emulator as long as all else
    "$@" run --source 'sim:?seed=5&width=320&height=240' --frames "$frames" --record "$log" --set preview.period_frames=7 ${all:+--model src/detect/shipped.fvm}
}

run "record on x86" record "$folder/x86.lcm" build/fovea
sets=
for set in c sse4 avx2 avx512; do
    if grep -q "$(echo $set | sed 's/sse4/sse4_2/;s/avx512/avx512bw/;s/^c$/fpu/')" /proc/cpuinfo; then
        sets="$sets $set"
        run "replay with FOVEA_CPU=$set" env FOVEA_CPU=$set build/fovea replay "$folder/x86.lcm" --verify
    else
        echo "SKIPPED FOVEA_CPU=$set: this processor lacks it"
    fi
done
run "replay with libc's FMA and AVX2 masked" env \
    GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2_Usable,-AVX2,-FMA_Usable,-FMA,-FMA4_Usable,-AVX512F,-ERMS \
    build/fovea replay "$folder/x86.lcm" --verify
have build-clang/fovea && run "replay with the clang build" build-clang/fovea replay "$folder/x86.lcm" --verify
if have build-aarch64/fovea; then
    run "replay the x86 recording on aarch64" tools/emulate.sh build-aarch64/fovea replay "$folder/x86.lcm" --verify
    for set in c ${all:+neon dotprod}; do # without a cap it is i8mm
        run "replay it on aarch64 with FOVEA_CPU=$set" env FOVEA_CPU=$set tools/emulate.sh build-aarch64/fovea replay "$folder/x86.lcm" --verify
    done
    run "record on aarch64" record "$folder/arm.lcm" tools/emulate.sh build-aarch64/fovea
    run "replay the aarch64 recording on x86" build/fovea replay "$folder/arm.lcm" --verify
fi
# Across a loop: a corridor seen at 8 Hz, which comes round and closes. Loops and their graphs are float work from end to end.
record_loop() {
    build/fovea run --source 'sim:corridor?seed=1&width=240&height=180&rate=8' --record "$folder/loop.lcm" --picture none \
        --set preview.period_frames=0 --set lcm_url= | tee "$folder/loop.txt"
    grep -q ' 1 loop closed' "$folder/loop.txt"
}
run "record a loop on x86" record_loop
for set in $sets; do
    [ "$set" = c ] && [ -z "$all" ] && continue # ten times as long; they replay the shorter run above
    run "replay the loop with FOVEA_CPU=$set" env FOVEA_CPU=$set build/fovea replay "$folder/loop.lcm" --verify
done
[ -x build-clang/fovea ] && run "replay the loop with the clang build" build-clang/fovea replay "$folder/loop.lcm" --verify
[ -x build-aarch64/fovea ] && run "replay the loop on aarch64" tools/emulate.sh build-aarch64/fovea replay "$folder/loop.lcm" --verify
# Each further run must itself replay to what it sent: none of the three holds a message that depends on the run.
for again in 1 2 3; do
    run "record again ($again)" record "$folder/again$again.lcm" build/fovea
    run "replay that run ($again)" build/fovea replay "$folder/again$again.lcm" --verify
done
echo "$((checks - failures)) passed, $failures failed"
[ $failures -eq 0 ]
