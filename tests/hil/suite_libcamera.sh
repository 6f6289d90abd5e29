#!/bin/bash
# The part of suite.sh for libcamera: on the USB camera and on vimc.
part_libcamera() {
export LIBCAMERA_LOG_LEVELS=*:FATAL
plug YUYV,GREY,MJPG "$frames/%-320x240.raw" 10
file=$frames/YUYV-320x240.raw lib='libcamera:0?format=YUYV'
for format in YUYV GREY MJPG; do
    expect=$frames/$format-320x240.raw
    [ $format = MJPG ] && expect=$expect.grey
    check "libcamera: $format bit for bit" \
        "$tool" read "libcamera:0?format=$format&width=320&height=240" frames=8 expect="$expect"
done
check 'libcamera: a format that the camera does not have is refused' \
    says 'format: found .*, expected NV12; the camera gives: .*MJPEG' "$tool" read 'libcamera:0?format=NV12' open=fails
id=$("$tool" read libcamera:nothing open=fails 2>/dev/null | sed -n 's/.*expected one of: //p')
named() { echo "$id" | grep FOVEA; }
check 'libcamera: an unknown camera is refused, those there are named' named
# The same program, with its heap calls counted.
mkdir -p counted
printf '#!/bin/sh\nLD_PRELOAD=%s exec %s\n' "$HIL_project/build/hil-count.so" "$FOVEA_PLUGINS/fovea-libcamera" >counted/fovea-libcamera
chmod +x counted/fovea-libcamera
by_id() {
    FOVEA_PLUGINS=counted HIL_HEAP_COUNT=heap.count \
        "$tool" read "libcamera:$id?format=YUYV" frames=20 expect="$file" heap_count=heap.count | tee id.log
    grep -q 'clock 0, meaning 1' id.log && grep -q 'loop thread 0.0, all threads 0.0' id.log && grep -q 'exact 20' id.log &&
        grep -q 'other process [0-9]' id.log
}
check 'libcamera: by its id; clock found out; start of exposure; no heap call in our process, those of its own counted' by_id
exposed() {
    "$tool" read "$lib&exposure=12.5" frames=6 && says ': 125' v4l2-ctl -d "$usb" -C exposure_time_absolute
}
check 'libcamera: exposure reaches the camera' exposed
bright() {
    "$tool" read "$lib&control.Brightness=0.5" frames=6 && says ': 32' v4l2-ctl -d "$usb" -C brightness &&
        says 'control.Brightness: found 9, expected' "$tool" read "$lib&control.Brightness=9" open=fails
}
check 'libcamera: a control by name is set, in its range' bright
check 'libcamera: an unknown control is refused, those there are named' \
    says "unknown control 'Nothing'; expected one of: .*Brightness" "$tool" read "$lib&control.Nothing=1" open=fails
check 'libcamera: a size that the camera does not have is named' \
    "$tool" read 'libcamera:0?width=330&height=250' frames=3 says='the camera gives'
control sharpness=1
check 'libcamera: frames that never come are waited for, the rest is exact' "$tool" read "$lib" frames=10 expect="$file"
control sharpness=2
check 'libcamera: truncated frames are counted and skipped' "$tool" read "$lib" frames=8 damaged=2 expect="$file"
control sharpness=3
check 'libcamera: frames with the error bit are counted and skipped' "$tool" read "$lib" frames=8 damaged=2 expect="$file"
control sharpness=4
check 'libcamera: corrupt MJPEG is counted and skipped, the rest is exact' "$tool" read 'libcamera:0?format=MJPG' frames=8 \
    damaged=2 expect="$frames/MJPG-320x240.raw.grey" says='damaged JPEG'
control sharpness=0
process='$(pidof fovea-libcamera)'
check 'libcamera: its process aborts: named, and frames come back' \
    "$tool" read "$lib" frames=10 expect="$file" run="kill -ABRT $process" says='signal 6' recovered=1
check 'libcamera: its process hangs: it is killed, and frames come back' \
    "$tool" read "$lib" frames=10 expect="$file" run="kill -STOP $process" says='no frame for' recovered=1
lone() { ! pidof fovea-libcamera; }
check 'libcamera: none of its processes is left' lone
check "libcamera: unplugged ${HIL_UNPLUGS:-10} times: gone, back in time, nothing left behind" \
    "$tool" read "$lib" seconds=900 times="${HIL_UNPLUGS:-10}" unplug='bash usb-unplug.sh' plug='bash usb-plug.sh'
lib_starting() {
    for wait in 0 0.3 1; do
        (sleep $wait; bash usb-unplug.sh) &
        "$tool" read "libcamera:$id?format=YUYV" until=gone
        wait
        pidof fovea-libcamera && return 1
        bash usb-plug.sh
        settle
    done
    "$tool" read "$lib" frames=3 expect="$file"
}
check 'libcamera: unplugged while starting: no harm, no process left' lib_starting
check 'libcamera: an unplugged camera comes back under another node' \
    "$tool" read "$lib" frames=12 recovered=1 expect="$file" \
    run="bash usb-unplug.sh; sleep 1; busybox modprobe vivid n_devs=1 node_types=0x1; $HIL_dir/system/bin/udevadm settle; bash usb-plug.sh"
unplug
rmmod vivid
modprobe vimc
settle
check 'libcamera: vimc streams' "$tool" read 'libcamera:0?width=320&height=240&format=RGB3' frames=8
rmmod vimc
}
