#!/bin/sh
# What tools/package/check.sh runs in a Debian that systemd started: the services of the packages, with /etc/fovea/front.yaml.
set -u
fail() {
    echo "service: $*"
    systemctl status fovea@front fovea-web@front fovea-calibrate@front --no-pager -l
    journalctl -u fovea@front -u fovea-web@front -u fovea-calibrate@front --no-pager | tail -n 40
    exit 1
}
until_true() { # until_true SECONDS COMMAND
    for _ in $(seq "$1"); do
        sh -c "$2" && return 0
        sleep 1
    done
    return 1
}
shows() { systemctl show -p "$1" --value fovea@front; }
tracks='systemctl show -p StatusText --value fovea@front | grep -q tracking'

systemctl start fovea@front || fail "it does not start"
until_true 30 "$tracks" || fail "it has no pose"
pid=$(shows MainPID)
policies=$(for task in /proc/"$pid"/task/*; do chrt -p "${task##*/}" | sed -n 's/.*policy: //p'; done | sort | uniq -c | tr -s ' \n' ' ')
case $policies in
" 1 SCHED_FIFO|SCHED_RESET_ON_FORK "[1-9]*" SCHED_OTHER ") ;;
*) fail "found threads of $policies, expected one of SCHED_FIFO and others of SCHED_OTHER" ;;
esac
grep -q '^CapEff:[[:space:]]*0*$' "/proc/$pid/status" && grep -q '^Seccomp:[[:space:]]*2' "/proc/$pid/status" || fail "it has rights that it does not need"

systemctl start fovea-web@front || fail "the page does not start"
until_true 20 'curl -s -o /dev/null http://127.0.0.1:7680/' || fail "the page does not answer"

systemctl start fovea-calibrate@front || fail "the calibration does not start"
until_true 30 'curl -s -o /dev/null http://127.0.0.1:7690/' || fail "the page of the calibration does not answer"
[ "$(systemctl show -p ActiveState --value fovea-calibrate@front)" = active ] || fail "the calibration has ended without a board"
systemctl stop fovea-calibrate@front || fail "the calibration does not stop"

kill -STOP "$pid"
until_true 30 "[ \"\$(systemctl show -p NRestarts --value fovea@front)\" = 1 ]" || fail "the watchdog did not start a stopped run again"
until_true 30 "$tracks" || fail "it has no pose after the restart"

echo 'features.threshold: 1000000' >>/etc/fovea/front.yaml
systemctl reload fovea@front || fail "it cannot be reloaded"
until_true 10 "journalctl -u fovea@front --no-pager | grep -q 'features.threshold'" || fail "a reload does not name a wrong key"
systemctl stop fovea@front || fail "it does not stop"
[ -s /var/lib/fovea/hall.map ] || fail "it saved no map"
[ "$(stat -c %U /var/lib/fovea/hall.map)" = fovea ] || fail "its map is not its user's"
grep -qx 'starts: 2' /var/lib/fovea/front.health && grep -qx 'ends: 1' /var/lib/fovea/front.health || fail "its counters did not survive the restart"
echo 'service: ok'
