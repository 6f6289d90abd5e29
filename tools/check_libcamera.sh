#!/bin/bash
# The program that keeps libcamera must compile against the libcamera of newer Debian suites too, not only against the one installed.
# Their headers are unpacked below build-libcamera; nothing is installed. A suite that cannot be reached is named.
# Usage: tools/check_libcamera.sh [SUITE...]     (trixie: 0.4; sid: 0.7 or later)
set -u
cd "$(dirname "$0")/.." || exit 1
failed=0
[ $# -gt 0 ] || set -- trixie sid
for suite in "$@"; do
    dir=$PWD/build-libcamera/$suite
    mkdir -p "$dir"/{lists/partial,archives/partial}
    mirror=$(apt-get indextargets --format '$(SITE)' 'Created-By: Packages' 2>/dev/null | grep -m 1 debian)
    echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $mirror $suite main" >"$dir/sources.list"
    options=(-o Dir::Etc::SourceList="$dir/sources.list" -o Dir::Etc::SourceParts=/dev/null -o Dir::State::Lists="$dir/lists"
        -o Dir::Cache="$dir" -o Dir::Cache::Archives="$dir/archives" -o Acquire::Languages=none -o Acquire::Check-Valid-Until=false)
    if ! ls "$dir"/libcamera-dev_*.deb >/dev/null 2>&1; then
        apt-get "${options[@]}" -q update >"$dir/log" 2>&1
        (cd "$dir" && apt-get "${options[@]}" -q download "libcamera-dev/$suite") >>"$dir/log" 2>&1
    fi
    rm -rf "$dir/lists"
    package=$(ls "$dir"/libcamera-dev_*.deb 2>/dev/null)
    [ -n "$package" ] || { echo "libcamera of $suite: could not be fetched: skipped"; continue; }
    dpkg -x "$package" "$dir/headers"
    version=${package##*dev_}
    for compiler in g++ clang++; do
        command -v $compiler >/dev/null || continue
        for file in drivers/libcamera.cpp drivers/libcamera/*.cpp; do
            $compiler -std=c++17 -fsyntax-only -Wall -Wextra -Wshadow -Werror -Iinclude \
                -isystem "$dir/headers/usr/include/libcamera" "$file" || failed=1
        done
        echo "libcamera ${version%%_*} of $suite: compiled with $compiler"
    done
done
exit $failed
