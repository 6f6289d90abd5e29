#!/bin/sh
# Unpack the arm64 libraries that a cross build links against into a folder of the build. Nothing is installed and the
# host's package lists stay as they are: liblcm-dev is not co-installable with its arm64 twin.
# Usage: tools/make_sysroot.sh DIR
set -eu
dir=$1
packages="liblcm1 liblcm-dev libglib2.0-0 libpcre2-8-0 libffi8 libselinux1 libmount1 libblkid1 libyaml-0-2 libyaml-dev
          libpng16-16 libpng-dev libjpeg62-turbo libjpeg62-turbo-dev zlib1g zlib1g-dev libcmocka0 libcmocka-dev"
stamp=$dir/.packages
[ -f "$stamp" ] && [ "$(cat "$stamp")" = "$packages" ] && exit 0

rm -rf "$dir"
mkdir -p "$dir/apt/lists/partial" "$dir/apt/archives/partial" "$dir/debs"
dir=$(cd "$dir" && pwd)
# shellcheck disable=SC2086
apt() {
    apt-get -q -o "Dir::State::lists=$dir/apt/lists" -o "Dir::Cache=$dir/apt" -o "Dir::State::status=$dir/apt/status" \
        -o APT::Architecture=arm64 -o APT::Architectures::=arm64 -o APT::Sandbox::User=root "$@"
}
: >"$dir/apt/status"
echo "Fetching arm64 libraries"
apt update >/dev/null
# shellcheck disable=SC2086
(cd "$dir/debs" && apt download $packages >/dev/null)
for deb in "$dir"/debs/*.deb; do dpkg -x "$deb" "$dir"; done
rm -rf "$dir/debs" "$dir/apt"
echo "$packages" >"$dir/.packages"
