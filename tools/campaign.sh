#!/bin/sh
# The long proofs, each with a verdict line; goes on after a failure and fails at the end. Finished parts are remembered in
# BUILD/campaign, so that an interrupted campaign goes on where it stopped (remove the folder to begin anew).
# Usage: tools/campaign.sh [--sample] [PART...]     --sample: about five minutes, nothing remembered; PARTs: only these
set -u
cd "$(dirname "$0")/.."
build=build
done_folder=$build/campaign
sample=
[ "${1:-}" = --sample ] && sample=1 && shift
parts=" $* "
mkdir -p "$done_folder"
failed=

part() { # part NAME COMMAND...
    name=$1
    shift
    case $parts in "  " | *" $name "*) ;; *) return ;; esac
    [ -z "$sample" ] && [ -f "$done_folder/$name" ] && { echo "done before  $name"; return; }
    begin=$(date +%s)
    if "$@" >"$done_folder/$name.log" 2>&1; then
        echo "ok           $name, $(($(date +%s) - begin)) s"
        [ -n "$sample" ] || touch "$done_folder/$name"
    else
        echo "FAILED       $name"
        grep -hE -A 1 '^ +(HANG|CRASH)' "$done_folder/$name.log" | head -n 20
        tail -n 15 "$done_folder/$name.log"
        failed="$failed $name"
    fi
}

# The simulated camera at 60 Hz by the clock: no frame dropped for which the loop had processor time, memory as at the start. What else
# uses the processor makes the time longer that the loop takes of it: the best of RUNS counts.
realtime() { # realtime FRAMES RUNS
    for run in $(seq "$2"); do
        stats=$done_folder/realtime.json
        $build/fovea run --source 'sim:wander?rate=60' --rate real --frames "$1" --stats "$stats" --picture none --quiet \
            --set 'lcm_url=' || return 1
        late=$(sed -n 's/.*"late": \([0-9]*\).*/\1/p' "$stats" | head -n 1)
        starved=$(sed -n 's/.*"late_without_cpu": \([0-9]*\).*/\1/p' "$stats" | head -n 1)
        heap=$(sed -n 's/.*"heap_calls_after_init": \([0-9]*\).*/\1/p' "$stats" | head -n 1)
        echo "run $run: late $late, of these without processor time $starved, heap calls $heap"
        [ "$heap" -eq 0 ] || return 1
        [ "$late" -ne "$starved" ] || return 0
    done
    return 1
}

# Runs of any length stay in the block: the memory that is in no file is after a long run that after a short one, but for some
# pages that are touched late. The resident set would also count pages of libraries, which come and go with the page cache.
wander() {
    for frames in 600 "$1"; do
        $build/fovea run --source 'sim:wander?width=320&height=240' --frames "$frames" --picture none --quiet \
            --stats "$done_folder/wander.json" --set 'lcm_url=' || return 1
        bytes=$(sed -n 's/.*"anonymous_bytes": \([0-9]*\).*/\1/p' "$done_folder/wander.json" | head -n 1)
        echo "$frames frames: $bytes bytes in no file"
        [ "$frames" = 600 ] && first=$bytes
    done
    [ "$bytes" -gt 0 ] && [ "$bytes" -le $((first + 262144)) ]
}

# Loops of the simulated corridor, closed and true, over seeds; what is done is kept by seed.
corridor() { # corridor SEEDS NEEDED OPTIONS NAME
    $build/tests/campaign/closures "$1" "$2" "$3" ${4:+"$done_folder/$4.seeds"}
}

# Seeded faults upon simulated and recorded sources, each run in a process of its own; what is done is kept by seed. The report, with
# pictures of the worst runs, is BUILD/campaign/fault-schedules/faults.md.
faults() { # faults SEEDS FIRST [--sample]
    folder=$done_folder/fault-schedules
    program=$build/tests/campaign/faults
    data=${FOVEA_DATA:-../shared/data}
    mkdir -p "$folder"
    $program --recordings | while read -r name uri; do
        [ -f "$folder/$name" ] && continue
        $build/fovea run --source "$uri" --record "$folder/begun" --picture none --quiet --set lcm_url= || exit 1
        mv "$folder/begun" "$folder/$name"
    done || return 1
    [ ! -d "$data/handheld_7scenes_a" ] || $program --real "tum:$data/handheld_7scenes_a" "$folder" handheld || return 1
    [ ! -d "$data/euroc_mh05_a" ] || $program --real "euroc:$data/euroc_mh05_a" "$folder" euroc || return 1
    $program "$1" "$2" "$folder" "${3:-}"
}

# Processes that save maps and record to numbered files are killed at random moments: nothing that was kept is lost.
kills() {
    make --no-print-directory "$build/tests/unit/app/config/test_map_file" && FOVEA_KILLS=$1 "$build/tests/unit/app/config/test_map_file" || return 1
    make --no-print-directory "$build/tests/unit/app/run/test_black_box" || return 1
    for killed in $(seq 0 200 $(($1 - 1))); do # each time from an empty folder: all that is in it is read after each kill
        FOVEA_KILLS=$(($1 - killed < 200 ? $1 - killed : 200)) FOVEA_LONG=$([ -n "$sample" ] || echo 1) \
            "$build/tests/unit/app/run/test_black_box" || return 1
    done
}

# The latency that the page of fovea-web shows, against blinks of a light seen in Chromium. It judges times: on a quiet machine.
blinks() { # blinks COUNT
    "$(tools/browser_python.sh $build)" tests/campaign/blinks.py $build "$1"
}

# What browsers cost the loop: the same bits, and counted instructions.
browsers() { # browsers FRAMES
    "$(tools/browser_python.sh $build)" tests/campaign/browsers.py $build "$1"
}

# Cameras on the fake device: unplugged over and over, and damaged motion JPEG under asan.
cameras() { # cameras UNPLUGGED DAMAGED
    make --no-print-directory $build/tests/unit/drivers/test_v4l2_unplug || return 1
    $build/tests/unit/drivers/test_v4l2_unplug "$1" || return 1
    make --no-print-directory BUILD=build-asan SAN=asan build-asan/tests/unit/drivers/test_mjpeg || return 1
    build-asan/tests/unit/drivers/test_mjpeg "$2"
}

# Cameras calibrated from simulated boards: as near to the truth as stated. Sets that are bad on purpose are called so for the
# true reason.
calibration() { # calibration CAMERAS
    make --no-print-directory "$build/tests/unit/calibrate/test_simulated" && FOVEA_LONG=$1 "$build/tests/unit/calibrate/test_simulated" || return 1
    make --no-print-directory "$build/tests/unit/calibrate/test_uncertainty" && FOVEA_LONG=$1 "$build/tests/unit/calibrate/test_uncertainty" || return 1
    make --no-print-directory "$build/tests/unit/calibrate/test_rig" && FOVEA_LONG=$1 "$build/tests/unit/calibrate/test_rig" || return 1
    make --no-print-directory "$build/tests/unit/calibrate/test_inertial" && FOVEA_LONG=20 "$build/tests/unit/calibrate/test_inertial" || return 1
    make --no-print-directory "$build/tests/unit/calibrate/test_bad_sets" && FOVEA_LONG=$1 "$build/tests/unit/calibrate/test_bad_sets" || return 1
    make --no-print-directory "$build/tests/unit/runtime/test_calibration" && FOVEA_LONG=20 "$build/tests/unit/runtime/test_calibration" || return 1
    make --no-print-directory "$build/tests/unit/calibrate/test_guide" && FOVEA_LONG=$1 "$build/tests/unit/calibrate/test_guide"
}

# All tests of the build that clang optimises, with those in C++, which need OpenCV and Ceres.
clang_tests() {
    make --no-print-directory -j"$(nproc)" BUILD=build-clang CC=clang CXX=clang++ all tests && tools/run_tests.sh build-clang
}

# All tests under asan+ubsan, those too that CI leaves out there.
asan_tests() {
    make --no-print-directory -j"$(nproc)" BUILD=build-asan SAN=asan all tests && tools/run_tests.sh build-asan
}

# A million mutated packets on every input from a network, under asan+ubsan.
packets() {
    make --no-print-directory BUILD=build-asan SAN=asan build-asan/tests/campaign/packets && build-asan/tests/campaign/packets "$1"
}

# Honest on the simulated camera: five minutes of standing, turning, being carried off; orbits followed to 0.5 % of their
# length and to 2 % of their scale by odometry, over seeds, with the boxes of what walks about known.
honest() {
    make --no-print-directory $build/tests/unit/runtime/test_honesty && FOVEA_LONG=1 $build/tests/unit/runtime/test_honesty || return 1
    for seed in $(seq 1 "$1"); do
        line=$($build/fovea run --source "sim:orbit?seed=$seed" --picture none --set lcm_url= \
            --set scale.source=wheel_odometry --set movable_boxes=truth --trajectory-final "$done_folder/orbit.tum" | grep posed) || return 1
        echo "seed $seed:$line"
        echo "$line" | awk '{
            n = split($0, part, "RMS error")
            split(part[2], live, "[(%]"); split(part[n], final, "[(%]")
            sub(/.*scale off by /, ""); sub(/ %.*/, "")
            off = $0 + 0
            exit !(n == 3 && live[2] + 0 <= 0.5 && final[2] + 0 <= 0.5 && off <= 2 && off >= -2)
        }' || return 1
    done
}

# Free space over whole passes of the driving robot, against the truth: masks of the truth, poses of the truth and of two cameras.
free_space() { # free_space PASSES
    make --no-print-directory "$build/tests/unit/drivers/test_sim_free_space" && FOVEA_LONG=$1 "$build/tests/unit/drivers/test_sim_free_space"
}

# The same by the shipped network: its masks in the loop, poses of two cameras; halls that nothing was chosen by.
free_space_network() { # free_space_network PASSES
    test=$build/tests/unit/drivers/test_sim_free_space
    make --no-print-directory "$test" && FOVEA_SEGMENTER=src/detect/segmenter.fvm FOVEA_ONLY='*two_cameras' FOVEA_FIRST=4000 FOVEA_LONG=$1 "$test"
}

# Drives by the whole program and the planner that users copy, with masks of the shipped network. The sample drives twice: what else the
# machine does changes nothing.
drive_network() { # drive_network FIRST HALLS NEEDED
    [ -z "$sample" ] || rm -f "$done_folder/halls.txt" "$done_folder/again.txt"
    make --no-print-directory all examples && python3 tests/campaign/halls.py "$build" "$done_folder/halls.txt" "$@" || return 1
    [ -n "$sample" ] || return 0
    python3 tests/campaign/halls.py "$build" "$done_folder/again.txt" "$@" && cmp "$done_folder/halls.txt" "$done_folder/again.txt"
}

# The shipped network on frames of seeds that training never draws.
segmenter() { # segmenter FRAMES
    make --no-print-directory "$build/fovea" "$build/venv-sweep/ready" &&
        "$build/venv-sweep/bin/python" tools/evaluate/segmentation.py --fovea "$build/fovea" --work "$done_folder/segmenter-frames" --frames "$1" --mean 0.85 --least 0.7
}

# Sweeps of tools/evaluate: interrupted, with a worker killed, two versions side by side.
sweeps() {
    make --no-print-directory "$build/venv-sweep/ready" && "$build/venv-sweep/bin/python" tests/evaluate/sweeps.py
}

# Ten thousand steps that call no heap, lock or system.
armed() {
    make --no-print-directory "$build/tests/realtime/test_armed" && FOVEA_LONG=1 "$build/tests/realtime/test_armed"
}

# Damaged .tflite files, imported and run, and damaged model files, both under asan+ubsan.
mutants() { # mutants COUNT MODELS
    tests/import/mutants.sh "$1" || return 1
    make --no-print-directory BUILD=build-asan SAN=asan build-asan/tests/unit/nn/test_model && FOVEA_MUTANTS=$2 build-asan/tests/unit/nn/test_model
}

# No unit of a network takes more than 0.25 ms. It judges times: on the machine that tools/import/costs.txt names, or a faster one.
units() {
    BUILD=$build "$(tools/networks_python.sh $build)" tests/import/units.py --runs 15
}

# A minute on each slow link: every pose in time in the other network, a preview every 5 s.
slow_links() {
    make --no-print-directory "$build/tests/transport/test_sending" && FOVEA_LONG=60 "$build/tests/transport/test_sending"
}

# Packages of both architectures, in bare roots; two builds give the same bytes.
packages() {
    make --no-print-directory deb && make --no-print-directory deb ARCH=arm64 && tools/package/check.sh all arm64 service guest trixie reproducible
}

if [ -n "$sample" ]; then
    part realtime realtime 3600 3
    part wander wander 3000
    part soak $build/tests/campaign/wander --soak 20000
    part corridor corridor 1 1 'width=320&height=240'
    part cameras cameras 100 2000
    part everywhere tests/replay/everywhere.sh 100
    part bisect tests/replay/bisect.sh
    part kills kills 60
    part kidnap tools/evaluate/kidnap.sh 2
    seed=${FAULTS_SEED:-$(date +%s)}
    case $parts in "  " | *" faults "*) echo "faults       seeds from $seed on (FAULTS_SEED=$seed repeats them)" ;; esac
    part faults faults 28 "$seed" --sample
    part packets packets 50000
    part fuzz make --no-print-directory fuzz FUZZ_SECONDS="${FUZZ_SECONDS:-6}"
    part networks tools/check_networks.sh "$build" 1 best
    part mutants mutants 100 1000
    part drive-network drive_network 7001 1 1
else
    part realtime realtime 36000 1
    part hour $build/tests/campaign/wander 108000
    part corridor corridor 100 95 '' corridor
    part corridor-repeated corridor 100 95 'textures=repeated' corridor-repeated
    part wander wander 108000
    part soak $build/tests/campaign/wander --soak 2000000
    part cameras cameras 1000 20000
    part hil make --no-print-directory hil
    part cross make --no-print-directory cross
    part asan asan_tests
    part clang clang_tests
    part everywhere tests/replay/everywhere.sh --all 500
    part bisect tests/replay/bisect.sh
    part kills kills 1000
    part slow-links slow_links
    part armed armed
    part kidnap tools/evaluate/kidnap.sh 100
    part faults faults 2000 0
    part revisits tools/evaluate/revisits.sh
    part sweeps sweeps
    part segmenter segmenter 500
    part free_space free_space 20
    part free_space-network free_space_network 20
    part drive-network drive_network 9101 100 95
    part drive $build/tests/campaign/drive --first 6001 --worlds 100 --needed 95
    part drive-stereo $build/tests/campaign/drive --first 7001 --worlds 100 --needed 95 --stereo 1
    part packets packets 1000000
    part blinks blinks 200
    part browsers browsers 60
    part slow_link python3 tests/campaign/slow_link.py $build 40
    part commands $build/tests/campaign/commands $build/fovea 1800
    part fuzz make --no-print-directory fuzz FUZZ_SECONDS=1200
    part networks tools/check_networks.sh "$build" 40
    part public python3 tests/import/public.py "$build"
    part mutants mutants 2000 20000
    part units units
    part honest honest 10
    part calibration calibration 100
    part bare-debian tools/try_bare_debian.sh
    part libcamera tools/check_libcamera.sh
    part packages packages
fi
[ -z "$failed" ] || { echo "failed:$failed"; exit 1; }
