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
configure() { # configure NAME LINE...
    name=$1
    shift
    printf '%s\n' 'rate: real' "$@" >"/etc/fovea/$name.yaml"
}

orbit='sim:orbit?width=240&height=180&rate=2&frames=1000000'

# From the start of the kernel to the first pose that another program received.
name=boot
until_true 300 '[ -s /packages/first-pose ]' || fail "no pose came of the run that begins with the machine"
seconds() { systemctl show -p "$1" --value fovea@boot | awk '{ printf "%.1f", $1 / 1e6 }'; }
echo "boot: service started after $(seconds ExecMainStartTimestampMonotonic) s, ready after $(seconds ActiveEnterTimestampMonotonic) s, first pose after $(cat /packages/first-pose) s"
systemctl stop fovea@boot || fail "it does not stop"

name=none
./busybox modprobe vivid n_devs=1 node_types=0x1 num_inputs=1 input_types=0x00 || fail "no driver vivid"
udevadm settle -t 30

# A camera, LCM both ways, and a map that is saved.
configure front 'source: v4l2:/dev/video0?width=320&height=180' 'camera_fov: 60' 'map.save: hall.map'
systemctl start fovea@front || fail "it does not start"
[ "$(shows ActiveState)" = active ] || fail "it does not say that it runs"
until_true 120 'fovea top --once --json 2>/dev/null | grep -q "\"processed\":[1-9]"' || fail "it says of no frame that it was processed"
locked=$(sed -n 's/^VmLck:[[:space:]]*\([0-9]*\) kB$/\1/p' "/proc/$(shows MainPID)/status")
[ "${locked:-0}" -gt 18000 ] || fail "found ${locked:-no} kB of locked memory, expected the block and the program"
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
until_true 120 'fovea top --once --json 2>/dev/null | grep -q "\"processed\":[1-9]"' || fail "no frame of a camera of libcamera was processed"
[ "$(stat -c %U "/proc/$(pidof fovea-libcamera)")" = fovea ] || fail "the program of libcamera is not the service's user"
systemctl stop fovea@lib || fail "it does not stop"
! pidof fovea-libcamera || fail "the program of libcamera is left"
echo 'libcamera: ok'

# A plug-in, that draws letters, in the sandbox of the service: a picture is drawn before the run.
mkdir -p /run/systemd/system/fovea@drawn.service.d
printf '%s\n' '[Service]' 'Environment=LD_DEBUG=files LD_DEBUG_OUTPUT=/var/lib/fovea/loaded' \
    'ExecStartPre=/usr/bin/fovea run --source sim:orbit?width=160&height=120 --frames 20 --set lcm_url= --picture drawn.png' >/run/systemd/system/fovea@drawn.service.d/drawn.conf
systemctl daemon-reload
configure drawn "source: $orbit"
systemctl start fovea@drawn || fail "it does not draw, or does not start"
grep -q 'calling init: .*fovea-text.so' /var/lib/fovea/loaded* || fail "the plug-in is not loaded"
[ -s /var/lib/fovea/drawn.png ] || fail "no picture was drawn"
systemctl stop fovea@drawn || fail "it does not stop"
echo 'plug-in: ok'

# From a start to the first pose, and from what the watchdog does to the next.
poses_again() { # poses_again WHAT: the time from the watchdog's first kill to the next pose, with the two seconds of RestartSec
    status tracking 600 || fail "$1: it has no pose after the restart"
    again=$(journalctl -u "fovea@$name" -o short-monotonic --no-pager | tr -d '[]' | awk '
        /Watchdog timeout/ && !killed { killed = $1 }
        /tracking from frame/ && killed { printf "%.1f", $1 - killed; exit }')
    echo "$1: first pose ${again:-none} s after the kill"
    echo "${again:-9999} $start" | awk '{ exit !($1 <= 1.5 * $2 + 4) }' || fail "$1: after a kill the pose takes ${again:-none} s, after a start $start s"
}
configure back "source: $orbit"
begin=$(now)
systemctl start fovea@back || fail "it does not start"
status tracking 600 || fail "it has no pose"
start=$(journalctl -u fovea@back -o short-monotonic --no-pager | tr -d '[]' | awk -v begin="$begin" '/tracking from frame/ { printf "%.1f", $1 - begin; exit }')
echo "first pose ${start:=0} s after the start"
pid=$(shows MainPID)
kill -STOP "$pid"
restarts 1 120 || fail "the watchdog did not start a stopped run again"
poses_again stopped
systemctl stop fovea@back || fail "it does not stop"

configure hang "source: fault:$orbit?kind=stall&first=20&shortest=1&longest=1&count=1&wait=3600000"
systemctl start fovea@hang || fail "it does not start"
restarts 1 600 || fail "the watchdog did not start a run again whose loop hangs"
poses_again stalled
journalctl -u fovea@hang --no-pager -p warning | grep -qi 'watchdog' || fail "the journal does not name the watchdog"
systemctl stop fovea@hang || fail "it does not stop"

# The name that udev gives a camera by where it is, whatever its number.
port=$(ls /dev/fovea/port-*vivid* 2>/dev/null | head -n 1) # the other one needs libcamera to set it up
[ -n "$port" ] || fail "udev named no camera of vivid below /dev/fovea: $(ls /dev/fovea) $(udevadm info /dev/video0 | grep -E 'ID_PATH|ID_V4L|DEVLINKS')"
configure named "source: v4l2:$port?width=320&height=180" 'camera_fov: 60'
systemctl start fovea@named || fail "it does not start with $port"
until_true 120 'fovea top --once --json 2>/dev/null | grep -q "\"processed\":[1-9]"' || fail "no frame of $port was processed"
systemctl stop fovea@named || fail "it does not stop"
echo "udev: $port"

# A control group of version 2 takes pages back from a run. Its files are on a disk, which lies in memory that is not the group's: all of
# it is written first.
for module in crc32c_generic loop ext4; do ./busybox modprobe "$module" || fail "no driver $module"; done
dd if=/dev/zero of=/run/disk bs=1M count=128 2>said && ./busybox mke2fs -F -b 4096 /run/disk >said && mount -o loop /run/disk /var/tmp || fail "no disk: $(cat said)"
./test_reclaim >said 2>&1 && grep -q 'the end was met' said || fail "pages taken back: $(cat said)"
sed -n 's/^the end was met/pages taken back: &/p' said
umount /var/tmp
echo 'guest: ok'
