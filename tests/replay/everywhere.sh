#!/bin/bash
# A recording replays bit for bit wherever it was made: every kernel set, gcc and clang, libc's FMA and AVX2 variants masked,
# and aarch64 under qemu, in both directions; a bit that is flipped in a run on aarch64 is named. Builds that do not exist are named and
# skipped, unless --all asks for them.
# Usage: tests/replay/everywhere.sh [--all] [FRAMES]
set -u
cd "$(dirname "$0")/../.."
all=
[ "${1:-}" = --all ] && all=1 && shift
frames=${1:-200}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
failures=0

# As many at a time as there are processors; `wait` waits for all of them.
run() { # run NAME COMMAND...: in the background; its verdict and, if it failed, the end of its output
    while [ "$(jobs -pr | wc -l)" -ge "$(nproc)" ]; do wait -n; done
    {
        name=$1
        shift
        out=$(mktemp -p "$folder")
        if "$@" >"$out" 2>&1; then
            echo "ok    $name"
        else
            echo "FAILED $name"
            tail -n 5 "$out" | sed 's/^/    /'
        fi | tee -a "$folder/verdicts"
    } &
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
    "$@" run --source 'sim:?seed=5&width=320&height=240&imu=200' --frames "$frames" --record "$log" --set preview.period_frames=7 \
        --set "image.operations=[denoise, contrast_enhancement, sharpen, normalize]" --set "image.seen_by=[features, networks]" --set edges.period_frames=5 --set edges.segments=true --set lockstep_every=1 ${all:+--model src/detect/shipped.fvm}
}

# What was seen by a corridor at 8 Hz, which returns to its start: closures and their graphs are float work from end to end.
record_loop() {
    build/fovea run --source 'sim:corridor?seed=1&width=240&height=180&rate=8' --record "$folder/loop.lcm" --picture none \
        --set preview.period_frames=0 --set lcm_url= | tee "$folder/loop.txt"
    grep -q ' 1 closure' "$folder/loop.txt"
}
# A short way with each further method of features, past the first map, one with two cameras and one with an IMU beside them.
methods="orb harris shi_tomasi stereo inertial"
record_method() {
    method=$1 rig= settings=
    [ "$1" = stereo ] && method=fast rig='&camera2=0.1,0,0,0,-4,3'
    [ "$1" = inertial ] && method=fast rig='&baseline=0.1&imu=200&gravity=9.78' settings='--set odometry.gravity_m_s2=9.78'
    # shellcheck disable=SC2086 # several words or none
    build/fovea run --source "sim:orbit?seed=3&width=320&height=240$rig" --frames 40 $settings --record "$folder/$1.lcm" --picture none \
        --set features.method="$method" --set preview.period_frames=0 --set lcm_url= | grep 'posed [1-9]'
}
replay_methods() { # replay_methods COMMAND...
    for method in $methods; do "$@" replay "$folder/$method.lcm" --verify || return 1; done
}
run "record a loop on x86" record_loop
run "record on x86" record "$folder/x86.lcm" build/fovea
for method in $methods; do run "record $method on x86" record_method "$method"; done
wait

# What takes longest comes first.
to_arm_and_back() {
    record "$folder/arm.lcm" tools/emulate.sh build-aarch64/fovea && build/fovea replay "$folder/arm.lcm" --verify &&
        build/fovea compare "$folder/x86.lcm" "$folder/arm.lcm" | tee "$folder/compared" && grep -q "^equal: $frames iterations, $frames " "$folder/compared"
}
# A bit that is flipped in the state of the run on ARM is named with its frame and stage by the one on x86; without it both are equal.
flip_on_arm() {
    source='sim:orbit?width=160&height=120&frames=12'
    arm="tools/emulate.sh build-aarch64/tests/replay/flipped"
    build/tests/replay/flipped "$folder/steady.lcm" "$source" && $arm "$folder/steady_arm.lcm" "$source" &&
        build/fovea compare "$folder/steady.lcm" "$folder/steady_arm.lcm" | tee "$folder/steady" && grep -q '^equal: 12 iterations, 12 ' "$folder/steady" || return 1
    for owner in odometry publish; do
        $arm "$folder/flipped_arm.lcm" "$source" $owner 7 || return 1
        build/fovea compare "$folder/steady.lcm" "$folder/flipped_arm.lcm" | tee "$folder/flipped"
        grep -q "^different: .* at frame 7 (iteration 7, .* after 7 equal iterations: equal inputs; first stage: $owner;" "$folder/flipped" || return 1
    done
}
if have build/tests/replay/flipped && have build-aarch64/tests/replay/flipped; then run "name the frame and stage of a bit flipped on aarch64" flip_on_arm; fi
if have build-aarch64/fovea; then
    run "replay the loop on aarch64" tools/emulate.sh build-aarch64/fovea replay "$folder/loop.lcm" --verify
    run "record on aarch64, replay that on x86, in lock-step with the recording of x86" to_arm_and_back
    run "replay every method and rig on aarch64" replay_methods tools/emulate.sh build-aarch64/fovea
    run "replay the x86 recording on aarch64" tools/emulate.sh build-aarch64/fovea replay "$folder/x86.lcm" --verify
    for set in c ${all:+neon dotprod}; do # without a cap it is i8mm
        run "replay it on aarch64 with FOVEA_CPU=$set" env FOVEA_CPU=$set tools/emulate.sh build-aarch64/fovea replay "$folder/x86.lcm" --verify
    done
fi
for set in c sse4 avx2 avxvnni avx512; do
    if ! grep -q "$(echo $set | sed 's/sse4/sse4_2/;s/avxvnni/avx[_512]*vnni/;s/avx512$/avx512bw/;s/^c$/fpu/')" /proc/cpuinfo; then
        echo "SKIPPED FOVEA_CPU=$set: this processor lacks it"
        continue
    fi
    run "replay with FOVEA_CPU=$set" env FOVEA_CPU=$set build/fovea replay "$folder/x86.lcm" --verify
    run "replay every method and rig with FOVEA_CPU=$set" replay_methods env FOVEA_CPU=$set build/fovea
    [ "$set" = c ] && [ -z "$all" ] && continue # ten times as long; they replay the shorter run
    run "replay the loop with FOVEA_CPU=$set" env FOVEA_CPU=$set build/fovea replay "$folder/loop.lcm" --verify
done
run "replay with libc's FMA and AVX2 masked" env \
    GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2_Usable,-AVX2,-FMA_Usable,-FMA,-FMA4_Usable,-AVX512F,-ERMS \
    build/fovea replay "$folder/x86.lcm" --verify
if have build-clang/fovea; then
    run "replay with the clang build" build-clang/fovea replay "$folder/x86.lcm" --verify
    run "replay every method and rig with the clang build" replay_methods build-clang/fovea
    run "replay the loop with the clang build" build-clang/fovea replay "$folder/loop.lcm" --verify
fi
# Each further run must itself replay to what it sent: none of the three holds a message that depends on the run.
again() { record "$1" build/fovea && build/fovea replay "$1" --verify; }
for number in 1 2 3; do run "record again and replay that ($number)" again "$folder/again$number.lcm"; done
wait

failures=$((failures + $(grep -c '^FAILED' "$folder/verdicts")))
echo "$(grep -c '^ok' "$folder/verdicts") passed, $failures failed"
[ $failures -eq 0 ] && [ -s "$folder/verdicts" ]
