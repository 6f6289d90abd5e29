#!/bin/sh
# What tools/package/check.sh runs in a virtual machine that systemd of Debian started: the service of the packages, with cameras of the
# kernel. Its last line is "guest: ok". The machine is emulated, and slow: times are judged by that of a start.
set -u
cd /packages || exit 1
fail() {
    echo "guest: $*"
    systemctl status "fovea@$name" --no-pager -l
    journalctl -u "fovea@$name" --no-pager | tail -n 40
    exit 1
}
until_true() { # until_true SECONDS COMMAND
    for _ in $(seq "$1"); do
        sh -c "$2" && return 0
        sleep 1
    done
    return 1
}
shows() { systemctl show -p "$1" --value "fovea@$name"; }
status() { # status WORDS SECONDS: what the service tells systemd
    until_true "$2" "systemctl show -p StatusText --value fovea@$name | grep -q '$1'"
}
restarts() { # restarts COUNT SECONDS
    until_true "$2" "[ \"\$(systemctl show -p NRestarts --value fovea@$name)\" = $1 ]"
}
now() { cut -d ' ' -f 1 /proc/uptime; }
since() { echo "$1 $(now)" | awk '{ printf "%.1f", $2 - $1 }'; }
configure() { # configure NAME LINE...
    name=$1
    shift
    printf '%s\n' 'rate: real' "$@" >"/etc/fovea/$name.yaml"
}

name=none
ip link set lo up
ip link set lo multicast on
ip route add 224.0.0.0/4 dev lo
./busybox modprobe vivid n_devs=1 node_types=0x1 num_inputs=1 input_types=0x00 || fail "no driver vivid"
udevadm settle -t 30

# A camera, LCM both ways, and a map that is saved.
configure front 'source: v4l2:/dev/video0?width=320&height=180' 'camera_fov: 60' 'map.save: hall.map'
systemctl start fovea@front || fail "it does not start"
[ "$(shows ActiveState)" = active ] || fail "it does not say that it runs"
until_true 120 'fovea top --once --json 2>/dev/null | grep -q FOVEA' || fail "its messages do not come"
./command --wait 60 save >said || fail "it does not answer: $(cat said)"
[ -s /var/lib/fovea/hall.map ] || fail "it saved no map"
echo "vivid: $(cat said)"
systemctl stop fovea@front || fail "it does not stop"

# The program of libcamera, a process of its own.
./busybox modprobe vimc || fail "no driver vimc"
udevadm settle -t 30
configure lib 'source: libcamera:0?width=320&height=240' 'camera_fov: 60'
systemctl start fovea@lib || fail "it does not start with a camera of libcamera"
until_true 60 'pidof fovea-libcamera >/dev/null' || fail "the program of libcamera does not run"
until_true 120 'fovea top --once --json 2>/dev/null | grep -q FOVEA' || fail "no messages with a camera of libcamera"
[ "$(stat -c %U "/proc/$(pidof fovea-libcamera)")" = fovea ] || fail "the program of libcamera is not the service's user"
systemctl stop fovea@lib || fail "it does not stop"
! pidof fovea-libcamera || fail "the program of libcamera is left"
echo 'libcamera: ok'

# From a start to the first pose, and from what the watchdog does.
orbit='sim:orbit?width=160&height=120&rate=10&frames=1000000'
configure back "source: $orbit"
begin=$(now)
systemctl start fovea@back || fail "it does not start"
status tracking 600 || fail "it has no pose"
start=$(since "$begin")
echo "first pose $start s after the start"
pid=$(shows MainPID)
kill -STOP "$pid"
restarts 1 120 || fail "the watchdog did not start a stopped run again"
begin=$(now)
status tracking 600 || fail "it has no pose after the restart"
again=$(since "$begin")
echo "stopped: first pose $again s after the restart"
echo "$again $start" | awk '{ exit !($1 <= 1.5 * $2 + 2) }' || fail "after a restart the pose takes $again s, after a start $start s"
systemctl stop fovea@back || fail "it does not stop"

configure back "source: fault:$orbit?kind=stall&first=40&shortest=1&longest=1&count=1&wait=3600000"
systemctl reset-failed fovea@back 2>/dev/null
systemctl start fovea@back || fail "it does not start"
restarts 1 600 || fail "the watchdog did not start a run again whose loop hangs"
journalctl -u fovea@back --no-pager | grep -qi 'watchdog' || fail "the journal does not name the watchdog"
systemctl stop fovea@back || fail "it does not stop"
echo 'stalled: started again'
echo 'guest: ok'
