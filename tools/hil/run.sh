#!/bin/bash
# `make hil`: build what the virtual machine runs, make the frames that it is fed, boot it, verify what it recorded, and bring
# back its report. Results in build-hil/results. HIL_PARTS=vivid,usb runs these parts of tests/hil/suite.sh alone.
set -u
cd "$(dirname "$0")/../.." || exit 1
[ "$(uname -m)" = x86_64 ] || { echo "hil: found $(uname -m), needs x86_64: skipped"; exit 0; }
tools/hil/setup.sh build-hil || exit 1
tool=build/hil-tool frames=build-hil/frames results=build-hil/results report=build-hil/results/report.tap
rm -rf $frames $results
mkdir -p $frames
make_frames() { # make_frames WIDTH HEIGHT COUNT FORMAT...
    local size="$1 $2 $3" name=-$1x$2.raw format
    shift 3
    # shellcheck disable=SC2086
    for format in "$@"; do $tool make "$format" $size "$frames/$format$name" || exit 1; done
}
make_frames 320 240 6 GREY YUYV UYVY NV12 YU12 Y10 Y12 Y16 RGGB BGGR GRBG GBRG MJPG
make_frames 640 480 2 GREY YUYV NV12 UYVY
make_frames 1280 720 2 GREY YUYV NV12 UYVY
make_frames 752 480 6 GREY
make_frames 1279 801 6 GREY
$tool make sim 'sim:orbit?width=320&height=240&lens=pinhole&fov=70&rate=3' 90 $frames/sim.raw || exit 1

begin=$(date +%s)
HIL_PARTS=${HIL_PARTS:-} tools/hil/vm.sh build-hil $results "${HIL_SECONDS:-3600}" tests/hil/suite.sh
status=$?

# Recordings of the machine are verified outside: there the kernels of another instruction set replay them.
verify() { # verify NAME COMMAND...: one more line of the report
    local name=$1 verdict=ok number=$(($(grep -c . $report) + 1))
    shift
    "$@" >"$results/logs/$number.log" 2>&1 || { verdict='not ok' status=1; tail -n 12 "$results/logs/$number.log" | sed 's/^/# /'; }
    echo "$verdict $number - $name" | tee -a $report
}
direct() { $tool direct $results/"$1".lcm $frames/sim.raw $results/"$1"-direct.lcm && build/fovea replay $results/"$1"-direct.lcm --verify; }
[ -f $results/loopback.lcm ] &&
    verify 'whole runtime through v4l2loopback: messages bit for bit those of the frames fed directly' direct loopback
[ -f $results/usb.lcm ] &&
    verify 'whole runtime through the USB camera: messages bit for bit those of the frames fed directly' direct usb
[ -f $results/outage.lcm ] &&
    verify 'an outage in a run: replays bit for bit' build/fovea replay $results/outage.lcm --verify
echo "1..$(grep -c . $report)" >>$report
echo "hil: $(grep -c '^ok' $report) passed, $(grep -c '^not ok' $report) failed, $(($(date +%s) - begin)) s in the machine;" \
    "report, logs and recordings in $results"
exit $status
