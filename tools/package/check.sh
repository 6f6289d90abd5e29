#!/bin/sh
# Prove the packages, each part in roots of its own, as root:
#   amd64         in a bare Debian: apt install, a run, an upgrade that keeps what was changed in /etc/fovea, a purge that leaves nothing
#   all           the same with all five packages: a program linked with libfovea-dev, the page and the calibration answer
#   arm64         the packages of arm64 in a bare arm64 Debian, emulated: installed and run
#   service       in a Debian that systemd starts as its first process, by systemd-nspawn: the service is real-time in its loop alone, its page
#                 answers, a run that is stopped is started again and poses, a reload takes a key, a stop saves the map
#   guest         in the virtual machine of `make hil`, with cameras of the kernel's drivers: notify, LCM both ways, libcamera's process, what
#                 the watchdog does about a run that is stopped and a loop that hangs, and pages that a control group of version 2 takes back
#   trixie        built and installed in a bare Debian 13, from a clone of this commit: a run
#   reproducible  built twice, in folders of different names, one after the other, with another date, locale, umask and number of cores: the same bytes
# Usage: tools/package/check.sh PART...     after `make deb`, for arm64 after `make deb ARCH=arm64`
#   FOVEA_SUITE   the Debian of the roots (default bookworm)
set -eu
cd "$(dirname "$0")/../.."
suite=${FOVEA_SUITE:-bookworm}
work=$(mktemp -d)
trap 'umount "$work"/root-*/proc 2>/dev/null || true; rm -rf --one-file-system "$work"' EXIT
trap 'exit 1' INT TERM

fail() { echo "package check: $*" >&2; exit 1; }
# What is called in them sees no variable of this shell, and starts no service.
in_root() { chroot "$root" env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive LC_ALL=C sh -euc "$1"; }

debian_root() { # debian_root ARCH: a Debian of `suite` with apt and nothing else
    root=$work/root-$1
    tools/install.sh package-root
    if [ "$1" != "$(dpkg --print-architecture)" ]; then
        tools/install.sh "package-root-$1"
        mountpoint -q /proc/sys/fs/binfmt_misc || mount -t binfmt_misc binfmt_misc /proc/sys/fs/binfmt_misc
        update-binfmts --enable qemu-aarch64 || true
        arch-test "$1" >/dev/null || fail "this kernel does not run programs of $1 (binfmt_misc with qemu-user-static)"
    fi
    mkdir -p build-package/roots
    kept=build-package/roots/$suite-$1.tar
    [ -f "$kept" ] || { mmdebstrap --quiet --format=tar --variant=apt --arch="$1" "$suite" "$kept.part" && mv "$kept.part" "$kept"; }
    mkdir "$root" && tar -xf "$kept" -C "$root"
    mount -t proc proc "$root/proc"
    cp /etc/resolv.conf "$root/etc/resolv.conf"
    mkdir "$root/packages"
}

bare_root() { # bare_root ARCH: a Debian beside our packages
    debian_root "$1"
    cp build/packages/*_"$1".deb "$root/packages/" || fail "found no package of $1 in build/packages: make deb ARCH=$1"
}

# Without a terminal nobody can answer what becomes of a file that was changed: it stays, which is the answer by default.
kept_as_they_are='-o Dpkg::Options::=--force-confdef -o Dpkg::Options::=--force-confold'
installed() { # installed PACKAGE...: by apt, as a user does it
    in_root "apt-get update -q >/dev/null
             apt-get install -y -q --no-install-recommends $kept_as_they_are $(printf ' /packages/%s_*.deb' "$@") >/packages/log 2>&1 || { tail -n 20 /packages/log; exit 1; }"
}

poses() { # a run of the command
    in_root 'fovea run --frames 60 --set lcm_url= --picture none' >"$work/run" 2>&1 || { cat "$work/run"; fail "fovea run failed"; }
    grep -q 'posed [1-9]' "$work/run" || { cat "$work/run"; fail "fovea run gave no pose"; }
}

answer() { # the two programs beside it
    in_root 'fovea-web --help >/dev/null && fovea-calibrate target --target chessboard:9x6:0.025 --out /packages/board.pdf >/dev/null'
}

runs() { # the command, its service's user and what belongs to it
    poses
    in_root 'fovea config --check /etc/fovea/example.yaml >/dev/null'
    cp docs/run.png "$root/packages/"
    in_root 'cd /packages && fovea detect --model /usr/share/fovea/shipped.fvm run.png && fovea features run.png' >"$work/run" 2>&1 || { cat "$work/run"; fail "fovea detect or features failed"; }
    if in_root 'cd /packages && fovea features --method surf run.png' >"$work/run" 2>&1; then fail "SURF is in the package"; fi
    grep -qi 'surf' "$work/run" || { cat "$work/run"; fail "the refusal of SURF does not name it"; }
    # shellcheck disable=SC2016
    in_root 'for unit in /usr/lib/systemd/system/fovea*@.service; do echo "$unit"; systemd-analyze security --offline=true --threshold=15 "$unit" || exit 1; done' >"$work/run" 2>&1 ||
        { cat "$work/run"; fail "a service is exposed by more than 1.5"; }
    groups=$(in_root 'id -nG fovea') || fail "there is no user fovea"
    for group in video iio; do
        case " $groups " in *" $group "*) ;; *) fail "the user fovea is in the groups '$groups', expected also $group" ;; esac
    done
}

# The same packages as of a later version, whose example has one more line.
later_version() {
    for deb in "$root"/packages/*.deb; do
        rm -rf "$work/deb"
        dpkg-deb -R "$deb" "$work/deb"
        sed -i 's/^Version: .*/&+later/; s/\((= [^)]*\))/\1+later)/' "$work/deb/DEBIAN/control"
        if [ -f "$work/deb/etc/fovea/example.yaml" ]; then
            echo '# one more line' >>"$work/deb/etc/fovea/example.yaml"
            sed -i "s|.*  etc/fovea/example.yaml|$(md5sum <"$work/deb/etc/fovea/example.yaml" | cut -d ' ' -f 1)  etc/fovea/example.yaml|" \
                "$work/deb/DEBIAN/md5sums"
        fi
        dpkg-deb --root-owner-group -Znone -b "$work/deb" "$deb" >/dev/null
    done
}

upgraded_and_purged() { # upgraded_and_purged PACKAGE...
    in_root 'systemctl enable -q fovea@front; fovea config >/etc/fovea/front.yaml; mkdir -p /var/lib/fovea; echo kept >/var/lib/fovea/hall.map'
    later_version
    installed "$@"
    in_root 'dpkg-query -W fovea' | grep -q '+later' || fail "the later version was not installed"
    grep -q 'one more line' "$root/etc/fovea/example.yaml" || fail "an example that nobody changed was not renewed"
    # And one that was changed.
    echo '# mine' >>"$root/etc/fovea/example.yaml"
    later_version
    before=$(in_root 'dpkg-query -W fovea')
    installed "$@"
    [ "$(in_root 'dpkg-query -W fovea')" != "$before" ] || fail "the second later version was not installed"
    tail -n 1 "$root/etc/fovea/example.yaml" | grep -q '# mine' || fail "an example that was changed was lost in an upgrade"
    [ -f "$root/etc/fovea/front.yaml" ] || fail "/etc/fovea/front.yaml was lost in an upgrade"
    in_root "apt-get remove -y -q fovea >/dev/null 2>&1"
    [ -f "$root/etc/fovea/example.yaml" ] || fail "removal without purge took /etc/fovea/example.yaml"
    in_root "apt-get purge -y -q $* >/packages/log 2>&1 || { tail -n 20 /packages/log; exit 1; }"
    [ -f "$root/etc/fovea/front.yaml" ] && [ -f "$root/var/lib/fovea/hall.map" ] || fail "a purge took files that are the operator's"
    rm -f "$root/etc/fovea/front.yaml" "$root/etc/fovea/"*.dpkg-*
    left=$(cd "$root" && find etc usr lib var/lib/dpkg/info var/lib/systemd -name '*fovea*' | sort | tr '\n' ' ')
    left=$(echo "$left" | sed 's|etc/fovea ||')
    [ -z "$left" ] || fail "a purge left $left"
}

amd64() {
    bare_root amd64
    installed fovea
    runs
    upgraded_and_purged fovea
}

all() {
    bare_root amd64
    installed fovea libfovea0 libfovea-dev fovea-web fovea-calibrate
    runs
    in_root 'apt-get install -y -q --no-install-recommends gcc libc6-dev pkg-config >/dev/null 2>&1'
    cp tools/examples/loop.c "$root/packages/"
    # shellcheck disable=SC2016
    in_root 'cd /packages && gcc -Wall -o loop loop.c $(pkg-config --cflags --libs fovea) && ldd loop | grep -q "libfovea.so"
             [ "$(head -c $((3 * 320 * 240)) /dev/zero | ./loop 320 240 300 300 160 120 | grep -c " starting$")" = 3 ]'
    answer
    state=var/lib/private
    in_root "mkdir -p /$state/fovea-web /$state/fovea-calibrate && ln -sn private/fovea-web /var/lib/fovea-web
             touch /$state/fovea-web/front.token /$state/fovea-calibrate/front.token /$state/fovea-calibrate/front.yaml"
    upgraded_and_purged fovea libfovea0 libfovea-dev fovea-web fovea-calibrate
    left=$(cd "$root" && find var/lib -path '*/fovea-*' | sort | tr '\n' ' ')
    [ "$left" = "$state/fovea-calibrate $state/fovea-calibrate/front.yaml " ] || fail "a purge left $left"
}

arm64() {
    bare_root arm64
    installed fovea libfovea0
    runs
    in_root 'uname -m' | grep -q aarch64 || fail "the root is not of aarch64"
    upgraded_and_purged fovea libfovea0
}

service() {
    tools/install.sh package-service
    bare_root amd64
    in_root 'apt-get update -q >/dev/null
             apt-get install -y -q --no-install-recommends systemd-sysv udev curl /packages/fovea_*.deb /packages/fovea-web_*.deb /packages/fovea-calibrate_*.deb >/packages/log 2>&1 || { tail -n 20 /packages/log; exit 1; }'
    cp tools/package/try_service.sh "$root/packages/"
    printf '%s\n' 'source: sim:orbit?frames=1000000' 'rate: real' 'lcm_url: ""' 'web.socket: /run/fovea/front.sock' 'map.save: hall.map' >"$root/etc/fovea/front.yaml"
    echo TARGET=chessboard:9x6:0.025 >"$root/etc/fovea/front.calibrate"
    printf '%s\n' '[Unit]' 'After=multi-user.target' '[Service]' 'Type=oneshot' \
        'ExecStart=/bin/sh -c "/packages/try_service.sh >/packages/said 2>&1; systemctl poweroff"' \
        '[Install]' 'WantedBy=multi-user.target' >"$root/etc/systemd/system/trial.service"
    in_root 'systemctl enable trial.service >/dev/null 2>&1'
    umount "$root/proc"
    timeout 180 systemd-nspawn --quiet --directory="$root" --boot --register=no --keep-unit >"$work/boot" 2>&1 </dev/null || true
    mount -t proc proc "$root/proc"
    tail -n 1 "$root/packages/said" 2>/dev/null | grep -qx 'service: ok' || {
        tail -n 5 "$work/boot"
        cat "$root/packages/said" 2>/dev/null
        fail "the service did not do what it must"
    }
}

guest() {
    tools/install.sh build hil package-guest
    make --no-print-directory build/command build/tests/realtime/test_reclaim
    tools/hil/setup.sh build-hil
    bare_root amd64
    in_root 'apt-get update -q >/dev/null
             apt-get install -y -q --no-install-recommends systemd-sysv udev kmod iproute2 procps libcamera-ipa libcmocka0 >/packages/log 2>&1 &&
             apt-get install -y -q /packages/fovea_*.deb >>/packages/log 2>&1 || { tail -n 20 /packages/log; exit 1; }' # with what it recommends: libcamera
    cp tools/package/try_guest.sh tools/package/first_pose.sh build/command build/tests/realtime/test_reclaim "$(command -v busybox)" "$root/packages/"
    printf '%s\n' '[Unit]' 'After=multi-user.target' '[Service]' 'Type=oneshot' 'TimeoutStartSec=infinity' \
        'ExecStart=/bin/sh -c "/packages/try_guest.sh >/results/said 2>&1; sync; printf \\\\001 | dd of=/dev/port bs=1 seek=244"' \
        '[Install]' 'WantedBy=multi-user.target' >"$root/etc/systemd/system/trial.service"
    # One run begins with the machine; what it sends is heard from the start, so that the time of its first pose is known.
    printf '%s\n' 'rate: real' 'source: sim:orbit?width=240&height=180&rate=2&frames=1000000' >"$root/etc/fovea/boot.yaml"
    printf '%s\n' '[Unit]' 'Before=fovea@boot.service' 'Requires=multicast.service' 'After=multicast.service' '[Service]' \
        'ExecStart=/packages/first_pose.sh' '[Install]' 'WantedBy=multi-user.target' >"$root/etc/systemd/system/first-pose.service"
    printf '%s\n' '[Service]' 'Type=oneshot' 'RemainAfterExit=yes' \
        'ExecStart=/bin/sh -c "ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo"' >"$root/etc/systemd/system/multicast.service"
    in_root 'systemctl enable trial.service first-pose.service fovea@boot.service >/dev/null 2>&1'
    umount "$root/proc"
    HIL_ROOT=$root tools/hil/vm.sh build-hil "$work/results" 3600 >"$work/boot" 2>&1 || true
    mount -t proc proc "$root/proc"
    cat "$work/results/said" 2>/dev/null || tail -n 20 "$work/boot"
    tail -n 1 "$work/results/said" | grep -qx 'guest: ok' || fail "the service did not do what it must in the machine"
}

# Other compilers and libraries than those that the rest is tested with: gcc 14, libcamera 0.4.
trixie() {
    suite=trixie
    debian_root "$(dpkg --print-architecture)"
    in_root 'apt-get update -q >/dev/null && apt-get install -y -q --no-install-recommends git make ca-certificates >/dev/null 2>&1'
    git clone -q --no-hardlinks . "$root/root/fovea"
    in_root 'chown -R root:root /root/fovea && cd /root/fovea && make deb >/packages/log 2>&1 || { tail -n 40 /packages/log; exit 1; }'
    cp "$root"/root/fovea/build/packages/*.deb "$root/packages/"
    rm -rf "$root/root/fovea"
    installed fovea libfovea0 libfovea-dev fovea-web fovea-calibrate
    poses
    answer
}

reproducible() {
    export CCACHE_DISABLE=1
    tools/install.sh package-other
    # Another year, month, day and hour by the clock of all that the second build calls; files keep the times that the kernel gives them.
    other_date="env NO_FAKE_STAT=1 faketime -f +39917520"
    # shellcheck disable=SC2086
    [ $(($($other_date date +%s) - $(date +%s))) -gt 39900000 ] || fail "there is no other date to build at"
    # A locale that sorts and writes numbers otherwise, and is there: of a name that is not, C is used without a word.
    mkdir "$work/locales"
    localedef -i tr_TR -f UTF-8 "$work/locales/tr_TR.UTF-8"
    [ "$(LOCPATH=$work/locales LC_ALL=tr_TR.UTF-8 locale decimal_point)" = , ] || fail "there is no other locale to build in"
    (umask 022 && export TZ=UTC LC_ALL=C FOVEA_JOBS=1 FOVEA_PLACE="$work/first" FOVEA_PACKAGES="$work/packages-1" && tools/package/build.sh >/dev/null)
    (umask 077 && export TZ=Pacific/Kiritimati LOCPATH="$work/locales" LC_ALL=tr_TR.UTF-8 LANGUAGE=fr FOVEA_JOBS=3 FOVEA_PLACE="$work/second-build-of-another-name" \
        FOVEA_PACKAGES="$work/packages-2" HOME="$work" && $other_date tools/package/build.sh >/dev/null)
    for deb in "$work"/packages-1/*.deb; do
        cmp "$deb" "$work/packages-2/${deb##*/}" || fail "two builds differ in ${deb##*/}"
    done
    (cd "$work/packages-1" && sha256sum ./*.deb)
}

[ $# -gt 0 ] || { sed -n '2,14s/^# //p' "$0" && exit 2; }
for part in "$@"; do
    case $part in amd64 | all | arm64 | service | guest | trixie | reproducible) ;; *) fail "found '$part', expected amd64, all, arm64, service, guest, trixie or reproducible" ;; esac
    "$part" # by itself: a failure within it ends this script
    echo "packages: $part: ok"
    [ -z "${root:-}" ] || { umount "$root/proc" && rm -rf --one-file-system "$root" && root=; }
done
