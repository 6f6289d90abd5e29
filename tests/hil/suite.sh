#!/bin/bash
# The tests on kernel drivers, run by tests/hil/guest.sh inside the virtual machine. Each check is one line of a TAP report;
# what it said stands in logs/. Nothing here judges speed: the machine is emulated. HIL_PARTS names parts (part_* below)
# to be run alone, with commas.
set -u
tool=$HIL_project/build/hil-tool
fovea=$HIL_project/build/fovea
export FOVEA_PLUGINS=$HIL_project/build
report=$HIL_results/report.tap
logs=$HIL_results/logs
mkdir -p "$logs"
: >"$report"
number=0 failed=0

check() { # check NAME COMMAND...
    name=$1
    shift
    number=$((number + 1))
    log=$logs/$(printf %02d $number)-$(echo "$name" | tr -c 'a-zA-Z0-9\n' - | cut -c1-60).log
    begin=$(cut -d' ' -f1 /proc/uptime)
    if "$@" >"$log" 2>&1; then
        line="ok $number - $name"
    else
        line="not ok $number - $name"
        failed=$((failed + 1))
        sed 's/^/# /' "$log" | tail -n 12
    fi
    echo "$line" >>"$report"
    echo "$line # $begin to $(cut -d' ' -f1 /proc/uptime) s"
}
settle() { udevadm settle -t 20; }
background=
start() { "$@" >>"$logs/background.log" 2>&1 & background=$!; }
finish() { [ -n "$background" ] && { kill "$background"; wait "$background"; } 2>/dev/null; background=; }
by_id() { ls /dev/v4l/by-id/*"$1"*index0 2>/dev/null; }
wait_for() { for _ in $(seq 400); do [ -e "$1" ] && return 0; sleep 0.05; done; return 1; }
export -f wait_for

# ---- what several parts need ---------------------------------------------------------------------------------------
modprobe vhci-hcd
modprobe name_node
modprobe uvcvideo nodrop=1
plug() { # plug FORMAT WIDTH HEIGHT FILE RATE OPTIONS...: waits for its by-id name
    start "$tool" usb "$@"
    for _ in $(seq 200); do usb=$(by_id FOVEA0001 | head -n 1); [ -n "$usb" ] && break; sleep 0.1; done
    settle
}
unplug() { finish; for _ in $(seq 100); do [ -z "$(by_id FOVEA0001)" ] && break; sleep 0.1; done; settle; }
# The same as commands of their own, for programs that unplug what they read: usb.raw, at the rate in usb.rate.
cat >usb-plug.sh <<P
setsid $tool usb GREY 320 240 /run/usb.raw \$(cat /run/usb.rate) "\$@" >>$logs/background.log 2>&1 </dev/null &
echo \$! >/run/usb.pid
for _ in \$(seq 400); do ls /dev/v4l/by-id/*FOVEA0001*index0 >/dev/null 2>&1 && exit 0; sleep 0.05; done; exit 1
P
echo 'kill -9 $(cat /run/usb.pid); true' >usb-unplug.sh
cat >camera.yaml <<'Y'
image_width: 320
image_height: 240
camera_matrix: {rows: 3, cols: 3, data: [230, 0, 160, 0, 230, 120, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
Y
"$tool" make sim 'sim:orbit?width=320&height=240&lens=pinhole&fov=70&rate=10' 90 sim.raw
run_fovea() { # run_fovea RECORDING OPTIONS...
    recording=$1
    shift
    FOVEA_CPU=c "$fovea" run --camera camera.yaml --record "$recording" --picture none --set lcm_url= \
        --set preview.period_frames=0 --set features.count_max=400 --set loop.lock_memory=false "$@"
}
verify() { "$tool" direct "$1" sim.raw direct.lcm && "$fovea" replay direct.lcm --verify; }
whole_runtime() { # whole_runtime URI RECORDING FRAMES
    run_fovea "$HIL_results/$2" --source "$1" --rate max --frames "$3" && verify "$HIL_results/$2"
}

# ---- vivid: the kernel's virtual video driver -------------------------------------------------------------------
part_vivid() {
modprobe vivid n_devs=1 node_types=0x1 num_inputs=1 input_types=0x00
settle
vivid='v4l2:/dev/video0?width=640&height=480'
for format in GREY NV12 YUYV UYVY YU12 Y10 Y12 Y16 RGGB BGGR GRBG GBRG; do
    v4l2-ctl -d /dev/video0 --list-formats | grep -q "'${format/BGGR/BA81}" || [ ${#format} = 3 ] || continue
    check "vivid streams $format" "$tool" read "$vivid&format=$format" frames=6
done
set_control() { echo "v4l2-ctl -d /dev/video0 -c $1=1"; }
check 'vivid: a frame flagged as damaged is counted and skipped' \
    "$tool" read "$vivid" frames=10 run="$(set_control inject_v4l2_buf_flag_error)" damaged=1 says='marks frames as damaged'
check 'vivid: a fatal streaming error is got over' \
    "$tool" read "$vivid" frames=10 run="$(set_control inject_fatal_streaming_error)" recovered=1 says='Input/output error'
for call in reqbufs qbuf streamon; do
    check "vivid: a failing $call at the start is got over" bash -c \
        "$(set_control inject_vidioc_${call}_error); $tool read '$vivid' frames=8 says='Invalid argument'"
done
check 'vivid: a failing qbuf while streaming is got over' \
    "$tool" read "$vivid" frames=10 run="$(set_control inject_vidioc_qbuf_error)" recovered=1 says='giving back a buffer'
check 'vivid: lost frames are counted' bash -c \
    "v4l2-ctl -d /dev/video0 -c percentage_of_dropped_buffers=40; $tool read '$vivid' frames=10 dropped=1; s=\$?
     v4l2-ctl -d /dev/video0 -c percentage_of_dropped_buffers=0; exit \$s"
check 'vivid: sequence numbers wrap' bash -c \
    "v4l2-ctl -d /dev/video0 -c wrap_sequence_number=1; $tool read '$vivid' frames=150 seconds=90 >wrap.log; s=\$?
     cat wrap.log; v4l2-ctl -d /dev/video0 -c wrap_sequence_number=0; ! grep -qE 'dropped [0-9]{6}' wrap.log && exit \$s"
check 'vivid: stamps that wrap are replaced by the time of arrival' bash -c \
    "v4l2-ctl -d /dev/video0 -c wrap_timestamp=1; $tool read '$vivid' frames=20 says='time of arrival'; s=\$?
     v4l2-ctl -d /dev/video0 -c wrap_timestamp=0; exit \$s"
check 'vivid: a rate that it does not have is told' \
    "$tool" read "$vivid&rate=999" frames=3 says='rate: asked 999, the camera gives'
check 'vivid: a size that it does not have is told' \
    "$tool" read 'v4l2:/dev/video0?width=650&height=490' frames=3 says='asked 650, the camera gives'
check 'vivid: a control by name is set' bash -c \
    "$tool read '$vivid&control.brightness=77' frames=3 && v4l2-ctl -d /dev/video0 -C brightness | grep -q ': 77'"
check 'vivid: a control out of range is refused' bash -c \
    "$tool read '$vivid&control.brightness=999' open=fails | grep 'found 999, expected \[0, 255\]'"
check 'vivid: an unknown control is refused, the nearest is named' bash -c \
    "$tool read '$vivid&control.brightnes=9' open=fails | grep \"did you mean 'brightness'\""
check 'vivid: a second reader is told that the camera is in use' bash -c \
    "$tool read '$vivid' frames=1000 seconds=60 >first.log & sleep 2
     $tool read '$vivid' frames=1 seconds=8 says='another program'; cat first.log; kill %1; grep -q 'state ok' first.log"
check 'vivid: rmmod while streaming is refused, frames go on' \
    "$tool" read "$vivid" frames=10 run='! busybox rmmod vivid'
printf 'echo vivid.0 >/sys/bus/platform/drivers/vivid/unbind\n' >vivid-unplug.sh
printf 'echo vivid.0 >/sys/bus/platform/drivers/vivid/bind\nwait_for /dev/video0\n' >vivid-plug.sh
check 'vivid: disconnected while streaming: gone, and back' "$tool" read "$vivid" seconds=90 times=3 \
    unplug='v4l2-ctl -d /dev/video0 -c disconnect=1' plug='bash vivid-unplug.sh; bash vivid-plug.sh'
check 'vivid: unbound and bound 10 times: gone, back in time, nothing left behind' \
    "$tool" read "$vivid" seconds=120 times=10 unplug='bash vivid-unplug.sh' plug='bash vivid-plug.sh'
rmmod vivid
}

# ---- vivid's output looped to its input: own frames ---------------------------------------------------------------
part_looped() {
modprobe vivid n_devs=1 node_types=0x101 num_inputs=1 input_types=0x3 num_outputs=1 output_types=0x1
settle
v4l2-ctl -d /dev/video0 -c loop_video=1
for format in GREY YUYV NV12 UYVY; do
    "$tool" make $format 1280 720 2 loop.raw
    start "$tool" write /dev/video1 $format 1280 720 loop.raw 1000 0 mmap # as fast as the output takes them
    sleep 1
    check "vivid looped: $format bit for bit" "$tool" read "v4l2:/dev/video0?width=1280&height=720&format=$format" \
        frames=4 expect=loop.raw torn=2 seconds=40
    finish
done
rmmod vivid
}

# ---- v4l2loopback: frames written by a program ---------------------------------------------------------------------
part_loopback() {
modprobe v4l2loopback devices=1 video_nr=10 exclusive_caps=1 max_buffers=4
settle
for row in 'GREY 752 480' 'GREY 1279 801' 'YUYV 320 240' 'NV12 320 240' 'BGGR 320 240' 'Y16 320 240'; do
    read -r format width height <<<"$row"
    "$tool" make $format $width $height 6 own.raw
    start "$tool" write /dev/video10 $format $width $height own.raw 5 0
    sleep 1
    check "v4l2loopback: $format $width x $height bit for bit" "$tool" read v4l2:/dev/video10 frames=8 expect=own.raw
    finish
done
# With exclusive_caps=1 this version takes no new writer once a reader streamed while the last one died.
rmmod v4l2loopback
modprobe v4l2loopback devices=1 video_nr=10 exclusive_caps=0 max_buffers=4
settle
"$tool" make GREY 320 240 6 own.raw
start "$tool" write /dev/video10 GREY 320 240 own.raw 10 0
sleep 1
check 'v4l2loopback: a writer that dies is a time-out, and frames come back with it' \
    "$tool" read v4l2:/dev/video10 frames=12 seconds=60 recovered=1 says='no frame for' \
    run="kill $background; (sleep 4; exec $tool write /dev/video10 GREY 320 240 own.raw 10 400) >>writer.log 2>&1 &"
cp writer.log "$logs/"; finish
rmmod v4l2loopback
modprobe v4l2loopback devices=1 video_nr=10 exclusive_caps=1 max_buffers=4
settle
}

# ---- fovea run on v4l2loopback: the messages are those of the same frames fed directly ------------------------------
part_runtime() {
start "$tool" write /dev/video10 GREY 320 240 sim.raw 4 0
sleep 1
check 'fovea check says that the camera answers' bash -c \
    "FOVEA_CPU=c $fovea check --source v4l2:/dev/video10 --camera camera.yaml --set lcm_url= --set loop.lock_memory=false | tee check.log
     grep -q 'v4l2:/dev/video10 answers: 320 x 240 grey8' check.log"
check 'whole runtime through v4l2loopback: messages bit for bit those of the frames fed directly' \
    whole_runtime v4l2:/dev/video10 loopback.lcm 40
finish
check 'fovea check says that the camera gives nothing' bash -c \
    "$fovea check --source v4l2:/dev/video10 --camera camera.yaml --set lcm_url= --set loop.lock_memory=false 2>&1 | tee check.log
     grep -Eq 'gives no pictures|gives no frame' check.log"
rmmod v4l2loopback
}

# ---- a USB camera behind the real uvcvideo ------------------------------------------------------------------------
part_usb() {
for format in GREY YUYV UYVY NV12 YU12 Y10 Y12 Y16 RGGB BGGR GRBG GBRG MJPG; do
    "$tool" make $format 320 240 6 usb.raw
    plug $format 320 240 usb.raw 10
    expect=usb.raw
    [ $format = MJPG ] && expect=usb.raw.grey
    check "uvcvideo: $format bit for bit" "$tool" read "v4l2:$usb?format=$format" frames=8 expect=$expect
    unplug
done
"$tool" make GREY 320 240 6 usb.raw
plug GREY 320 240 usb.raw 10
check 'uvcvideo: stamps at the start of exposure, moved to its middle where it is known' bash -c \
    "$tool read 'v4l2:$usb' frames=3 | tee a.log; $tool read 'v4l2:$usb?exposure=10' frames=3 | tee b.log
     grep -q 'clock 0, meaning 1, exposure 0.0' a.log && grep -q 'clock 0, meaning 2, exposure 10.0' b.log"
check 'uvcvideo: exposure and gain reach the camera, automatic exposure is off' bash -c \
    "$tool read 'v4l2:$usb?exposure=12.5&gain=33' frames=3 && v4l2-ctl -d $usb -C auto_exposure,exposure_time_absolute,gain |
     tee c.log; grep -q 'auto_exposure: 1' c.log && grep -q 'absolute: 125' c.log && grep -q 'gain: 33' c.log"
check 'uvcvideo: exposure out of range is refused in milliseconds' bash -c \
    "$tool read 'v4l2:$usb?exposure=900' open=fails | grep 'exposure (ms): found 900, expected \[0.1, 500\]'"
check 'uvcvideo: automatic gain that it does not have is refused' bash -c \
    "$tool read 'v4l2:$usb?auto_gain=1' open=fails | grep 'auto_gain: this camera has none'"
check 'uvcvideo: by-path names are taken' bash -c \
    "$tool read \"v4l2:\$(ls /dev/v4l/by-path/*vhci*index0)\" frames=3 expect=usb.raw"
unplug
plug GREY 320 240 usb.raw 10 refuse=1
check 'uvcvideo: a control that the camera refuses is told' bash -c \
    "$tool read 'v4l2:$usb?gain=33' open=fails | grep 'gain: the camera refuses 33'"
unplug
plug GREY 320 240 usb.raw 10 drop=4
check 'uvcvideo: frames that never come' "$tool" read "v4l2:$usb" frames=10 expect=usb.raw
unplug
plug YUYV 320 240 usb.raw 10 truncate=4
check 'uvcvideo: truncated frames are counted and skipped' "$tool" read "v4l2:$usb" frames=8 damaged=2
unplug
plug GREY 320 240 usb.raw 10 damage=4
check 'uvcvideo: frames with the error bit are counted and skipped' \
    "$tool" read "v4l2:$usb" frames=8 damaged=2 expect=usb.raw
unplug
"$tool" make MJPG 320 240 6 jpeg.raw
plug MJPG 320 240 jpeg.raw 10 corrupt=3
check 'uvcvideo: corrupt MJPEG is counted and skipped, the rest is exact' \
    "$tool" read "v4l2:$usb" frames=8 damaged=2 expect=jpeg.raw.grey says='damaged JPEG'
unplug
plug MJPG 320 240 jpeg.raw 10 truncate=3
check 'uvcvideo: truncated MJPEG is counted and skipped, the rest is exact' \
    "$tool" read "v4l2:$usb" frames=8 damaged=2 expect=jpeg.raw.grey
unplug
}

# The unplugging is done by commands of their own, since the reader runs them.
part_unplug() {
"$tool" make GREY 320 240 6 usb.raw
echo 20 >usb.rate
bash usb-plug.sh
usb=$(by_id FOVEA0001)
check 'uvcvideo: unplugged 50 times: gone, back in time, nothing left behind' \
    "$tool" read "v4l2:$usb" seconds=400 times=50 unplug='bash usb-unplug.sh' plug='bash usb-plug.sh'
check 'uvcvideo: unplugged while starting' bash -c \
    "for wait in 0 0.1 0.3; do (sleep \$wait; bash usb-unplug.sh) & $tool read 'v4l2:$usb' until=gone || exit 1; wait
     bash usb-plug.sh; done"
check 'uvcvideo: comes back under another node, found by its camera' bash -c \
    "node=\$(readlink -f $usb)
     $tool read \"v4l2:\$node\" frames=12 recovered=1 seconds=60 expect=usb.raw \
         run=\"bash usb-unplug.sh; sleep 1; busybox modprobe vivid n_devs=1 node_types=0x1; udevadm settle; bash usb-plug.sh\"
     s=\$?; [ \$(readlink -f $usb) != \$node ] || s=1; readlink -f $usb; exit \$s"
bash usb-unplug.sh; sleep 1; rmmod vivid; bash usb-plug.sh
usb=$(by_id FOVEA0001)
check 'uvcvideo: another camera in its place is not taken' bash -c \
    "node=\$(readlink -f $usb)
     $tool read \"v4l2:\$node\" frames=9 seconds=60 says=\"found 'Fovea test camera\" \
         run=\"bash usb-unplug.sh; sleep 1; setsid $tool usb GREY 320 240 usb.raw 20 serial=OTHER >/dev/null 2>&1 & sleep 4; true\"; s=\$?; pkill -f serial=OTHER; exit \$s"
bash usb-unplug.sh
sleep 1
}

# ---- fovea run on the USB camera ----------------------------------------------------------------------------------
part_usb_runtime() {
cp sim.raw usb.raw
echo 4 >usb.rate
bash usb-plug.sh
usb=$(by_id FOVEA0001)
check 'whole runtime through the USB camera: messages bit for bit those of the frames fed directly' \
    whole_runtime "v4l2:$usb" usb.lcm 40
outage() { # the camera goes away in the middle of a run and comes back
    (while [ "$(stat -c %s "$HIL_results/outage.lcm" 2>/dev/null || echo 0)" -lt 3500000 ]; do sleep 0.2; done # 40 frames
     bash usb-unplug.sh; sleep 4; bash usb-plug.sh) &
    run_fovea "$HIL_results/outage.lcm" --source "v4l2:$usb" --frames 80 && wait &&
        "$tool" states "$HIL_results/outage.lcm" state=ok state=gone state=returning state=ok pose=3 pose=1 rate=4 &&
        "$fovea" replay "$HIL_results/outage.lcm" --verify
}
check 'an outage in a run: states on LCM, the loop keeps its rate, lost in time, found again, replays bit for bit' outage
bash usb-unplug.sh
}

[ -f "$HIL_project/build/fovea-libcamera.so" ] && . "$HIL_project/tests/hil/suite_libcamera.sh"

parts=${HIL_PARTS:-vivid,looped,loopback,runtime,usb,unplug,usb_runtime,libcamera}
for part in ${parts//,/ }; do "part_${part}"; done

echo "1..$number" >>"$report"
echo "$number checks, $failed failed"
[ $failed -eq 0 ] && [ $number -gt 0 ]
