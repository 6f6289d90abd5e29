#!/bin/sh
# Build the Debian packages of this tree, and judge them by lintian. They are built in a copy of the files that git knows (or of all files,
# where there is no git), with the Debian folder and a changelog of the version in include/fovea/fovea.h. The date is that of the commit:
# two builds of one commit give the same bytes. The packages of a version that CHANGELOG.md calls "not released" carry the date behind it.
# Usage: tools/package/build.sh [ARCH]     ARCH: amd64 or arm64 (default: this machine's); another one is a cross build
#   FOVEA_PACKAGES   where the packages go (default build/packages)
#   FOVEA_PLACE      where they are built (default build-package/ARCH)
set -eu
cd "$(dirname "$0")/../.."
here=$(dpkg --print-architecture)
arch=${1:-$here}
case $arch in amd64 | arm64) ;; *) echo "tools/package/build.sh: found ARCH '$arch', expected amd64 or arm64" >&2 && exit 2 ;; esac
packages=${FOVEA_PACKAGES:-build/packages}
place=${FOVEA_PLACE:-build-package/$arch}
tools/install.sh build web calibrate package
export FOVEA_MAKE=
set --
if [ "$arch" != "$here" ]; then
    [ "$arch" = arm64 ] || { echo "tools/package/build.sh: $arch is built on $arch only" >&2 && exit 2; }
    tools/install.sh cross
    root=$PWD/build-package/root-$arch
    tools/make_sysroot.sh "$root" whole
    FOVEA_MAKE="SYSROOT=$root EMULATOR=$PWD/tools/package/emulate.sh"
    FOVEA_ROOT=$root
    PATH=$PWD/tools/package/cross:$PATH
    export FOVEA_ROOT DPKG_ADMINDIR="$root/var/lib/dpkg"
    set -- -d
fi

version=$(sed -n 's/^#define FOVEA_VERSION "\(.*\)"/\1/p' include/fovea/fovea.h)
if [ -z "${SOURCE_DATE_EPOCH:-}" ]; then
    SOURCE_DATE_EPOCH=$(git log -1 --format=%ct 2>/dev/null || stat -c %Y CHANGELOG.md)
fi
export SOURCE_DATE_EPOCH
# Debian has no package of it: one of its own, -1, would be later than this.
full=$version
grep -m 1 '^## ' CHANGELOG.md | grep -q '(not released)' && full=$version~$(date -u -d "@$SOURCE_DATE_EPOCH" +%Y%m%d%H%M%S)

rm -rf "$place"
tree=$place/fovea-$version
mkdir -p "$tree" "$packages"
if git rev-parse --git-dir >/dev/null 2>&1; then git ls-files -coz --exclude-standard | xargs -0 ls -d 2>/dev/null | tr '\n' '\0'; else
    find . -path './build*' -prune -o -type f -print0; fi | tar --null -T - -c | tar -x -C "$tree"
cp -R tools/package/debian "$tree/debian"
cat >"$tree/debian/changelog" <<CHANGELOG
fovea ($full-0fovea1) unstable; urgency=medium

  * The changes are in CHANGELOG.md.

 -- the Fovea authors <packages@fovea.example.org>  $(LC_ALL=C date -u -R -d "@$SOURCE_DATE_EPOCH")
CHANGELOG

# The symbols that tools/*.symbols promise. Before 1.0 a minor version may change the interface.
major=${version%%.*}
minor=${version#*.}
minor=${minor%%.*}
case $version in 0.*) api=0.$minor next=0.$((minor + 1)) ;; *) api=$major next=$((major + 1)) ;; esac
for library in libfovea libfovea-messages; do
    echo "$library.so.$api libfovea0 #MINVER#, libfovea0 (<< $next~)"
    echo '* Build-Depends-Package: libfovea-dev'
    sed "s/.*/ &@Base $api~/" tools/$library.symbols
done >"$tree/debian/libfovea0.symbols"

rm -f "$packages"/fovea*_"$arch".* "$packages"/libfovea*_"$arch".* # ours of before, with what lintian would look for
echo "Building fovea $full-0fovea1 for $arch"
(cd "$tree" && dpkg-buildpackage -b -us -uc -a"$arch" -j"${FOVEA_JOBS:-$(nproc)}" "$@") >"$place/log" 2>&1 || {
    tail -n 40 "$place/log"
    echo "tools/package/build.sh: the build failed; all it said is in $place/log" >&2
    exit 1
}
mv "$place"/*_"$arch".deb "$place"/*.changes "$place"/*.buildinfo "$packages"/
rm -rf "$tree"
lintian --fail-on error --allow-root "$packages"/*_"$arch".changes
(cd "$packages" && ls -l ./*_"$arch".deb | awk '{ print $5, $9 }')
