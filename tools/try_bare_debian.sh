#!/bin/sh
# Follow the README in a bare Debian 12 that has only git, make and this clone: `make run`, then `make test`.
# Usage: tools/try_bare_debian.sh [DIR]   (as root; DIR defaults to a temporary folder; needs debootstrap)
set -eu
cd "$(dirname "$0")/.."
root=${1:-$(mktemp -d)}
mirror=$(awk '$1 == "URIs:" { print $2; exit } $1 == "deb" { print $2; exit }' \
    /etc/apt/sources.list.d/debian.sources /etc/apt/sources.list 2>/dev/null)
[ -x "$root/usr/bin/make" ] ||
    debootstrap --variant=minbase --include=git,make,ca-certificates bookworm "$root" "$mirror" >/dev/null
cp /etc/resolv.conf "$root/etc/resolv.conf"
mountpoint -q "$root/proc" || mount -t proc proc "$root/proc"
trap 'umount "$root/proc"' EXIT
rm -rf "$root/root/fovea"
git clone -q . "$root/root/fovea"
in_root() { chroot "$root" env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin TERM=dumb sh -c "cd /root/fovea && $1"; }
in_root 'make run'
in_root 'make test'
echo "bare Debian: ok"
