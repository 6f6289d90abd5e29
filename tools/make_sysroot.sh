#!/bin/sh
# Unpack the arm64 libraries that a cross build links against into a folder of the build. Nothing is installed and the
# host's package lists stay as they are: liblcm-dev is not co-installable with its arm64 twin.
# Usage: tools/make_sysroot.sh DIR [whole]
#   whole: all that packages are built with, and what those need, the C library among it, with the data base by which
#   dpkg-shlibdeps knows which package a library is of (some 470 packages, 240 MB to fetch)
set -eu
dir=$1
case ${2:-} in
"") packages="liblcm1 liblcm-dev libglib2.0-0 libpcre2-8-0 libffi8 libselinux1 libmount1 libblkid1 libyaml-0-2 libyaml-dev
          libpng16-16 libpng-dev libjpeg62-turbo libjpeg62-turbo-dev zlib1g zlib1g-dev libcmocka0 libcmocka-dev" ;;
whole) packages="libc6-dev $(sed -n '/^Build-Depends:/,/^[^ ]/s/^ \(lib[^ ,]*-dev\|zlib1g-dev\).*/\1/p' "$(dirname "$0")/package/debian/control" | tr '\n' ' ')" ;;
*) echo "tools/make_sysroot.sh: found '$2', expected whole or nothing" >&2 && exit 2 ;;
esac
stamp=$dir/.packages
made="$packages, links within"
[ -f "$stamp" ] && [ "$(cat "$stamp")" = "$made" ] && exit 0

rm -rf "$dir"
mkdir -p "$dir/apt/lists/partial" "$dir/apt/archives/partial"
dir=$(cd "$dir" && pwd)
apt() {
    apt-get -q -o "Dir::State::lists=$dir/apt/lists" -o "Dir::Cache=$dir/apt" -o "Dir::State::status=$dir/apt/status" \
        -o APT::Architecture=arm64 -o APT::Architectures::=arm64 -o APT::Sandbox::User=root "$@"
}
: >"$dir/apt/status"
echo "Fetching arm64 libraries"
apt update >/dev/null
if [ "${2:-}" != whole ]; then
    # shellcheck disable=SC2086
    (cd "$dir/apt/archives" && apt download $packages >/dev/null)
    for deb in "$dir"/apt/archives/*.deb; do dpkg -x "$deb" "$dir"; done
else
    # shellcheck disable=SC2086
    apt install -y --download-only --no-install-recommends $packages >/dev/null
    base=$dir/var/lib/dpkg
    mkdir -p "$base/info" "$base/updates" "$dir/control"
    echo 1 >"$base/info/format"
    for deb in "$dir"/apt/archives/*.deb; do
        rm -rf "$dir/control"/*
        dpkg -e "$deb" "$dir/control"
        name=$(sed -n 's/^Package: //p' "$dir/control/control")
        grep -q '^Multi-Arch: same' "$dir/control/control" && name=$name:arm64
        dpkg-deb --fsys-tarfile "$deb" | tar -xvf - -C "$dir" | sed 's|^\.||; s|/$||; s|^$|/.|' >"$base/info/$name.list"
        for part in symbols shlibs; do
            [ ! -f "$dir/control/$part" ] || cp "$dir/control/$part" "$base/info/$name.$part"
        done
        { sed 's/^Package: .*/&\nStatus: install ok installed/' "$dir/control/control" && echo; } >>"$base/status"
    done
    # These two are chosen by the scripts of packages, none of which ran.
    for library in blas lapack; do ln -sf $library/lib$library.so.3 "$dir/usr/lib/aarch64-linux-gnu/lib$library.so.3"; done
fi
# Links from the root would lead out of the folder: a linker that finds no libz.so takes libz.a.
find "$dir" -type l -lname '/*' | while read -r link; do
    target=$dir$(readlink "$link")
    [ ! -e "$target" ] || ln -sfnr "$target" "$link"
done
rm -rf "$dir/apt" "$dir/control"
echo "$made" >"$dir/.packages"
