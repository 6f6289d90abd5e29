#!/bin/bash
# `make hil`: build what the virtual machine runs, boot it, and bring back its report. Results in build-hil/results.
# HIL_PARTS=vivid,usb runs these parts of tests/hil/suite.sh alone.
set -u
cd "$(dirname "$0")/../.." || exit 1
[ "$(uname -m)" = x86_64 ] || { echo "hil: found $(uname -m), needs x86_64: skipped"; exit 0; }
tools/hil/setup.sh build-hil || exit 1
rm -rf build-hil/results
begin=$(date +%s)
HIL_PARTS=${HIL_PARTS:-} tools/hil/vm.sh build-hil build-hil/results "${HIL_SECONDS:-900}" tests/hil/suite.sh
status=$?
echo "hil: $(grep -c '^ok' build-hil/results/report.tap) passed, $(grep -c '^not ok' build-hil/results/report.tap) failed," \
    "$(($(date +%s) - begin)) s in the machine; report, logs and recordings in build-hil/results"
exit $status
