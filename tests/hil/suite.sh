#!/bin/bash
# The tests on kernel drivers, run by tests/hil/guest.sh inside the virtual machine. Each check is one line of a TAP report;
# what it said stands in logs/. Nothing here judges speed, as the machine is emulated, but that
# frames are back within a second of its own after 99 % of the replugs. HIL_PARTS names parts (part_* below)
# to be run alone, with commas. What was fed is made, and what was recorded is verified, outside (tools/hil/run.sh).
set -u
tool=$HIL_project/build/hil-tool
fovea=$HIL_dir/scalar/fovea # without the vector instructions that emulation makes slow; the bits are the same
frames=$HIL_dir/frames
export FOVEA_PLUGINS=$HIL_project/build
report=$HIL_results/report.tap
logs=$HIL_results/logs
mkdir -p "$logs"
: >"$report"
number=0 failed=0

check() { # check NAME COMMAND...
    local name=$1 log begin end
    shift
    number=$((number + 1))
    printf -v log '%s/%02d-%.60s.log' "$logs" $number "${name//[^a-zA-Z0-9]/-}"
    read -r begin _ </proc/uptime
    if "$@" >"$log" 2>&1; then
        line="ok $number - $name"
        sed -n 's/^unplugged/# &/p' "$log"
    else
        line="not ok $number - $name"
        failed=$((failed + 1))
        sed 's/^/# /' "$log" | tail -n 12
    fi
    read -r end _ </proc/uptime
    echo "$line" >>"$report"
    echo "$line # $begin to $end s"
}
# Starting a program costs an emulator more than most checks do: waiting is done without.
mkfifo never.fifo
exec {never}<>never.fifo
export never
echo 'nap() { read -rt "$1" -u "$never" || true; }' >nap.sh # for scripts too
. ./nap.sh
settle() { udevadm settle -t 60; }
start() { # start COMMAND...: in the background, until it says that it streams
    "$@" >started.log 2>&1 &
    background=$!
    for _ in {1..600}; do grep -q streaming started.log && break; nap 0.1; done
}
finish() {
    { kill "$background"; wait "$background"; } 2>/dev/null
    cat started.log >>"$logs/background.log"
}
says() { # says WORDS COMMAND...: the command does well and says these words
    local words=$1 status
    shift
    "$@" >said.log 2>&1
    status=$?
    cat said.log
    [ $status -eq 0 ] && grep -q -e "$words" said.log
}
fails() { ! "$@"; }
control() { v4l2-ctl -d "$usb" -c "$1"; }

# ---- what several parts need ---------------------------------------------------------------------------------------
modprobe vhci-hcd
modprobe name_node
modprobe uvcvideo nodrop=1

# The USB camera, with commands of their own for programs that unplug what they read.
usb_id=/dev/v4l/by-id/usb-Fovea_Fovea_test_camera_FOVEA0001-video-index0
cat >usb-plug.sh <<P
. ./nap.sh
read -r formats file rate options <usb.what
setsid $tool usb \$formats 320 240 \$file \$rate \$options "\$@" >>$logs/background.log 2>&1 </dev/null &
echo \$! >usb.pid
for _ in {1..1200}; do [ -e $usb_id ] && exit 0; nap 0.05; done
exit 1
P
echo 'read -r pid <usb.pid; kill -9 $pid; true' >usb-unplug.sh
plug() { # plug FORMATS FILE RATE OPTIONS...: waits for its by-id name
    echo "$*" >usb.what
    bash usb-plug.sh
    settle
    usb=$usb_id
}
unplug() {
    bash usb-unplug.sh
    for _ in {1..1200}; do [ -e $usb_id ] || break; nap 0.05; done
    settle
}

refusing() { # refusing URI FILE: the USB camera refuses to stream until that has been said
    : >refused.log
    control sharpness=6
    (until grep -q 'starting to stream' refused.log; do nap 0.2; done; control sharpness=0) &
    "$tool" read "$1" frames=4 expect="$2" says='starting to stream' >refused.log
    local status=$?
    cat refused.log
    [ $status -eq 0 ] || control sharpness=0
    return $status
}

cat >camera.yaml <<'Y'
image_width: 320
image_height: 240
camera_matrix: {rows: 3, cols: 3, data: [230, 0, 160, 0, 230, 120, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
Y
run_fovea() { # run_fovea RECORDING OPTIONS...
    recording=$HIL_results/$1
    shift
    FOVEA_CPU=c "$fovea" run --camera camera.yaml --record "$recording" --picture none --set lcm_url= \
        --set preview.period_frames=0 --set features.count_max=400 --set loop.lock_memory=false "$@"
}
check_camera() { # check_camera DEVICE OPTIONS...
    FOVEA_CPU=c "$fovea" check --source "v4l2:$1" --camera camera.yaml --set lcm_url= --set loop.lock_memory=false
}

# ---- vivid: the kernel's virtual video driver -------------------------------------------------------------------
set_vivid() { v4l2-ctl -d /dev/video0 -c "$1"; }
with_vivid() { # with_vivid CONTROL OPTIONS...: read while the control is set
    local control=$1
    shift
    set_vivid "$control" && "$tool" read "$vivid" "$@"
    local status=$?
    set_vivid "${control%=*}=0"
    return $status
}
part_vivid() {
modprobe vivid n_devs=1 node_types=0x1 num_inputs=1 input_types=0x00
settle
vivid='v4l2:/dev/video0?width=320&height=180'
for format in GREY NV12 YUYV UYVY YU12 Y10 Y12 Y16 RGGB BGGR GRBG GBRG; do
    check "vivid streams $format" "$tool" read "$vivid&format=$format" frames=6
done
check 'vivid streams YUYV at 640 x 480' "$tool" read 'v4l2:/dev/video0?width=640&height=480&format=YUYV' frames=6
inject() { echo "v4l2-ctl -d /dev/video0 -c $1=1"; }
check 'vivid: a frame flagged as damaged is counted and skipped' \
    "$tool" read "$vivid" frames=10 run="$(inject inject_v4l2_buf_flag_error)" damaged=1 says='marks frames as damaged'
check 'vivid: a fatal streaming error is got over' \
    "$tool" read "$vivid" frames=10 run="$(inject inject_fatal_streaming_error)" recovered=1 says='Input/output error'
for call in reqbufs qbuf streamon; do
    set_vivid inject_vidioc_${call}_error=1
    check "vivid: a failing $call at the start is got over" "$tool" read "$vivid" frames=8 says='Invalid argument'
done
check 'vivid: a failing qbuf while streaming is got over' \
    "$tool" read "$vivid" frames=10 run="$(inject inject_vidioc_qbuf_error)" recovered=1 says='giving back a buffer'
check 'vivid: lost frames are counted' with_vivid percentage_of_dropped_buffers=40 frames=10 dropped=1
wrap_numbers() { # after 128 frames
    vivid="$vivid&rate=25" with_vivid wrap_sequence_number=1 frames=150 >wrap.log
    local status=$?
    cat wrap.log
    [ $status -eq 0 ] && ! grep -qE 'dropped [0-9]{6}' wrap.log
}
check 'vivid: sequence numbers wrap' wrap_numbers
check 'vivid: stamps that wrap are replaced by the time of arrival' with_vivid wrap_timestamp=1 frames=20 says='time of arrival'
check 'vivid: a rate that it does not have is named' \
    "$tool" read "$vivid&rate=999" frames=3 says='rate: asked 999, the camera gives'
check 'vivid: a size that it does not have is named' \
    "$tool" read 'v4l2:/dev/video0?width=330&height=190' frames=3 says='asked 330, the camera gives'
named() { "$tool" read "$vivid&control.brightness=77" frames=3 && says ': 77' v4l2-ctl -d /dev/video0 -C brightness; }
check 'vivid: a control by name is set' named
check 'vivid: a control out of range is refused' \
    says 'found 999, expected \[0, 255\]' "$tool" read "$vivid&control.brightness=999" open=fails
check 'vivid: an unknown control is refused, the nearest is named' \
    says "did you mean 'brightness'" "$tool" read "$vivid&control.brightnes=9" open=fails
second() {
    "$tool" read "$vivid" frames=100000 >first.log &
    local first=$! status
    for _ in {1..600}; do grep -q 'first frame' first.log && break; nap 0.1; done
    says 'another program' "$tool" read "$vivid" open=fails
    status=$?
    kill $first
    return $status
}
check 'vivid: a second reader learns that the camera is in use' second
check 'vivid: rmmod while streaming is refused, frames go on' \
    "$tool" read "$vivid" frames=10 run='! busybox rmmod vivid'
echo 'echo vivid.0 >/sys/bus/platform/drivers/vivid/unbind' >vivid-unplug.sh
echo '. ./nap.sh; echo vivid.0 >/sys/bus/platform/drivers/vivid/bind; for _ in {1..1200}; do for node in /dev/video*; do [ -e $node ] && exit 0; done; nap 0.05; done; exit 1' >vivid-plug.sh
check 'vivid: disconnected while streaming: gone, and back' "$tool" read "$vivid" times=3 \
    unplug='v4l2-ctl -d /dev/video0 -c disconnect=1' plug=true # vivid is back with the last close
check 'vivid: unbound and bound 10 times: gone, back in time, nothing left behind' \
    "$tool" read "$vivid" seconds=900 times=10 unplug='bash vivid-unplug.sh' plug='bash vivid-plug.sh'
rmmod vivid
}

# ---- vivid's output looped to its input: own frames ---------------------------------------------------------------
# Both ends have HDMI timings; no text over the picture; more buffers than frames, so that the output never runs dry.
part_looped() {
modprobe vivid n_devs=1 node_types=0x101 num_inputs=1 input_types=0x3 num_outputs=1 output_types=0x1
settle
v4l2-ctl -d /dev/video0 -c loop_video=1,osd_text_mode=2
timings() { # timings INDEX: on both ends
    v4l2-ctl -d /dev/video1 --set-dv-bt-timings index=$1
    v4l2-ctl -d /dev/video0 --set-dv-bt-timings index=$1
}
loop() { # loop FORMAT WIDTH HEIGHT
    local file=$frames/$1-$2x$3.raw
    start "$tool" write /dev/video1 $1 $2 $3 "$file" 1000 0 mmap=16
    check "vivid looped: $1 $2 x $3 bit for bit" \
        "$tool" read "v4l2:/dev/video0?width=$2&height=$3&format=$1" frames=4 expect="$file"
    finish
}
timings 0 # of v4l2-ctl --list-dv-timings: 640 x 480 at 59.94 Hz
for format in GREY YUYV NV12 UYVY; do loop $format 640 480; done
timings 3 # 1280 x 720 at 24 Hz
for format in GREY YUYV NV12 UYVY; do loop $format 1280 720; done
rmmod vivid
}

# ---- v4l2loopback: frames written by a program ---------------------------------------------------------------------
# A frame goes out when the one before has been read: a reader that is slower than the writer would see torn ones.
part_loopback() {
modprobe v4l2loopback devices=1 video_nr=10 exclusive_caps=1 max_buffers=4
settle
for row in 'GREY 752 480' 'GREY 1279 801' 'YUYV 320 240' 'NV12 320 240' 'BGGR 320 240' 'Y16 320 240'; do
    read -r format width height <<<"$row"
    file=$frames/$format-${width}x$height.raw
    rm -f taken
    start "$tool" write /dev/video10 $format $width $height "$file" 5 0 after=taken
    check "v4l2loopback: $format $width x $height bit for bit" \
        "$tool" read v4l2:/dev/video10 frames=8 expect="$file" pace=taken
    finish
done
reload() { rmmod v4l2loopback; modprobe v4l2loopback devices=1 video_nr=10 exclusive_caps=1 max_buffers="$1"; settle; }
file=$frames/GREY-320x240.raw
start "$tool" write /dev/video10 GREY 320 240 "$file" 50 0
check 'v4l2loopback: a slow reader loses frames, which are counted, and none comes twice' \
    "$tool" read v4l2:/dev/video10 frames=12 held=150 dropped=6
finish
# A writer that used write() leaves the device as one that takes no other while a reader is there (0.12.7); one that
# streamed does not, but numbers no frames. It is given the buffer again that went out last, which a reader that has just opened
# the device may be reading: so here too a frame goes out when the one before has been read.
reload 4
rm -f taken
start "$tool" write /dev/video10 GREY 320 240 "$file" 10 0 mmap=4 after=taken
check 'v4l2loopback: a writer that dies is a time-out, and frames come back with it' \
    "$tool" read v4l2:/dev/video10 frames=12 recovered=1 says='no frame for' expect="$file" pace=taken \
    run="kill $background; (sleep 4; exec $tool write /dev/video10 GREY 320 240 $file 10 400 mmap=4 after=taken) >>writer.log 2>&1 &"
cat writer.log >>"$logs/background.log"
pid=$(pidof hil-tool) && kill $pid
rmmod v4l2loopback
}

# ---- fovea run on v4l2loopback: the messages are those of the same frames fed directly ------------------------------
# Frames come as the recording grows, so that a slow machine loses none; the rate that is stated is low, so that the driver does
# not set up the camera again while the loop works on one.
part_runtime() {
modprobe v4l2loopback devices=1 video_nr=10 exclusive_caps=1 max_buffers=8
settle
start "$tool" write /dev/video10 GREY 320 240 "$frames/sim.raw" 0.5 0 after="$HIL_results/loopback.lcm"
check 'fovea check says that the camera answers' says 'v4l2:/dev/video10 answers: 320 x 240 grey8' check_camera /dev/video10
check 'whole runtime through v4l2loopback: runs and is recorded' \
    run_fovea loopback.lcm --source v4l2:/dev/video10 --rate max --frames 16
finish
check 'fovea check says that the camera gives nothing' \
    says 'gives no pictures\|gives no frame' fails check_camera /dev/video10
rmmod v4l2loopback
}

# ---- a USB camera behind the real uvcvideo ------------------------------------------------------------------------
part_usb() {
all=GREY,YUYV,UYVY,NV12,YU12,Y10,Y12,Y16,RGGB,BGGR,GRBG,GBRG,MJPG
plug $all "$frames/%-320x240.raw" 10
for format in ${all//,/ }; do
    expect=$frames/$format-320x240.raw
    [ $format = MJPG ] && expect=$expect.grey
    check "uvcvideo: $format bit for bit" "$tool" read "v4l2:$usb?format=$format" frames=8 expect="$expect"
done
grey="v4l2:$usb?format=GREY" file=$frames/GREY-320x240.raw
stamps() {
    says 'clock 0, meaning 1, exposure 0.0' "$tool" read "$grey" frames=3 &&
        says 'clock 0, meaning 2, exposure 10.0' "$tool" read "$grey&exposure=10" frames=3
}
check 'uvcvideo: stamps at the start of exposure, moved to its middle where it is known' stamps
reach() {
    "$tool" read "$grey&exposure=12.5&gain=33" frames=3 || return
    v4l2-ctl -d "$usb" -C auto_exposure,exposure_time_absolute,gain | tee values.log
    grep -q 'auto_exposure: 1' values.log && grep -q 'absolute: 125' values.log && grep -q 'gain: 33' values.log
}
check 'uvcvideo: exposure and gain reach the camera, automatic exposure is off' reach
check 'uvcvideo: exposure out of range is refused in milliseconds' \
    says 'exposure (ms): found 900, expected \[0.1, 500\]' "$tool" read "$grey&exposure=900" open=fails
by_path=(/dev/v4l/by-path/*vhci*index0)
check 'uvcvideo: by-path names are taken' "$tool" read "v4l2:${by_path[0]}?format=GREY" frames=3 expect="$file"
control sharpness=5
check 'uvcvideo: a control that the camera refuses is named' \
    says 'gain: the camera refuses 33' "$tool" read "$grey&gain=33" open=fails
control sharpness=0
automatic() { # the pictures are brighter than the target, and stay so
    control gain=33
    "$tool" read "$grey&auto_gain=1" frames=30 && says 'gain: [0-9]$\|gain: [12][0-9]$' v4l2-ctl -d "$usb" -C gain
}
check 'uvcvideo: automatic gain by the driver, where the camera has none' automatic
check 'uvcvideo: frames that never come are waited for, the rest is exact' "$tool" read "$grey&control.sharpness=1" frames=10 expect="$file"
check 'uvcvideo: truncated frames are counted and skipped' \
    "$tool" read "v4l2:$usb?format=YUYV&control.sharpness=2" frames=8 damaged=2 expect="$frames/YUYV-320x240.raw"
check 'uvcvideo: frames with the error bit are counted and skipped' \
    "$tool" read "$grey&control.sharpness=3" frames=8 damaged=2 expect="$file"
jpeg="v4l2:$usb?format=MJPG"
check 'uvcvideo: corrupt MJPEG is counted and skipped, the rest is exact' \
    "$tool" read "$jpeg&control.sharpness=4" frames=8 damaged=2 expect="$frames/MJPG-320x240.raw.grey" says='damaged JPEG'
check 'uvcvideo: truncated MJPEG is counted and skipped, the rest is exact' \
    "$tool" read "$jpeg&control.sharpness=2" frames=8 damaged=2 expect="$frames/MJPG-320x240.raw.grey"
check 'uvcvideo: a camera that refuses to stream is named and tried again' refusing "$grey" "$file"
unplug
}

# ---- unplugging ---------------------------------------------------------------------------------------------------
part_unplug() {
file=$frames/GREY-320x240.raw
plug GREY "$file" 20
check "uvcvideo: unplugged ${HIL_UNPLUGS:-50} times: gone, back in time, nothing left behind" \
    "$tool" read "v4l2:$usb" seconds=900 times="${HIL_UNPLUGS:-50}" unplug='bash usb-unplug.sh' plug='bash usb-plug.sh'
starting() {
    for wait in 0 0.1 0.3; do
        (sleep $wait; bash usb-unplug.sh) &
        "$tool" read "v4l2:$usb" until=gone || return
        wait
        bash usb-plug.sh
    done
}
check 'uvcvideo: unplugged while starting' starting
renumbered() { # vivid takes its node meanwhile
    local node status
    node=$(readlink -f "$usb")
    "$tool" read "v4l2:$node" frames=12 recovered=1 expect="$file" \
        run="bash usb-unplug.sh; sleep 1; busybox modprobe vivid n_devs=1 node_types=0x1; $HIL_dir/system/bin/udevadm settle; bash usb-plug.sh"
    status=$?
    readlink -f "$usb"
    [ $status -eq 0 ] && [ "$(readlink -f "$usb")" != "$node" ]
}
check 'uvcvideo: comes back under another node, found by its camera' renumbered
unplug
rmmod vivid
plug GREY "$file" 20
replaced() {
    local node status
    node=$(readlink -f "$usb")
    says 'state gone, .*recovered 0' "$tool" read "v4l2:$node" frames=5 says="found 'Fovea test camera" \
        run="bash usb-unplug.sh; sleep 1; setsid $tool usb GREY 320 240 $file 20 serial=OTHER >/dev/null 2>&1 & echo \$! >other.pid"
    status=$?
    kill "$(<other.pid)"
    return $status
}
check 'uvcvideo: another camera in its place is not taken' replaced
settle
}

# ---- fovea run on the USB camera ----------------------------------------------------------------------------------
part_usb_runtime() {
plug GREY "$frames/sim.raw" 0.5 after="$HIL_results/usb.lcm"
check 'whole runtime through the USB camera: runs and is recorded' \
    run_fovea usb.lcm --source "v4l2:$usb" --rate max --frames 16
unplug
outage() { # the camera goes away in the middle of a run and comes back; its first frame waits for the loop to see that
    (while [ -e $usb_id ]; do nap 0.2; done; nap 4; bash usb-plug.sh waits=1500) &
    run_fovea outage.lcm --source "v4l2:$usb" --frames 30 && wait &&
        "$tool" states "$HIL_results/outage.lcm" state=ok state=gone state=returning state=ok pose=1 pose=3 pose=1 rate=2
}
echo "GREY $frames/sim.raw 2 after=$HIL_results/outage.lcm" >usb.what
bash usb-plug.sh leaves=14
settle
check 'an outage in a run: states on LCM, the loop keeps its rate, lost in time, found again' outage
unplug
}

. "$HIL_project/tests/hil/suite_libcamera.sh"

parts=${HIL_PARTS:-vivid,looped,loopback,runtime,usb,unplug,usb_runtime,libcamera}
for part in ${parts//,/ }; do
    "part_${part}"
done
echo "$number checks, $failed failed"
[ $failed -eq 0 ] && [ $number -gt 0 ]
