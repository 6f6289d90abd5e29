#!/bin/sh
# Install the Debian packages that a group of targets needs, and only those that are missing.
# Usage: tools/install.sh GROUP...     (see packages below)
set -eu

packages() {
    case $1 in
    build) echo gcc g++ make pkg-config liblcm-dev liblcm-bin libyaml-dev libpng-dev libjpeg-dev \
                zlib1g-dev libfreetype-dev fonts-dejavu-core ;;
    web)   echo libwebsockets-dev libjansson-dev libjs-three libjs-chart.js ;;
    calibrate) echo libopencv-core-dev libopencv-imgproc-dev libopencv-calib3d-dev libopencv-features2d-dev \
                libopencv-contrib-dev libceres-dev ;;
    package) echo build-essential dpkg-dev debhelper fakeroot lintian libcamera-dev libopencv-videoio-dev ;;
    package-root) echo mmdebstrap ;;
    package-service) echo systemd-container ;;
    package-guest) echo libcmocka-dev ;;
    package-other) echo locales faketime ;;
    package-root-arm64) echo mmdebstrap arch-test qemu-user-static binfmt-support ;;
    test)  echo libcmocka-dev libopencv-core-dev libopencv-imgproc-dev libopencv-features2d-dev \
                libopencv-calib3d-dev libopencv-imgcodecs-dev libopencv-contrib-dev libceres-dev python3 python3-venv iproute2 iptables \
                libwebsockets-dev libjansson-dev libjs-three libjs-chart.js openssl chromium chromium-driver ;;
    bench) echo libopencv-core-dev libopencv-imgproc-dev libopencv-features2d-dev libopencv-calib3d-dev \
                libopencv-imgcodecs-dev opencv-doc python3 python3-venv ;;
    evaluate) echo python3 python3-venv ;;
    mrcal) echo python3-mrcal ;;
    check) echo ccache clang clang-format clang-tidy libclang-rt-14-dev python3 ;;
    cross) echo gcc-aarch64-linux-gnu g++-aarch64-linux-gnu qemu-user llvm-19 ;;
    pictures) echo imagemagick ;;
    jar)   echo default-jdk-headless liblcm-java ;;
    spy)   echo default-jre liblcm-java libjchart2d-java ;;
    hil)   echo qemu-system-x86 busybox-static v4l-utils libcamera-dev libcamera-tools xz-utils procps ;;
    fmt)   echo clang-format ;;
    fuzz)  echo clang libclang-rt-14-dev libjansson-dev ;;
    *) echo "tools/install.sh: unknown group '$1'" >&2; exit 2 ;;
    esac
}

missing=
for group in "$@"; do
    for package in $(packages "$group"); do
        dpkg-query -W -f '${db:Status-Status}\n' "$package" 2>/dev/null | grep -qx installed || missing="$missing $package"
    done
done
[ -z "$missing" ] && exit 0

sudo=
if [ "$(id -u)" != 0 ]; then
    command -v sudo >/dev/null || { echo "tools/install.sh: run as root or install sudo; missing:$missing" >&2; exit 1; }
    sudo=sudo
fi
echo "Installing:$missing"
$sudo apt-get update -q >/dev/null
# shellcheck disable=SC2086
DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -q --no-install-recommends $missing >/dev/null
