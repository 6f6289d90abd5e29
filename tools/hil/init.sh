#!/bin/sh
# First program of the virtual machine: the host's root file system, read-only under a layer in memory, becomes the root; then
# tests/hil/guest.sh takes over in it. With hil.root=FOLDER it is that folder of the host, in which systemd takes over. What it needs to
# know stands on the kernel's command line as hil.NAME=VALUE.
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t devtmpfs dev /dev
while read -r module; do insmod "/modules/$module"; done </modules/order
for word in $(cat /proc/cmdline); do
    case $word in hil.*=*) export "HIL_${word#hil.}" ;; esac
done
options=trans=virtio,version=9p2000.L,msize=512000
mount -t 9p -o $options,ro,cache=loose host /lower || exec sh
mount -t tmpfs -o mode=755 tmpfs /upper
mkdir /upper/changes /upper/work
mount -t overlay -o lowerdir="/lower$HIL_root",upperdir=/upper/changes,workdir=/upper/work overlay /new || exec sh
mount --move /proc /new/proc
mount --move /sys /new/sys
mount --move /dev /new/dev
if [ -n "$HIL_root" ]; then
    mkdir -p /new/lib/modules /new/results
    mount --bind "/lower$HIL_dir/kernel/lib/modules" /new/lib/modules
    mount -t 9p -o $options,cache=none results /new/results
    exec /bin/busybox switch_root /new /lib/systemd/systemd
fi
mkdir -p "/new$HIL_results"
mount -t 9p -o $options,cache=none results "/new$HIL_results"
mount -t tmpfs tmpfs /new/run
mkdir -p /new/dev/shm
mount -t tmpfs -o mode=1777 tmpfs /new/dev/shm
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root
exec chroot /new /bin/bash "$HIL_project/tests/hil/guest.sh"
