#!/bin/bash
# Inside the virtual machine, in the host's root file system under a layer in memory: make it a system that cameras can be
# plugged into, run the script asked for, and switch the machine off with its status.
mkdir -p /dev/pts /lib/modules
mount -t configfs none /sys/kernel/config 2>/dev/null
busybox ip link set lo up
ln -sfn "$HIL_dir/kernel/lib/modules/$(uname -r)" "/lib/modules/$(uname -r)"
modprobe() { busybox modprobe "$@"; }
rmmod() { busybox rmmod "$@"; }
export -f modprobe rmmod

# udev, with the rules that make device nodes and their by-id and by-path names and no others.
system=$HIL_dir/system
mkdir -p /run/udev/rules.d
for rule in 50-udev-default 60-persistent-v4l; do cp "$system/lib/udev/rules.d/$rule.rules" /run/udev/rules.d/; done
for rule in /lib/udev/rules.d/*.rules; do
    [ -e "/run/udev/rules.d/${rule##*/}" ] || ln -s /dev/null "/run/udev/rules.d/${rule##*/}"
done
mkdir -p /lib/udev
for helper in v4l_id path_id; do [ -e "/lib/udev/$helper" ] || cp "$system/lib/udev/$helper" /lib/udev/ 2>/dev/null; done
ln -sf "$system/bin/udevadm" /run/systemd-udevd
udevadm() { "$HIL_dir/system/bin/udevadm" "$@"; }
export -f udevadm
/run/systemd-udevd --daemon
udevadm trigger --subsystem-match=video4linux --subsystem-match=media
udevadm settle -t 10
export LIBCAMERA_IPA_MODULE_PATH=$system/usr/lib/x86_64-linux-gnu/libcamera
export LIBCAMERA_IPA_CONFIG_PATH=$system/usr/share/libcamera/ipa

cd /run || exit 1
bash "$HIL_project/$HIL_script"
status=$?
dmesg >"$HIL_results/dmesg.log" 2>&1
sync
printf "\\x$(printf %02x $status)" | dd of=/dev/port bs=1 seek=$((0xf4)) 2>/dev/null
busybox poweroff -f
