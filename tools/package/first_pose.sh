#!/bin/sh
# In the machine of tools/package/check.sh guest: wait for the first message with a pose (state tracking or weak), and write when it came,
# in seconds since the kernel started.
fovea echo FOVEA_POSE | while read -r message; do
    case $message in
    *'"state": 1,'* | *'"state": 2,'*)
        cut -d ' ' -f 1 /proc/uptime >/packages/first-pose
        break
        ;;
    esac
done
