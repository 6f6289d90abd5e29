#!/bin/bash
# Everything that `make hil` boots, made in build-hil from Debian packages that are unpacked there and not installed: the
# kernel image and its modules, v4l2loopback and vimc built for that kernel, udev, the pipeline helpers of libcamera, and an
# initial file system. What is already there is left as it is.
# Usage: tools/hil/setup.sh FOLDER
set -eu
here=$(cd "$(dirname "$0")/../.." && pwd)
mkdir -p "$1"
dir=$(cd "$1" && pwd)
say() { echo "hil: $*"; }

# The kernel that Debian's meta package stands for at present.
kernel=$(apt-cache depends linux-image-amd64 | sed -n 's/.*Depends: linux-image-\(.*\)/\1/p' | head -n 1)
[ -n "$kernel" ] || { apt-get update -q >/dev/null; kernel=$(apt-cache depends linux-image-amd64 | sed -n 's/.*Depends: linux-image-\(.*\)/\1/p' | head -n 1); }
[ -n "$kernel" ] || { echo "hil: apt knows no package linux-image-amd64" >&2; exit 1; }
series=$(echo "$kernel" | sed 's/^\([0-9]*\.[0-9]*\).*/\1/')
made=$(cat "$here/tools/hil/setup.sh" "$here/tests/hil/name_node.c" "$here/tools/hil/init.sh" | sha256sum | cut -c1-16)-$kernel
[ "$(cat "$dir/made" 2>/dev/null)" = "$made" ] && { echo "$kernel"; exit 0; } >&2
rm -f "$dir/made"

# ---- packages ----
mkdir -p "$dir/packages"
cd "$dir/packages"
for package in "linux-image-$kernel" "linux-headers-$kernel" "linux-headers-${kernel%-amd64}-common" "linux-kbuild-$series" \
    "linux-source-$series" v4l2loopback-dkms udev libcamera-ipa; do
    ls "${package}"_*.deb >/dev/null 2>&1 || missing="${missing:-} $package"
done
if [ -n "${missing:-}" ]; then
    say "fetching$missing"
    # shellcheck disable=SC2086
    apt-get download -q $missing >/dev/null 2>"$dir/download.log" || { cat "$dir/download.log" >&2; exit 1; }
fi

# ---- unpacked ----
cd "$dir"
rm -rf kernel headers system modules
mkdir -p kernel headers system modules
lib=./lib/modules/$kernel
say "unpacking $kernel"
# Not all of these folders hold modules in every kernel; tar then complains of those that are missing.
dpkg --fsys-tarfile "packages/linux-image-${kernel}_"*.deb | tar x -C kernel --wildcards "./boot/vmlinuz-*" "$lib/modules.*" \
    "$lib/kernel/drivers/media/*" "$lib/kernel/drivers/virtio/*" "$lib/kernel/drivers/usb/*" "$lib/kernel/drivers/input/*" \
    "$lib/kernel/drivers/video/*" "$lib/kernel/drivers/gpu/drm/*.ko" "$lib/kernel/sound/*" "$lib/kernel/lib/*" \
    "$lib/kernel/net/9p/*" "$lib/kernel/fs/9p/*" "$lib/kernel/fs/overlayfs/*" "$lib/kernel/fs/netfs/*" \
    "$lib/kernel/fs/fscache/*" "$lib/kernel/drivers/block/loop.ko" "$lib/kernel/fs/ext4/*" "$lib/kernel/fs/jbd2/*" \
    "$lib/kernel/fs/mbcache.ko" "$lib/kernel/crypto/crc32c_generic.ko" 2>tar.log || grep -q 'Not found in archive' tar.log
for package in packages/linux-headers-*.deb packages/linux-kbuild-*.deb packages/v4l2loopback-dkms_*.deb; do
    dpkg -x "$package" headers
done
for package in packages/udev_*.deb packages/libcamera-ipa_*.deb; do dpkg -x "$package" system; done
# The ELF image itself: QEMU boots it directly, and need not emulate its decompression.
headers=$dir/headers/usr/src
bash "$headers/linux-headers-$kernel/scripts/extract-vmlinux" "kernel/boot/vmlinuz-$kernel" >vmlinux 2>/dev/null || true
if [ ! -s vmlinux ]; then # an xz stream in the middle of the file
    offset=$(LC_ALL=C grep -abo "$(printf '\3757zXZ')" "kernel/boot/vmlinuz-$kernel" | head -n 1 | cut -d: -f1)
    tail -c +$((offset + 1)) "kernel/boot/vmlinuz-$kernel" | xz -dc --single-stream >vmlinux 2>/dev/null || [ -s vmlinux ]
fi

# ---- modules ----
say "building modules"
sed -i "s#^include .*#include $headers/linux-headers-${kernel%-amd64}-common/Makefile#" "$headers/linux-headers-$kernel/Makefile"
module() { # module NAME: of the sources in modules/NAME
    make -s -C "$headers/linux-headers-$kernel" M="$dir/modules/$1" modules >"$dir/modules/$1.log" 2>&1 ||
        { cat "$dir/modules/$1.log" >&2; exit 1; }
}
mkdir -p modules/v4l2loopback modules/name_node "kernel/$lib/updates"
cp "$headers"/v4l2loopback-*/*.[ch] modules/v4l2loopback/
echo 'obj-m := v4l2loopback.o' >modules/v4l2loopback/Makefile
cp "$here/tests/hil/name_node.c" modules/name_node/
echo 'obj-m := name_node.o' >modules/name_node/Makefile
dpkg --fsys-tarfile "packages/linux-source-${series}_"*.deb | tar xO "./usr/src/linux-source-$series.tar.xz" | xz -dc -T0 |
    tar x -C modules --strip-components=4 --wildcards "linux-source-$series/drivers/media/test-drivers/vimc/*"
sed -i 's/\$(CONFIG_VIDEO_VIMC)/m/' modules/vimc/Makefile
for name in v4l2loopback name_node vimc; do module $name; done
find modules -name '*.ko' -exec cp {} "kernel/$lib/updates/" \;
busybox depmod -b kernel "$kernel"

# ---- the first file system: busybox, the modules that the root needs, init ----
root=$dir/initrd
rm -rf "$root"
mkdir -p "$root"/{bin,proc,sys,dev,modules,lower,upper,new}
cp "$(command -v busybox)" "$root/bin/busybox"
for tool in sh mount mkdir insmod cat chroot; do ln -s busybox "$root/bin/$tool"; done
order() { # order MODULE...: their files and those that they need, needed ones first
    for name in "$@"; do
        line=$(grep "/$name\.ko:" "kernel/$lib/modules.dep")
        needed=$(echo "${line#*:}" | tr ' ' '\n' | tac)
        for file in $needed "${line%%:*}"; do echo "$file"; done
    done | awk 'NF && !seen[$0]++'
}
for file in $(order virtio_pci 9pnet_virtio 9p overlay); do
    cp "kernel/$lib/$file" "$root/modules/"
    basename "$file" >>"$root/modules/order"
done
install -m 755 "$here/tools/hil/init.sh" "$root/init"
(cd "$root" && find . | busybox cpio -o -H newc 2>/dev/null | gzip -1) >initrd.gz
echo "$kernel" >release
echo "$made" >made
say "ready in $dir"
